//! A backtrace with names, from the addresses that the guest has found on a stack.
//!
//! The guest tells for each word of the stack that follows a call instruction where it
//! returns to and, if the instruction says so, what it called. Some are left over from calls
//! that have returned. So the chain is followed from the innermost call outwards: the next
//! one is the first that called the function we are in. If none did, it was called through a
//! pointer or reached by a jump, and the next one is taken.

use std::collections::BTreeMap;

use super::Frame;
use crate::json::Value;

/// The most lines that are shown.
const SHOWN: usize = 12;

/// Where the functions of apps are called, and what comes of a panic: nobody looks for these.
const OUTERMOST: [&str; 2] = ["executive::run::worker::work", "kernel::start::"];
const OF_PANICS: [&str; 7] = [
    "executive::text::backtrace::",
    "executive::run::containment::",
    "kernel::watch::panic::",
    "kernel::entry::panic",
    "__rustc::",
    "rust_begin_unwind",
    "core::panicking::panic",
];

/// A call on the stack.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Call {
    returns_to: u64,
    callee: Option<u64>,
}

impl Call {
    /// Reads the list of a line of kind `backtrace`; what is no call is left out.
    pub(super) fn list(value: Option<&Value>) -> Vec<Call> {
        let texts = value.map_or(&[][..], Value::elements).iter();
        texts
            .filter_map(|text| Call::read(text.as_text()?))
            .collect()
    }

    fn read(text: &str) -> Option<Call> {
        let number = |text: &str| u64::from_str_radix(text.strip_prefix("0x")?, 16).ok();
        let mut words = text.split(' ');
        Some(Call {
            returns_to: number(words.next()?)?,
            callee: words.next().and_then(number),
        })
    }

    /// Returns an address within the call instruction.
    fn instruction(self) -> u64 {
        self.returns_to.saturating_sub(1)
    }

    /// Returns the addresses whose names the chain needs.
    pub(super) fn addresses(self) -> impl Iterator<Item = u64> {
        [Some(self.instruction()), self.callee]
            .into_iter()
            .flatten()
    }
}

/// Tells the chain of calls that leads to `place`, or to the innermost call, a line each; nothing
/// if no name is known.
pub(super) fn tell(
    place: Option<u64>,
    calls: &[Call],
    frames: &BTreeMap<u64, Vec<Frame>>,
) -> Option<String> {
    let known = |address: u64| frames.get(&address).map_or(&[][..], Vec::as_slice);
    let mut lines: Vec<(String, usize)> = Vec::new();
    let chain = chain(place, calls, &known);
    let own = |frame: &&Frame| !OF_PANICS.iter().any(|of| frame.function.starts_with(of));
    let all = chain.into_iter().flat_map(known);
    let all = all.take_while(|frame| !OUTERMOST.iter().any(|of| frame.function.starts_with(of)));
    let all = all.skip_while(|frame| !own(frame));
    let mut all = all.filter(|frame| frame.function != "??").peekable();
    while let Some(frame) = all.next() {
        // Of what the library calls within itself, the call that is not its own tells most.
        if frame.is_of_library() && all.peek().is_some_and(|outer| outer.is_of_library()) {
            continue;
        }
        let line = format!("{}, {}", brief(&frame.function), frame.place());
        match lines.last_mut() {
            Some((last, times)) if *last == line => *times += 1,
            _ => lines.push((line, 1)),
        }
    }
    if lines.is_empty() {
        return None;
    }
    let mut text = String::from("called, the innermost first:");
    for (line, times) in lines.iter().take(SHOWN) {
        text += "\n    ";
        text += line;
        if *times > 1 {
            text += &format!(", {times} times");
        }
    }
    if let Some(more @ 1..) = lines.len().checked_sub(SHOWN) {
        text += &format!("\n    and {more} more");
    }
    Some(text)
}

/// Leaves out what types a function was made for: those are pages long.
fn brief(function: &str) -> String {
    let mut depth = 0;
    let mut brief = String::new();
    let mut before = ' ';
    for letter in function.chars() {
        // An angle bracket after a name begins arguments; after anything else, it is a type's.
        depth += i32::from(letter == '<' && (depth > 0 || before.is_alphanumeric()));
        if depth == 0 {
            brief.push(letter);
        }
        depth -= i32::from(letter == '>' && depth > 0 && before != '-');
        before = letter;
    }
    brief
}

