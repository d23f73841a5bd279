//! Checks: properties of the whole tree, each counted as a test.
//!
//! Checks keep the promises beyond the reach of unit tests: no package from elsewhere, no file too
//! long, layers in order, no crate beyond its budget of lines, no complaint from the formatter, the
//! linter or the documentation, a hand-off of no more instructions than its baseline, and a guest
//! under KVM where KVM works. The checks judge the project's own packages.
//!
//! Free disk space is checked before anything is built: a disk filling up in the middle would show
//! up as a linker error, or as a guest without a log.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use super::{
    CheckFailure, SourceFile, Tally, TestPlan, apart, budgets, layers, none_of, packages, paths,
    words,
};
use crate::bench::{hand_off, native};
use sched_dag::Policy;
use tool::image;
use tool::install;
use tool::probe;
use tool::progress::ProgressNote;
use tool::qemu::Qemu;
use tool::recordings;
use tool::system;

/// The largest number of lines of a source file.
const MOST_LINES: usize = 800;

/// The folders of the root. Cargo's own folder holds everything generated, results of measurements
/// included.
const FOLDERS: [&str; 9] = [
    "apps",
    "boot",
    "docs",
    "fass",
    "kernel",
    "sched-dag",
    "scripts",
    "target",
    "tests",
];

/// Refuses unplanned folders in the root, such as a command's output.
fn strange_folders(root: &Path) -> Result<(), String> {
    let folders = fs::read_dir(root).into_iter().flatten().flatten();
    let folders = folders.filter(|entry| entry.path().is_dir());
    let names = folders.map(|entry| entry.file_name().to_string_lossy().into_owned());
    let strange = names.filter(|name| !name.starts_with('.') && !FOLDERS.contains(&&**name));
    let line = |name| format!("{name}/ is no folder of the project; write results below target/");
    none_of(strange.map(line).collect())
}

/// Runs the wanted checks, except for cargo's.
pub(super) fn run_all(plan: &TestPlan, sources: &[SourceFile], tally: &mut Tally) {
    let blessed = plan.blessed.as_deref();
    let mut run = |name: &str, check: &dyn Fn() -> Result<(), String>| {
        if plan.wants(name) {
            tally.run(name, || Ok(check()?));
        }
    };
    run("Cargo.lock names only our own packages", &|| {
        let lock = fs::read_to_string(system::workspace().join("Cargo.lock"));
        foreign(&lock.map_err(|error| format!("Cargo.lock: {error}"))?)
    });
    run("no folder of the root is unknown", &|| {
        strange_folders(system::workspace())
    });
    type Fault = fn(&str, &str) -> Option<String>;
    let of_each_file: [(&str, Fault); 5] = [
        ("no source file has more than 800 lines", is_long),
        ("every source file opens with an essay", lacks_essay),
        ("no doc sentence begins with a question word", words::asks),
        ("only the table of policies names one", names_policy),
        ("no line escapes the budgets", budgets::escape),
    ];
    for (name, fault) in of_each_file {
        run(name, &|| complain(sources, fault));
    }
    run("types of a crate have names of their own", &|| {
        words::check_names(sources)
    });
    let rooms = "no room says more pronouns, nor pages more words";
    run(rooms, &|| words::check_rooms(sources, blessed));
    run("layers name only layers below them", &|| {
        apart::check(sources).and_then(|()| layers::check(sources))
    });
    run(
        "every path that a page or a comment names is there",
        &|| paths::check(sources),
    );
    run("no crate has more lines than its budget", &|| {
        budgets::check(sources, blessed)
    });
    run_with_programs(plan, tally);
}

/// Runs the checks that need host programs, images or guests. A missing program is reported as
/// skipped, not as a failure.
fn run_with_programs(plan: &TestPlan, tally: &mut Tally) {
    let blessed = plan.blessed.as_deref();
    let mut run = |name: &str, check: &dyn Fn() -> Result<(), CheckFailure>| {
        if plan.wants(name) {
            tally.run(name, check);
        }
    };
    let reader = "an independent reader opens MCAP files in their test";
    run(reader, &|| {
        let reader = recordings::independent_reader();
        reader.map(drop).map_err(CheckFailure::Skipped)
    });
    if plan.quick {
        return;
    }
    let hop = "the hand-off takes no more instructions than its baseline";
    run(hop, &|| Ok(hand_off::check(blessed)?));
    run(
        "a hop on Linux takes no more instructions than its baseline",
        &|| {
            install::ensure(&install::VALGRIND).map_err(CheckFailure::Skipped)?;
            Ok(native::check(blessed)?)
        },
    );
    run(
        "Coq checks the proofs, which are of the same statements",
        &|| {
            install::ensure(&install::COQ).map_err(CheckFailure::Skipped)?;
            let script = system::workspace().join("sched-dag/proofs/check");
            Ok(system::run(&mut Command::new(script)).map(drop)?)
        },
    );
    run("a guest runs under KVM", &|| {
        let image = image::build("fork-join");
        let probed = image.and_then(|image| probe::kvm(&Qemu::default(), &image));
        probed.map_err(CheckFailure::Skipped)
    });
}

