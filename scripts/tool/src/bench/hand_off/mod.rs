//! The way from a completion to its successor's first instruction, measured.
//!
//! The app `hand-off` runs DAGs of empty bodies that stamp, and prints what lies
//! between the stamps. In deterministic mode a nanosecond is an instruction, so
//! the same figures come out of every run, and can be held against those that
//! the repository keeps: `tests/baselines/hand-off.json`.
//!
//! - `table`, `plan`: what is to be measured;
//! - `figure`, `baseline`: what was, and what it was before;
//! - `traced`: what only the trace can tell;
//! - `report`, `scale`: the tables;
//! - `listing`: one hop, instruction by instruction.

mod baseline;
mod figure;
mod listing;
mod plan;
mod report;
mod scale;
mod table;
mod traced;

use std::ffi::OsString;
use std::fs;
use std::path::Path;
use std::process::ExitCode;
use std::time::Duration;

use figure::Figure;
use plan::{Boot, Kind, Plan};

use super::by_plan;
use crate::golden::Golden;
use crate::outcome::boot;
use crate::progress::Progress;
use crate::qemu::Mode;
use crate::{image, install, probe, system};

/// How long a boot may take in wall time.
const LIMIT: Duration = Duration::from_secs(300);

/// Runs `bench hand-off` with the words after its name.
pub(super) fn run(words: &[OsString]) -> ExitCode {
    by_plan(&table::TABLE, words, Plan::new, measure_all)
}

/// Measures as `--compare` does, and prints the table; rewrites the baseline if figures have
/// grown and there is a `list` of rewritten files.
///
/// # Errors
///
/// In words: a guest failed, there is no baseline, or which figures have grown.
pub(crate) fn check(list: Option<&Path>) -> Result<(), String> {
    let words = ["--compare".into(), "--mode=deterministic".into()];
    let options = table::TABLE.parse(&words);
    let plan = Plan::new(&options.map_err(|refusal| format!("{refusal:?}"))?)?;
    install::ensure_qemu()?;
    let before = plan.before.as_deref().unwrap_or_default();
    let image = image::build("hand-off")?;
    let now = measure_mode(&plan, Mode::Deterministic, &image.path)?;
    let comparison = report::comparison(&now, before);
    print!("{}", comparison.text);
    if comparison.complaints.is_empty() {
        return Ok(());
    }
    if list.is_none() {
        return Err(comparison.complaints.join("; "));
    }
    let (file, text) = (plan::BASELINE, &*baseline::text(before));
    let below = "";
    Golden { file, below, text }.compare(&baseline::text(&now), list)
}

/// Measures and reports. Returns whether nothing has grown.
fn measure_all(plan: &Plan) -> Result<bool, String> {
    install::ensure_qemu()?;
    if let Some(scale) = &plan.scale {
        return measure_scale(scale).map(|()| true);
    }
    let image = image::build("hand-off")?;
    if let Some((boot, file)) = &plan.listing {
        return listing::list(boot, &image.path, file).map(|()| true);
    }
    let mut measured = Vec::new();
    for mode in modes(plan, &image.path)? {
        let figures = measure_mode(plan, mode, &image.path)?;
        for figure in &figures {
            println!("{}", figure.machine_line(mode));
        }
        measured.push((mode, figures));
    }
    print!("{}", report::table(&measured));
    let instructions = measured
        .iter()
        .find(|(mode, _)| *mode == Mode::Deterministic);
    let Some((_, instructions)) = instructions else {
        return Ok(true);
    };
    let mut is_good = true;
    if let Some(before) = &plan.before {
        let comparison = report::comparison(instructions, before);
        print!("{}", comparison.text);
        is_good = comparison.complaints.is_empty();
    }
    if plan.saves {
        baseline::write(&plan.baseline, instructions)?;
        println!("written: {}", plan.baseline.display());
    }
    Ok(is_good)
}

