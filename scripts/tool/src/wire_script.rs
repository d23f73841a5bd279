//! Reads bytes with their times from a file for `run --input`.
//!
//! Each line is a time of the run and bytes, as text in quotation marks or as hexadecimal pairs.
//! Before the bytes may come the name of their wire and, if the bytes are a packet, its sender:
//!
//! ```text
//! # A radar says how far the car ahead is.
//! 4ms "gap 2350\n"
//! 1500us 67 61 70 0a
//! 5ms wire.commands 10.0.2.2:7 "stop"
//! ```
//!
//! In quotation marks, `\n`, `\r`, `\t`, `\0`, `\"`, `\'` and `\\` mean single bytes, and `\x` with
//! two hexadecimal digits means any byte. Empty lines and lines beginning with `#` are ignored.
//! Times must not decrease. The guest gets entries in the form defined in
//! `kernel/src/watch/background/endpoint/script.rs`.

use std::net::{Ipv4Addr, SocketAddrV4};

use fass_dag_file::time::parse_ns;
use text::visible;

/// The most bytes of a line: the guest takes all of them in one interrupt.
const MOST_BYTES: usize = 1024;

/// The most bytes of a packet, limited by the room in an Ethernet frame.
const MOST_OF_PACKET: usize = 1472;

/// Bytes that arrive together on a wire, with their time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ScriptEntry {
    /// The number of the entry's line.
    pub line: usize,
    /// The time of the run.
    pub at_ns: u64,
    /// The name of the wire; `None` means the first wire connected to the file.
    pub wire: Option<String>,
    /// The packet's sender; `None` for the bytes of a port.
    pub from: Option<SocketAddrV4>,
    /// The bytes.
    pub bytes: Vec<u8>,
}

/// Reads the text of a file of bytes with their times.
///
/// # Errors
///
/// In words, beginning with the number of the line: the fault and the remedy.
pub fn read(text: &str) -> Result<Vec<ScriptEntry>, String> {
    let mut entries: Vec<ScriptEntry> = Vec::new();
    for (number, line) in (1..).zip(text.lines()) {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let entry = entry(number, line).map_err(|why| format!("{number}: {why}"))?;
        // The guest delivers the entries in order, so an earlier time could not be met.
        if entries.last().is_some_and(|last| last.at_ns > entry.at_ns) {
            return Err(format!(
                "{number}: this is before the line above; put the lines in the order of their times"
            ));
        }
        entries.push(entry);
    }
    Ok(entries)
}

fn entry(number: usize, line: &str) -> Result<ScriptEntry, String> {
    let (time, rest) = first_word(line);
    let at_ns = parse_ns(time)?;
    let (wire, rest) = match rest.strip_prefix("wire.") {
        Some(named) => {
            let (name, rest) = first_word(named);
            (Some(name.to_owned()), rest)
        }
        None => (None, rest),
    };
    let (from, rest) = match first_word(rest) {
        (peer, rest) if !peer.starts_with('"') && peer.contains(['.', ':']) => {
            (Some(read_peer(peer)?), rest)
        }
        _ => (None, rest),
    };
    let bytes = match rest.strip_prefix('"') {
        Some(text) => unescaped(text)?,
        None => rest
            .split_whitespace()
            .map(pair)
            .collect::<Result<_, _>>()?,
    };
    let most = from.map_or(MOST_BYTES, |_| MOST_OF_PACKET);
    match bytes.len() {
        0 => Err(
            "there are no bytes; give a text such as \"on\\n\", or pairs such as 6f 6e 0a".into(),
        ),
        count if count > most => Err(format!(
            "{count} bytes arrive at once, and {most} is the most; divide them, the time may be the \
             same"
        )),
        _ => Ok(ScriptEntry {
            line: number,
            at_ns,
            wire,
            from,
            bytes,
        }),
    }
}

/// Divides a text into its first word and the rest.
fn first_word(text: &str) -> (&str, &str) {
    let (word, rest) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
    (word, rest.trim())
}

fn read_peer(word: &str) -> Result<SocketAddrV4, String> {
    let is_host = |peer: &SocketAddrV4| !peer.ip().is_unspecified() && peer.port() > 0;
    let peer = word.parse().ok().filter(is_host);
    peer.ok_or_else(|| {
        let shown = visible(word);
        format!("`{shown}` is no peer; write ADDRESS:PORT, such as 10.0.2.2:7")
    })
}

/// Reads the text after a quotation mark, up to the closing mark.
fn unescaped(text: &str) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::new();
    let mut rest = text.chars();
    loop {
        let Some(letter) = rest.next() else {
            return Err("the text has no end; close it with \"".into());
        };
        match letter {
            '"' if rest.as_str().trim().is_empty() => return Ok(bytes),
            '"' => return Err("something follows the text; write one text in a line".into()),
            '\\' => bytes.push(escaped(&mut rest)?),
            letter => bytes.extend(letter.encode_utf8(&mut [0; 4]).bytes()),
        }
    }
}

fn escaped(rest: &mut std::str::Chars<'_>) -> Result<u8, String> {
    let name = rest.next();
    match name {
        Some('n') => Ok(b'\n'),
        Some('r') => Ok(b'\r'),
        Some('t') => Ok(b'\t'),
        Some('0') => Ok(0),
        Some(letter @ ('"' | '\'' | '\\')) => Ok(letter as u8),
        Some('x') => {
            let digits: String = rest.by_ref().take(2).collect();
            pair(&digits)
        }
        _ => Err(
            "a backslash is followed by none of n, r, t, 0, x, \" and \\; double it to mean \
             itself"
                .into(),
        ),
    }
}

