//! Every order of events in a tiny set: each state's steps, each state once.
//!
//! From the first state on each step that a driver may take is taken: time goes on, at once or past
//! what was due; of the instances that have started one or two complete, wait or fail, on their core
//! or after they have lost it; a wait has its answer, or another one has one; a DAG is ended, closed,
//! paused or resumed, or gets a signal.

use std::collections::HashSet;

use sched_dag::DagId;
use sched_dag::lifecycle::{Request, WaitId};

use super::walk::{Step, Walk};
use crate::support::set::Set;

/// By so much a late driver comes later: a release and its deadline may both have passed.
const LATE_NS: u64 = 3;

/// Explores a set. Returns how many states it has; the error is the way to the first difference.
pub(crate) fn explore(set: &Set) -> Result<usize, String> {
    let of_dag = |dag: &sched_dag::DagSpec| {
        let last = dag.jobs? - 1;
        let waits = dag.subtasks.iter().flat_map(|subtask| &subtask.waits);
        let waits_ns: u64 = waits.map(|wait| wait.limit_ns).sum();
        let most_ns = dag.relative_deadline_ns?.max(1 + waits_ns * (last + 1));
        Some(dag.offset_ns + dag.period_ns? * last + most_ns + 1)
    };
    // Then nothing but completions can happen any more.
    let last_ns = set.specs.iter().filter_map(of_dag).max().unwrap_or(0);
    // Both jobs of a DAG alone may be signalled.
    let most_disturbances = if set.specs.len() == 1 { 2 } else { 1 };
    let mut first = Walk::new(set);
    first.instant(0, &[])?;
    let mut known = HashSet::new();
    let mut open = vec![(first, Vec::new(), 0)];
    while let Some((walk, way, disturbances)) = open.pop() {
        let mut is_last = true;
        for steps in steps(&walk, disturbances < most_disturbances) {
            let is_disturbance =
                |step: &&Step| !matches!(step, Step::Complete(_) | Step::Ask(Request::Answer(_)));
            let disturbances = disturbances + steps.iter().filter(is_disturbance).count();
            let times_ns = [0, 1, LATE_NS].map(|later_ns| walk.now_ns + later_ns);
            for now_ns in times_ns {
                let is_nothing = steps.is_empty() && now_ns == walk.now_ns;
                if is_nothing || now_ns > walk.now_ns.max(last_ns) {
                    continue;
                }
                let mut next = walk.clone();
                let mut way = way.clone();
                way.push((now_ns, steps.clone()));
                let taken = next.instant(now_ns, &steps);
                taken.map_err(|found| format!("{found}\nafter {way:?}"))?;
                is_last = false;
                match known.insert((disturbances, next.hash())) {
                    true => open.push((next, way, disturbances)),
                    false => judged(&next, &way)?,
                }
            }
        }
        if is_last {
            judged(&walk, &way)?;
        }
    }
    Ok(known.len())
}

fn judged(walk: &Walk<'_>, way: &[(u64, Vec<Step>)]) -> Result<(), String> {
    let judged = walk.judged(walk.is_over());
    judged.map_err(|found| format!("{found}\nafter {way:?}"))
}

/// Returns all that may happen at an instant.
fn steps(walk: &Walk<'_>, may_disturb: bool) -> Vec<Vec<Step>> {
    let started = walk.started();
    let mut steps = vec![Vec::new()];
    for &one in &started {
        steps.push(vec![Step::Complete(one)]);
        let others = started.iter().filter(|&&other| other != one);
        steps.extend(others.map(|&other| vec![Step::Complete(one), Step::Complete(other)]));
        if may_disturb {
            steps.extend([vec![Step::Fail(one)], vec![Step::Replace(one)]]);
        }
    }
    for wait in walk.waits.present() {
        let (instance, number) = (wait.instance, wait.number + 1);
        let answers = [wait, WaitId { instance, number }].map(Request::Answer);
        steps.extend(answers.map(|answer| vec![Step::Ask(answer)]));
    }
    if may_disturb {
        for dag in (0..).map(DagId).take(walk.set.specs.len()) {
            let requests = [
                Request::End(dag),
                Request::Close(dag),
                match walk.is_paused(dag) {
                    true => Request::Resume(dag),
                    false => Request::Pause(dag),
                },
            ];
            let signal = walk.set.is_sporadic(dag).then_some(Request::Signal(dag));
            let requests = requests.into_iter().chain(signal);
            steps.extend(requests.map(|request| vec![Step::Ask(request)]));
        }
    }
    steps
}
