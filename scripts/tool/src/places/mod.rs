//! Places in code: the function of an image that an address lies in, and the calls to it.
//!
//! A guest that reports a fault knows the address of the instruction, and its
//! image has no names in it that it could read. So wherever the tool shows a line
//! of kind `panic` or `fault` whose `place` is an address, it adds one
//! line that names the function, and the app's line there, if there is one. After a line of
//! kind `backtrace` it tells the calls (`backtrace`). What the guest printed stays as it is.
//!
//! Names and lines are found by `addr2line`, which reads the image's symbols and
//! debugging information and knows both ways in which the compiler writes names. It
//! is part of binutils, which C compilers bring along; where it is missing, one
//! sentence says so. An image that cannot be read adds nothing: the report of a fault
//! is no place for another one.

mod backtrace;

use std::cell::Cell;
use std::collections::BTreeMap;
use std::env;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::protocol::{MachineLine, read_line};
use crate::system;
use backtrace::Call;

/// The program that finds names and lines.
const PROGRAM: &str = "addr2line";

/// The kinds whose `place` may be an address.
const KINDS: [&str; 3] = ["panic", "fault", BACKTRACE];

/// The kind that has the calls on a stack.
const BACKTRACE: &str = "backtrace";

/// Folders of the workspace whose code is not the app's.
const OF_OTHERS: [&str; 4] = ["boot/", "fass/", "kernel/", "sched-dag/"];

/// The names for addresses in one image.
#[derive(Debug)]
pub struct Places {
    image: PathBuf,
    program: &'static str,
    /// Whether it has been said that the program is missing.
    is_missed: Cell<bool>,
}

impl Places {
    /// Begins with an image that need not be there, or be an ELF file.
    #[must_use]
    pub fn new(image: &Path) -> Places {
        Places {
            image: image.to_path_buf(),
            program: PROGRAM,
            is_missed: Cell::new(false),
        }
    }

    /// Returns what to add to a line of the serial log, if anything, such as
    /// `0x20e0b8 is faults::crimes::sum_down, of apps/faults/src/crimes.rs:115`.
    #[must_use]
    pub fn explain(&self, line: &str) -> Option<String> {
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
        let Some(program) = system::find_program(self.program) else {
            return (!self.is_missed.replace(true)).then(|| missed(first, self.program));
        };
        let frames = frames(&program, &self.image, &addresses)?;
        if is_backtrace {
            return backtrace::tell(address, &calls, &frames);
        }
        Some(sentence(first, frames.get(&first)?))
    }
}

/// A function that contains an address, called or inlined there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frame {
    /// The function, `??` if it is not known.
    pub function: String,
    /// File and line, as `FILE:LINE`; `?` or 0 for a line that is not known.
    pub line: String,
}

/// Returns what contains each of the addresses in an image, the innermost first, as
/// `addr2line` (`program`) tells; nothing if it fails.
#[must_use]
pub fn frames(
    program: &Path,
    image: &Path,
    addresses: &[u64],
) -> Option<BTreeMap<u64, Vec<Frame>>> {
    // `-a` repeats each address; `-i` names the inlined calls that contain it, each in two
    // lines (`-f`: function, file and line); `-C` makes names readable.
    let output = Command::new(program)
        .args(["-aifC", "-e"])
        .arg(image)
        .args(addresses.iter().map(|address| format!("{address:#x}")))
        .stdin(Stdio::null())
        .stderr(Stdio::null())
        .output();
    let output = output.ok().filter(|output| output.status.success())?;
    Some(read_frames(&String::from_utf8_lossy(&output.stdout)))
}

fn read_frames(found: &str) -> BTreeMap<u64, Vec<Frame>> {
    let mut all = BTreeMap::new();
    let mut lines = found.lines();
    let mut frames: &mut Vec<Frame> = &mut Vec::new();
    while let Some(line) = lines.next() {
        let digits = line.strip_prefix("0x").filter(|digits| digits.len() == 16);
        if let Some(address) = digits.and_then(|digits| u64::from_str_radix(digits, 16).ok()) {
            frames = all.entry(address).or_default();
            continue;
        }
        // ` (discriminator 2)` after the line tells copies of it apart; a path may have spaces.
        let place = lines.next().unwrap_or("??:?");
        frames.push(Frame {
            function: line.into(),
            line: place
                .split(" (discriminator ")
                .next()
                .unwrap_or(place)
                .into(),
        });
    }
    all
}

