//! Cases that only a test that drives the scheduler itself shows: the ends of
//! time and numbers that go on; what else happens at the instant at which a completion takes the
//! short way, [`Scheduler::pass_on`](sched_dag::Scheduler::pass_on); and what drivers of a real
//! machine may do: mistakes, clocks that go back, cores that are preferred. (That they come late, or
//! end what has lost its core meanwhile, and that the short way comes to the same as the long one,
//! random walks tell: `properties`.)

use std::panic::catch_unwind;

use sched_dag::virtual_time::{ExecutionTimes, RunOutcome};
use sched_dag::{
    CommitOptions, ConstructionPolicy, DagSpec, OverrunPolicy, Policy, Scheduler, verify,
};

use crate::support::hand::Hand;
use crate::support::{
    PREEMPTIVE, Run, Script, Spec, TWO_CORES, cores, dag, driver, instance, under,
};

/// Runs one that has further jobs, of which none can be due.
fn unlimited(spec: DagSpec, policy: Policy) -> Run {
    Script::new(1).run(driver(&[spec], under(policy)))
}

#[test]
fn releases_go_on_as_long_as_there_is_an_instant_after_the_deadline() {
    // Deadlines at 9, 6 and 3 before the last time; the next one would be at it.
    for policy in [Policy::StaticPriority, Policy::Edf] {
        let spec = dag(3, 2, 3, &[0, 0], &[(0, 1)])
            .offset(u64::MAX - 11)
            .endless();
        let end = format!("now={}, completed=3, misses=0, next=never", u64::MAX - 3);
        unlimited(spec, policy).must_be(&end);
    }
    let spec = dag(u64::MAX, 1, 1, &[0], &[]).endless();
    unlimited(spec, Policy::Edf).must_be("released=1");
}

#[test]
fn the_last_deadline_that_there_is_can_be_met_and_missed() {
    let (begin_ns, end_ns, late_ns) = (u64::MAX - 5, u64::MAX - 1, u64::MAX);
    for end in [
        format!("{end_ns} finish: completed 0.0 Met"),
        format!("{late_ns} finish: missed 0.0, completed 0.0 Missed"),
    ] {
        let spec = dag(u64::MAX, 4, 1, &[0], &[]).offset(begin_ns);
        let mut hand = Hand::new(&[spec], PREEMPTIVE);
        assert_eq!(hand.scheduler.next_event_ns(), Some(begin_ns));
        hand.must(&format!(
            "{begin_ns}: released 0.0, next={late_ns}\n{end}, finished=true, next=never"
        ));
    }
}

#[test]
fn an_instance_that_cannot_end_before_the_end_of_time_says_so() {
    let spec = dag(1, 4, 1, &[0], &[]).offset(u64::MAX - 5);
    let mut run = driver(&[spec], PREEMPTIVE);
    let end = run.run(&mut ExecutionTimes(|_| 6));
    assert_eq!(end, RunOutcome::TimeOverflow(instance(0, 0, 0)));
}

#[test]
fn a_signal_is_dropped_if_the_instant_after_its_deadline_is_no_time() {
    for (at_ns, comes) in [
        (u64::MAX - 6, "signalled 0.0, released 0.0"),
        (u64::MAX - 5, "dropped 0.0"),
    ] {
        let spec = dag(5, 5, 3, &[0], &[]).sporadic();
        Hand::new(&[spec], PREEMPTIVE).must(&format!("{at_ns} signal: {comes}"));
    }
    let spec = dag(1 << 63, 5, 3, &[0], &[]).endless().sporadic();
    // The next job could be due at 2^63 + 2^63 + 7, after the end of time.
    Hand::new(&[spec], PREEMPTIVE).must(
        "9223372036854775815 signal: signalled 0.0, due 0.0, released 0.0
         9223372036854775816 finish: completed 0.0 Met
         9223372036854775817 signal: dropped 0.1, next=never, dropped_signals=1, over=true",
    );
}

#[test]
fn without_a_limit_of_jobs_a_dag_is_not_over_unless_it_waits_for_a_signal() {
    let endless = || dag(10, 10, 1, &[0], &[]).endless();
    Hand::new(&[endless()], PREEMPTIVE).must(
        "0: released 0.0, finished=false
         5 finish: completed 0.0 Met, finished=false",
    );
    // The second signal is kept until 17.
    Hand::new(&[endless().sporadic()], PREEMPTIVE).must(
        "0: finished=true
         7 signal: released 0.0, finished=false
         9 finish: completed 0.0 Met, finished=true
         10 signal: finished=false
         17: released 0.1, finished=false",
    );
}

