//! Finds places in code: the function that contains an address of an image, and the calls that lead
//! there.
//!
//! A guest reporting a fault knows the address of the instruction, but its image contains no
//! readable names. So when the tool shows a line of kind `panic` or `fault` with an address as its
//! `place`, the tool adds a line naming the function, and the app's source line if there is one.
//! After a line of kind `backtrace` it lists the calls. The guest's own lines stay as they are.
//!
//! The tool finds names and lines with `addr2line`, which reads the image's symbols and debugging
//! information and demangles names. The program is part of binutils and comes with C compilers.
//! Without `addr2line`, or with an unreadable image, nothing is added: the report of a fault is no
//! place for a second fault.
//!
//! For a backtrace, the guest examines the words of the stack. For each word that follows a call
//! instruction it prints the return address and, if the instruction tells it, the callee. Some
//! words are left over from calls that have returned. So the tool follows the chain from the
//! innermost call outwards: the next call is the first that called the current function. Without
//! such a call, the function was called through a pointer or reached by a jump, and the tool takes
//! the next word.

use std::collections::BTreeMap;
use std::env;
use std::io::{BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{self, ChildStdout, Command, Stdio};
use std::sync::Mutex;

use crate::system;
use views::json::Value;
use views::protocol::{MachineLine, read_line};

/// The kinds of lines whose `place` may be an address.
const KINDS: [&str; 3] = ["panic", "fault", BACKTRACE];

/// The kind of lines listing the calls on a stack.
const BACKTRACE: &str = "backtrace";

/// Folders of the workspace whose code is not the app's.
const OF_OTHERS: [&str; 4] = ["boot/", "fass/", "kernel/", "sched-dag/"];

/// Returns the text to add to a line of an image's serial log, if any, such as
/// `0x20e0b8 is faults::crimes::sum_down, of apps/faults/src/crimes.rs:115`. The image need not
/// exist or be an ELF file.
pub fn explain(image: &Path, line: &str) -> Option<String> {
    let line = read_line(0, line)?.ok()?;
    let is_backtrace = line.kind == BACKTRACE;
    let address = address(&line);
    let calls = match is_backtrace {
        true => Call::list(line.value.get("calls")),
        false => Vec::new(),
    };
    let addresses = calls.iter().flat_map(|call| call.addresses());
    let addresses: Vec<u64> = address.into_iter().chain(addresses).collect();
    let first = *addresses.first()?;
    let mut of_lines = OF_LINES.lock().ok()?;
    if of_lines.as_ref().is_none_or(|of| of.image != image) {
        let program = system::find_program("addr2line")?;
        *of_lines = NamedImage::open(&program, image);
    }
    let Some(frames) = of_lines.as_mut()?.frames(&addresses) else {
        *of_lines = None;
        return None;
    };
    if is_backtrace {
        return tell(address, &calls, frames);
    }
    Some(sentence(first, frames.get(&first)?))
}

/// A function that contains an address, called or inlined there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frame {
    /// The function's name; `??` if unknown.
    pub function: String,
    /// File and line, as `FILE:LINE`; `?` or 0 for an unknown line.
    pub line: String,
}

/// Finds the functions that contain each of the addresses in an image, the innermost first, by
/// running `addr2line` (`program`). Returns `None` if the program fails.
pub fn frames(
    program: &Path,
    image: &Path,
    addresses: &[u64],
) -> Option<BTreeMap<u64, Vec<Frame>>> {
    Some(NamedImage::open(program, image)?.frames(addresses)?.clone())
}

/// A running `addr2line` with an open image, and the answers so far.
struct NamedImage {
    image: PathBuf,
    process: process::Child,
    answers: BufReader<ChildStdout>,
    known: BTreeMap<u64, Vec<Frame>>,
}

/// The `addr2line` for the lines of a log, kept because it reads the whole debugging information
/// when it starts.
static OF_LINES: Mutex<Option<NamedImage>> = Mutex::new(None);

/// An address outside every image, sent to mark the end of the preceding answer.
const NOWHERE: &str = "0xffffffffffffffff";

