//! Certification of a run: whether its record shows everything assumed in the proofs of its bounds.
//!
//! The theorems of `sched-dag/proofs` are about each run by the rules whose instances execute for
//! their WCETs at most. A run is *certified* if it was such a run, so each bound held by its
//! theorem. The conditions are checked in this order, and the first failure is reported:
//!
//! 1. *record*: the record has the whole run, no job is due twice, and no due job is missing;
//! 2. *witness*: the bounds are the answers of the same analysis here;
//! 3. *rules*: the [findings](crate::findings) have no breach;
//! 4. *order* (`order.rs`): no instance with a core to keep began before a more urgent instance
//!    that was ready by the step in which the core was given;
//! 5. *cut*: each released job of a DAG with a bound has executed to its end; on one core, where a
//!    bound may rest on the demand of all, so has each released job of any DAG;
//! 6. *WCET*: no segment executes for longer than its WCET and its charges;
//! 7. *lost*: nor do execution and lost time together take longer;
//! 8. *bound*: no response is above its bound. By an argument on paper this follows from all other
//!    conditions, so a failure is an error of ours.
//!
//! *Lost* times are the time until an instance is ready, from the nominal release or the last
//! finish that the instance waits for; the time for which a wait goes on beyond its limit; and for
//! each segment the run's longest inversion, with preemption twice: before the segment's own first
//! instruction, and before the next instruction of the preempted instance. `docs/proving.md` argues
//! by hand why an instance pays for lost time. A charge too small does no harm where WCETs were not
//! used up.
//!
//! No witness is checked here: `./scripts/check-witness --proven` checks witnesses, and names the
//! theorems.

use std::collections::{BTreeMap, BTreeSet};

use sched_dag::analysis::AnalysisResult;
use sched_dag::journal::EventKind;
use sched_dag::{Dag, DagId, Instance, Preemption, Subtask};

use crate::findings::Findings;
use crate::record::Run;
use crate::units::shown;
use crate::view::{History, SliceEnd, View};

/// Certifies a run with bounds.
///
/// # Errors
///
/// The name of the first failed condition, and the reason in words.
pub fn certify(run: &Run, findings: &Findings) -> Result<(), (&'static str, String)> {
    match (run.lost, run.complete) {
        _ if run.bounds_ns.iter().all(Option::is_none) => {
            return Err(("witness", "no DAG has a bound".into()));
        }
        (0, true) => {}
        (0, false) => return Err(("record", "it ends before the run".into())),
        (lost, _) => return Err(("record", format!("{lost} events were lost"))),
    }
    let view = View::new(run);
    if let Some(why) = due_again(&view).or_else(|| missing(&view)) {
        return Err(("record", why));
    }
    let answer = run.commit.check_bounds().map_err(|why| ("witness", why))?;
    if let Some(breach) = findings.breaches.first() {
        return Err(("rules", breach.with_names(&run.task_set).to_string()));
    }
    for (condition, why) in [("order", order::broken(&view)), ("cut", cut(&view))] {
        if let Some(why) = why {
            return Err((condition, why));
        }
    }
    let segments = segments(&view);
    let owed_ns = findings.figures.longest_inversion_ns;
    for (condition, owed_ns) in [("WCET", None), ("lost", Some(owed_ns))] {
        if let Some(why) = segments.iter().find_map(|it| it.excess(run, owed_ns)) {
            return Err((condition, why));
        }
    }
    // Nothing but its own charge pays for a member of a table that moves to another core.
    let (task_set, move_ns) = (&run.task_set, run.commit.told.move_ns);
    let mut dags = (0..).map(DagId).take(task_set.dags().len());
    let moves = |dag| {
        let is_member = task_set.table_of(dag).is_none() && !task_set.tables().is_empty();
        is_member && task_set.cores_of_dag(dag, run.options.cores).len() > 1
    };
    if owed_ns > move_ns && dags.any(moves) {
        let [owed, charged] = [owed_ns, move_ns].map(shown);
        let why = format!("an inversion of {owed}, and a move is charged {charged}");
        return Err(("lost", why));
    }
    exceeded(&view, &answer).map_or(Ok(()), |why| Err(("bound", why)))
}

/// Returns which job is due twice, if any: responses would count from the last time.
fn due_again(view: &View<'_>) -> Option<String> {
    let mut due = BTreeSet::new();
    let mut jobs = view.events.iter().filter(|it| it.what == EventKind::Due);
    let again = jobs.find(|it| !due.insert((it.dag, it.job)))?;
    let name = view.run.task_set.dag(again.dag).name();
    Some(format!("dag `{name}` job {} is due twice", again.job))
}

