//! The paper's evaluation: join latency by a DAG, by equal and by close stamps.
//!
//! A *condition* is what joins, the number N of parallel subtasks, and a seed. Each
//! is one boot of the app `join-latency`, which prints the times of all executions
//! and joins. They are kept as one file a condition, from which all else is
//! computed: samples, summary, pictures, table. So nothing is lost if this is
//! interrupted, and what is there already is not measured again, as long as it was
//! measured under the same conditions (image, QEMU, all options).
//!
//! - `plan`, `condition`: what is to be measured;
//! - `times`, `figures`: from the guest's lines to figures;
//! - `results`: from figures to what people and programs read.

mod condition;
mod figures;
mod plan;
mod results;
mod times;

use std::ffi::OsString;
use std::fs;
use std::path::Path;
use std::process::ExitCode;
use std::time::Duration;

use condition::Condition;
use figures::Figures;
use plan::{Plan, Provenance};

use super::frame::{by_plan, draw, judged};
use crate::outcome::boot;
use crate::program::Order;
use crate::progress::Progress;
use crate::qemu::Mode;
use crate::{files, image, install, probe, program};

/// How often a condition is booted at most in deterministic mode.
const MOST_BOOTS: usize = 6;

/// Runs `bench join-latency` with the words after its name.
pub(super) fn run(words: &[OsString]) -> ExitCode {
    by_plan(&plan::TABLE, words, Plan::new, |plan| {
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
        provenance.version
    );
    println!("time: {}", plan.meaning());
    if let Some(why) = why {
        println!("mode {mode} because {why}");
    }
    let folder = plan.out.join("conditions");
    let made = fs::create_dir_all(&folder);
    made.map_err(|error| format!("cannot make `{}`: {error}", folder.display()))?;
    let mut progress = Progress::new(plan.conditions.len() as u64, "conditions");
    let mut measured = Vec::new();
    for (condition, over) in plan.conditions.iter().zip(0..) {
        progress.show(over);
        let statement = provenance.statement(plan, condition);
        let file = folder.join(format!("{}.csv", condition.file_stem()));
        let read = |text: &str| times::read(text, &statement, condition.subtasks);
        let kept = fs::read_to_string(&file).ok();
        let samples = match kept.and_then(|text| read(&text)) {
            Some(samples) => samples,
            None => {
                let text = measure(plan, condition, &image.path, &statement)?;
                write_whole(&file, &text)?;
                read(&text).ok_or_else(|| format!("{condition}: its times are damaged"))?
            }
        };
        measured.push((*condition, Figures::of(&samples)));
        // After each: an interruption leaves numbers for what was measured.
        let summary = results::summary_json(plan, &provenance, &measured);
        write_whole(&plan.out.join("summary.json"), &summary)?;
        write_whole(
            &plan.out.join("samples.csv"),
            &results::samples_csv(&measured),
        )?;
    }
    progress.end();
    if let Err(line) = draw("join_latency.py", &plan.out) {
        eprintln!("{line}");
    }
    print!("{}", results::table(&measured));
    println!("written: {}", plan.out.display());
    Ok(())
}

/// Writes a file whole or not at all: an interruption leaves the old one.
fn write_whole(path: &Path, text: &str) -> Result<(), String> {
    let unfinished = path.with_extension("unfinished");
    files::write(&unfinished, text)?;
    let renamed = fs::rename(&unfinished, path);
    renamed.map_err(|error| format!("cannot write `{}`: {error}", path.display()))
}

/// Measures one condition, and returns its times: in deterministic mode until two boots agree, or
/// [`MOST_BOOTS`] have been tried; then it says so and returns those of the first.
///
/// Two boots agree as the kernel removes from counted time what depends on the host
/// (its `machine::counted_time`). That rests on how QEMU 7.2 works, so it is checked
/// wherever figures are made.
fn measure(
    plan: &Plan,
    condition: &Condition,
    image: &Path,
    statement: &str,
) -> Result<String, String> {
    let is_sure = plan.once || plan.on_linux || plan.mode != Mode::Deterministic;
    let mut seen = Vec::new();
    while seen.len() < MOST_BOOTS {
        let times = boot_once(plan, condition, image, statement)?;
        if is_sure || seen.contains(&times) {
            if seen.len() > 1 {
                eprintln!("{condition}: {} boots until two agreed", seen.len() + 1);
            }
            return Ok(times);
        }
        seen.push(times);
    }
    eprintln!(
        "{condition}: no two of {MOST_BOOTS} boots agree to the last nanosecond; the first is kept"
    );
    Ok(seen.swap_remove(0))
}

/// Boots one condition, and returns its times.
fn boot_once(
    plan: &Plan,
    condition: &Condition,
    image: &Path,
    statement: &str,
) -> Result<String, String> {
    let limit = Duration::from_secs(120 + plan.jobs);
    judged(
        condition,
        "join-latency",
        |log| {
            if !plan.on_linux {
                return boot(&plan.qemu(condition), image, log, limit, |_| {});
            }
            let words = plan.linux_words(condition);
            let words: Vec<OsString> = words.split(' ').map(OsString::from).collect();
            let order = Order {
                program: image,
                words: &words,
                is_live: false,
                stops: false,
                log,
                limit,
            };
            program::run(&order, &mut |_| {})
        },
        |outcome| {
            let transcript = &outcome.transcript;
            times::write(transcript, statement, condition.subtasks, plan.jobs)
        },
    )
}
