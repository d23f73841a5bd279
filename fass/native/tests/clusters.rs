//! Workers that are divided: each cluster obeys the rules by itself, and hears of the others.
//!
//! Which cluster is how far is up to the host. So these tests hold what each one must have done
//! in the end, whatever the order between them.

#[path = "support/graphs.rs"]
mod graphs;

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::Duration;

use fass::{
    Dag, Latest, Policy, Raiser, Sample, Signal, SubtaskAttributes, create_dag, finish_create_dags,
};
use graphs::{chain, checking, commit_divided, fork_join, layered, runs_all, spec};
use native::{Closure, Native, Report, Setting};
use sched_dag::{ClusterId, DagSpec};

const JOBS: u64 = 100;
const PERIOD: Duration = Duration::from_micros(10);
const SHORTER: Duration = Duration::from_micros(3);

/// The divisions that all is tried in: clusters of one worker and of several.
const DIVISIONS: [&[u32]; 5] = [&[1, 1], &[2, 1], &[1, 2], &[2, 2], &[1, 1, 1]];

fn named(name: &str) -> SubtaskAttributes {
    SubtaskAttributes::named(name)
}

/// Puts each DAG into the next cluster.
fn dealt(specs: Vec<DagSpec>, sizes: &[u32]) -> Vec<DagSpec> {
    let clusters = (0..).map(ClusterId).take(sizes.len()).cycle();
    let put = |(spec, cluster): (DagSpec, ClusterId)| DagSpec {
        cluster: Some(cluster),
        ..spec
    };
    specs.into_iter().zip(clusters).map(put).collect()
}

#[test]
fn each_cluster_obeys_r1_to_r5() {
    let specs = || {
        vec![
            spec(8, &chain(8), 100),
            spec(6, &fork_join(4), 100),
            spec(24, &layered(3), 60),
            spec(5, &[], 100),
            spec(10, &fork_join(8), 80),
        ]
    };
    for sizes in DIVISIONS {
        for policy in [Policy::StaticPriority, Policy::Edf] {
            let specs = dealt(specs(), sizes);
            let workers = sizes.iter().sum();
            let setting = Setting { policy, workers };
            runs_all(&specs, setting, sizes);
        }
    }
}

#[test]
fn nothing_runs_on_the_workers_of_another_cluster() {
    let sizes = [1, 2, 1];
    let setting = Setting {
        policy: Policy::Edf,
        workers: 5,
    };
    let specs = dealt(vec![spec(6, &fork_join(4), 50); 6], &sizes);
    let task_set = commit_divided(&specs, setting, &sizes);
    let of_dag = |dag: &sched_dag::Dag| {
        let own = task_set.cores_of(dag.cluster(), setting.workers);
        let body = || -> Closure {
            let own = own.clone();
            Box::new(move |_| {
                let worker = native::worker().expect("a worker calls this");
                assert!(own.contains(&worker), "worker {worker} of {own:?}");
            })
        };
        dag.subtasks().iter().map(|_| body()).collect()
    };
    let bodies = task_set.dags().iter().map(of_dag).collect();
    let recorded = native::run_recorded(task_set.clone(), bodies, setting);
    assert_eq!(recorded.violations, []);
    assert_eq!(recorded.by_worker[0], 600);
    assert_eq!(recorded.by_worker[1] + recorded.by_worker[2], 600);
    assert_eq!(recorded.by_worker[3..], [600, 0], "no cluster has worker 4");
}

/// Runs what `commit` commits in all divisions of two and three clusters, at full speed and
/// written down.
fn in_all_divisions(commit: impl Fn(u32) -> Box<dyn Fn(&Report)>) {
    for sizes in DIVISIONS {
        for policy in [Policy::StaticPriority, Policy::Edf] {
            let clusters = u32::try_from(sizes.len()).expect("few");
            let machine = || {
                let workers = sizes.iter().sum();
                Native::new()
                    .workers(workers)
                    .clusters(sizes)
                    .policy(policy)
            };
            let of_run = machine();
            let judge = commit(clusters);
            judge(&of_run.run());
            let of_run = machine();
            let judge = commit(clusters);
            let recorded = of_run.run_recorded();
            assert_eq!(recorded.violations, [], "{policy:?}, {sizes:?}");
            judge(&recorded.report);
        }
    }
}

/// A sporadic DAG of one cluster whose job raises a signal to the next one.
fn player(name: &str, cluster: u32) -> (Dag, Signal) {
    let dag = create_dag();
    dag.name(name)
        .cluster(cluster)
        .jobs(JOBS)
        .relative_deadline(SHORTER);
    let signal = dag.sporadic(SHORTER);
    (dag, signal)
}