fn pair(digits: &str) -> Result<u8, String> {
    let is_pair = digits.len() == 2 && digits.bytes().all(|digit| digit.is_ascii_hexdigit());
    let byte = u8::from_str_radix(digits, 16).ok().filter(|_| is_pair);
    byte.ok_or_else(|| {
        format!(
            "`{}` is no pair of hexadecimal digits; write bytes such as 0a, or a text in \
             quotation marks",
            visible(digits)
        )
    })
}

/// Returns the entries in the guest's form.
pub fn for_guest(entries: &[ScriptEntry]) -> Vec<u8> {
    let nobody = SocketAddrV4::new(Ipv4Addr::UNSPECIFIED, 0);
    let mut script = Vec::new();
    for entry in entries {
        let (from, wire) = (entry.from.unwrap_or(nobody), entry.wire.as_deref());
        let wire = wire.unwrap_or_default().as_bytes();
        script.extend(entry.at_ns.to_le_bytes());
        script.extend(from.ip().octets());
        script.extend(from.port().to_le_bytes());
        for length in [wire.len(), entry.bytes.len()] {
            // Both fit: `entry` limits the bytes, and the wire's name must fit into a command line,
            // too.
            script.extend(u16::try_from(length).unwrap_or(u16::MAX).to_le_bytes());
        }
        script.extend(wire);
        script.extend(&entry.bytes);
    }
    script
}

#[cfg(test)]
mod tests {
    use super::{for_guest, read};
    use crate::tests::rows;

    #[test]
    fn texts_and_pairs_become_bytes_at_their_times() {
        let text = "# radar\n\n4ms \"gap 2350\\n\"\n4ms \"\\x00\\\"\\\\ \\r\\t\\0é\"  \n1s 67 0A\n";
        let entries = read(text).unwrap();
        let expected = [
            (4_000_000, &b"gap 2350\n"[..]),
            (4_000_000, b"\0\"\\ \r\t\0\xc3\xa9"),
            (1_000_000_000, b"g\n"),
        ];
        let bytes = entries.iter().map(|entry| (entry.at_ns, &entry.bytes[..]));
        assert!(bytes.eq(expected));
        assert!(entries.iter().map(|entry| entry.line).eq(3..6));
        let script = for_guest(&entries[2..]);
        assert_eq!(script, b"\x00\xca\x9a\x3b\0\0\0\0\0\0\0\0\0\0\0\0\x02\0g\n");
    }

    #[test]
    fn a_line_may_name_its_wire_and_its_peer() {
        let text = "1ns wire.echo 10.0.2.2:7 \"it\\'s\"\n1ns wire.be ad\n1ns 10.0.2.2:7 ad\n";
        let entries = read(text).unwrap();
        let peer = "10.0.2.2:7".parse().ok();
        let expected = [
            (Some("echo"), peer, &b"it's"[..]),
            (Some("be"), None, b"\xad"),
            (None, peer, b"\xad"),
        ];
        let parts = entries
            .iter()
            .map(|entry| (entry.wire.as_deref(), entry.from, &entry.bytes[..]));
        assert!(parts.eq(expected), "{entries:?}");
        let script = for_guest(&entries[..1]);
        assert_eq!(
            script,
            b"\x01\0\0\0\0\0\0\0\x0a\0\x02\x02\x07\0\x04\0\x04\0echoit's"
        );
        let most = format!("1ns 10.0.2.2:7 \"{}\"", "x".repeat(1472));
        assert_eq!(read(&most).unwrap()[0].bytes.len(), 1472);
    }

    /// Texts that are refused, and the reasons.
    const REFUSED: &str = r#"5 "a" | 1: `5` has no unit; append one of ns, us, ms and s
# a\nsoon 0a | 2: `soon` is no time
5ms | 1: there are no bytes; give a text
5ms "" | 1: there are no bytes; give a text
5ms "a | 1: the text has no end; close it
5ms "a" 0a | 1: something follows the text; write one
5ms "\q" | 1: a backslash is followed by none of
5ms "\x1" | 1: `1"` is no pair of hexadecimal digits; write
5ms 0a0 | 1: `0a0` is no pair of hexadecimal digits; write
5ms +1 | 1: `+1` is no pair
5ms wire.echo | 1: there are no bytes; give a text
5ms 10.0.2.2 "a" | 1: `10.0.2.2` is no peer; write ADDRESS:PORT
5ms [::1]:7 "a" | 1: `[::1]:7` is no peer; write ADDRESS:PORT
5ms 0.0.0.0:7 "a" | 1: `0.0.0.0:7` is no peer
5ms 0a\n4ms 0a | 2: this is before the line above; put"#;

    #[test]
    fn what_is_wrong_is_told_with_its_line_and_the_remedy() {
        for [text, says] in rows(REFUSED) {
            let refused = read(&text).unwrap_err();
            assert!(refused.starts_with(&says), "{text}: {refused}");
        }
        let refused = read(&format!("5ms \"{}\"", "x".repeat(1025))).unwrap_err();
        assert!(refused.starts_with("1: 1025 bytes arrive at once"));
        let refused = read(&format!("5ms 10.0.2.2:7 \"{}\"", "x".repeat(1473))).unwrap_err();
        assert!(refused.starts_with("1: 1473 bytes arrive at once, and 1472 is the most"));
    }
}
