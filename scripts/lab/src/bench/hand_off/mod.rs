//! The way from a completion to its successor's first instruction, measured.
//!
//! The app `hand-off` runs DAGs of empty bodies that take time stamps, and prints the differences.
//! In deterministic mode a nanosecond is an instruction. So every run gives the same figures,
//! comparable with those in the repository: `tests/baselines/hand-off.json`.
//!
//! - `boots`: the app and the number of cores of each boot, and the cost of cores and subtasks;
//! - `listing`: one hop, instruction by instruction.

mod boots;
mod listing;

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use super::baseline::{self, Baseline};
use super::frame::{Figure, by_plan};
use tool::files;
use tool::options::{Command, CommandLine, OptionName, ValueKind, options};
use tool::progress::Progress;
use tool::qemu::Mode;
use tool::{image, install, probe};

static TABLE: Command = Command {
    invocation: "./scripts/bench hand-off",
    about: "Measures on the machine the way from a completion to its successor's first instruction.",
    positional: None,
    options: OPTIONS,
    notes: "What each row means stands in docs/performance.md.

Exit code: 0 measured, and nothing grew; 1 something grew, or did not run;
2 the command line is refused.
",
};

options! {
    /// The unit of what is counted: instructions (deterministic), time (kvm, threads), or both.
    MODE: ValueKind::OneOf(&["both", "deterministic", "threads", "kvm"]), or "both";
    /// Compare the instructions with the baseline; one that grew is a failure.
    COMPARE: ValueKind::Nothing;
    /// Write the instructions into the baseline, tests/baselines/hand-off.json.
    SAVE_BASELINE: ValueKind::Nothing;
    /// Instead, count what the workloads cost on more cores and with more subtasks.
    SCALE: ValueKind::Nothing;
    /// Instead, log each instruction of one hop, count them by parts of the code, and write
    /// them to FILE. Needs objdump and addr2line (binutils).
    LISTING: ValueKind::File("FILE");
}

const BASELINE: Baseline = Baseline {
    file: "tests/baselines/hand-off.json",
    saved_by: "./scripts/bench hand-off --save-baseline",
};

/// The measurement to make.
#[derive(Debug)]
struct HandOffPlan {
    /// The only mode to measure in; `None`: instructions and time.
    mode: Option<Mode>,
    /// The figures of the baseline, if they are to be compared.
    before: Option<Vec<Figure>>,
    saves: bool,
    /// Whether the cost of cores and subtasks is counted instead.
    scale: bool,
    /// The file for the instructions of one hop, if a listing is wanted instead.
    listing: Option<PathBuf>,
}

impl HandOffPlan {
    /// Makes the plan from the options.
    ///
    /// # Errors
    ///
    /// The options exclude each other: one line with the reason.
    fn new(options: &CommandLine) -> Result<Self, String> {
        let all = [
            name::LISTING,
            name::SCALE,
            name::COMPARE,
            name::SAVE_BASELINE,
            name::MODE,
        ];
        let given = all.into_iter().filter(|name| options.is_given(*name));
        let given: Vec<&str> = given.map(OptionName::as_str).collect();
        let mode = options.text(name::MODE).and_then(Mode::from_name);
        match given[..] {
            [own @ ("listing" | "scale"), other, ..] => Err(format!(
                "`--{own}` with `--{other}`: it is a run of its own; leave `--{other}` out"
            )),
            [name @ ("compare" | "save-baseline"), ..]
                if mode.is_some_and(|mode| mode != Mode::Deterministic) =>
            {
                Err(format!(
                    "`--{name}` needs the instructions, which this mode does not count; \
                     leave `--mode` out"
                ))
            }
            _ => files::check(&[], &options.named(&[name::LISTING])),
        }?;
        let before = options.is_given(name::COMPARE).then(|| BASELINE.read());
        Ok(Self {
            mode,
            before: before.transpose()?,
            saves: options.is_given(name::SAVE_BASELINE),
            scale: options.is_given(name::SCALE),
            listing: options.path(name::LISTING).map(PathBuf::from),
        })
    }
}