#[test]
fn signals_go_to_and_fro_until_the_last() {
    in_all_divisions(|clusters| {
        let (ping, to_ping) = player("ping", 0);
        let (pong, to_pong) = player("pong", clusters - 1);
        let begin = create_dag();
        begin.name("begin").cluster(clusters - 1).jobs(1);
        begin.period(PERIOD).relative_deadline(PERIOD);
        let raise = |mut signal: Raiser<'_>, _job| signal.raise();
        for (dag, signal) in [(&begin, &to_ping), (&ping, &to_pong), (&pong, &to_ping)] {
            dag.using(signal.raising())
                .register_untyped_subtask(raise, named("raise"));
        }
        finish_create_dags(&[ping, pong, begin]).expect("the DAGs are right");
        Box::new(|report| {
            // Only one is ever on its way, so none is too soon. After its last job the one that
            // was signalled first gets another signal.
            let completed = report.statistics.iter().map(|of| of.completed);
            assert_eq!(completed.collect::<Vec<_>>(), [JOBS, JOBS, 1]);
        })
    });
}

/// A sporadic DAG that counts its runs and notes what it samples.
fn listening(cluster: u32, latest: &Latest<u64>, seen: &Arc<AtomicU64>) -> (Dag, Signal) {
    let dag = create_dag();
    dag.name("listening")
        .cluster(cluster)
        .jobs(JOBS)
        .relative_deadline(SHORTER);
    let signal = dag.register_sporadic_subtask(|| (7u64,), vec!["heard"], SHORTER, named("hear"));
    let seen = Arc::clone(seen);
    dag.using(latest.sample()).register_sink_subtask(
        move |sample: Option<Sample<'_, u64>>, (own,): (u64,)| {
            let sample = sample.expect("it is shown before the signal is sent");
            assert_eq!((*sample.value, own), (sample.job, 7));
            let before = seen.swap(*sample.value, Relaxed);
            assert!(
                before == u64::MAX || before <= *sample.value,
                "values never go back"
            );
        },
        vec!["heard"],
        SHORTER,
        named("look"),
    );
    (dag, signal)
}

#[test]
fn no_signal_is_lost_and_what_it_tells_of_is_there() {
    in_all_divisions(|clusters| {
        let tells = create_dag();
        tells.name("tells").cluster(0).jobs(JOBS);
        let latest = tells.latest("count");
        let seen = Arc::new(AtomicU64::new(u64::MAX));
        let (listens, signal) = listening(clusters - 1, &latest, &seen);
        let mut count = 0u64;
        let source = move |mut signal: Raiser<'_>| {
            signal.raise();
            count += 1;
            (count - 1,)
        };
        tells.using(signal.raising()).register_periodic_subtask(
            source,
            vec!["count"],
            PERIOD,
            named("count"),
        );
        tells.register_sink_subtask(|_: (u64,)| (), vec!["count"], PERIOD, named("end"));
        finish_create_dags(&[listens, tells]).expect("the DAGs are right");
        Box::new(move |report| {
            let of_listener = &report.statistics[0];
            assert_eq!(of_listener.signals, JOBS);
            // What comes too soon is dropped only while another job is still to be released.
            assert_eq!(of_listener.completed + of_listener.dropped_signals, JOBS);
            assert!(of_listener.completed > 0);
            assert_eq!(seen.load(Relaxed), JOBS - 1, "the last one was heard");
            assert_eq!(report.statistics[1].completed, JOBS);
        })
    });
}

#[test]
#[should_panic(expected = "the third job")]
fn a_panic_in_one_cluster_ends_the_run_though_others_rest() {
    let machine = Native::new().workers(3).clusters(&[2, 1]);
    let (waits, signal) = player("waits", 0);
    waits.register_untyped_subtask(|_job| (), named("never"));
    let fails = create_dag();
    fails.name("fails").cluster(1).jobs(10);
    fails.period(PERIOD).relative_deadline(PERIOD);
    fails.using(signal.raising()).register_untyped_subtask(
        |_signal: Raiser<'_>, job| assert!(job != 2, "the third job"),
        named("fail"),
    );
    finish_create_dags(&[waits, fails]).expect("the DAGs are right");
    machine.run();
}

#[test]
#[should_panic(expected = "2 workers for clusters of 3 cores")]
fn fewer_workers_than_the_clusters_have_are_refused() {
    let [policy, sizes] = [Policy::Edf, Policy::Edf].map(|policy| (policy, [1, 2]));
    let setting = |workers| Setting {
        policy: policy.0,
        workers,
    };
    let specs = dealt(vec![spec(1, &[], 1), spec(1, &[], 1)], &sizes.1);
    let task_set = commit_divided(&specs, setting(3), &sizes.1);
    let (bodies, _) = checking(&task_set);
    native::run(task_set, bodies, setting(2));
}