impl NamedImage {
    fn open(program: &Path, image: &Path) -> Option<Self> {
        // `-a` repeats each address; `-i` names the inlined calls around the address, each in two
        // lines (`-f`: function, file and line); `-C` makes names readable.
        let mut command = Command::new(program);
        command.args(["-aifC", "-e"]).arg(image);
        command.stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut process = command.stderr(Stdio::null()).spawn().ok()?;
        Some(Self {
            image: image.into(),
            answers: BufReader::new(process.stdout.take()?),
            process,
            known: BTreeMap::new(),
        })
    }

    /// Returns the functions that contain each of the addresses, and those of earlier addresses.
    fn frames(&mut self, addresses: &[u64]) -> Option<&BTreeMap<u64, Vec<Frame>>> {
        for address in addresses {
            if !self.known.contains_key(address) {
                let frames = self.ask(*address)?;
                self.known.insert(*address, frames);
            }
        }
        Some(&self.known)
    }

    fn ask(&mut self, address: u64) -> Option<Vec<Frame>> {
        let question = format!("{address:#x}\n{NOWHERE}\n");
        self.process
            .stdin
            .as_mut()?
            .write_all(question.as_bytes())
            .ok()?;
        let mut lines = self.answers.by_ref().lines().map_while(Result::ok);
        read_frames(&mut lines)
    }
}

/// Reads the answer to an address, up to the answer to [`NOWHERE`].
fn read_frames(lines: &mut impl Iterator<Item = String>) -> Option<Vec<Frame>> {
    // The address itself.
    lines.next()?;
    let mut frames = Vec::new();
    loop {
        let (function, place) = (lines.next()?, lines.next()?);
        if function == NOWHERE {
            // `place` is no function, and no line follows.
            lines.next()?;
            return Some(frames);
        }
        // ` (discriminator 2)` after the line tells copies of the line apart; a path may contain
        // blanks.
        let line = place.split(" (discriminator ").next().unwrap_or(&place);
        frames.push(Frame {
            function,
            line: line.into(),
        });
    }
}

impl Drop for NamedImage {
    fn drop(&mut self) {
        // The end of its input, closed here, ends the process.
        let _ = self.process.wait();
    }
}

/// Returns the address in a line's `place`, if the line's kind has addresses.
fn address(line: &MachineLine) -> Option<u64> {
    let place = line.text_at("place")?;
    let digits = place.strip_prefix("0x")?;
    KINDS
        .contains(&line.kind.as_str())
        .then(|| u64::from_str_radix(digits, 16).ok())?
}

/// Describes an address and its frames in a sentence.
fn sentence(address: u64, frames: &[Frame]) -> String {
    let function = frames.first().map_or("??", |frame| &frame.function);
    if function == "??" {
        return format!("{address:#x} is in no function of the image");
    }
    // The innermost line of the app, since the fault itself is often in a library.
    let line = frames.iter().find_map(line_of_app);
    let line = line.map_or_else(String::new, |line| format!(", of {line}"));
    format!("{address:#x} is {function}{line}")
}

impl Frame {
    /// Reports whether the code belongs to Rust's library.
    fn is_of_library(&self) -> bool {
        self.line.starts_with("/rustc/")
    }

    /// Returns file and line in short form: from the workspace's root, or from the library's root.
    fn file_and_line(&self) -> &str {
        let line = self.line.as_str();
        if let Some((_, below)) = line
            .split_once("/library/")
            .filter(|_| self.is_of_library())
        {
            return below;
        }
        let root = system::workspace().to_str();
        let below = root.and_then(|root| line.strip_prefix(root)?.strip_prefix('/'));
        below.unwrap_or(line)
    }
}

