//! DAGs whose subtasks execute for given times and check their jobs' numbers.

#![allow(dead_code, reason = "not every test program uses every helper")]

pub(crate) mod lifecycle;
pub(crate) mod sharing;

use std::time::Duration;

use fass::{Dag, Occupation, SubtaskAttributes, create_dag, execute_for, finish_create_dags};
use virtual_time::{Report, VirtualTime};

pub(crate) const fn ms(milliseconds: u64) -> Duration {
    Duration::from_millis(milliseconds)
}

pub(crate) fn named(name: &str) -> SubtaskAttributes {
    SubtaskAttributes::named(name)
}

pub(crate) fn execute(duration: Duration) {
    execute_for(duration, Occupation::Spin);
}

#[track_caller]
pub(crate) fn commit(dags: &[Dag]) {
    if let Err(error) = finish_create_dags(dags) {
        panic!("{error}");
    }
}

/// Commits DAGs and runs them, by the rules.
#[track_caller]
pub(crate) fn run(machine: &VirtualTime, dags: &[Dag]) -> Report {
    commit(dags);
    let report = machine.run();
    assert_eq!(report.violations(), []);
    report
}

/// Source and sink of the given execution times; the sink insists on receiving
/// the values in their order. Topics carry the DAG's name.
pub(crate) fn pair(name: &str, period: Duration, deadline: Duration, times: [Duration; 2]) -> Dag {
    let dag = create_dag();
    dag.name(name);
    let mut written = 0_u64;
    let source = move || {
        execute(times[0]);
        written += 1;
        (written,)
    };
    dag.register_periodic_subtask(source, vec![name], period, named("source"));
    let mut last = 0;
    let sink = move |(number,): (u64,)| {
        execute(times[1]);
        assert!(number > last, "{number} after {last}");
        last = number;
    };
    dag.register_sink_subtask(sink, vec![name], deadline, named("sink"));
    dag
}

/// One source, two branches and a join, which insists on one job's values.
pub(crate) fn diamond(period: Duration, deadline: Duration, times: [Duration; 4]) -> Dag {
    let [source, left, right, join] = times;
    let dag = create_dag();
    dag.name("diamond");
    let mut job = 0_u64;
    dag.register_periodic_subtask(
        move || {
            execute(source);
            job += 1;
            (job - 1,)
        },
        vec!["job"],
        period,
        named("source"),
    );
    for (branch, time) in [("left", left), ("right", right)] {
        dag.register_subtask(
            move |(job,): (u64,)| {
                execute(time);
                (job,)
            },
            vec!["job"],
            vec![branch],
            named(branch),
        );
    }
    dag.register_sink_subtask(
        move |(left, right): (u64, u64)| {
            execute(join);
            assert_eq!(left, right, "values of two jobs meet");
        },
        vec!["left", "right"],
        deadline,
        named("join"),
    );
    dag
}