/// Runs `bench hand-off` with the words after its name.
pub(super) fn run(words: &[OsString]) -> ExitCode {
    by_plan(&TABLE, words, HandOffPlan::new, measure)
}

/// Measures as `--compare` does, and [checks](Baseline::check) the figures.
///
/// # Errors
///
/// In words: a guest failed, or the check.
pub(crate) fn check(list: Option<&Path>) -> Result<(), String> {
    install::ensure_qemu()?;
    let image = image::build("hand-off")?;
    let now = measure_mode(Mode::Deterministic, &image)?;
    BASELINE.check(&now, list)
}

/// Measures and reports. Returns whether no figure has grown.
fn measure(plan: &HandOffPlan) -> Result<bool, String> {
    install::ensure_qemu()?;
    let image = &image::build("hand-off")?;
    if plan.scale {
        return boots::measure_scale(image).map(|()| true);
    }
    if let Some(file) = &plan.listing {
        return listing::list(image, file).map(|()| true);
    }
    let mut measured = Vec::new();
    for mode in modes(plan.mode, image)? {
        let figures = measure_mode(mode, image)?;
        for figure in &figures {
            println!("{}", boots::machine_line(figure, mode));
        }
        measured.push((mode, figures));
    }
    print!("{}", baseline::table(&measured));
    // Instructions come first, if they were counted at all.
    let (_, first) = &measured[0];
    BASELINE.judge(first, plan.before.as_deref(), plan.saves)
}

/// Chooses the modes: if none is named, counted instructions, and KVM or else threads for time.
fn modes(named: Option<Mode>, image: &Path) -> Result<Vec<Mode>, String> {
    let timed = boots::of_mode(Mode::Kvm).into_iter();
    // The largest machine: KVM must work for all boots.
    let machine = timed.max_by_key(|boot| boot.cores);
    let machine = machine.map_or_else(Default::default, |boot| boot.qemu(Mode::Kvm));
    let (mode, why) = probe::choose(named, Mode::Threads, &machine, image)?;
    let Some(why) = why else {
        return Ok(vec![mode]);
    };
    println!("mode {mode} besides deterministic because {why}");
    Ok(vec![Mode::Deterministic, mode])
}

/// Makes all boots in one mode.
fn measure_mode(mode: Mode, image: &Path) -> Result<Vec<Figure>, String> {
    let mut figures: Vec<Figure> = Vec::new();
    let boots = boots::of_mode(mode);
    let mut progress = Progress::new(boots.len() as u64, "boots");
    for (boot, over) in boots.into_iter().zip(0..) {
        progress.show(over);
        for figure in boot.measure(mode, image)? {
            // A figure counted in a later boot goes next to its workload.
            let end = figures.iter().rposition(|other| {
                (other.cores, &other.workload) == (figure.cores, &figure.workload)
            });
            figures.insert(end.map_or(figures.len(), |end| end + 1), figure);
        }
    }
    progress.wipe();
    Ok(figures)
}

#[cfg(test)]
mod tests {
    use super::{HandOffPlan, TABLE};
    use crate::tests::{right, rows};

    /// Command lines, and their refusals. More are in `tests/it/files.rs`.
    const REFUSED: &str = "--compare --mode threads | leave `--mode` out
--save-baseline --mode threads | `--save-baseline`
--scale --compare | leave `--compare` out
--listing x --compare | leave `--compare` out
--listing x --scale | a run of its own
--listing /none/x | cannot be written";

    #[test]
    fn what_cannot_be_is_refused() {
        for [line, words] in rows(REFUSED) {
            let refused = HandOffPlan::new(&right(&TABLE, &line)).expect_err(&line);
            assert!(refused.contains(&words), "{refused}");
        }
        for line in ["--scale", "--listing /dev/null", "--compare --mode both"] {
            assert!(HandOffPlan::new(&right(&TABLE, line)).is_ok(), "{line}");
        }
    }
}
