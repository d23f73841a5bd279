//! What only the trace can tell: wake-ups, and the parts of a preemption.
//!
//! A system that wakes a sink for each of its inputs makes N wake-ups of a join of N.
//! Here a sink is made ready once, when its last predecessor has finished; the trace
//! has an event for each time. Of a preemption it has the kernel's own times of
//! request, suspension, start, finish and continuation, which no body can see.

use std::collections::BTreeMap;

use sched_dag::DagId;
use sched_dag::journal::{Event, What};

use crate::bench::frame::Figure;
use crate::trace::model::Run;
use crate::trace::read;

/// The preemptor's DAG in the runs that have one.
const PREEMPTOR: DagId = DagId(0);

/// Reads all figures of a boot that has dumped its trace.
pub(super) fn read_all(log: &str, cores: u64) -> Result<Vec<Figure>, String> {
    let runs = read(log).map_err(|malformed| malformed.to_string())?;
    if runs.iter().any(|run| run.lost > 0) {
        return Err("the trace has lost events; measure fewer jobs".into());
    }
    let mut figures = wakeups(&runs, cores);
    let preemptions = runs.iter().filter(|run| is_of(run, "preemptor"));
    figures.extend(preemptions.flat_map(|run| preemption(run, cores)));
    if figures.is_empty() {
        return Err("the trace shows no fork-join and no preemption".into());
    }
    Ok(figures)
}

fn is_of(run: &Run, name: &str) -> bool {
    let mut dags = run.task_set.dags().iter();
    dags.next().is_some_and(|dag| dag.name() == name)
}

/// Counts how often sinks of fork-joins are made ready.
fn wakeups(runs: &[Run], cores: u64) -> Vec<Figure> {
    // By number of branches: wake-ups and jobs.
    let mut counts: BTreeMap<usize, (u64, u64)> = BTreeMap::new();
    for run in runs.iter().filter(|run| is_of(run, "fork-join")) {
        let sink = run.task_set.dag(DagId(0)).subtasks().len() - 1;
        let (ready, jobs) = counts.entry(sink - 1).or_default();
        for event in &run.events {
            let is_sinks = event.subtask.is_some_and(|of| of.index() == sink);
            *ready += u64::from(event.what == What::Ready && is_sinks);
            *jobs += u64::from(event.what == What::Released);
        }
    }
    let counts = counts.into_iter().filter(|(_, (_, jobs))| *jobs > 0);
    let figure = |(branches, (ready, jobs))| {
        let workload = format!("fork-join-{branches}");
        Figure::new((cores, workload, "sink_wakeups"), jobs, [ready])
    };
    counts.map(figure).collect()
}

/// Takes preemptions apart: on one core, or on others than that with the timer.
fn preemption(run: &Run, cores: u64) -> Vec<Figure> {
    let mut parts = [
        ("request_to_suspended", Vec::new()),
        ("suspended_to_start", Vec::new()),
        ("finish_to_resumed", Vec::new()),
    ];
    // A trace is in order of time only core by core.
    let mut events = run.events.clone();
    events.sort_by_key(|event| event.time_ns);
    for (place, request) in events.iter().enumerate() {
        let is_meant = request.what == What::Request && request.dag == PREEMPTOR;
        if !is_meant || (cores > 1 && request.core.index() == 0) {
            continue;
        }
        // What happened next on that core, each after the one before.
        let mut later = events[place..].iter();
        let times = [
            (What::Suspend, false),
            (What::Start, true),
            (What::Finish, true),
            (What::Resume, false),
        ];
        let times = times.map(|(what, of_preemptor)| {
            let is_next = |event: &&Event| {
                (event.what, event.core) == (what, request.core)
                    && (event.dag == PREEMPTOR) == of_preemptor
            };
            later.find(is_next).map(|event| event.time_ns)
        });
        if let [Some(suspended), Some(start), Some(finish), Some(resumed)] = times {
            let samples = [
                suspended - request.time_ns,
                start - suspended,
                resumed - finish,
            ];
            for ((_, all), sample) in parts.iter_mut().zip(samples) {
                all.push(sample);
            }
        }
    }
    let workload = match cores {
        1 => "preemption",
        _ => "preemption of another core",
    };
    let parts = parts.into_iter().filter(|(_, samples)| !samples.is_empty());
    let figure = |(part, samples)| Figure::new((cores, workload, part), 1, samples);
    parts.map(figure).collect()
}

#[cfg(test)]
mod tests {
    use super::read_all;

    /// Returns the first figure's workload and steps, and the medians of all, of such events.
    fn measured(name: &str, events: &str) -> (String, u64, Vec<u64>) {
        let log = format!(
            r#"{{"kind":"trace_begin","policy":"static","preemption":"on","cores":1,"run":0}}
{{"kind":"trace_dag","dag":0,"name":"{name}","period_ns":9,"relative_deadline_ns":9,"offset_ns":0,"in_flight":1,"overrun":"queue","subtasks":[["a",0,0,null],["b",1,0,null],["c",2,0,null]],"edges":[[0,1],[1,2]]}}
{{"kind":"trace_dag","dag":1,"name":"low","period_ns":9,"relative_deadline_ns":9,"offset_ns":0,"in_flight":1,"overrun":"queue","subtasks":[["a",9,0,null]],"edges":[]}}
{{"kind":"trace","events":[{events}]}}
{{"kind":"trace_end","events":{},"lost":0,"complete":true}}
"#,
            events.matches("[").count()
        );
        let figures = read_all(&log, 1).unwrap();
        let medians = figures.iter().map(|figure| figure.median).collect();
        (figures[0].workload.clone(), figures[0].per, medians)
    }

    #[test]
    fn wake_ups_of_a_sink_are_counted_and_a_preemption_is_taken_apart() {
        let ready = r#"[0,"released",0,0,0,-1],[1,"ready",0,0,0,1],[2,"ready",0,0,0,2],[3,"start",0,0,0,2],[4,"ready",0,0,0,2]"#;
        let expected = ("fork-join-1".into(), 1, vec![2]);
        assert_eq!(measured("fork-join", ready), expected);
        let preempted = r#"[10,"request",0,0,0,0],[13,"suspend",0,1,0,0],[20,"start",0,0,0,0],[30,"finish",0,0,0,0],[45,"resume",0,1,0,0]"#;
        let expected = ("preemption".into(), 1, vec![3, 7, 15]);
        assert_eq!(measured("preemptor", preempted), expected);
        assert!(read_all("", 1).unwrap_err().contains("shows no fork-join"));
    }
}
