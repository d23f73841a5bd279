//! Scripts of datagrams: each part of a file in `vectors` is a router and a client of its own.

use std::collections::VecDeque;
use std::str::Split;

use zenoh::{Declaration, Session, SessionOptions};

/// Returns the bytes of words: hexadecimal digits, `pat:FROM:LENGTH` for bytes that count up, and
/// `-` for none.
pub(crate) fn bytes(words: &str) -> Vec<u8> {
    let word = |word: &str| match word.strip_prefix("pat:") {
        Some(range) => {
            let (from, length) = range.split_once(':').unwrap();
            let [from, length] = [from, length].map(|number| number.parse().unwrap());
            (from..from + length)
                .map(|at: usize| at.to_le_bytes()[0])
                .collect()
        }
        None => (0..word.len() / 2)
            .map(|at| u8::from_str_radix(&word[2 * at..2 * at + 2], 16).unwrap())
            .collect::<Vec<u8>>(),
    };
    words.split(' ').flat_map(word).collect()
}

/// Returns a client with this identity, in hexadecimal digits, and its lease in milliseconds.
pub(crate) fn client(identity: &str, lease_ms: u64) -> Session {
    let identity = u128::from_str_radix(identity, 16).unwrap();
    Session::new(SessionOptions { identity, lease_ms })
}

/// A value that was heard, or that a script wants to be.
#[derive(Debug, PartialEq)]
struct Value(Vec<u8>, Vec<u8>, Vec<u8>, Option<u64>);

struct Script<'s> {
    session: Session,
    declared: Vec<Declaration<'s>>,
    now_ns: u64,
    heard: VecDeque<Value>,
    /// The result of a put, until it is compared.
    put: Option<Option<Vec<u8>>>,
}

impl<'s> Script<'s> {
    fn declare(&mut self, words: &'s str) {
        let declared = words
            .split(' ')
            .filter_map(|word| match word.split_at_checked(1)? {
                ("+", key) => Some(Declaration::Subscriber(key)),
                ("^", key) => Some(Declaration::Token(key)),
                _ => None,
            });
        self.declared = declared.collect();
    }

    /// Carries out a line.
    fn step(&mut self, line: &'s str) {
        let (word, rest) = line.split_once(' ').unwrap_or((line, ""));
        let is_digit = |first: char| first.is_ascii_hexdigit();
        let is_number = |word: &&str| word.len() == 8 && word.starts_with(is_digit);
        let mut words = rest.split(' ');
        if word != "=" {
            assert!(self.heard.is_empty(), "not wanted: {:?}", self.heard);
        }
        match word {
            "client" => {
                let [identity, lease] = [(); 2].map(|()| words.next().unwrap());
                self.session = client(identity, lease.parse().unwrap());
                self.declare(rest);
            }
            "open" => {
                self.declare(rest);
                self.open(words.next().filter(is_number).unwrap_or("00"));
            }
            "+" => self.now_ns += rest.parse::<u64>().unwrap() * 1_000_000,
            "<" => self.hear(&bytes(rest)),
            "=" => self.want(words),
            "put" => {
                let [key, attachment, payload] = [(); 3].map(|()| words.next().unwrap());
                let (attachment, payload) = (bytes(attachment), bytes(payload));
                let mut out = [0; 1500];
                let length = self.session.put(key, &attachment, &payload, &mut out);
                self.put = Some(length.map(|length| out[..length].into()));
            }
            ">" => {
                let mut out = [0; 1500];
                let wanted = (rest != "none").then(|| bytes(rest));
                let put = self.put.take();
                assert_eq!(
                    put.unwrap_or_else(|| Some(self.due(&mut out).into())),
                    wanted
                );
            }
            "up" => {
                let since_ns = rest.parse::<u64>().unwrap() * 1_000_000;
                assert_eq!(self.session.up_since_ns(), Some(since_ns));
            }
            "down" => assert_eq!(self.session.up_since_ns(), None),
            "close" => self.session.close(),
            "lose" => self.session.lose(),
            "counts" => {
                let counts = format!("{:?}", self.session.counts()).replace([':', '{', '}'], "");
                let counts = counts.trim_start_matches("SessionCounts ").split(", ");
                let counts = counts.map(str::trim).filter(|count| !count.ends_with(" 0"));
                assert_eq!(counts.collect::<Vec<_>>().join(", "), rest);
            }
            _ => panic!("no such line"),
        }
    }

    /// Compares the next value that was heard.
    fn want(&mut self, mut words: Split<'_, char>) {
        let [key, attachment, payload] = [(); 3].map(|()| words.next().unwrap());
        let key = match key.strip_prefix('x') {
            Some(digits) => bytes(digits),
            None => key.trim_matches('-').as_bytes().into(),
        };
        let stamp_ns = words.next().map(|number| number.parse().unwrap());
        let value = Value(key, bytes(attachment), bytes(payload), stamp_ns);
        assert_eq!(self.heard.pop_front(), Some(value));
    }

    /// Opens a session, in which the router's first number is this.
    fn open(&mut self, first: &str) {
        for line in ["> 2300", "+ 100", "> 41097211111111111111110a7805"] {
            self.step(line);
        }
        self.hear(&bytes("6109f0aa511d0ad4a01e6551dfaa5d5774804b0a780501aa"));
        let mut out = [0; 1500];
        assert_eq!(self.due(&mut out)[..2], [0x42, 10]);
        self.hear(&bytes(&format!("620a {first}")));
        assert_eq!(self.session.up_since_ns(), Some(self.now_ns));
    }

    fn hear(&mut self, datagram: &[u8]) {
        let heard = &mut self.heard;
        self.session.hear(self.now_ns, datagram, &mut |put| {
            let [key, attachment, payload] = [put.key, put.attachment, put.payload].map(Vec::from);
            heard.push_back(Value(key, attachment, payload, put.stamp_ns));
        });
    }

    fn due<'o>(&mut self, out: &'o mut [u8]) -> &'o [u8] {
        let declared = |place| self.declared.get(place).copied();
        let length = self.session.due(self.now_ns, declared, out);
        &out[..length]
    }
}

/// Carries out each part of a file, and returns how many there are.
fn carry_out(file: &str) -> usize {
    let parts = file.split("\n## ").skip(1);
    let run = |part: &str| {
        let mut script = Script {
            session: client("1111111111111111", 10_000),
            declared: Vec::new(),
            now_ns: 0,
            heard: VecDeque::new(),
            put: None,
        };
        let (name, lines) = part.split_once('\n').unwrap();
        println!("## {name}");
        for line in lines
            .lines()
            .filter(|line| !line.is_empty() && !line.starts_with('#'))
        {
            println!("{line}");
            script.step(line);
        }
        assert!(script.heard.is_empty(), "not wanted: {:?}", script.heard);
    };
    parts.map(run).count()
}

#[test]
fn a_session_opens_lives_ends_and_opens_anew() {
    assert_eq!(carry_out(include_str!("../vectors/session.txt")), 13);
}

#[test]
fn what_a_router_sends_is_read() {
    assert_eq!(carry_out(include_str!("../vectors/heard.txt")), 8);
}

#[test]
fn what_a_router_takes_is_written() {
    assert_eq!(carry_out(include_str!("../vectors/sent.txt")), 4);
}

#[test]
fn wrong_bytes_of_each_kind_end_no_session() {
    assert_eq!(carry_out(include_str!("../vectors/malformed.txt")), 26);
}
