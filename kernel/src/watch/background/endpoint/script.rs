//! A script: bytes with their times, which arrive in place of a device's.
//!
//! For repeatable runs, input comes from a script in the loader's module. An entry of the script is
//!
//! | bytes | meaning |
//! | --- | --- |
//! | 8 | a time of the run, in nanoseconds |
//! | 4, 2 | the address and the port of the peer; the port is 0 where there is none |
//! | 2, 2 | the lengths of the next two fields |
//! | | the name of the wire; may be empty for the first wire of the script |
//! | | the bytes |
//!
//! Numbers have their lowest byte first; an address has the order of its text. With a peer the
//! bytes are a packet. Bytes arrive by the heartbeat's alarm. The host has made the script, so
//! anything but an entry counts as its end.
//!
//! Output goes to the serial port. A single wire's bytes are sent as they are. For wires with the
//! option `wire.NAME=file`, each packet is sent as a line of text, `wire.NAME PEER "BYTES"`,
//! without a peer if none is stated.

use alloc::boxed::Box;
use alloc::format;
use alloc::string::String;
use core::fmt::Write as _;
use core::net::{Ipv4Addr, SocketAddrV4};
use core::sync::atomic::{AtomicBool, Ordering};

use fass::platform::{Buffer, SetOnce};
use fass::shared::{DeviceEnd, Wire};
use net::MOST_PAYLOAD;

use super::serial::{self, FIFO_BYTES};
use super::{CONNECTED, Endpoint, EndpointWords, Opened, arrive, end_of};
use crate::options::UsageError;
use executive::machine::serial::SECOND;
use executive::machine::spinlock::SpinLock;
use executive::machine::this_core::{self, Core};
use executive::machine::timer::{self, Alarm};
use executive::run::execution;
use front::app::endpoint::EndpointWord;
use front::report;

/// The most bytes of a line: a packet's bytes, its peer, and a name.
const MOST_OF_LINE: usize = 512 + 4 * MOST_PAYLOAD;

struct Script {
    entries: &'static [u8],
    /// Whether the script has a wire, and whether lines of output have the port.
    has_wire: AtomicBool,
    has_port: AtomicBool,
    /// The line being sent, and the number of its bytes sent so far. Used in core 0's background.
    line: SpinLock<(String, usize)>,
}

static SCRIPT: SetOnce<Script> = SetOnce::new();

struct ScriptEndpoint {
    end: DeviceEnd,
    script: &'static Script,
    is_first: bool,
    sends_lines: bool,
    playing: SpinLock<Playing>,
}

struct Playing {
    /// The entries still to arrive in this run, among them those of other wires.
    rest: &'static [u8],
    /// The packet that arrives next.
    packet: Buffer,
}

#[derive(Debug, PartialEq, Eq)]
struct Entry<'s> {
    at_ns: u64,
    from: Option<SocketAddrV4>,
    wire: &'s [u8],
    bytes: &'s [u8],
}

/// Opens the script, if there is one.
pub(super) fn open(wire: &Wire, words: &EndpointWords<'_>) -> Opened {
    if SCRIPT.get().is_none() {
        SCRIPT.set(cut(words)?);
    }
    let is_meant = words.word.is_none_or(|word| word == EndpointWord::File);
    let script = SCRIPT.get().filter(|script| !script.entries.is_empty());
    let Some(script) = script.filter(|_| is_meant) else {
        if words.word == Some(EndpointWord::File) {
            let line = format!("`wire.{}=file` has no file; give --input FILE", wire.name());
            return Err(UsageError::new(line).into());
        }
        return Ok(false);
    };
    let sends_lines = words.word.is_some();
    if !sends_lines || !script.has_port.swap(true, Ordering::Relaxed) {
        serial::take_port(wire)?;
    }
    let end = end_of(wire)?;
    if sends_lines {
        // The background finds waiting packets, so nobody has to be called.
        end.begin_packets(MOST_PAYLOAD, || ());
    }
    let playing = SpinLock::new(Playing {
        rest: &[],
        packet: Buffer::new(Buffer::LEAST_BYTES),
    });
    CONNECTED.add(Box::new(ScriptEndpoint {
        end,
        script,
        is_first: !script.has_wire.swap(true, Ordering::Relaxed),
        sends_lines,
        playing,
    }));
    Ok(true)
}

/// Cuts the script off the module: it follows the app's own bytes.
fn cut(words: &EndpointWords<'_>) -> Result<Script, UsageError> {
    let bytes = words.options.number("input", 0..=1 << 32, 0)?;
    let file = words.module.get().unwrap_or_default();
    let own = usize::try_from(bytes)
        .ok()
        .and_then(|bytes| file.len().checked_sub(bytes));
    let own = own.ok_or_else(|| UsageError::new("`input`: the module is shorter"))?;
    let (own, entries) = file.split_at(own);
    words.module.set(Some(own).filter(|own| !own.is_empty()));
    Ok(Script {
        entries,
        has_wire: AtomicBool::new(false),
        has_port: AtomicBool::new(false),
        line: SpinLock::new((String::with_capacity(MOST_OF_LINE), 0)),
    })
}

