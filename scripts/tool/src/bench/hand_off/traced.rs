//! What only the trace can tell: wake-ups, and the parts of a preemption.
//!
//! A system that wakes a sink for each of its inputs makes N wake-ups of a join of N.
//! Here a sink is made ready once, when its last predecessor has finished; the trace
//! has an event for each time. Of a preemption it has the kernel's own times of
//! request, suspension, start, finish and continuation, which no body can see.

use std::collections::BTreeMap;

use sched_dag::DagId;
use sched_dag::journal::{Event, What};
use sched_dag::law::Distribution;

use super::figure::Figure;
use crate::trace::model::Run;
use crate::trace::read;

/// The preemptor's DAG in the runs that have one.
const PREEMPTOR: DagId = DagId(0);

/// Reads all figures of a boot that has dumped its trace.
pub(super) fn read_all(log: &str, cores: u64) -> Result<Vec<Figure>, String> {
    figures_of(&read(log)?, cores)
}

fn figures_of(runs: &[Run], cores: u64) -> Result<Vec<Figure>, String> {
    if runs.iter().any(|run| run.lost > 0) {
        return Err("the trace has lost events; measure fewer jobs".into());
    }
    let mut figures = wakeups(runs, cores);
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
        let count =
            |is_it: &dyn Fn(&&Event) -> bool| run.events.iter().filter(is_it).count() as u64;
        let (ready, jobs) = counts.entry(sink - 1).or_default();
        *ready += count(&|event| {
            event.what == What::Ready && event.subtask.is_some_and(|of| of.index() == sink)
        });
        *jobs += count(&|event| event.what == What::Released);
    }
    let counts = counts.into_iter().filter(|(_, (_, jobs))| *jobs > 0);
    counts
        .map(|(branches, (ready, jobs))| Figure {
            cores,
            workload: format!("fork-join-{branches}"),
            figure: "sink_wakeups".into(),
            per: jobs,
            median: ready,
            p99: ready,
            max: ready,
        })
        .collect()
}

/// Takes preemptions apart: on one core, or on others than that with the timer.
fn preemption(run: &Run, cores: u64) -> Vec<Figure> {
    const PARTS: [&str; 3] = [
        "request_to_suspended",
        "suspended_to_start",
        "finish_to_resumed",
    ];
    let mut samples: [Vec<u64>; 3] = Default::default();
    // A trace is in order of time only core by core.
    let mut events = run.events.clone();
    events.sort_by_key(|event| event.time_ns);
    let requests = events.iter().enumerate();
    let requests = requests.filter(|(_, event)| {
        event.what == What::Request
            && event.dag == PREEMPTOR
            && (cores == 1 || event.core.index() > 0)
    });
    for (place, request) in requests {
        // What happened next on that core, each after the one before.
        let mut later = events[place..].iter();
        let mut next = |word, of_preemptor: bool| {
            let event = later.find(|event| {
                event.what == word
                    && event.core == request.core
                    && (event.dag == PREEMPTOR) == of_preemptor
            })?;
            Some(event.time_ns)
        };
        let times = [
            next(What::Suspend, false),
            next(What::Start, true),
            next(What::Finish, true),
            next(What::Resume, false),
        ];
        let [Some(suspended), Some(start), Some(finish), Some(resumed)] = times else {
            continue;
        };
        samples[0].push(suspended - request.time_ns);
        samples[1].push(start - suspended);
        samples[2].push(resumed - finish);
    }
    let workload = match cores {
        1 => "preemption",
        _ => "preemption of another core",
    };
    let figures = PARTS.iter().zip(samples);
    let figures = figures.filter(|(_, samples)| !samples.is_empty());
    figures
        .map(|(part, samples)| {
            let of = Distribution::new(samples);
            Figure {
                cores,
                workload: workload.into(),
                figure: (*part).into(),
                per: 1,
                median: of.median(),
                p99: of.p99(),
                max: of.max(),
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::figures_of;
    use crate::made::{commit as commit_of, record_of};
    use crate::record::Record;

    /// Returns the first figure's workload and steps, and the medians of all, of such events.
    fn measured(name: &str, events: &str) -> (String, u64, Vec<u64>) {
        let commit =
            format!("static 1\n{name} T=9 D=9 O=0: a/0 b/1 c/2; 0>1 1>2\nlow T=9 D=9 O=0: a/9");
        let runs = Record::read(&record_of("", &commit_of(&commit), events))
            .unwrap()
            .runs;
        let figures = figures_of(&runs, 1).unwrap();
        let medians = figures.iter().map(|figure| figure.median).collect();
        (figures[0].workload.clone(), figures[0].per, medians)
    }

    #[test]
    fn wake_ups_of_a_sink_are_counted_and_a_preemption_is_taken_apart() {
        let ready = "0 released c0 0.0\n1 ready c0 0.0.1\n2 ready c0 0.0.2\n3 start c0 0.0.2\n4 ready c0 0.0.2";
        let expected = ("fork-join-1".into(), 1, vec![2]);
        assert_eq!(measured("fork-join", ready), expected);
        let preempted = "10 request c0 0.0.0\n13 suspend c0 1.0.0\n20 start c0 0.0.0\n30 finish c0 0.0.0\n45 resume c0 1.0.0";
        let expected = ("preemption".into(), 1, vec![3, 7, 15]);
        assert_eq!(measured("preemptor", preempted), expected);
        assert!(
            figures_of(&[], 1)
                .unwrap_err()
                .contains("shows no fork-join")
        );
    }
}
