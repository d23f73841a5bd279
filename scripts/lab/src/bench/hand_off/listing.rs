//! The instructions of one hop: from one subtask's call to its successor's.
//!
//! A chain of 64 empty bodies is booted with every instruction logged. The log is cut at the calls
//! of subtasks' functions, where `SubtaskCode::run` of `fass` polls a future. A *hop* is the part
//! between two calls; the listed hop has the most frequent length. Each instruction belongs to a
//! file of ours: among the functions the instruction was inlined from, the innermost of ours
//! decides.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;

use super::boots::{HandOffBoot, Kind, LIMIT};
use crate::bench::code::{self, Frames};
use tool::places::Frame;
use tool::qemu::{Mode, RunEnd};
use tool::{files, system};
use views::protocol::Status;

/// Boots, prints how many instructions each file contributes to a hop, and writes the hop to a
/// file.
///
/// # Errors
///
/// In words: a program is missing, the guest failed, or the file cannot be written.
pub(super) fn list(image: &Path, file: &Path) -> Result<(), String> {
    let instructions = code::instructions(image)?;
    let executed = executed(image)?;
    let frames = |addresses: BTreeSet<u64>| {
        let addresses: Vec<u64> = addresses.into_iter().collect();
        code::frames(image, &addresses)
    };
    let is_call = |address: &u64| {
        let text = instructions.get(address);
        text.is_some_and(|text| text.starts_with("call") && text.contains('*'))
    };
    let call = the_call(&frames(executed.iter().copied().filter(is_call).collect())?)?;
    let hop = usual_hop(&executed, call).ok_or("no subtask's call is in the log")?;
    let frames = frames(hop.iter().copied().collect())?;
    print!("{}", table(hop, &frames));
    let listing = listing(hop, &frames, &instructions);
    files::write(file, listing)
}

/// Boots the image and returns the addresses of all executed instructions.
fn executed(image: &Path) -> Result<Vec<u64>, String> {
    // Few jobs, as every instruction is logged.
    let words = "part=workloads jobs=5 chain=64 branches=1 layered=3";
    let mut qemu = HandOffBoot::new(Kind::Figures, 1, 64, words).qemu(Mode::Deterministic);
    qemu.logs_instructions = true;
    let serial = system::new_log("listing")?;
    let mut running = qemu.start(image, &serial)?;
    let log = running.child.output();
    let (ending, addresses) = std::thread::scope(|scope| {
        // Read while the guest runs: a full pipe would stop it.
        let reader =
            scope.spawn(|| log.map_or_else(Vec::new, |log| addresses(BufReader::new(log))));
        let followed = running.follow(LIMIT, &mut |_| ());
        followed.map(|(ending, _)| (ending, reader.join().unwrap_or_default()))
    })?;
    if ending != RunEnd::Guest(Status::Success) {
        let (said, log) = (running.complaints(), serial.display());
        return Err(format!("{ending} {said}; its serial log is {log}"));
    }
    // Failing to remove our own log harms nothing.
    let _ = fs::remove_file(&serial);
    Ok(addresses)
}

/// Reads QEMU's log: each line has the address between slashes, in 16 digits.
fn addresses(mut log: impl BufRead) -> Vec<u64> {
    let mut addresses = Vec::new();
    let mut line = Vec::new();
    while log
        .read_until(b'\n', &mut line)
        .is_ok_and(|bytes| bytes > 0)
    {
        let parts = line.split(|byte| *byte == b'/');
        let numbers = parts.filter(|part| part.len() == 16).filter_map(|part| {
            let digits = std::str::from_utf8(part).ok()?;
            u64::from_str_radix(digits, 16).ok()
        });
        addresses.extend(numbers.take(1));
        line.clear();
    }
    addresses
}