/// Runs cargo's checks, in parallel with other work.
pub(super) fn lint_all(plan: &TestPlan, sources: &[SourceFile]) -> Tally {
    let mut tally = Tally::default();
    let mut run = |name: &str, words: &str, remedy: &str| {
        if plan.wants(name) {
            tally.run(name, || match plan.quick {
                true => Err(CheckFailure::Skipped("left out by --quick".into())),
                false => Ok(cargo(sources, words, remedy)?),
            });
        }
    };
    run(
        "rustfmt has nothing to change",
        "fmt --check",
        "run `cargo fmt`",
    );
    let clippy = "clippy --quiet --all-targets -- -D warnings";
    run("clippy has nothing to say", clippy, "see above");
    let doc = "doc --quiet --no-deps";
    run("rustdoc has nothing to say", doc, "see above");
    let private = format!("{doc} --document-private-items");
    run(
        "rustdoc has nothing to say of private items",
        &private,
        "see above",
    );
    tally
}

/// Runs cargo on the packages of the given files. Cargo's output is printed only on failure.
fn cargo(sources: &[SourceFile], words: &str, remedy: &str) -> Result<(), String> {
    let mut command = system::cargo();
    let mut each = words.split(' ');
    command.args(each.next());
    // By name, since `--workspace` would also judge apps of other projects.
    for package in packages(sources) {
        command.args(["-p", &package]);
    }
    command.args(each).env("RUSTDOCFLAGS", "-D warnings");
    // A folder of their own: on a shared one, cargo would let lints and tests wait for each other.
    let target = env::var_os("CARGO_TARGET_DIR").map_or("target".into(), PathBuf::from);
    command.env("CARGO_TARGET_DIR", target.join("lints"));
    let _lasting = ProgressNote::new(&format!("cargo {words}"));
    let output = command.output();
    let output = output.map_err(|error| format!("cannot start cargo: {error}"))?;
    if output.status.success() {
        return Ok(());
    }
    eprint!("{}", String::from_utf8_lossy(&output.stdout));
    eprint!("{}", String::from_utf8_lossy(&output.stderr));
    Err(format!("`cargo {words}` failed; {remedy}"))
}

/// Names packages from elsewhere. The project's packages lie in the workspace, and have no
/// `source`.
fn foreign(lock: &str) -> Result<(), String> {
    let packages = lock.split("[[package]]").skip(1);
    let foreign = packages.filter(|package| package.contains("\nsource = "));
    let name = |package: &str| package.split('"').nth(1).unwrap_or("?").to_string();
    let names = none_of(foreign.map(name).collect());
    names.map_err(|names| format!("packages of others: {names}; do without them"))
}

fn is_long(name: &str, text: &str) -> Option<String> {
    let lines = text.lines().count();
    let is_long = name.ends_with(".rs") && lines > MOST_LINES;
    is_long.then(|| format!("has {lines} lines, split it"))
}

fn lacks_essay(name: &str, text: &str) -> Option<String> {
    let mut lines = text.lines();
    let code = lines.find(|line| !line.trim().is_empty() && !line.starts_with("#!"));
    let has_essay = code.is_some_and(|line| line.starts_with("//!"));
    let lacks = name.ends_with(".rs") && !has_essay;
    lacks.then(|| "does not open with `//!`".to_string())
}

/// Finds a policy's name in the scheduling library, outside the table of policies. Scheduler, law,
/// analysis and witness must ask the table for each policy's properties instead.
fn names_policy(name: &str, text: &str) -> Option<String> {
    let room = name.strip_prefix("sched-dag/src/")?;
    let code = layers::code(text);
    let names = Policy::ALL.iter();
    let mut names = names.map(|policy| format!("Policy::{policy:?}"));
    let named = names.find(|named| code.contains(named))?;
    let is_free = room.starts_with("policies/") || room.ends_with("tests.rs");
    (!is_free).then(|| format!("names {named}; ask the table what that policy is like"))
}

