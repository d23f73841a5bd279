//! Makes certificates for the sets of a DAG file, by exploring their states on this computer before
//! the run.
//!
//! A set gets a certificate where no other test proves the set. The certificate follows the set's
//! records and travels with the file. The commit checks the certificate again.

use fass_dag_file::{Length, Set, verified};
use sched_dag::analysis::{AnalysisSettings, Overheads, answer, certify};
use sched_dag::{CommitOptions, Policy, Preemption, SchedulerOptions};

use super::name;
use crate::options::CommandLine;

/// Gives a set a certificate for a run with these words, if the set needs one and can have one.
/// Replaces a certificate of other words or another set. Returns the number of states.
pub(super) fn give(
    set: &mut Set,
    words: &[String],
    options: &CommandLine,
    length: Length,
) -> Option<usize> {
    let cores = u32::try_from(options.number(name::CORES).unwrap_or(1)).ok()?;
    let word = |name: &str| {
        let mut values = words.iter().rev().filter_map(|word| word.split_once('='));
        values.find(|(of, _)| *of == name).map(|(_, value)| value)
    };
    // At a console, persons may pause DAGs; measured times are not known yet; the last two words
    // let cores idle.
    let apart = [
        "console",
        "clusters",
        "overheads",
        "wcets",
        "window_us",
        "grid_us",
    ];
    let has_other_cores = word("cores").is_some_and(|of| of.parse() != Ok(cores));
    let is_apart = has_other_cores || apart.iter().any(|name| word(name).is_some());
    if is_apart {
        return None;
    }
    let mut terms_ns = Overheads::NONE.terms_ns();
    let stated = word("overheads_ns").unwrap_or_default().split(',');
    for (term_ns, stated) in terms_ns.iter_mut().zip(stated) {
        *term_ns = stated.parse().unwrap_or(0);
    }
    let scheduler = SchedulerOptions {
        policy: word("policy").map_or(Some(Policy::StaticPriority), Policy::of_word)?,
        preemption: match word("preemption") {
            Some("off") => Preemption::Disabled,
            _ => Preemption::Enabled,
        },
        cores,
    };
    let keeps = scheduler.preemption == Preemption::Disabled;
    let mut subtasks = set.dags.iter().flat_map(|dag| &dag.spec.subtasks);
    if !subtasks.all(|of| keeps || of.non_preemptive) {
        return None;
    }
    let settings = AnalysisSettings::new(scheduler, Overheads::of_terms_ns(terms_ns));
    let options = CommitOptions::new(scheduler.policy, cores);
    let mut task_set = verified(set, &options, length).ok()?.task_set;
    task_set.fix(&set.certificate);
    if answer(&task_set, &settings).is_proven() {
        return None;
    }
    set.certificate = certify(&task_set, &settings).ok()?;
    Some(set.certificate.lines().count() - 1)
}
