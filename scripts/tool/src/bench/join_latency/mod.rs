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
//! - `setting`: by what;
//! - `times`, `figures`: from the guest's lines to figures;
//! - `results`: from figures to what people and programs read.

mod condition;
mod figures;
mod plan;
mod results;
mod setting;
mod times;

use std::ffi::OsString;
use std::fs;
use std::path::Path;
use std::process::ExitCode;

use figures::Figures;
use plan::Plan;
use setting::Setting;

use super::frame::{by_plan, draw};
use crate::files;
use crate::progress::Progress;

/// Runs `bench join-latency` with the words after its name.
pub(super) fn run(words: &[OsString]) -> ExitCode {
    by_plan(&plan::TABLE, words, Plan::new, |plan| {
        measure_all(plan).map(|()| true)
    })
}

/// Measures what is not there yet, and writes all results.
fn measure_all(plan: &Plan) -> Result<(), String> {
    let (setting, why) = Setting::new(plan)?;
    let (conditions, jobs, cores) = (plan.conditions.len(), plan.jobs, plan.cores);
    let (mode, version) = (setting.mode_name(), &setting.version);
    println!("{conditions} conditions of {jobs} jobs; mode {mode}, {cores} cores; {version}");
    println!("time: {}", setting.meaning());
    if let Some(why) = why {
        println!("{why}");
    }
    let folder = plan.out.join("conditions");
    let made = fs::create_dir_all(&folder);
    made.map_err(|error| format!("cannot make `{}`: {error}", folder.display()))?;
    let mut progress = Progress::new(conditions as u64, "conditions");
    let mut measured = Vec::new();
    for (condition, over) in plan.conditions.iter().zip(0..) {
        progress.show(over);
        let statement = setting.statement(condition);
        let file = folder.join(format!("{}.csv", condition.file_stem()));
        let read = |text: String| times::read(&text, &statement, condition.subtasks);
        let samples = match fs::read_to_string(&file).ok().and_then(read) {
            Some(samples) => samples,
            None => {
                let text = setting.measure(condition)?;
                write_whole(&file, &text)?;
                read(text).ok_or_else(|| format!("{condition}: its times are damaged"))?
            }
        };
        measured.push((*condition, Figures::of(&samples)));
        // After each: an interruption leaves numbers for what was measured.
        let summary = results::summary_json(&setting, &measured);
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