/// Collects the fault of each file, with the file's name, on a single line.
fn complain(
    sources: &[SourceFile],
    fault: impl Fn(&str, &str) -> Option<String>,
) -> Result<(), String> {
    let faults = sources.iter().filter_map(|SourceFile { name, text }| {
        let fault = fault(name, text)?;
        Some(format!("{name} {fault}"))
    });
    none_of(faults.collect())
}

/// The largest disk space taken by all tests and images, built from nothing, in MiB.
const NEEDED_MIB: u64 = 3 << 10;

/// Makes sure that there is enough disk space. If the free space is unknown, only prints a note.
///
/// # Errors
///
/// One sentence: the missing space, its place, and the remedy.
pub(super) fn check() -> Result<(), String> {
    // The running program lies in the target folder, so `df` is asked about its disk.
    let tool = env::current_exe().unwrap_or_default();
    let folder = tool.parent().unwrap_or(Path::new("."));
    let answer = Command::new("df").arg("-Pk").arg(folder).output();
    let free = answer.map(|answer| free_mib(&String::from_utf8_lossy(&answer.stdout)));
    let Ok(Some(free_mib)) = free else {
        let place = folder.display();
        eprintln!("test: `df -Pk {place}` does not say how much is free; 3 GiB are needed");
        return Ok(());
    };
    judge(free_mib, folder)
}

fn judge(free_mib: u64, folder: &Path) -> Result<(), String> {
    if free_mib >= NEEDED_MIB {
        return Ok(());
    }
    Err(format!(
        "{free_mib} MiB are free where `{}` is, and building all tests takes up to {NEEDED_MIB}; \
         remove something, or set CARGO_TARGET_DIR to a folder on another disk",
        folder.display()
    ))
}

/// Reads the available space, in MiB, from the output of `df -Pk` for a single folder (POSIX, `df`,
/// under STDOUT): the number before the percentage. Names may contain blanks.
fn free_mib(said: &str) -> Option<u64> {
    // From the end, since a device's name may contain blanks, too.
    let mut words = said.lines().nth(1)?.split_whitespace().rev();
    words.find(|word| word.ends_with('%'))?;
    let kib: u64 = words.next()?.parse().ok()?;
    Some(kib >> 10)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_package_from_a_registry_is_named() {
        let own = "version = 4\n\n[[package]]\nname = \"boot\"\nversion = \"0.1.0\"\n";
        assert_eq!(foreign(own), Ok(()));
        let with = format!("{own}\n[[package]]\nname = \"libc\"\nsource = \"registry+x\"\n");
        let fault = foreign(&with).unwrap_err();
        assert_eq!(fault, "packages of others: libc; do without them");
    }

    #[test]
    fn a_policy_that_is_named_outside_of_the_table_is_found() {
        let text = "fn f() {\n    // Policy::Fifo\n    Policy::Edf\n}\n";
        let found = names_policy("sched-dag/src/law/sweep.rs", text).expect("a fault");
        assert!(found.starts_with("names Policy::Edf;"), "{found}");
        for name in [
            "sched-dag/src/policies/mod.rs",
            "sched-dag/tests/it/main.rs",
        ] {
            assert_eq!(names_policy(name, text), None);
        }
    }

    #[test]
    fn what_df_says_is_read_and_a_full_disk_is_told_with_its_place_and_the_remedy() {
        let free = |line: &str| free_mib(&format!("Filesystem 1024-blocks Used\n{line}\n"));
        let usual = "/dev/vda1 264212084 20036928 75248960      22% /";
        assert_eq!(free(usual), Some(73_485));
        let odd = "a b:/c 264212084 20036928 1023 100% /with a blank";
        assert_eq!(free(odd), Some(0));
        assert_eq!(
            free("none 0 0 0 - /proc").or(free("")).or(free_mib("")),
            None
        );
        assert_eq!(judge(3072, Path::new("/x")), Ok(()));
        let line = judge(12, Path::new("/x")).unwrap_err();
        assert!(line.starts_with("12 MiB are free where `/x` is"), "{line}");
        assert!(line.contains("set CARGO_TARGET_DIR"), "{line}");
    }
}