/// Returns the address where subtasks' futures are polled: the only executed indirect call of
/// `plan.rs` from a function `run`, wherever it is inlined.
fn the_call(calls: &Frames) -> Result<u64, String> {
    let is_poll = |frames: &Vec<Frame>| {
        let line = frames.first().map_or("", |frame| &frame.line);
        let is_run = |frame: &Frame| frame.line.contains("fass/src/") && frame.function == "run";
        // The other indirect call asks whether a function has a replacement.
        line.contains("plan.rs") && frames.iter().any(is_run)
    };
    let polls: Vec<u64> = (calls.iter().filter(|(_, frames)| is_poll(frames)))
        .map(|(address, _)| *address)
        .collect();
    match polls[..] {
        [call] => Ok(call),
        _ => Err(format!(
            "{} calls of subtasks' futures instead of one are in the log",
            polls.len()
        )),
    }
}

/// Returns the first hop of the most frequent length.
fn usual_hop(executed: &[u64], call: u64) -> Option<&[u64]> {
    let calls = (0..executed.len()).filter(|&at| executed[at] == call);
    let calls: Vec<usize> = calls.collect();
    let hops = calls.windows(2).map(|pair| &executed[pair[0]..pair[1]]);
    let hops: Vec<&[u64]> = hops.collect();
    let mut counts: BTreeMap<usize, usize> = BTreeMap::new();
    for hop in &hops {
        *counts.entry(hop.len()).or_default() += 1;
    }
    let usual = counts.into_iter().max_by_key(|&(_, count)| count)?.0;
    hops.into_iter().find(|hop| hop.len() == usual)
}

/// Returns the line and the function of an instruction.
fn line_and_function<'f>(frames: &'f Frames, address: &u64) -> (&'f str, &'f str) {
    let frames = frames.get(address).map_or(&[][..], |frames| frames);
    code::own(frames).unwrap_or(("elsewhere", "?"))
}

fn table(hop: &[u64], frames: &Frames) -> String {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for address in hop {
        let (line, _) = line_and_function(frames, address);
        let file = line.split(':').next().unwrap_or(line);
        *counts.entry(file).or_default() += 1;
    }
    let mut counts: Vec<_> = counts.into_iter().collect();
    counts.sort_by_key(|&(_, count)| std::cmp::Reverse(count));
    let all = "instructions from one subtask's call to its successor's";
    counts.push((all, hop.len()));
    let row = |(file, count): (&str, usize)| format!("{count:6} {file}\n");
    counts.into_iter().map(row).collect()
}

/// Returns the hop, one instruction a line: address, text, and its innermost line of ours.
fn listing(hop: &[u64], frames: &Frames, instructions: &BTreeMap<u64, String>) -> String {
    let line = |address: &u64| {
        let (line, function) = line_and_function(frames, address);
        let instruction = instructions.get(address).map_or("?", |text| text);
        format!("{address:x}  {instruction:60} {line}: {function}\n")
    };
    hop.iter().map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use tool::system::workspace;

    #[test]
    fn an_address_is_read_from_each_line_that_has_one() {
        let log = "Trace 0: 0x7f0001 [0000000000000000/0000000000204a10/0x40c0b0/0xff]\nother\n";
        assert_eq!(addresses(log.as_bytes()), [0x20_4a10]);
    }

    #[test]
    fn the_usual_hop_is_the_first_of_the_commonest_length() {
        let executed = [9, 1, 2, 3, 1, 4, 1, 5, 1];
        assert_eq!(usual_hop(&executed, 1), Some(&[1, 4][..]));
        assert_eq!(usual_hop(&executed, 7), None);
    }

    #[test]
    fn the_innermost_file_of_ours_decides() {
        let root = workspace().display();
        let frame = |line: &str| Frame {
            function: "f".into(),
            line: format!("{root}{line}").replace(&format!("{root}/rustc"), "/rustc"),
        };
        let inlined = [
            "/rustc/x/core/src/ptr.rs:1",
            "/kernel/executive/src/machine/spinlock.rs:3",
            "/kernel/executive/src/run/worker.rs:4",
        ];
        let frames = Frames::from([(7, inlined.map(frame).into()), (8, Vec::new())]);
        let expected = ("kernel/executive/src/machine/spinlock.rs:3", "f");
        assert_eq!(line_and_function(&frames, &7), expected);
        let counted = table(&[7, 8, 7], &frames);
        assert!(counted.starts_with("     2 kernel/executive/src/machine/spinlock.rs\n"));
    }
}