/// Returns addresses of the instructions that called one another, the innermost first.
fn chain<'f>(
    place: Option<u64>,
    mut calls: &[Call],
    known: &impl Fn(u64) -> &'f [Frame],
) -> Vec<u64> {
    // The last of an address' frames is the function that was really called.
    let function = |address: u64| known(address).last().map(|frame| frame.function.as_str());
    let mut chain: Vec<u64> = place.into_iter().collect();
    loop {
        let inner = chain.last().and_then(|&address| function(address));
        let called = |call: &Call| inner.is_some() && call.callee.and_then(function) == inner;
        let next = calls.iter().position(called).unwrap_or(0);
        let Some(call) = calls.get(next) else {
            return chain;
        };
        chain.push(call.instruction());
        calls = &calls[next + 1..];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Addresses with what contains them, the innermost first. The worker (0x10) calls `app`
    /// (0x20) by a pointer, which calls `deep` (0x30), within which `small` is inlined.
    const IMAGE: &str = "10 executive::run::worker::work /w/worker.rs:1
14 executive::run::worker::work /w/worker.rs:1
20 app /w/app.rs:1
24 app /w/app.rs:5
30 small /w/small.rs:7 deep /w/deep.rs:1
34 small /w/small.rs:7 deep /w/deep.rs:9
40 stale /w/stale.rs:1
44 stale /w/stale.rs:1";

    fn image(table: &str) -> BTreeMap<u64, Vec<Frame>> {
        let rows = table.lines().map(|row| {
            let words: Vec<&str> = row.split(' ').collect();
            let frame = |pair: &[&str]| Frame {
                function: pair[0].into(),
                line: pair[1].into(),
            };
            let frames = words[1..].chunks(2).map(frame).collect();
            (u64::from_str_radix(words[0], 16).unwrap(), frames)
        });
        rows.collect()
    }

    fn calls(texts: &[&str]) -> Vec<Call> {
        texts.iter().filter_map(|text| Call::read(text)).collect()
    }

    #[test]
    fn the_chain_of_calls_is_followed_past_what_is_left_over() {
        // The first is left over, and the last is none.
        let calls = calls(&["0x45 0x40", "0x25 0x30", "0x15", "?"]);
        assert_eq!(calls.len(), 3);
        let told = tell(Some(0x34), &calls, &image(IMAGE));
        let expected = "called, the innermost first:\n    small, /w/small.rs:7\n    \
                        deep, /w/deep.rs:9\n    app, /w/app.rs:5";
        assert_eq!(told.as_deref(), Some(expected));
        // Without names nothing is told.
        assert_eq!(tell(Some(1), &calls, &BTreeMap::new()), None);
    }

    #[test]
    fn what_called_itself_is_counted_and_long_chains_are_cut() {
        let rows: Vec<String> = (0..40)
            .map(|n: u64| format!("{n:x} f{} /w/f.rs:1", n.min(20)))
            .collect();
        let image = image(&rows.join("\n"));
        let texts: Vec<String> = (1..=40).map(|n| format!("{n:#x}")).collect();
        let calls = calls(&texts.iter().map(String::as_str).collect::<Vec<_>>());
        let told = tell(None, &calls, &image).unwrap();
        assert_eq!(told.lines().count(), 1 + SHOWN + 1);
        assert!(told.ends_with("\n    and 9 more"), "{told}");
        let told = tell(None, &calls[19..], &image).unwrap();
        let ends = "f19, /w/f.rs:1\n    f20, /w/f.rs:1, 20 times";
        assert!(told.ends_with(ends), "{told}");
    }

    #[test]
    fn names_are_told_without_the_types_they_were_made_for() {
        for (name, short) in [
            (
                "<fass::Turns<F,Subs> as fass::A>::turn",
                "<fass::Turns as fass::A>::turn",
            ),
            ("poll<a::{closure#3}, fn(B<u64>) -> C>", "poll"),
            ("alloc::vec::Vec<T,A>::push", "alloc::vec::Vec::push"),
            ("faults::crimes::panic", "faults::crimes::panic"),
        ] {
            assert_eq!(brief(name), short);
        }
    }
}