#[test]
fn numbers_go_on_over_many_skipped_jobs() {
    // One job runs while thousands are skipped; slots are counted by sequence.
    let spec = dag(1, 1_000_000, 3, &[0, 0], &[(0, 1)]).overrunning(3, OverrunPolicy::Skip);
    let spec = spec.with(|spec| spec.jobs = Some(100_000));
    let skipped: Vec<String> = (3..=50_000).map(|job| format!("skipped 0.{job}")).collect();
    // Blocked as long as any job is in flight whose number is less by 3 or more; oldest first.
    Hand::new(&[spec], PREEMPTIVE).must(&format!(
        "50000: released 0.0, released 0.1, released 0.2, {}, in_flight=3, skips=49998, runs=0.0.0
         50001 finish: skipped 0.50001, runs=0.0.1
         50001 finish: completed 0.0 Met, runs=0.1.0
         50002 finish: skipped 0.50002, runs=0.1.1
         50002 finish: completed 0.1 Met, runs=0.2.0
         50003 finish: skipped 0.50003, runs=0.2.1
         50003 finish: completed 0.2 Met
         50004: released 0.50004",
        skipped.join(", ")
    ));
}

fn chain(period_ns: u64, deadline_ns: u64, jobs: u64) -> DagSpec {
    dag(period_ns, deadline_ns, jobs, &[0, 0], &[(0, 1)])
}

#[test]
fn a_deadline_or_a_release_of_the_same_instant_leaves_it_open() {
    for (deadline_ns, script) in [
        // The deadline itself is in time. A later miss is reported by the rest of the instant.
        (10, "10 hand 0.0.0: start 0.0.1 on 0, done=on 0"),
        (
            10,
            "11 hand 0.0.0: done=Some(Open)
             11: missed 0.0, start 0.0.1 on 0",
        ),
        // So is the sink's, and it reports its own miss.
        (
            10,
            "4 hand 0.0.0: start 0.0.1 on 0
             10 hand 0.0.1: completed 0.0 Met, done=Some(Idle)",
        ),
        (
            10,
            "4 hand 0.0.0: start 0.0.1 on 0
             11 hand 0.0.1: missed 0.0, completed 0.0 Missed, done=Some(Idle)",
        ),
        (200, "99 hand 0.0.0: start 0.0.1 on 0, done=on 0"),
        (
            200,
            "100 hand 0.0.0: done=Some(Open)
             100: released 0.1, start 0.0.1 on 0, start 0.1.0 on 1",
        ),
        // The job that is due is skipped by the rest of the instant, too.
        (
            200,
            "2 pause: off 0
             99 hand 0.0.0: start 0.0.1 on 0, done=on 0",
        ),
        (
            200,
            "2 pause: off 0
             100 hand 0.0.0: done=Some(Open)
             100: skipped 0.1, start 0.0.1 on 0",
        ),
    ] {
        let script = format!("0: released 0.0, start 0.0.0 on 0\n{script}");
        Hand::new(&[chain(100, deadline_ns, 2)], TWO_CORES).must(&script);
    }
}

#[test]
fn a_signal_of_the_same_instant_leaves_it_open() {
    let signalled = dag(5, 5, 2, &[0], &[]).sporadic();
    Hand::new(&[chain(100, 100, 1), signalled], TWO_CORES).must(
        "0: released 0.0
         7 signal 1, open
         7 hand 0.0.0: done=Some(Open)",
    );
}

/// DAG 0, which DAG 1 preempts at 2.
fn preempted_at_2(count: u32) -> Hand {
    let urgent = dag(100, 100, 1, &[0], &[]).offset(2);
    let mut hand = Hand::new(
        &[dag(100, 100, 1, &[5, 5], &[(0, 1)]), urgent],
        cores(count),
    );
    hand.must("0: released 0.0, start 0.0.0 on 0");
    hand
}

#[test]
fn a_clock_that_goes_back_stands_still() {
    preempted_at_2(1).must("50: released 1.0\n40: now=50");
}

#[test]
fn an_end_of_what_does_not_run_is_refused() {
    for (script, expected) in [
        (
            "1 finish 0.0.1",
            "dag 0 job 0 subtask 1 is completed and has not started",
        ),
        (
            "1 fail 0.0.1",
            "dag 0 job 0 subtask 1 fails and has not started",
        ),
        ("1 finish 0.0.0, finish 0.0.0", "complete each once"),
        ("1 finish 0.1.0", "dag 0 job 1 subtask 0"),
    ] {
        let run = catch_unwind(|| _ = preempted_at_2(1).must(script));
        let refused = run.expect_err(script);
        let said: &String = refused.downcast_ref().expect("a text");
        assert!(said.contains(expected), "{said}");
    }
}

