//! The tracks of a DAG: its jobs, and each subtask's instances.
//!
//! Jobs overlap, and slices of one track must not, so jobs lie on as many *lanes*
//! as overlap at most. A subtask needs one track only: by R2 its instance of a job
//! is not ready before the one of the job before has finished.

use sched_dag::journal::What;
use sched_dag::{DagId, Instance, SubtaskId};

use super::super::view::{JobHistory, View};
use super::flows::Flows;
use super::output::{Group, Output, Track};
use super::{draw_piece, instance_args, name_or};
use crate::json::Object;

/// Draws all DAGs of a run.
pub(super) fn draw(view: &View<'_>, prefix: &str, flows: &mut Flows, output: &mut Output) {
    flows.draw_again();
    for (dag, model) in (0..).map(DagId).zip(view.run.task_set.dags()) {
        let label = format!(
            "{}T = {}, D = {}",
            if model.is_sporadic() {
                "sporadic, "
            } else {
                ""
            },
            milliseconds(model.period_ns()),
            milliseconds(model.relative_deadline_ns())
        );
        let name = format!("{prefix}dag {}", name_or(model.name(), dag.0));
        let group = output.group(&name, &label);
        draw_moments(view, dag, group, output);
        draw_jobs(view, dag, group, output);
        for (subtask, of) in (0..).map(SubtaskId).zip(model.subtasks()) {
            let mut track = output.track(group, &name_or(of.name(), subtask.0));
            draw_subtask(view, dag, subtask, flows, &mut track);
            output.add(track);
        }
    }
}

/// Draws what happens to jobs at one moment, and their deadlines.
fn draw_moments(view: &View<'_>, dag: DagId, group: Group, output: &mut Output) {
    let mut track = output.track(group, "releases, deadlines");
    let args = |job: u64| Object::new().number("job", job).end();
    for event in view.events.iter().filter(|event| event.dag == dag) {
        let what = match event.what {
            What::Released => "release",
            What::Queued => "release waits",
            What::Skipped => "skip",
            What::Aborted => "abort",
            What::Missed => "MISS",
            What::Signalled => "signal for",
            What::Dropped => "signal dropped,",
            _ => continue,
        };
        let name = format!("{what} #{}", event.job);
        track.instant(event.time_ns, &name, &args(event.job));
    }
    for (&(_, job), history) in jobs_of(view, dag) {
        let deadline_ns = view.deadline_ns(dag, job);
        // A later one would only make the picture longer.
        if history.released_ns.is_some() && deadline_ns <= view.end_ns {
            track.instant(deadline_ns, &format!("deadline #{job}"), &args(job));
        }
    }
    output.add(track);
}

/// Draws each job from its nominal release to its completion.
fn draw_jobs(view: &View<'_>, dag: DagId, group: Group, output: &mut Output) {
    let mut lanes: Vec<Track> = Vec::new();
    let mut busy_until_ns: Vec<u64> = Vec::new();
    for (&(_, job), history) in jobs_of(view, dag) {
        if history.released_ns.is_none() && history.completed_ns.is_none() {
            continue;
        }
        let nominal_ns = view.release_ns(dag, job);
        let end_ns = history.completed_ns;
        let to_ns = end_ns.unwrap_or(view.end_ns).max(nominal_ns);
        let is_free = |until_ns: &u64| *until_ns <= nominal_ns;
        let lane = busy_until_ns.iter().position(is_free);
        let lane = lane.unwrap_or_else(|| {
            lanes.push(output.track(group, &format!("jobs, lane {}", lanes.len() + 1)));
            busy_until_ns.push(0);
            lanes.len() - 1
        });
        busy_until_ns[lane] = to_ns;
        let name = format!("job #{job}{}", what_became_of(history));
        let args = job_args(view, dag, job, history);
        lanes[lane].begin(nominal_ns, &name, &args);
        lanes[lane].end(to_ns);
    }
    lanes.into_iter().for_each(|lane| output.add(lane));
}

fn what_became_of(history: &JobHistory) -> &'static str {
    match history {
        job if job.aborted_ns.is_some() => ", aborted",
        job if job.missed_ns.is_some() => ", missed",
        job if job.completed_ns.is_none() => ", not completed",
        _ => "",
    }
}

fn job_args(view: &View<'_>, dag: DagId, job: u64, history: &JobHistory) -> String {
    let release_ns = view.release_ns(dag, job);
    let mut args = Object::new()
        .number("job", job)
        .number("release_ns", release_ns)
        .number("deadline_ns", view.deadline_ns(dag, job));
    if let Some(released_ns) = history.released_ns {
        args = args.number("released_ns", released_ns);
    }
    if let Some(completed_ns) = history.completed_ns {
        let response_ns = completed_ns.saturating_sub(release_ns);
        args = args.number("response_time_ns", response_ns);
    }
    args.end()
}

/// Draws a subtask's instances from readiness to their end.
fn draw_subtask(view: &View<'_>, dag: DagId, subtask: SubtaskId, flows: &Flows, track: &mut Track) {
    let of_dag = Instance {
        dag,
        job: 0,
        subtask: SubtaskId(0),
    }..=Instance {
        dag,
        job: u64::MAX,
        subtask: SubtaskId(u32::MAX),
    };
    let instances = view.histories.range(of_dag);
    for (&instance, history) in instances.filter(|(instance, _)| instance.subtask == subtask) {
        let first = history.slices.first();
        let Some(begin_ns) = history.ready_ns.or(first.map(|slice| slice.from_ns)) else {
            continue;
        };
        let over_ns = history.over_ns();
        let was_cancelled = over_ns.is_some() && first.is_none();
        let name = match was_cancelled {
            true => format!("#{}, cancelled", instance.job),
            false => format!("#{}", instance.job),
        };
        if let Some(ready_ns) = history.ready_ns {
            let name = format!("ready #{}", instance.job);
            track.instant(ready_ns, &name, &instance_args(instance).end());
        }
        let args = instance_args(instance).number("suspensions", history.suspensions);
        track.begin(begin_ns, &name, &args.end());
        for (index, slice) in history.slices.iter().enumerate() {
            let args = Object::new().number("core", slice.core.0).end();
            let name = format!("on core {}", slice.core.0);
            draw_piece(view, (instance, index), (&name, &args), flows, track);
        }
        track.end(over_ns.unwrap_or(view.end_ns));
    }
}

fn jobs_of<'v>(
    view: &'v View<'_>,
    dag: DagId,
) -> impl Iterator<Item = (&'v (DagId, u64), &'v JobHistory)> {
    view.jobs.range((dag, 0)..=(dag, u64::MAX))
}

fn milliseconds(ns: u64) -> String {
    let text = format!("{}.{:06}", ns / 1_000_000, ns % 1_000_000);
    let text = text.trim_end_matches('0').trim_end_matches('.');
    format!("{text} ms")
}
