//! Rules R2 and R3: what an instance waits for, and what makes it ready.
//!
//! The *conditions* of an instance are the finish of each predecessor in its
//! job, the end of its subtask's instance in the job before (skipped jobs do
//! not count) and, for a source, its job's release.
//!
//! R2: it is neither ready nor started before all of them. As each instance
//! waits for the one before it, no two of one subtask overlap.
//!
//! R3: it becomes ready in the scheduler's step that one of its conditions
//! brings about. With R2 that is the last one, so all that waits for a finish
//! and for nothing else is released in one step. Which of two is the last is
//! left open, for two cores may finish and then take the scheduler's lock in the
//! other order. And it does become ready, within the bound.

use sched_dag::Instance;

use super::breach::{Breach, Rule};
use super::history::History;
use super::view::{Moment, View};

/// A condition of an instance.
struct Condition {
    /// When it held; `None`: it is not known to have held.
    held: Option<Moment>,
    /// Whether it may have held without leaving an event.
    may_be_lost: bool,
    what: What,
}

/// Which condition.
#[derive(PartialEq, Eq)]
enum What {
    Predecessor(Instance),
    JobBefore(Instance),
    Release,
}

/// Judges all instances by R2 and R3, and returns the longest time from a
/// finish that was the last condition to the readiness.
pub(super) fn judge(view: &View<'_>, bound_ns: u64, breaches: &mut Vec<Breach>) -> Option<u64> {
    let mut longest_ns = None;
    for &(dag, job) in view.jobs.keys() {
        let subtasks = view.run.dags[dag.index()].subtasks.len();
        for subtask in (0..).take(subtasks).map(sched_dag::SubtaskId) {
            let instance = Instance { dag, job, subtask };
            breaches.extend(forgotten(view, instance, bound_ns));
        }
    }
    for (&instance, history) in &view.histories {
        let conditions = conditions(view, instance);
        let early = conditions
            .iter()
            .find_map(|condition| early(view, instance, history, condition));
        if let Some(breach) = early {
            breaches.push(breach);
            continue;
        }
        let Some(held) = all_held(&conditions) else {
            continue;
        };
        let Some(ready) = history.ready else {
            continue;
        };
        breaches.extend(out_of_step(view, instance, bound_ns, ready, &held));
        let last = conditions.iter().max_by_key(|condition| {
            let held = condition.held.map(|moment| moment.time_ns);
            (held, condition.what != What::Release)
        });
        if let Some(last) = last.filter(|last| last.what != What::Release)
            && let Some(held) = last.held
        {
            let latency_ns = ready.time_ns.saturating_sub(held.time_ns);
            longest_ns = longest_ns.max(Some(latency_ns));
        }
    }
    longest_ns
}

fn conditions(view: &View<'_>, instance: Instance) -> Vec<Condition> {
    let Instance { dag, job, subtask } = instance;
    let predecessors = &view.run.dags[dag.index()].predecessors[subtask.index()];
    let mut conditions: Vec<Condition> = predecessors
        .iter()
        .map(|&subtask| {
            let predecessor = Instance { dag, job, subtask };
            let history = view.histories.get(&predecessor);
            Condition {
                held: history.and_then(|history| history.finish),
                may_be_lost: history.is_none() && view.is_lossy(),
                what: What::Predecessor(predecessor),
            }
        })
        .collect();
    if let Some(job) = view.job_before(dag, job) {
        let before = Instance { dag, job, subtask };
        let history = view.histories.get(&before);
        let is_stopped = view.stopped.contains_key(&dag);
        conditions.push(Condition {
            held: history.and_then(History::over),
            may_be_lost: history.is_none() && (view.is_lossy() || is_stopped),
            what: What::JobBefore(before),
        });
    }
    if predecessors.is_empty() {
        let job = view.jobs.get(&(dag, job));
        conditions.push(Condition {
            held: job.and_then(|job| job.released),
            // That it was never released is for R1 to say.
            may_be_lost: true,
            what: What::Release,
        });
    }
    conditions
}

/// Returns when the conditions held, if all are known to have.
fn all_held(conditions: &[Condition]) -> Option<Vec<Moment>> {
    conditions.iter().map(|condition| condition.held).collect()
}

/// R2 for one condition.
fn early(
    view: &View<'_>,
    instance: Instance,
    history: &History,
    condition: &Condition,
) -> Option<Breach> {
    if condition.what == What::Release || (condition.held.is_none() && condition.may_be_lost) {
        return None;
    }
    let is_early = |moment: &Moment| {
        let held = condition.held;
        held.is_none_or(|held| moment.time_ns < held.time_ns)
    };
    let (does, moment) = [("starts", history.start), ("is ready", history.ready)]
        .into_iter()
        .filter_map(|(does, moment)| Some((does, moment?)))
        .filter(|(_, moment)| is_early(moment))
        .min_by_key(|(_, moment)| moment.time_ns)?;
    let run = view.run;
    let (who, verb) = match condition.what {
        What::JobBefore(before) => (run.name(before), "is over"),
        What::Predecessor(predecessor) => (run.name(predecessor), "finishes"),
        What::Release => return None,
    };
    let when = match condition.held {
        Some(held) => format!("only at {} ns on core {}", held.time_ns, held.core.0),
        None => "never".into(),
    };
    let (name, core) = (run.name(instance), moment.core.0);
    let text = match condition.what {
        What::JobBefore(_) => {
            format!("{name} {does} on core {core}; {who}, the job before, {verb} {when}")
        }
        _ => format!("{name} {does} on core {core}; {who}, which it waits for, {verb} {when}"),
    };
    Some(Breach {
        rule: Rule::Join,
        time_ns: moment.time_ns,
        text,
    })
}

/// R3: ready in a step that no condition brought about, or too late.
fn out_of_step(
    view: &View<'_>,
    instance: Instance,
    bound_ns: u64,
    ready: Moment,
    held: &[Moment],
) -> Option<Breach> {
    let last = held.iter().max_by_key(|held| held.time_ns)?;
    let (name, core) = (view.run.name(instance), ready.core.0);
    let since = format!("was over at {} ns on core {}", last.time_ns, last.core.0);
    let text = if !held.iter().any(|held| held.is_same_step(ready)) {
        format!(
            "{name} is ready in a step on core {core} that nothing it waits for brought about; \
             the last of that {since}"
        )
    } else if last.time_ns.saturating_add(bound_ns) < ready.time_ns {
        let late_ns = ready.time_ns - last.time_ns;
        format!("{name} is ready {late_ns} ns after the last of what it waits for {since}")
    } else {
        return None;
    };
    Some(Breach {
        rule: Rule::CompletionBoundary,
        time_ns: ready.time_ns,
        text,
    })
}

/// R3: all conditions hold, and nothing happens.
fn forgotten(view: &View<'_>, instance: Instance, bound_ns: u64) -> Option<Breach> {
    let Instance { dag, job, .. } = instance;
    if view.histories.contains_key(&instance) || view.is_cut(dag, job) {
        return None;
    }
    let held = all_held(&conditions(view, instance))?;
    let last = held.iter().max_by_key(|held| held.time_ns)?;
    let is_over = last.time_ns.saturating_add(bound_ns) < view.end_ns || view.run.complete;
    is_over.then(|| Breach {
        rule: Rule::CompletionBoundary,
        time_ns: last.time_ns,
        text: format!(
            "{} is never ready although all that it waits for was over at {} ns on core {}",
            view.run.name(instance),
            last.time_ns,
            last.core.0
        ),
    })
}
