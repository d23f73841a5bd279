//! The evaluation on the machine: what joins every job does, what matches stamps does
//! what its rules say of the same execution times, and a run is the same every time.

use fork_join::ExecutionTimes;
use harness::Guest;
use pub_sub::workload::{self, Stamping};
use pub_sub::{ApproximateTime, Parameters};
use std::num::NonZeroUsize;
use std::thread;
use tool::Outcome;
use tool::protocol::{MachineLine, Status};

const JOBS: u64 = 150;

fn guest(words: &str) -> Guest {
    let guest = Guest::new("join-latency").cores(8).memory_mib(64);
    guest.word(&format!("jobs={JOBS}")).word(words)
}

fn summary(outcome: &Outcome) -> &MachineLine {
    let mut lines = outcome.transcript.of_kind("join_latency");
    lines
        .next()
        .unwrap_or_else(|| panic!("no summary\n{}", outcome.tail()))
}

/// Checks the counts of joins: of one job, across jobs, missing.
fn counts_are(outcome: &Outcome, expected: [u64; 3]) {
    let line = summary(outcome);
    let names = ["same_index", "cross_index", "missing"];
    let counts = names.map(|name| line.number_at(name).expect(name));
    assert_eq!(counts, expected, "{}", line.text);
    assert_eq!(line.number_at("allocations"), Some(0), "{}", line.text);
}

#[test]
fn a_dag_and_equal_stamps_join_every_job() {
    for policy in ["fass", "exact"] {
        let outcome = guest(&format!("policy_under_test={policy} subtasks=6")).succeed();
        counts_are(&outcome, [JOBS, 0, 0]);
    }
}

#[test]
fn a_dag_joins_within_microseconds() {
    let outcome = guest("policy_under_test=fass subtasks=4").succeed();
    let most_ns = summary(&outcome).number_at("join_latency_ns.max");
    assert!(most_ns.is_some_and(|ns| ns < 50_000), "{most_ns:?}");
}

#[test]
fn close_stamps_join_as_the_policy_does_in_virtual_time() {
    for (parallel, ms) in [(2, 10), (2, 50), (4, 30)] {
        let words = format!("max_interval_ms={ms} subtasks={parallel}");
        let outcome = guest(&format!("policy_under_test=approximate {words}")).succeed();
        let line = summary(&outcome);
        let joins = line.number_at("joins").expect("checked by the reader");

        let jobs = usize::try_from(JOBS).expect("small");
        let queue = NonZeroUsize::new(1000).expect("not 0");
        let parameters = Parameters::new(parallel, queue).max_interval_ns(ms * 1_000_000);
        let mut synchronizer = ApproximateTime::new(parameters);
        let mut times: Vec<ExecutionTimes> = (0..parallel)
            .map(|branch| ExecutionTimes::new(1, branch))
            .collect();
        let execution_ns = |branch: usize, _| {
            times[branch]
                .next_time()
                .as_nanos()
                .try_into()
                .expect("50 ms at most")
        };
        let record = workload::run(&mut synchronizer, Stamping::Publication, jobs, execution_ns);
        // A machine takes microseconds for what takes no time there, so that of
        // stamps that are nearly equally close now and then others win.
        let difference = joins.abs_diff(record.sets.len() as u64);
        assert!(
            difference <= 3,
            "{} joins in virtual time, {}",
            record.sets.len(),
            line.text
        );
    }
}

#[test]
fn a_queue_that_is_too_short_loses_joins_by_equal_stamps() {
    let outcome = guest("policy_under_test=exact subtasks=4 queue=1").succeed();
    let missing = summary(&outcome).number_at("missing");
    assert!(missing > Some(0), "{missing:?}");
}

#[test]
fn lost_inputs_make_a_condition_worthless() {
    let outcome = guest("policy_under_test=exact subtasks=2 depth=1").end_in(Status::Failure);
    let verdict = outcome.transcript.verdict().expect("checked before");
    assert!(verdict.reason.contains("`depth`"), "{}", verdict.reason);
}

/// Long runs, and several boots, since what the host does to a boot is rare: without
/// `kernel/executive/src/machine/counted_time.rs` one boot in ten is another, one in four where
/// the host is busy. One of some 150 differed with it, probably for one of two
/// reasons that were found and are gone now (docs/evaluation.md). Too few boots have been seen since to claim that none
/// is left, so one of four is let pass.
#[test]
fn long_runs_print_the_same_bytes() {
    let boot = |policy| {
        let guest = Guest::new("join-latency").cores(8).memory_mib(64);
        let words = format!("policy_under_test={policy} subtasks=6 jobs=2000");
        guest.word(&words).succeed().serial
    };
    let boots = |policy| {
        let boots: Vec<String> = (0..4).map(|_| boot(policy)).collect();
        let alike = |one: &String| boots.iter().filter(|other| *other == one).count();
        let most = boots.iter().map(alike).max().expect("there are boots");
        let differ = boots[0].lines().zip(boots[1].lines()).find(|(a, b)| a != b);
        assert!(
            most >= 3,
            "{policy}: only {most} of 4 are alike, the first two differ in {differ:?}"
        );
    };
    thread::scope(|scope| {
        scope.spawn(|| boots("fass"));
        scope.spawn(|| boots("approximate"));
    });
}

#[test]
fn too_few_cores_are_refused() {
    let outcome = guest("subtasks=7").end_in(Status::Usage);
    let reason = outcome.transcript.verdict().expect("checked before").reason;
    assert!(reason.contains("need 9 cores"), "{reason}");
}
