//! The code of an image: its instructions, and the functions containing the instructions.
//!
//! `objdump` and `addr2line` of binutils provide both.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

use tool::places::{self, Frame};
use tool::system;

/// For each address, the functions containing the address, the innermost first.
pub(super) type Frames = BTreeMap<u64, Vec<Frame>>;

/// The largest number of addresses in one command line, with room to spare.
const AT_ONCE: usize = 20_000;

/// Returns the instructions of an image by address.
///
/// # Errors
///
/// In words: `objdump` is missing or has failed.
pub(super) fn instructions(image: &Path) -> Result<BTreeMap<u64, String>, String> {
    let mut objdump = Command::new(program("objdump")?);
    objdump.args(["-d", "-C", "--no-show-raw-insn"]).arg(image);
    let text = system::run(&mut objdump)?;
    let instruction = |line: &str| {
        let (address, text) = line.trim().split_once(":\t")?;
        Some((u64::from_str_radix(address, 16).ok()?, text.to_string()))
    };
    Ok(text.lines().filter_map(instruction).collect())
}

/// Returns the functions containing each of some addresses.
///
/// # Errors
///
/// In words: `addr2line` is missing or has failed.
pub(super) fn frames(image: &Path, addresses: &[u64]) -> Result<Frames, String> {
    let addr2line = program("addr2line")?;
    let mut all = Frames::new();
    for some in addresses.chunks(AT_ONCE) {
        let found = places::frames(&addr2line, image, some);
        // Chunks have different addresses, so no entry is overwritten.
        all.append(&mut found.ok_or_else(|| format!("`{}` failed", addr2line.display()))?);
    }
    Ok(all)
}

/// Returns an address's innermost frame in a file of ours: the line, relative to the workspace's
/// root, such as `fass/src/run/plan.rs:183`, and the function. So library code counts for the file
/// that uses it.
pub(super) fn own(frames: &[Frame]) -> Option<(&str, &str)> {
    let root = system::workspace().to_str()?;
    frames.iter().find_map(|frame| {
        let line = frame.line.strip_prefix(root)?.strip_prefix('/')?;
        Some((line, &*frame.function))
    })
}

fn program(name: &str) -> Result<PathBuf, String> {
    let missing = || format!("`{name}` is not installed; install the package binutils");
    system::find_program(name).ok_or_else(missing)
}
