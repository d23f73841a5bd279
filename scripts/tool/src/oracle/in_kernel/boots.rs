//! Booting the app `replay` with cases, as few times as will do.

use std::fs;
use std::path::Path;

use replay::{Case, Epoch, build};
use sched_dag::law::Record;

use super::{Judged, Settings};
use crate::oracle::equal;
use crate::oracle::schedules::{Deviation, compare};
use crate::outcome::{Outcome, boot};
use crate::progress::Progress;
use crate::protocol::MachineLine;
use crate::qemu::Qemu;
use crate::record::Run;
use crate::trace;
use crate::{files, image, install, probe, system};

/// The most cases of one boot: the guest has them all in memory.
const MOST_CASES: usize = 64;

/// The guest's memory.
const MEMORY_MIB: u64 = 64;

/// Runs cases in the kernel, in boots of one number of cores each, and compares.
/// `texts` are the cases' records, one text a case.
///
/// # Errors
///
/// In words: there is no QEMU, no image, or a file cannot be written.
pub fn run(cases: &[Case], texts: &[String], settings: &Settings) -> Result<Vec<Judged>, String> {
    install::ensure_qemu()?;
    let image = image::build("replay")?;
    let machine = Qemu {
        machine: settings.machine,
        cores: cases
            .iter()
            .map(|case| case.cores.into())
            .max()
            .unwrap_or(1),
        ..Qemu::default()
    };
    probe::choose(Some(settings.mode), settings.mode, &machine, &image.path)?;
    let mut by_cores: Vec<(&Case, &str)> =
        cases.iter().zip(texts.iter().map(String::as_str)).collect();
    by_cores.sort_by_key(|(case, _)| case.cores);
    let mut judged = Vec::with_capacity(cases.len());
    let mut progress = Progress::new(cases.len() as u64, "cases");
    for group in by_cores.chunk_by(|(a, _), (b, _)| a.cores == b.cores) {
        let mut waiting = group;
        while let Some((first, _)) = waiting.first() {
            // What the guest cannot run would end the whole boot.
            if let Err(reason) = runs_there(first, settings) {
                judged.push(verdict(first, Err(reason)));
                waiting = &waiting[1..];
                continue;
            }
            let fits = |(case, _): &&(&Case, &str)| runs_there(case, settings).is_ok();
            let count = waiting.iter().take(MOST_CASES).take_while(fits).count();
            let outcome = boot_with(&image.path, &waiting[..count], settings)?;
            let before = judged.len();
            judged.extend(judge(&outcome, &waiting[..count], settings));
            waiting = &waiting[judged.len() - before..];
            progress.show(judged.len() as u64);
        }
    }
    progress.end();
    Ok(judged)
}

/// Returns why a case is not for the guest: its times are none in nanoseconds.
fn runs_there(case: &Case, settings: &Settings) -> Result<(), String> {
    build(case, settings.scale(), &Epoch::default(), None).map(drop)
}

fn verdict(case: &Case, outcome: Result<Deviation, String>) -> Judged {
    Judged {
        name: case.name.clone(),
        cores: case.cores,
        outcome,
    }
}

fn boot_with(
    image: &Path,
    cases: &[(&Case, &str)],
    settings: &Settings,
) -> Result<Outcome, String> {
    let log = system::new_log("replay")?;
    let module = log.with_extension("cases");
    let text: String = cases.iter().map(|(_, text)| *text).collect();
    files::write(&module, text)?;
    let Settings {
        mode,
        machine,
        unit_us,
        guard_us,
        window_us,
        computes,
        ..
    } = *settings;
    let work = if computes { "compute" } else { "simulate" };
    let qemu = Qemu {
        mode,
        machine,
        cores: cases.first().map_or(1, |(case, _)| case.cores.into()),
        memory_mib: MEMORY_MIB,
        guest_words: format!(
            "mode={mode} unit_us={unit_us} guard_us={guard_us} window_us={window_us} \
             work={work} events=on"
        ),
        module: Some(module.clone()),
        ..Qemu::default()
    };
    let only_cases: Vec<&Case> = cases.iter().map(|(case, _)| *case).collect();
    let outcome = boot(&qemu, image, &log, settings.limit(&only_cases), |_| {});
    // It is ours, and in the way of no one if it cannot be removed.
    let _ = fs::remove_file(&module);
    outcome
}

/// Judges the cases that ran and, if the guest did not get through, the one that
/// ended it; what comes after that has not been run.
pub(super) fn judge(
    outcome: &Outcome,
    cases: &[(&Case, &str)],
    settings: &Settings,
) -> Vec<Judged> {
    let mut judged = Vec::with_capacity(cases.len());
    let ending = outcome.judge().err();
    let (runs, damaged) = match trace::read(&outcome.serial) {
        Ok(runs) => (runs, None),
        Err(damaged) => (Vec::new(), Some(damaged.to_string())),
    };
    let mut ran = outcome.transcript.of_kind("replay").zip(&runs);
    for (case, _) in cases {
        let Some((line, run)) = ran.next() else {
            let why = ending.map(|fault| fault.reason).or(damaged);
            let why = why.unwrap_or_else(|| "it printed nothing about it".into());
            let log = outcome.log.display();
            let why = format!("did not run: {why}; the serial log is {log}");
            judged.push(verdict(case, Err(why)));
            return judged;
        };
        judged.push(verdict(case, compare_run(case, line, run, settings)));
    }
    match (ending, judged.last_mut()) {
        (Some(fault), Some(last)) if last.outcome.is_ok() => last.outcome = Err(fault.reason),
        (None, _) => {
            let _ = fs::remove_file(&outcome.log);
        }
        _ => {}
    }
    judged
}

/// Compares a case with its trace, and with what the guest itself says of the run.
fn compare_run(
    case: &Case,
    line: &MachineLine,
    run: &Run,
    settings: &Settings,
) -> Result<Deviation, String> {
    if line.text_at("case") != Some(case.name.as_str()) || run.lost > 0 {
        return Err(format!(
            "its trace is not whole, before line {}",
            line.number
        ));
    }
    let events = run.events.iter().copied();
    let record = Record::of_events(&run.task_set, true, events).ok_or("too many jobs")?;
    let (unit_ns, tolerance_ns) = (settings.scale().unit_ns, settings.tolerance_ns());
    let deviation = compare(case, &run.task_set, &record, unit_ns, tolerance_ns)?;
    for what in ["violations", "allocations"] {
        equal(
            "the guest itself",
            what,
            0,
            line.number_at(what).unwrap_or(u64::MAX),
        )?;
    }
    Ok(deviation)
}