/// Returns a file and line if they belong to the app. The path begins below the workspace's root,
/// or below the current folder, which is the root of the app's own repository if cargo starts the
/// tool there.
fn line_of_app(frame: &Frame) -> Option<&str> {
    let below = |folder: &Path| frame.line.strip_prefix(folder.to_str()?)?.strip_prefix('/');
    let path = match below(system::workspace()) {
        Some(path) if OF_OTHERS.iter().any(|of| path.starts_with(of)) => return None,
        Some(path) => path,
        None => below(&env::current_dir().ok()?)?,
    };
    // `addr2line` may know the file but not the line.
    (!path.ends_with(":?") && !path.ends_with(":0")).then_some(path)
}

/// The most lines shown of a backtrace.
const SHOWN: usize = 12;

/// Functions hidden from backtraces: first the callers of apps, then the handlers of a panic.
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
struct Call {
    returns_to: u64,
    callee: Option<u64>,
}

impl Call {
    /// Reads the list in a line of kind `backtrace`, skipping malformed entries.
    fn list(value: Option<&Value>) -> Vec<Call> {
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
        // The return address may belong to the next line, or even to the next function.
        self.returns_to.saturating_sub(1)
    }

    /// Returns the addresses whose functions are needed for the chain.
    fn addresses(self) -> impl Iterator<Item = u64> {
        [Some(self.instruction()), self.callee]
            .into_iter()
            .flatten()
    }
}

