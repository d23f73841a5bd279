//! Sets of DAGs accepted by methods of analysis.
//!
//! Gives the share of random sets by utilization, or the share of sets from files, for the division
//! into lent cores and for other methods (`acceptance`). No time is measured, so the table is the
//! same on every host.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use super::acceptance::{self, Generator, SetFile};
use super::frame::by_plan;
use tool::files;
use tool::options::{Command, CommandLine, ValueKind, options};
use tool::progress::ProgressNote;

static COMMAND: Command = Command {
    invocation: "./scripts/bench bounds",
    about: "Draws by utilization how many random sets of DAGs are accepted by lent cores and by \
            other methods.",
    positional: Some((
        ValueKind::File("FILE..."),
        "Count only the sets of these files, as in tests/oracle/lent.txt, with or without answers.",
    )),
    options: OPTIONS,
    notes: "\
A set has as many DAGs as cores, but 8 at least; by `melani` 8, by `small` 4. Methods: graham,
federated scheduling; multi_path, the same by the multi-path bound, or global deadline-monotonic
priorities; v_fed, virtually-federated scheduling, v_fed_p, the same with a parallelism stated of
each DAG; lent, heavy DAGs with tables that lend their idle time; table, that and one table for
several DAGs; fluid, a density test of a scheduler that no machine has; unrefuted (`--ceiling`), no
DAG is late in one run under global EDF.

Exit code: 0 counted; 1 no file can be written; 2 the command line or a file is refused.
",
};

options! {
    /// The numbers of cores.
    CORES: ValueKind::Numbers(1, 64), or "4,8,16";
    /// The kind of random sets: ours, ours with periods on a grid, Melani's graphs, or small ones
    /// of these.
    FROM: ValueKind::OneOf(Generator::WORDS), or "ours";
    /// Random sets for each number of cores, utilization and kind of deadlines.
    SETS: ValueKind::Number(1, 1_000_000), or "200";
    /// Runs each set in virtual time, too: a column of those without a late DAG. Takes minutes.
    CEILING: ValueKind::Nothing;
    /// The seed of all random sets.
    SEED: ValueKind::Number(0, u64::MAX), or "1";
    /// The folder for acceptance.csv and acceptance.svg.
    OUT 'o': ValueKind::File("DIR"), or "target/bounds";
}

/// The plan of a measurement.
struct BoundsPlan {
    files: Vec<SetFile>,
    generator: Generator,
    cores: Vec<u32>,
    sets: u64,
    has_ceiling: bool,
    seed: u64,
    out: PathBuf,
}

impl BoundsPlan {
    fn new(options: &CommandLine) -> Result<Self, String> {
        options.check_distinct(&[name::CORES])?;
        if options.files().len() > 0 {
            let why = "is for random sets; leave it or the files out";
            options.check_without(
                &[name::FROM, name::CORES, name::SETS, name::SEED, name::OUT],
                why,
            )?;
        }
        files::check_once(options.files())?;
        (options.named(&[name::OUT]).iter()).try_for_each(files::check_folder)?;
        Ok(Self {
            files: (options.files().map(SetFile::read)).collect::<Result<_, _>>()?,
            generator: Generator::of_word(options.text(name::FROM).unwrap_or_default()),
            cores: options.numbers(name::CORES),
            sets: options.number(name::SETS).unwrap_or_default(),
            has_ceiling: options.is_given(name::CEILING),
            seed: options.number(name::SEED).unwrap_or_default(),
            out: options.path(name::OUT).unwrap_or(Path::new("")).into(),
        })
    }
}

/// Runs `bench bounds` with the words after its name.
pub(super) fn run(words: &[OsString]) -> ExitCode {
    by_plan(&COMMAND, words, BoundsPlan::new, measure)
}

/// Counts and prints. Always returns true, as no share has a limit.
fn measure(plan: &BoundsPlan) -> Result<bool, String> {
    let BoundsPlan { files, out, .. } = plan;
    let has_ceiling = plan.has_ceiling;
    if files.is_empty() {
        let kind = (plan.generator, &plan.cores[..]);
        let table = acceptance::measure(kind, has_ceiling, plan.sets, plan.seed, out)?;
        print!("{table}");
        println!("written: {}", out.display());
    } else {
        let _lasting = ProgressNote::new("counting sets");
        print!("{}", acceptance::of_files(files, has_ceiling));
    }
    Ok(true)
}