/// Returns which job was not released, if any, although it is one of a stated number or should have
/// been complete. Only periodic DAGs with a bound are checked, except DAGs that were paused or
/// closed. A run that entered a mode is not checked, because a mode may leave DAGs out.
fn missing(view: &View<'_>) -> Option<String> {
    let run = view.run;
    let modes = view.events.iter().any(|it| it.what == EventKind::Entered);
    let stops = [EventKind::Off, EventKind::On, EventKind::Closed];
    let stopped = |dag| {
        view.events
            .iter()
            .any(|it| it.dag == dag && stops.contains(&it.what))
    };
    let bounded = (0..).map(DagId).zip(&run.bounds_ns);
    let bounded = bounded.filter_map(|(dag, bound_ns)| Some((dag, (*bound_ns)?)));
    let mut asked = bounded.filter(|&(dag, _)| !modes && !stopped(dag));
    asked.find_map(|(dag, bound_ns)| {
        let model = run.task_set.dag(dag);
        let by_now = |&job: &u64| model.grid_ns(job).saturating_add(bound_ns) < view.end_ns;
        let is_due = |job: &u64| model.jobs().is_some() || by_now(job);
        let jobs = (0..model.jobs().unwrap_or(u64::MAX)).take_while(is_due);
        let is_released = |job| {
            view.jobs
                .get(&(dag, job))
                .is_some_and(|of| of.released_ns.is_some())
        };
        let mut jobs = jobs.take_while(|_| !model.is_sporadic());
        let job = jobs.find(|&job| !is_released(job))?;
        Some(format!("dag `{}` job {job} was not released", model.name()))
    })
}

/// Returns the event that cut a job short, or the instance of a released job that never finished,
/// where theorems ask each to finish.
fn cut(view: &View<'_>) -> Option<String> {
    let Run {
        task_set, options, ..
    } = view.run;
    let is_asked = |dag: DagId| {
        let cores = task_set.cores_of(task_set.dag(dag).cluster(), options.cores);
        view.run.bounds_ns[dag.index()].is_some() || cores.len() == 1
    };
    let mut cuts = view.events.iter().filter(|it| CUTS.contains(&it.what));
    if let Some(event) = cuts.find(|it| is_asked(it.dag)) {
        let name = task_set.dag(event.dag).name();
        let word = event.what.word();
        return Some(format!("`{word}` of dag `{name}` job {}", event.job));
    }
    view.jobs.iter().find_map(|(&(dag, job), of)| {
        let subtasks = task_set.dag(dag).topological_order().iter();
        let mut instances = subtasks.map(|&subtask| Instance { dag, job, subtask });
        let finish_ns = |of: &Instance| view.histories.get(of)?.finish_ns;
        let unfinished = instances.find(|of| finish_ns(of).is_none());
        let instance = unfinished.filter(|_| is_asked(dag) && of.released_ns.is_some())?;
        Some(format!("{} never finished", named(view.run, instance)))
    })
}

/// The events by which a job ends before its instances.
const CUTS: [EventKind; 5] = [
    EventKind::Aborted,
    EventKind::Cancelled,
    EventKind::Ended,
    EventKind::DagEnded,
    EventKind::Restarted,
];

/// A segment, or a whole instance if the WCETs of its segments are unknown.
struct Segment {
    instance: Instance,
    /// The number of segments.
    count: u64,
    from_ns: u64,
    executed_ns: u64,
    /// The time until readiness, or the time beyond the limit of the wait before.
    late_ns: u64,
    /// The WCET with charges.
    charged_ns: u64,
}

impl Segment {
    /// Describes an execution that was too long or, given an inversion, execution and lost time
    /// together.
    fn excess(&self, run: &Run, owed_ns: Option<u64>) -> Option<String> {
        let times = self.count * (1 + u64::from(run.options.preemption == Preemption::Enabled));
        let lost_ns = |owed_ns: u64| owed_ns.saturating_mul(times).saturating_add(self.late_ns);
        let all_ns = self.executed_ns.saturating_add(owed_ns.map_or(0, lost_ns));
        (all_ns > self.charged_ns).then(|| {
            let times_ns = [
                self.executed_ns,
                self.from_ns,
                self.late_ns,
                self.charged_ns,
            ];
            let [executed, from, late, charged] = times_ns.map(shown);
            let lost = owed_ns.map_or(String::new(), |owed_ns| {
                format!(
                    "; with {late} late and {times} inversions of {}",
                    shown(owed_ns)
                )
            });
            let instance = named(run, self.instance);
            let why = "more than its WCET and charges of";
            format!("{instance} executed for {executed} from {from} on{lost}, {why} {charged}")
        })
    }
}

fn named(run: &Run, Instance { dag, job, subtask }: Instance) -> String {
    let dag = run.task_set.dag(dag);
    let (name, subtask) = (dag.name(), dag.subtask(subtask).name());
    format!("subtask `{subtask}` of dag `{name}` job {job}")
}