/// A chain with these lists, next to a less urgent DAG of four subtasks.
fn listed_chain(lists: &[&str], in_flight: u32) -> Hand {
    let chain = dag(100, 100, 1, &[0, 0], &[(0, 1)]).with(|spec| spec.in_flight = Some(in_flight));
    let others = dag(100, 100, 1, &[5, 6, 7, 8], &[]);
    let options = CommitOptions::new(TWO_CORES.policy, TWO_CORES.cores).with_lists(lists);
    let options = options.with_construction(ConstructionPolicy::any_graph());
    let task_set = verify(&[chain, others], &options)
        .expect("nothing is wrong")
        .task_set;
    let mut hand = Hand::of(Scheduler::new(task_set.into(), TWO_CORES));
    hand.must("0: released 0.0, released 1.0, start 0.0.0 on 0, start 1.0.0 on 1");
    hand
}

#[test]
fn a_chain_on_one_list_is_handed_on_past_the_line() {
    // With one slot, and with several.
    for in_flight in [1, 2] {
        listed_chain(&["core 0: 0.0 0.1"], in_flight).must(
            "4 hand 0.0.0: start 0.0.1 on 0, done=on 0
             9 hand 0.0.1: completed 0.0 Met, start 1.0.1 on 0, done=on 0",
        );
        listed_chain(&["core 0: 0.0", "core 1: 0.1"], in_flight).must(
            "4 hand 0.0.0: done=Some(Open)
             4: suspend 1.0.0 on 1, start 0.0.1 on 1, resume 1.0.0 on 0",
        );
    }
}

/// A chain of an affinity to the last core, next to DAGs of three less urgent subtasks there and
/// before it.
fn chain_in_a_group(in_flight: u32) -> Hand {
    let affinity = |of: DagSpec, cores: &[u32]| of.with(|spec| spec.affinity = cores.to_vec());
    let chain = dag(100, 100, 1, &[0, 0], &[(0, 1)]).with(|spec| spec.in_flight = Some(in_flight));
    let others = |priorities: &[u32]| dag(100, 100, 1, priorities, &[]);
    let specs = [
        affinity(chain, &[2]),
        affinity(others(&[5, 6, 7]), &[2]),
        affinity(others(&[3, 4, 8]), &[1, 0, 1]),
    ];
    let mut hand = Hand::new(&specs, cores(3));
    hand.must(
        "0: released 0.0, released 1.0, released 2.0, \
         start 2.0.0 on 0, start 2.0.1 on 1, start 0.0.0 on 2",
    );
    hand
}

#[test]
fn a_chain_of_a_group_of_one_core_is_handed_on() {
    for in_flight in [1, 2] {
        // The first in line is less urgent, so a dispatch is not needed; nor for the next group.
        chain_in_a_group(in_flight).must(
            "4 hand 0.0.0: start 0.0.1 on 2, done=on 2
             6 hand 2.0.0: start 2.0.2 on 0, done=on 0
             9 hand 0.0.1: completed 0.0 Met, start 1.0.0 on 2, done=on 2
             9 hand 2.0.1: done=Some(Idle)
             9 hand 1.0.0: start 1.0.1 on 2, done=on 2",
        );
    }
}

#[test]
fn of_the_idle_cores_of_a_group_the_preferred_one_is_taken_first() {
    for (preferred, taken) in [(0, 2), (1, 1), (2, 2)] {
        let grouped = dag(100, 100, 1, &[0], &[]).offset(2);
        let grouped = grouped.with(|spec| spec.affinity = vec![1, 2]);
        let others = dag(100, 100, 1, &[1], &[]).with(|spec| spec.affinity = vec![0]);
        let mut hand = Hand::new(&[others, grouped], cores(3));
        hand.must(&format!(
            "0: released 0.0, start 0.0.0 on 0
             1 prefer 2:
             2 prefer {preferred}: released 1.0, start 1.0.0 on {taken}"
        ));
    }
}

#[test]
fn an_idle_core_that_the_driver_prefers_is_taken_first() {
    // Core 1 would be; core 2 is taken if it is preferred, and a busy one is not.
    for (preferred, taken) in [(0, 1), (1, 1), (2, 2)] {
        preempted_at_2(3).must(&format!(
            "2 prefer {preferred}: released 1.0, start 1.0.0 on {taken}"
        ));
    }
}