/// Returns the address at which a line says that something happened.
fn address(line: &MachineLine) -> Option<u64> {
    let place = line.text_at("place")?;
    let digits = place.strip_prefix("0x")?;
    KINDS
        .contains(&line.kind.as_str())
        .then(|| u64::from_str_radix(digits, 16).ok())?
}

fn missed(address: u64, program: &str) -> String {
    format!(
        "the function at {address:#x} is not named, as `{program}` is not installed; install \
         the package binutils"
    )
}

/// Says in our words what the program has found.
fn sentence(address: u64, frames: &[Frame]) -> String {
    let function = frames.first().map_or("??", |frame| &frame.function);
    if function == "??" {
        return format!("{address:#x} is in no function of the image");
    }
    let line = frames.iter().find_map(line_of_app);
    let line = line.map_or_else(String::new, |line| format!(", of {line}"));
    format!("{address:#x} is {function}{line}")
}

impl Frame {
    /// Reports whether the code is Rust's library.
    fn is_of_library(&self) -> bool {
        self.line.starts_with("/rustc/")
    }

    /// Returns file and line in short: from the workspace on, or from the library's root on.
    fn place(&self) -> &str {
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

/// Returns a file and line if it is the app's: from the workspace on, or from this folder on,
/// which is the root of the app's own repository where cargo starts the tool.
fn line_of_app(frame: &Frame) -> Option<&str> {
    let below = |folder: &Path| frame.line.strip_prefix(folder.to_str()?)?.strip_prefix('/');
    let path = match below(system::workspace()) {
        Some(path) if OF_OTHERS.iter().any(|of| path.starts_with(of)) => return None,
        Some(path) => path,
        None => below(&env::current_dir().ok()?)?,
    };
    (!path.ends_with(":?") && !path.ends_with(":0")).then_some(path)
}

#[cfg(test)]
mod tests {
    use super::{Places, read_frames, sentence};
    use crate::system::workspace;
    use std::fs;
    use std::path::Path;

    fn line(kind: &str, place: &str) -> String {
        format!("{{\"kind\":\"{kind}\",\"cpu\":0,\"place\":\"{place}\",\"message\":\"m\"}}")
    }

    /// Returns where an address of this program is in its file: programs of the host
    /// are loaded anywhere.
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
        let places = Places::new(&std::env::current_exe().unwrap());
        let inside = in_file(fuse as *const () as usize);
        let explained = places.explain(&line("panic", &inside)).unwrap();
        let (place, found) = explained.rsplit_once(':').unwrap();
        let name = "tool::places::tests::fuse, of scripts/tool/src/places/mod.rs";
        assert_eq!(place, format!("{inside} is {name}"));
        // Any of its three lines.
        assert!(fuse().abs_diff(found.parse().unwrap()) <= 1, "{explained}");
        // Names of the library are readable, and its lines are not the app's.
        let library = in_file(std::fmt::write as *const () as usize);
        let expected = format!("{library} is core::fmt::write");
        assert_eq!(places.explain(&line("panic", &library)), Some(expected));
        let nowhere = places.explain(&line("panic", "0x10"));
        assert_eq!(
            nowhere.as_deref(),
            Some("0x10 is in no function of the image")
        );
        for other in [
            line("panic", "main.rs:3:1"),
            line("own", &inside),
            "  at 0x20".into(),
        ] {
            assert_eq!(places.explain(&other), None);
        }
        let missing = Places::new(Path::new("no such image"));
        assert_eq!(missing.explain(&line("panic", "0x200000")), None);
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
             0x00000000002070e9\ninterrupt_common\nfaults.2b61-cgu.0:?\n"
        );
        let frames = read_frames(&found);
        let told = |address: u64| sentence(address, &frames[&address]);
        let name = "<fass::subtask::Turns as core::future::Future>::poll";
        let expected = format!("0x20e0b8 is {name}, of apps/my vision/src/lib.rs:7");
        assert_eq!(told(0x20_e0b8), expected);
        assert_eq!(told(0x20_70e9), "0x2070e9 is interrupt_common");
    }

    #[test]
    fn without_the_program_its_package_is_named_once() {
        let places = Places {
            program: "no-such-addr2line",
            ..Places::new(Path::new("an image"))
        };
        let told = places.explain(&line("panic", "0x200000")).unwrap();
        assert!(told.starts_with("the function at 0x200000 is not named, as `no-such-addr2line`"));
        assert!(told.ends_with("; install the package binutils"), "{told}");
        assert_eq!(places.explain(&line("panic", "0x200000")), None);
    }
}