/// Describes the chain of calls leading to `place`, or to the innermost call, with a line for each
/// call. Returns `None` if no name is known.
fn tell(place: Option<u64>, calls: &[Call], frames: &BTreeMap<u64, Vec<Frame>>) -> Option<String> {
    let known = |address: u64| frames.get(&address).map_or(&[][..], Vec::as_slice);
    let mut lines: Vec<(String, usize)> = Vec::new();
    let chain = chain(place, calls, &known);
    // A panic's own functions come first, and say nothing of the cause.
    let own = |frame: &&Frame| !OF_PANICS.iter().any(|of| frame.function.starts_with(of));
    let all = chain.into_iter().flat_map(known);
    let all = all.take_while(|frame| !OUTERMOST.iter().any(|of| frame.function.starts_with(of)));
    let all = all.skip_while(|frame| !own(frame));
    let mut all = all.filter(|frame| frame.function != "??").peekable();
    while let Some(frame) = all.next() {
        // Of several library frames only the outermost is shown: the app called that function.
        if frame.is_of_library() && all.peek().is_some_and(|outer| outer.is_of_library()) {
            continue;
        }
        let line = format!("{}, {}", brief(&frame.function), frame.file_and_line());
        match lines.last_mut() {
            // A recursion would fill the list with a single line, so repetitions are counted.
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

/// Removes generic arguments from a function's name, because they may be pages long.
fn brief(function: &str) -> String {
    let mut depth = 0;
    let mut brief = String::new();
    let mut before = ' ';
    for letter in function.chars() {
        // `<` after a name opens arguments; elsewhere it opens a type such as `<A as B>`.
        depth += i32::from(letter == '<' && (depth > 0 || before.is_alphanumeric()));
        if depth == 0 {
            brief.push(letter);
        }
        // The `>` of `->` closes nothing.
        depth -= i32::from(letter == '>' && depth > 0 && before != '-');
        before = letter;
    }
    brief
}

/// Returns the addresses of the call instructions, the innermost first.
fn chain<'f>(
    place: Option<u64>,
    mut calls: &[Call],
    known: &impl Fn(u64) -> &'f [Frame],
) -> Vec<u64> {
    // The last frame of an address is the function that was really called; the others are inlined.
    let function = |address: u64| known(address).last().map(|frame| frame.function.as_str());
    let mut chain: Vec<u64> = place.into_iter().collect();
    loop {
        let inner = chain.last().and_then(|&address| function(address));
        let called = |call: &Call| inner.is_some() && call.callee.and_then(function) == inner;
        // No call fits: the call came through a pointer or a jump, so the next word is taken.
        let next = calls.iter().position(called).unwrap_or(0);
        let Some(call) = calls.get(next) else {
            return chain;
        };
        chain.push(call.instruction());
        // Words further inside were skipped as left over, and stay skipped.
        calls = &calls[next + 1..];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::system::workspace;
    use std::fs;

    fn line(kind: &str, place: &str) -> String {
        format!("{{\"kind\":\"{kind}\",\"cpu\":0,\"place\":\"{place}\",\"message\":\"m\"}}")
    }

    /// Returns the offset of an address of this program in its file: programs of the host are
    /// loaded anywhere.
    fn in_file(address: usize) -> String {
        let program = std::env::current_exe().unwrap();
        let program = program.to_str().unwrap();
        let maps = fs::read_to_string("/proc/self/maps").unwrap();
        let first = maps.lines().find(|map| map.ends_with(program)).unwrap();
        let (base, _) = first.split_once('-').unwrap();
        format!("{:#x}", address - usize::from_str_radix(base, 16).unwrap())
    }

    #[inline(never)]
    fn fuse() -> u32 {
        line!()
    }

    #[test]
    fn an_address_of_a_fault_is_named_with_the_apps_line_and_nothing_else_is() {
        let explained = |line: &str| explain(&std::env::current_exe().unwrap(), line);
        let inside = in_file(fuse as *const () as usize);
        let said = explained(&line("panic", &inside)).unwrap();
        let (place, found) = said.rsplit_once(':').unwrap();
        let name = "tool::places::tests::fuse, of scripts/tool/src/places.rs";
        assert_eq!(place, format!("{inside} is {name}"));
        // Any of its three lines.
        assert!(fuse().abs_diff(found.parse().unwrap()) <= 1, "{said}");
        // Names of the library are readable, and its lines are not the app's.
        let library = in_file(std::fmt::write as *const () as usize);
        let expected = format!("{library} is core::fmt::write");
        assert_eq!(explained(&line("panic", &library)), Some(expected));
        let nowhere = explained(&line("panic", "0x10"));
        assert_eq!(
            nowhere.as_deref(),
            Some("0x10 is in no function of the image")
        );
        for other in [
            line("panic", "main.rs:3:1"),
            line("own", &inside),
            "  at 0x20".into(),
        ] {
            assert_eq!(explained(&other), None);
        }
        let process = || OF_LINES.lock().unwrap().as_ref().map(|of| of.process.id());
        let first = process();
        assert!(explained(&line("panic", &inside)).is_some() && first.is_some());
        assert_eq!(process(), first, "a process for each line takes minutes");
        let missing = explain(Path::new("no such image"), &line("panic", "0x200000"));
        assert_eq!(missing, None);
    }

    #[test]
    fn the_innermost_line_of_the_app_is_chosen() {
        let root = workspace().display();
        let found = format!(
            "0x000000000020e0b8\n<fass::subtask::Turns as core::future::Future>::poll\n\
             /rustc/59807616e1fa/library/core/src/hint.rs:491\n\
             {{closure#0}}\n{root}/apps/vision/src/lib.rs:?\n\
             edges\n{root}/apps/my vision/src/lib.rs:7 (discriminator 2)\n\
             {{closure#1}}\n{root}/apps/vision/src/lib.rs:9\n\
             poll\n{root}/fass/src/run/subtask.rs:81\n\
             {NOWHERE}\n??\n??:0\n\
             0x00000000002070e9\ninterrupt_common\nfaults.2b61-cgu.0:?\n{NOWHERE}\n??\n??:0\n"
        );
        let mut lines = found.lines().map(String::from);
        let mut told = |address: u64| sentence(address, &read_frames(&mut lines).unwrap());
        let name = "<fass::subtask::Turns as core::future::Future>::poll";
        let expected = format!("0x20e0b8 is {name}, of apps/my vision/src/lib.rs:7");
        assert_eq!(told(0x20_e0b8), expected);
        assert_eq!(told(0x20_70e9), "0x2070e9 is interrupt_common");
    }

    /// Addresses with the functions that contain them, the innermost first. The worker (0x10) calls
    /// `app` (0x20) by a pointer, which calls `deep` (0x30), into which `small` is inlined.
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
        // Without names nothing is listed.
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
