//! What the compiler takes from a clone to the first boot, and after a change.
//!
//! The last commit is cloned into the folder for temporary files and compiled there from
//! nothing, as `./scripts/run` does: first the tool, then the demo's image. Then a file of the
//! app, of the kernel and of the scheduler is changed, and the image compiled again after each.
//! Told is the processors' time, which a host that does other work moves less than the
//! clock's.

use std::ffi::OsString;
use std::fs;
use std::path::Path;
use std::process::{Command as Program, ExitCode, Stdio};

use crate::options::Command;
use crate::system;

static TABLE: Command = Command {
    invocation: "./scripts/bench build",
    about: "Measures what compiling takes: from a clone to the first boot, and after a change.",
    positional: None,
    options: &[],
    notes: "\
Compiles the last commit in a clone; what is not committed is not in it. Prints a table and
a JSON object for each row, in seconds of processor time.

Exit code: 0 measured; 1 it does not compile; 2 the command line is refused.
",
};

/// A row's name, the file that is changed before, and what is compiled then.
const ROWS: [(&str, Option<&str>, &str); 5] = [
    ("a clone, the tool", None, "--profile tool -p tool"),
    ("a clone, the image", None, IMAGE),
    ("the app changed", Some("apps/fork-join/src/main.rs"), IMAGE),
    (
        "the kernel changed",
        Some("kernel/executive/src/lib.rs"),
        IMAGE,
    ),
    ("sched-dag changed", Some("sched-dag/src/lib.rs"), IMAGE),
];

const IMAGE: &str = "--release -p fork-join";

/// Measures, and prints.
pub(super) fn run(words: &[OsString]) -> ExitCode {
    if let Err(code) = TABLE.read(words) {
        return code;
    }
    let clone = std::env::temp_dir().join(format!("fass-build-{}", std::process::id()));
    let measured = measure(&clone);
    // It is ours, and in the way of no one if it cannot be removed.
    let _ = fs::remove_dir_all(&clone);
    match measured {
        Ok(()) => ExitCode::SUCCESS,
        Err(line) => TABLE.fail(&line),
    }
}

fn measure(clone: &Path) -> Result<(), String> {
    let mut git = Program::new("git");
    git.args(["clone", "--quiet"])
        .args([system::workspace(), clone]);
    wait(&mut git)?;
    for (name, changed, words) in ROWS {
        if let Some(file) = changed {
            let file = clone.join(file);
            let text = fs::read_to_string(&file).map_err(|error| error.to_string())?;
            let changed = format!("{text}\nconst _: u8 = 0;\n");
            fs::write(&file, changed).map_err(|error| error.to_string())?;
        }
        let before = of_children()?;
        let mut cargo = system::cargo();
        // The clone's own folder for what is compiled is empty.
        cargo.current_dir(clone).env_remove("CARGO_TARGET_DIR");
        wait(cargo.args(["build", "--quiet"]).args(words.split(' ')))?;
        let seconds = of_children()? - before;
        println!("{seconds:>8.1} s  {name}");
        println!(
            "{{\"kind\":\"bench\",\"name\":\"build\",\"what\":\"{name}\",\"processor_s\":{seconds:.2}}}"
        );
    }
    Ok(())
}

fn wait(program: &mut Program) -> Result<(), String> {
    let name = program.get_program().display().to_string();
    let status = program.stdin(Stdio::null()).status();
    match status.map_err(|error| format!("`{name}`: {error}"))? {
        status if status.success() => Ok(()),
        status => Err(format!("`{name}` failed: {status}")),
    }
}

/// Returns the seconds that processors have spent on programs which this one has waited
/// for, and which these have.
fn of_children() -> Result<f64, String> {
    let stat = fs::read_to_string("/proc/self/stat").map_err(|error| error.to_string())?;
    seconds(&stat).ok_or_else(|| "`/proc/self/stat` has an unknown form".into())
}

/// Reads `cutime` and `cstime`, fields 16 and 17 of `/proc/self/stat` (proc(5)), in hundredths
/// of a second. The second field is a name in parentheses, which may have blanks.
fn seconds(stat: &str) -> Option<f64> {
    let (_, after_name) = stat.rsplit_once(") ")?;
    let mut fields = after_name.split(' ').skip(16 - 3);
    let mut next = || fields.next()?.parse::<f64>().ok();
    Some((next()? + next()?) / 100.0)
}

#[cfg(test)]
mod tests {
    use super::seconds;

    #[test]
    fn the_times_of_children_are_read_behind_a_name_with_blanks() {
        let stat = "7 (a) b) S 1 2 3 4 5 6 7 8 9 10 11 12 250 150 20 0 1";
        assert_eq!(seconds(stat), Some(4.0));
        assert_eq!(seconds("7 (a"), None);
    }
}
