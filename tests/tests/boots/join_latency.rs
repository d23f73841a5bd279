//! The evaluation on the machine: a DAG and a join of equal stamps join every job, a join of close
//! stamps follows its rules for the same execution times, and a run is the same every time.

use std::thread;

use fork_join::ExecutionTimes;
use harness::workload;
use harness::{Guest, Members, Said};
use views::protocol::{MachineLine, Status};

const JOBS: u64 = 150;

fn guest(words: &str) -> Guest {
    let guest = Guest::new("join-latency").cores(8).memory_mib(64);
    guest.word(words)
}

/// Boots the evaluation for a number of jobs, and returns its summary.
fn summary(words: &str) -> MachineLine {
    let outcome = guest(&format!("jobs={JOBS} {words}")).succeed();
    let line = outcome.line("join_latency").clone();
    line.has([("allocations", 0)]);
    line
}

#[test]
fn a_dag_and_equal_stamps_join_every_job() {
    for policy in ["fass", "exact"] {
        let line = summary(&format!("policy_under_test={policy} subtasks=6"));
        line.has([("same_index", JOBS), ("cross_index", 0), ("missing", 0)]);
    }
    // On threads of the host, too.
    let words = "jobs=40 policy_under_test=exact subtasks=2";
    let outcome = guest(words).in_real_time().succeed();
    let line = outcome.line("join_latency");
    line.has([("same_index", 40), ("cross_index", 0), ("missing", 0)]);
}

#[test]
fn a_dag_joins_within_microseconds() {
    let line = summary("policy_under_test=fass subtasks=4");
    let most_ns = line.number("join_latency_ns.max");
    assert!(most_ns < 50_000, "{most_ns}");
}

#[test]
fn close_stamps_join_as_the_policy_does_in_virtual_time() {
    for (parallel, ms) in [(2, 10), (2, 50), (4, 30)] {
        let words = format!("max_interval_ms={ms} subtasks={parallel}");
        let line = summary(&format!("policy_under_test=approximate {words}"));
        let joins = line.number("joins");

        let times_ns = |branch| {
            let mut times = ExecutionTimes::new(1, branch);
            let ns = (0..JOBS).map(|_| times.next_time().as_nanos().try_into());
            ns.map(|ns| ns.expect("50 ms at most")).collect()
        };
        let times_ns: Vec<Vec<u64>> = (0..parallel).map(times_ns).collect();
        let samples = workload::run(ms, &times_ns);
        let in_virtual_time = samples.joins.len() as u64;
        // A machine takes microseconds for what takes no time there, so that of
        // stamps that are nearly equally close now and then others win.
        let difference = joins.abs_diff(in_virtual_time);
        assert!(
            difference <= 3,
            "{in_virtual_time} joins in virtual time, {}",
            line.text
        );
    }
}

#[test]
fn a_queue_that_is_too_short_loses_joins_by_equal_stamps() {
    let line = summary("policy_under_test=exact subtasks=4 queue=1");
    assert!(line.number("missing") > 0, "{}", line.text);
}

#[test]
fn lost_inputs_make_a_condition_worthless() {
    let guest = guest(&format!(
        "jobs={JOBS} policy_under_test=exact subtasks=2 depth=1"
    ));
    let reason = guest.end_in(Status::Failure).reason();
    assert!(reason.contains("`depth`"), "{reason}");
}

/// Compares long runs of several boots, since the host rarely changes a boot. Without
/// `kernel/executive/src/machine/counted_time.rs` one boot in ten differs, one in four on a busy
/// host. With it, one of some 150 boots differed, probably for one of two reasons found and removed
/// since (docs/paper.md). Too few boots have been seen since to claim that no other reason is left,
/// so the test tolerates one different boot of four.
#[test]
fn long_runs_print_the_same_bytes() {
    let boot = |policy| {
        let words = format!("policy_under_test={policy} subtasks=6 jobs=1000");
        guest(&words).succeed().serial
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
    let reason = guest("subtasks=7").refusal();
    assert!(reason.contains("need 9 cores"), "{reason}");
}