/// Counts what more cores and more subtasks cost.
fn measure_scale(scale: &plan::Scale) -> Result<(), String> {
    let image = image::build("hand-off")?;
    let count = |sizes: &[u64], boot: &dyn Fn(u64) -> Boot| {
        let counted = sizes.iter().map(|&size| {
            let figures = measure(&boot(size), Mode::Deterministic, &image.path)?;
            for figure in &figures {
                println!("{}", figure.machine_line(Mode::Deterministic));
            }
            Ok((size, figures))
        });
        counted.collect::<Result<Vec<_>, String>>()
    };
    let jobs = scale.jobs;
    let by_cores = count(&scale.cores, &|cores| {
        Boot::of_scale(cores, jobs, scale::LARGEST, scale::SIZES)
    })?;
    let by_subtasks = count(&scale.subtasks, &|subtasks| {
        Boot::of_scale(1, jobs, subtasks, &scale::sizes(subtasks))
    })?;
    let by_clusters = count(&scale::CLUSTERS, &|clusters| {
        Boot::of_clusters(clusters, jobs)
    })?;
    println!("medians of the instructions that all cores together executed:");
    print!("{}", scale::by_cores(&by_cores));
    println!("layered random graphs on one core:");
    print!("{}", scale::by_subtasks(&by_subtasks));
    println!("a layered random graph in each cluster of 4 cores:");
    print!("{}", scale::by_clusters(&by_clusters)?);
    Ok(())
}

/// Settles the modes: where none is named, instructions, and time as real as can be had.
fn modes(plan: &Plan, image: &Path) -> Result<Vec<Mode>, String> {
    let timed = plan.boots.iter().filter(|boot| boot.is_for(Mode::Kvm));
    let machine = timed.max_by_key(|boot| boot.cores);
    let machine = machine.map_or_else(Default::default, |boot| boot.qemu(Mode::Kvm));
    let (mode, why) = probe::choose(plan.mode, Mode::Threads, &machine, image)?;
    if let Some(why) = why {
        println!("mode {mode} besides deterministic because {why}");
        return Ok(vec![Mode::Deterministic, mode]);
    }
    Ok(vec![mode])
}

/// Makes all boots in one mode.
fn measure_mode(plan: &Plan, mode: Mode, image: &Path) -> Result<Vec<Figure>, String> {
    let mut figures: Vec<Figure> = Vec::new();
    let boots: Vec<&Boot> = plan.boots.iter().filter(|boot| boot.is_for(mode)).collect();
    let mut progress = Progress::new(boots.len() as u64, "boots");
    for (boot, over) in boots.into_iter().zip(0..) {
        progress.show(over);
        for figure in measure(boot, mode, image)? {
            // What is counted afterwards stands with its workload.
            let end = figures.iter().rposition(|other| {
                (other.cores, &other.workload) == (figure.cores, &figure.workload)
            });
            figures.insert(end.map_or(figures.len(), |end| end + 1), figure);
        }
    }
    progress.end();
    Ok(figures)
}

/// Boots once and reads the figures.
fn measure(what: &Boot, mode: Mode, image: &Path) -> Result<Vec<Figure>, String> {
    let log = system::new_log("hand-off")?;
    let recording = log.with_extension("rec");
    let mut qemu = what.qemu(mode);
    qemu.records = (what.kind == Kind::Recorded).then(|| recording.clone());
    let image = match what.kind {
        Kind::Figures | Kind::Trace => image.to_path_buf(),
        Kind::Recorded | Kind::Divided => image::build("guest-tests")?.path,
    };
    let outcome = boot(&qemu, &image, &log, LIMIT, |_| {})?;
    if let Err(fault) = outcome.judge() {
        return Err(format!(
            "the guest on {} cores, mode {mode}, failed: {}\n{}",
            what.cores,
            fault.reason,
            outcome.tail()
        ));
    }
    let figures = match what.kind {
        Kind::Trace => traced::read_all(&outcome.serial, what.cores)?,
        _ => Figure::read_all(&outcome.transcript, what.cores)?,
    };
    if figures.is_empty() {
        return Err(format!("the guest printed no figures\n{}", outcome.tail()));
    }
    // They are ours, and in the way of no one if they cannot be removed.
    let _ = fs::remove_file(&log);
    let _ = fs::remove_file(&recording);
    Ok(figures)
}