/// Returns the first entry of a script, and the entries after it.
fn first(script: &[u8]) -> Option<(Entry<'_>, &[u8])> {
    let (at_ns, rest) = script.split_first_chunk()?;
    let (ip, rest) = rest.split_first_chunk::<4>()?;
    let (port, rest) = rest.split_first_chunk()?;
    let (name, rest) = rest.split_first_chunk()?;
    let (length, rest) = rest.split_first_chunk()?;
    let (wire, rest) = rest.split_at_checked(u16::from_le_bytes(*name).into())?;
    let (bytes, rest) = rest.split_at_checked(u16::from_le_bytes(*length).into())?;
    let from = SocketAddrV4::new(Ipv4Addr::from(*ip), u16::from_le_bytes(*port));
    let entry = Entry {
        at_ns: u64::from_le_bytes(*at_ns),
        from: Some(from).filter(|from| from.port() > 0),
        wire,
        bytes,
    };
    Some((entry, rest))
}

impl ScriptEndpoint {
    /// Lets the next entry arrive if it is due. Reports whether an entry was due; if not, the
    /// heartbeat is set for the next entry.
    fn play(&self, now_ns: u64) -> bool {
        let mut playing = self.playing.lock();
        let Playing { rest, packet } = &mut *playing;
        let Some((entry, after)) = first(rest) else {
            return false;
        };
        let waits_ns = entry.at_ns.saturating_sub(execution::since_epoch(now_ns));
        if waits_ns > 0 {
            let due_ns = now_ns.saturating_add(waits_ns);
            timer::set_no_later(this_core::get(), Alarm::Heartbeat, due_ns);
            return false;
        }
        // Taken even if it is another wire's: each wire plays the whole script for itself.
        *rest = after;
        let wire = self.end.wire().name().as_bytes();
        let is_own = entry.wire == wire || entry.wire.is_empty() && self.is_first;
        let room = Buffer::HEADROOM..Buffer::HEADROOM + entry.bytes.len();
        match entry.from {
            _ if !is_own || room.end > packet.whole().len() => {}
            None => {
                // Before a signal is raised, which takes the scheduler's lock.
                drop(playing);
                arrive(&self.end, entry.bytes, now_ns);
            }
            Some(from) => {
                packet.set_range(room);
                packet.content_mut().copy_from_slice(entry.bytes);
                let has_come = self.end.swap_in(packet, from, now_ns);
                drop(playing);
                if let Some((plan, dag)) = has_come.then(|| self.end.announce()).flatten() {
                    execution::raise_in_interrupt(plan, dag);
                }
            }
        }
        true
    }

    /// Sends a part of the current line, or of the next line. Reports whether there was something
    /// to send.
    fn send_line(&self, is_ready: impl Fn() -> bool, send: impl Fn(u8)) -> bool {
        // A line may be long, and the lock disables interrupts: so send outside of the lock.
        let (mut line, mut gone) = core::mem::take(&mut *self.script.line.lock());
        if gone == line.len() {
            line.clear();
            gone = 0;
            let has_gone = self.end.swap_out(|packet, to| {
                // Writing to a `String` cannot fail.
                let _ = write!(line, "wire.{} ", self.end.wire().name());
                let _ = to.map(|to| write!(line, "{to} "));
                let _ = writeln!(line, "\"{}\"", packet.content().escape_ascii());
                true
            });
            if has_gone {
                self.end.tell_gone();
            }
        }
        let rest = &line.as_bytes()[gone..];
        let has_rest = !rest.is_empty();
        // QEMU takes bytes at once and is ready again and again, so a limit is needed.
        let parts = rest.chunks(FIFO_BYTES).take(64);
        for part in parts.take_while(|_| is_ready()) {
            part.iter().copied().for_each(&send);
            gone += part.len();
        }
        *self.script.line.lock() = (line, gone);
        has_rest
    }
}

impl Endpoint for ScriptEndpoint {
    fn begin_run(&self, now_ns: u64) {
        self.playing.lock().rest = self.script.entries;
        // Due at once: the first look sets the alarm for the first entry.
        timer::set_no_later(this_core::get(), Alarm::Heartbeat, now_ns);
    }

    fn beat(&self, core: &Core, now_ns: u64) {
        // As often as the script has entries that are due.
        while core.index == 0 && self.play(now_ns) {}
    }

    fn step(&self) -> bool {
        match self.sends_lines {
            false => serial::step(&self.end),
            true => self.send_line(|| SECOND.is_ready(), |byte| SECOND.write(byte)),
        }
    }

    fn end_run(&self) {
        self.playing.lock().rest = &[];
        while self.sends_lines && self.send_line(|| true, |byte| SECOND.send(byte)) {}
        serial::send_rest(&self.end);
    }

    fn tell(&self) {
        report::tell_wire(self.end.wire());
    }
}

#[cfg(test)]
mod tests {
    use super::{Entry, first};

    #[test]
    fn a_script_is_read_entry_by_entry_to_its_end() {
        let script = b"\x07\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\x02\0ab\
            \x00\x01\0\0\0\0\0\0\x0a\0\x02\x02\x07\x01\x04\0\x01\0echoc";
        let entry = |at_ns, from: Option<&str>, wire, bytes| Entry {
            at_ns,
            from: from.map(|from| from.parse().unwrap()),
            wire,
            bytes,
        };
        let (first_one, rest) = first(script).unwrap();
        assert_eq!(first_one, entry(7, None, b"", b"ab"));
        let second = entry(256, Some("10.0.2.2:263"), b"echo", b"c");
        assert_eq!(first(rest), Some((second, &b""[..])));
        for end in 0..rest.len() {
            assert_eq!(first(&rest[..end]), None);
        }
    }
}