/// Returns all segments with a WCET that began, by DAG, job and subtask.
fn segments(view: &View<'_>) -> Vec<Segment> {
    let Run {
        task_set, options, ..
    } = view.run;
    let overheads = view.run.commit.settings().overheads;
    let charges = task_set.dags().iter().map(|dag| {
        let shares = |other: &&_| Dag::cluster(other) == dag.cluster();
        let overheads = overheads.among(&mut task_set.dags().iter().filter(shares), options.cores);
        overheads.of_an_instance_ns(options.preemption)
    });
    let charges: Vec<Option<u64>> = charges.collect();
    let mut over_ns = BTreeMap::new();
    let mut all = Vec::new();
    // In the order of jobs: the job before comes first.
    for (&instance, history) in &view.histories {
        let Instance { dag, job, subtask } = instance;
        let model = task_set.dag(dag);
        // A bound holds whenever DAGs without a bound release, so their lateness does not count.
        let release_ns = view.run.bounds_ns[dag.index()].map(|_| view.release_ns(dag, job));
        let over = |of: &History| of.finish_ns.or(of.dropped_ns);
        let before = |&subtask| over(view.histories.get(&Instance { dag, job, subtask })?);
        let before = model.predecessors(subtask).iter().filter_map(before);
        let precursor = over_ns.insert((dag, subtask), over(history)).flatten();
        let due_ns = before.chain(release_ns).chain(precursor).max();
        let ready_ns = history.ready_ns.unwrap_or(0);
        let late_ns = ready_ns.saturating_sub(due_ns.unwrap_or(ready_ns));
        let subtask = model.subtask(subtask);
        // An instance without a WCET delays no instance with a bound.
        let Some(charged_ns) = charges[dag.index()].and_then(|ns| charged(subtask, ns)) else {
            continue;
        };
        let times = executed(history, subtask, late_ns, view.end_ns);
        let count = match charged_ns.len() {
            1 => times.len().max(1),
            _ => 1,
        };
        let parts = times.chunks(count).zip(charged_ns);
        all.extend(parts.map(|(times, charged_ns)| Segment {
            instance,
            count: times.len() as u64,
            from_ns: times[0].0,
            executed_ns: times.iter().map(|(_, ns, _)| ns).sum(),
            late_ns: times.iter().map(|(.., ns)| ns).sum(),
            charged_ns,
        }));
    }
    all
}

/// Returns the WCETs of a subtask's segments with charges, or their sum if the parts are unknown.
fn charged(subtask: &Subtask, charge_ns: u64) -> Option<Vec<u64>> {
    let whole_ns = subtask.charged_ns(charge_ns)?;
    let Some(mut segments_ns) = subtask.segments_ns() else {
        return Some(vec![whole_ns]);
    };
    // The first segment has all waits for locks.
    segments_ns[0] += subtask.charged_ns(0)? - subtask.wcet_ns()?;
    let segments_ns = segments_ns.into_iter().map(|ns| ns.checked_add(charge_ns));
    segments_ns.collect()
}

/// Returns the begin, the execution and the lateness of each segment; the first is late by
/// `late_ns`.
fn executed(history: &History, of: &Subtask, late_ns: u64, end_ns: u64) -> Vec<(u64, u64, u64)> {
    let mut found: Vec<(u64, u64, u64)> = Vec::new();
    let mut next_late_ns = Some(late_ns);
    for (number, slice) in history.slices.iter().enumerate() {
        if let Some(late_ns) = next_late_ns.take() {
            found.push((slice.from_ns, 0, late_ns));
        }
        let place = found.len() - 1;
        found[place].1 += slice.to_ns.unwrap_or(end_ns).saturating_sub(slice.from_ns);
        if history.end_of(number) == SliceEnd::Waits {
            let (from_ns, to_ns) = history.wait_after(*slice).unwrap_or_default();
            let limit_ns = of.waits().get(place).map_or(0, |wait| wait.limit_ns);
            let waited_ns = to_ns.unwrap_or(end_ns).saturating_sub(from_ns);
            next_late_ns = Some(waited_ns.saturating_sub(limit_ns));
        }
    }
    found
}

/// Returns which instance finished beyond the bound of its DAG, or of its sink, if any.
fn exceeded(view: &View<'_>, answer: &AnalysisResult) -> Option<String> {
    view.histories.iter().find_map(|(&instance, history)| {
        let Instance { dag, job, subtask } = instance;
        let bound_ns = answer.bounds[dag.index()]?.bound_ns;
        let sinks = view.run.task_set.dag(dag).sinks();
        let sink = sinks.iter().position(|sink| *sink == subtask);
        let of_sink = sink.and_then(|sink| answer.sinks_ns[dag.index()][sink]);
        let bound_ns = of_sink.map_or(bound_ns, |ns| ns.min(bound_ns));
        let response_ns = history.finish_ns?.saturating_sub(view.release_ns(dag, job));
        (response_ns > bound_ns).then(|| {
            let [response, bound] = [response_ns, bound_ns].map(shown);
            let instance = named(view.run, instance);
            format!("{instance} took {response}, beyond {bound}, and all else held; report this")
        })
    })
}

mod order;
#[cfg(test)]
mod tests;
