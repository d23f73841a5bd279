//! The paper's evaluation: join latency by a DAG, by equal and by close stamps.
//!
//! A *condition* is what joins, the number N of parallel subtasks, and a seed. Each
//! is one boot of the app `join-latency`, which prints the times of all executions
//! and joins. They are kept as one file a condition, from which all else is
//! computed: samples, summary, pictures, table. So nothing is lost if this is
//! interrupted, and what is there already is not measured again, as long as it was
//! measured under the same conditions (image, QEMU, all options).
//!
//! - `table`, `plan`, `condition`: what is to be measured;
//! - `times`, `figures`: from the guest's lines to figures;
//! - `files`, `plots`, `report`: from figures to what people and programs read;
//! - `progress`: what is seen meanwhile.

mod condition;
mod figures;
mod files;
mod plan;
mod plots;
mod progress;
mod report;
mod table;
mod times;

use std::ffi::OsString;
use std::fs;
use std::path::Path;
use std::process::ExitCode;
use std::time::Duration;

use condition::Condition;
use figures::Figures;
use files::{Measured, samples_csv, summary_json, write_whole};
use join_latency::Samples;
use plan::{Plan, Provenance};
use progress::Progress;

use super::by_plan;
use crate::outcome::boot;
use crate::qemu::Mode;
use crate::{image, install, probe, program, system};

/// Runs `bench join-latency` with the words after its name.
pub(super) fn run(words: &[OsString]) -> ExitCode {
    by_plan(&table::TABLE, words, Plan::new, |plan| {
        measure_all(plan).map(|()| true)
    })
}

/// Measures what is not there yet, and writes all results.
fn measure_all(plan: &Plan) -> Result<(), String> {
    let (image, mode, why) = match plan.on_linux {
        true => (image::build_linux("join-latency", None)?, plan.mode, None),
        false => {
            install::ensure_qemu()?;
            let image = image::build("join-latency")?;
            let machine = plan.qemu(&plan.conditions[0]);
            let otherwise = Mode::Deterministic;
            let (mode, why) = probe::choose(plan.named, otherwise, &machine, &image.path)?;
            (image, mode, why)
        }
    };
    let plan = &Plan {
        mode,
        ..plan.clone()
    };
    let provenance = Provenance::of(&image.path, plan.on_linux);
    println!(
        "{} conditions of {} jobs; mode {}, {} cores; {}",
        plan.conditions.len(),
        plan.jobs,
        plan.mode_name(),
        plan.cores,
        provenance.qemu
    );
    println!("time: {}", plan.meaning());
    if let Some(why) = why {
        println!("mode {mode} because {why}");
    }
    let mut progress = Progress::new(plan.conditions.len());
    let mut measured = Measured::new();
    for condition in &plan.conditions {
        let statement = provenance.statement(plan, condition);
        let file = plan.file(condition);
        let kept = fs::read_to_string(&file).ok();
        let kept = kept.and_then(|text| times::from_csv(&text, &statement, condition.subtasks));
        let samples = match kept {
            Some(samples) => {
                progress.skip(condition.to_string());
                samples
            }
            None => {
                progress.begin(condition.to_string());
                let samples = measure(plan, condition, &image.path, &mut progress)?;
                write_whole(&file, &times::to_csv(&samples, &statement))?;
                progress.end();
                samples
            }
        };
        measured.push((*condition, Figures::of(&samples)));
        // After each: an interruption leaves numbers for what was measured.
        let summary = summary_json(plan, &provenance, &measured);
        write_whole(&plan.out.join("summary.json"), &summary)?;
        write_whole(&plan.out.join("samples.csv"), &samples_csv(&measured))?;
    }
    if let Err(line) = plots::draw(&plan.out) {
        eprintln!("{line}");
    }
    print!("{}", report::table(&files::pooled(plan, &measured)));
    println!("written: {}", plan.out.display());
    Ok(())
}

/// How often a condition is booted at most in deterministic mode.
const MOST_BOOTS: usize = 6;

/// Measures one condition: in deterministic mode until two boots agree, or
/// [`MOST_BOOTS`] have been tried; then it says so and keeps the first.
///
/// Two boots agree as the kernel removes from counted time what depends on the host
/// (its `machine::counted_time`). That rests on how QEMU 7.2 works, so it is checked
/// wherever figures are made.
fn measure(
    plan: &Plan,
    condition: &Condition,
    image: &Path,
    progress: &mut Progress,
) -> Result<Samples, String> {
    let mut seen = Vec::new();
    while seen.len() < MOST_BOOTS {
        let samples = boot_once(plan, condition, image, progress)?;
        let is_sure =
            plan.mode_name() != Mode::Deterministic.name() || plan.once || seen.contains(&samples);
        if is_sure {
            if seen.len() > 1 {
                progress.note(&format!("{} boots until two agreed", seen.len() + 1));
            }
            return Ok(samples);
        }
        seen.push(samples);
    }
    progress.note(&format!(
        "no two of {MOST_BOOTS} boots agree to the last nanosecond; the first is kept"
    ));
    Ok(seen.swap_remove(0))
}

/// Boots one condition.
fn boot_once(
    plan: &Plan,
    condition: &Condition,
    image: &Path,
    progress: &mut Progress,
) -> Result<Samples, String> {
    let log = system::new_log("join-latency")?;
    let limit = Duration::from_secs(120 + plan.jobs);
    let mut follow = |line: &str| progress.follow(line);
    let outcome = match plan.on_linux {
        true => {
            let words = plan.linux_words(condition);
            let words: Vec<OsString> = words.split(' ').map(OsString::from).collect();
            let order = program::Order {
                program: image,
                words: &words,
                is_live: false,
                stops: false,
                log: &log,
                limit,
            };
            program::run(&order, &mut follow)?
        }
        false => boot(&plan.qemu(condition), image, &log, limit, follow)?,
    };
    if let Err(fault) = outcome.judge() {
        return Err(format!(
            "{condition} failed: {}\n{}",
            fault.reason,
            outcome.tail()
        ));
    }
    let samples = times::read_transcript(&outcome.transcript, condition.subtasks)?;
    if samples.source.len() as u64 != plan.jobs {
        let jobs = samples.source.len();
        return Err(format!(
            "{condition}: the guest printed {jobs} of {} jobs",
            plan.jobs
        ));
    }
    // It is ours, and in the way of no one if it cannot be removed.
    let _ = fs::remove_file(&log);
    Ok(samples)
}
