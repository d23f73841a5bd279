//! The size of each part of an image.
//!
//! An instruction belongs to a single part. Among the functions the instruction was inlined from,
//! the innermost in a file of ours decides, so library code counts for the part that uses it. A
//! part is a folder or file right below a crate's `src`. Code from no file of ours, such as for
//! dropping values, is listed separately, and so is everything else: constants, variables with
//! nonzero initial values, headers.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::process::ExitCode;

use super::code::{self, Frames};
use super::frame::by_plan;
use tool::options::{Command, CommandLine, ValueKind, options};
use tool::progress::ProgressNote;
use tool::{elf, files, image};
use views::json::Object;

static TABLE: Command = Command {
    invocation: "./scripts/bench sizes",
    about: "Says how many bytes of an image each part of the code takes.",
    positional: None,
    options: OPTIONS,
    notes: "\
Builds the image. Prints a table, the largest part first, and a JSON object for each part.
Counted are the bytes that `strip` leaves.

Exit code: 0 the image is within its limit; 1 it is not, or could not be read; 2 the
command line is refused.
",
};

options! {
    /// The app.
    APP: ValueKind::Text("APP"), or "fork-join";
}

/// The part of code from no file of ours.
const LIBRARY: &str = "the library, and what drops values";

/// Measures, and prints.
pub(super) fn run(words: &[OsString]) -> ExitCode {
    let app = |options: &CommandLine| {
        let app = options.text(name::APP).unwrap_or_default();
        image::check_app(app).map(|()| app.to_string())
    };
    by_plan(&TABLE, words, app, |app| weigh(app))
}

/// Prints the sizes of the parts of an app's image, and returns whether the sum is within its
/// limit.
fn weigh(app: &str) -> Result<bool, String> {
    // Nothing is printed before there is a result.
    let _lasting = ProgressNote::new("measuring");
    let image = image::build(app)?;
    let stripped = elf::stripped_bytes(&files::read_at(&image)?)?;
    let addresses: Vec<u64> = code::instructions(&image)?.into_keys().collect();
    let mut parts = parts(&addresses, &code::frames(&image, &addresses)?);
    let code: u64 = parts.values().sum();
    let rest = stripped.saturating_sub(code);
    parts.insert("constants, variables, headers".into(), rest);
    let mut parts: Vec<_> = parts.into_iter().collect();
    parts.sort_by_key(|&(_, bytes)| std::cmp::Reverse(bytes));
    for (part, bytes) in &parts {
        let share = 100.0 * *bytes as f64 / stripped.max(1) as f64;
        println!("{bytes:>9} {share:>5.1} %  {part}");
    }
    let most = image::MOST_STRIPPED_BYTES;
    println!("{stripped:>9} bytes of `{app}` in all, of {most} at most");
    for (part, bytes) in &parts {
        let line = Object::new().text("kind", "bench").text("name", "size");
        let line = line.text("app", app).text("part", part);
        println!("{}", line.number("bytes", *bytes).into_text());
    }
    Ok(stripped <= most)
}

/// Returns the bytes of each part. An instruction extends to the next instruction. The last
/// instruction, and any before a gap, counts as one byte.
fn parts(addresses: &[u64], frames: &Frames) -> BTreeMap<String, u64> {
    /// The length of the longest instruction (Intel SDM, volume 2, 2.3.11).
    const LONGEST: u64 = 15;
    let next = addresses.iter().skip(1).chain(addresses.last());
    let mut parts = BTreeMap::new();
    for (address, next) in addresses.iter().zip(next) {
        let bytes = match next - address {
            // A larger distance is a gap between functions or sections, which is no code.
            bytes @ 1..=LONGEST => bytes,
            _ => 1,
        };
        let frames = frames.get(address).map_or(&[][..], |frames| frames);
        let ours = code::own(frames).and_then(|(line, _)| part(line));
        *parts.entry(ours.unwrap_or(LIBRARY.into())).or_default() += bytes;
    }
    parts
}

/// Returns the part of a line of ours, such as `kernel: run`.
fn part(line: &str) -> Option<String> {
    let (owner, below) = line.split_once("/src/")?;
    let room = below.split(['/', ':']).next()?;
    Some(format!("{owner}: {}", room.trim_end_matches(".rs")))
}

#[cfg(test)]
mod tests {
    use super::{LIBRARY, parts};
    use crate::bench::code::Frames;
    use tool::places::Frame;
    use tool::system;

    #[test]
    fn an_instruction_is_its_innermost_file_of_ours_and_gaps_are_nobodys() {
        let root = system::workspace().display().to_string();
        let frame = |line: &str| Frame {
            function: "f".into(),
            line: line.replace("ROOT", &root),
        };
        let library = frame("/rustc/x/library/core/src/ptr/mod.rs:1");
        let inlined = vec![
            library.clone(),
            frame("ROOT/sched-dag/src/order.rs:7"),
            frame("ROOT/kernel/executive/src/run/worker.rs:4"),
        ];
        let of_room = vec![frame("ROOT/kernel/executive/src/run/execution/step.rs:4")];
        let frames = Frames::from([(10, inlined), (13, vec![library]), (20, of_room)]);
        let found = parts(&[10, 13, 20, 100, 104], &frames);
        let expected = [
            ("kernel/executive: run", 1),
            (LIBRARY, 7 + 4 + 1),
            ("sched-dag: order", 3),
        ];
        assert_eq!(
            found,
            expected.map(|(part, bytes)| (part.into(), bytes)).into()
        );
    }
}
