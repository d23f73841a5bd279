//! The short ways from a completion: [`Scheduler::hand_off`] and
//! [`Scheduler::hand_over`], where something else happens at the same instant.

mod support;

use sched_dag::{
    Activation, CoreId, DagId, DagSpec, Decision, HandOff, Instance, OverrunPolicy, Scheduler,
    SubtaskSpec,
};
use support::bench::Log;
use support::{PREEMPTIVE, TWO_CORES, cores, dag, instance, overrunning, scheduler};

const FIRST: CoreId = CoreId(0);
const SECOND: CoreId = CoreId(1);

fn chain(period_ns: u64, deadline_ns: u64, jobs: u64) -> DagSpec {
    dag(period_ns, deadline_ns, jobs, &[0, 0], &[(0, 1)])
}

fn dispatch(scheduler: &mut Scheduler, now_ns: u64) -> Vec<Decision> {
    scheduler
        .at(now_ns)
        .release_due(&mut ())
        .dispatch()
        .to_vec()
}

fn start(core: CoreId, instance: Instance) -> Decision {
    Decision::Start { core, instance }
}

/// What a completion by either short way is expected to bring.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Next {
    /// This instance, on the core for which it was asked.
    Starts(Instance),
    Idle,
    Open,
}

/// Finishes an instance that runs on core 0, by one way and by the other, each with a
/// scheduler of its own made by `make`.
fn finish(
    now_ns: u64,
    finished: Instance,
    make: impl Fn() -> Scheduler,
    next: Next,
    reported: &str,
) {
    for taker in [FIRST, SECOND] {
        let mut scheduler = make();
        let mut log = Log::default();
        let vertex = scheduler.vertex(finished);
        assert_eq!(scheduler.running(FIRST), Some(finished));
        let done = if taker == FIRST {
            scheduler.hand_off(now_ns, FIRST, vertex, &mut log)
        } else {
            scheduler.hand_over(now_ns, FIRST, vertex, taker, &mut log)
        };
        let expected = match next {
            Next::Starts(instance) => {
                HandOff::To(scheduler.vertex(instance), start(taker, instance))
            }
            Next::Idle => HandOff::Idle,
            Next::Open => HandOff::Open,
        };
        assert_eq!(done, expected, "for {taker:?}");
        assert_eq!(log.take(), reported, "for {taker:?}");
    }
}

#[test]
fn the_deadline_itself_is_in_time_and_the_next_instant_is_not() {
    // Both subtasks of one job with D = 10; the second one finishes.
    let running_the_second = || {
        let mut scheduler = scheduler(&[chain(100, 10, 2)], TWO_CORES);
        let _ = dispatch(&mut scheduler, 0);
        let vertex = scheduler.vertex(instance(0, 0, 0));
        let _ = scheduler.hand_off(4, FIRST, vertex, &mut ());
        scheduler
    };
    let last = instance(0, 0, 1);
    finish(10, last, running_the_second, Next::Idle, "Met 0");
    let missed = "missed 0, Missed 0";
    finish(11, last, running_the_second, Next::Idle, missed);
}

#[test]
fn a_deadline_that_passes_meanwhile_leaves_the_instant_open() {
    let running_the_first = || {
        let mut scheduler = scheduler(&[chain(100, 10, 2)], TWO_CORES);
        let _ = dispatch(&mut scheduler, 0);
        scheduler
    };
    let (first, second) = (instance(0, 0, 0), instance(0, 0, 1));
    finish(10, first, running_the_first, Next::Starts(second), "");
    // It is the rest of the instant that reports the miss.
    finish(11, first, running_the_first, Next::Open, "");
}

#[test]
fn a_release_at_the_same_instant_leaves_it_open() {
    let running_the_first = || {
        let mut scheduler = scheduler(&[chain(100, 200, 2)], TWO_CORES);
        let _ = dispatch(&mut scheduler, 0);
        scheduler
    };
    let (first, second) = (instance(0, 0, 0), instance(0, 0, 1));
    finish(99, first, running_the_first, Next::Starts(second), "");
    finish(100, first, running_the_first, Next::Open, "");
}

#[test]
fn a_release_that_has_waited_for_the_end_leaves_the_instant_open() {
    let spec = overrunning(dag(10, 100, 3, &[0], &[]), 1, OverrunPolicy::Queue);
    let with_one_waiting = || {
        let mut scheduler = scheduler(std::slice::from_ref(&spec), TWO_CORES);
        let _ = dispatch(&mut scheduler, 0);
        let _ = dispatch(&mut scheduler, 10);
        assert_eq!(scheduler.waiting(DagId(0)), 1);
        scheduler
    };
    finish(15, instance(0, 0, 0), with_one_waiting, Next::Open, "Met 0");
}

#[test]
fn a_signal_of_the_same_instant_leaves_it_open() {
    let sporadic = DagSpec {
        activation: Activation::Sporadic,
        ..dag(5, 5, 2, &[0], &[])
    };
    let signalled = || {
        let mut scheduler = scheduler(&[chain(100, 100, 1), sporadic.clone()], TWO_CORES);
        let _ = dispatch(&mut scheduler, 0);
        scheduler.at(7).signal(DagId(1), &mut ());
        scheduler
    };
    finish(7, instance(0, 0, 0), signalled, Next::Open, "");
}

#[test]
fn a_successor_that_is_first_in_line_is_cancelled_with_its_dag() {
    // DAG 0 goes first; DAG 1 waits in line on one core.
    let specs = [chain(100, 100, 1), dag(100, 100, 1, &[5], &[])];
    let mut scheduler = scheduler(&specs, PREEMPTIVE);
    assert_eq!(
        dispatch(&mut scheduler, 0),
        [start(FIRST, instance(0, 0, 0))]
    );
    let mut log = Log::default();
    let mut moment = scheduler.at(3);
    moment.complete(instance(0, 0, 0), &mut log);
    // Its successor is ready now, and the first in line.
    moment.stop(DagId(0), &mut log);
    let released = moment.release_due(&mut log);
    assert_eq!(released.dispatch(), [start(FIRST, instance(1, 0, 0))]);
    assert_eq!(
        log.take(),
        "ended 0, cancelled dag 0 job 0 subtask 1, DagEnded 0"
    );
}

#[test]
fn what_an_ended_dag_had_started_hands_over_to_others() {
    let specs = [chain(100, 100, 1), dag(100, 100, 1, &[5], &[])];
    let ended = || {
        let mut scheduler = scheduler(&specs, TWO_CORES);
        let _ = dispatch(&mut scheduler, 0);
        let other = scheduler.vertex(instance(1, 0, 0));
        let _ = scheduler.hand_off(1, SECOND, other, &mut ());
        let moment = {
            let mut moment = scheduler.at(2);
            moment.stop(DagId(0), &mut ());
            moment
        };
        assert!(moment.release_due(&mut ()).dispatch().is_empty());
        scheduler
    };
    let reported = "cancelled dag 0 job 0 subtask 1, DagEnded 0";
    finish(3, instance(0, 0, 0), ended, Next::Idle, reported);
}

#[test]
fn a_paused_dags_job_in_flight_goes_on_by_hand() {
    let paused = || {
        let mut scheduler = scheduler(&[chain(10, 100, 5)], TWO_CORES);
        let _ = dispatch(&mut scheduler, 0);
        let moment = {
            let mut moment = scheduler.at(2);
            moment.pause(DagId(0), &mut ());
            moment
        };
        assert!(moment.release_due(&mut ()).dispatch().is_empty());
        scheduler
    };
    let (first, second) = (instance(0, 0, 0), instance(0, 0, 1));
    finish(9, first, paused, Next::Starts(second), "");
    // The job that is due at 10 is skipped by the rest of the instant.
    finish(10, first, paused, Next::Open, "");
    let mut scheduler = paused();
    let vertex = scheduler.vertex(first);
    assert_eq!(
        scheduler.hand_over(10, FIRST, vertex, SECOND, &mut ()),
        HandOff::Open
    );
    let mut log = Log::default();
    let released = scheduler.at(10).release_due(&mut log);
    // The core that has finished is the one that became idle last.
    assert_eq!(released.dispatch(), [start(FIRST, second)]);
    assert_eq!(log.take(), "skipped 1");
}

#[test]
fn the_core_that_was_to_go_on_stays_the_first_to_be_given_something() {
    let specs = [dag(100, 100, 1, &[0], &[]), dag(50, 50, 2, &[1], &[])];
    let mut scheduler = scheduler(&specs, cores(3));
    let _ = dispatch(&mut scheduler, 0);
    for (at_ns, core, finished) in [
        (1, FIRST, instance(0, 0, 0)),
        (2, SECOND, instance(1, 0, 0)),
    ] {
        let vertex = scheduler.vertex(finished);
        let done = scheduler.hand_over(at_ns, core, vertex, CoreId(2), &mut ());
        assert_eq!(done, HandOff::Idle);
    }
    let decisions = dispatch(&mut scheduler, 50);
    assert_eq!(decisions, [start(CoreId(2), instance(1, 1, 0))]);
}

#[test]
fn cores_beyond_a_word_of_bits_take_over() {
    let count = 130;
    // A fork of as many branches as there are cores, and a join.
    let branches = 1..=count as usize;
    let edges = branches.flat_map(|branch| [(0, branch), (branch, count as usize + 1)]);
    let spec = DagSpec {
        period_ns: Some(1_000),
        relative_deadline_ns: Some(1_000),
        jobs: Some(1),
        subtasks: vec![SubtaskSpec::default(); count as usize + 2],
        edges: edges.collect(),
        ..DagSpec::default()
    };
    let mut scheduler = scheduler(&[spec], cores(count));
    let _ = dispatch(&mut scheduler, 0);
    let source = scheduler.vertex(instance(0, 0, 0));
    let open = scheduler.hand_over(1, FIRST, source, CoreId(129), &mut ());
    assert_eq!(open, HandOff::Open, "130 have become ready");
    assert_eq!(dispatch(&mut scheduler, 1).len(), 130);
    // All finish; the last to do so, on core 63, hands the join to core 64.
    let last = CoreId(63);
    for core in (0..count).map(CoreId).filter(|&core| core != last) {
        let branch = scheduler.running(core).expect("each core has a branch");
        let vertex = scheduler.vertex(branch);
        let done = scheduler.hand_off(2, core, vertex, &mut ());
        assert_eq!(done, HandOff::Idle);
    }
    let branch = scheduler.running(last).expect("it has the last one");
    let (vertex, join) = (scheduler.vertex(branch), instance(0, 0, 131));
    let done = scheduler.hand_over(3, last, vertex, CoreId(64), &mut ());
    let expected = HandOff::To(scheduler.vertex(join), start(CoreId(64), join));
    assert_eq!(done, expected);
    assert_eq!(scheduler.running(CoreId(64)), Some(join));
}

#[test]
fn a_dispatch_that_is_owed_leaves_the_instant_open() {
    // Two run, two are in line; an instant without dispatch has made core 1 idle.
    let spec = dag(100, 100, 1, &[0, 1, 2, 3], &[]);
    let owing = || {
        let mut scheduler = scheduler(std::slice::from_ref(&spec), TWO_CORES);
        let _ = dispatch(&mut scheduler, 0);
        scheduler.at(5).complete(instance(0, 0, 1), &mut ());
        scheduler
    };
    finish(5, instance(0, 0, 0), owing, Next::Open, "");
}

#[test]
#[should_panic(expected = "has to be idle")]
fn a_busy_core_cannot_take_over() {
    let specs = [chain(100, 100, 1), dag(100, 100, 1, &[5], &[])];
    let mut scheduler = scheduler(&specs, TWO_CORES);
    let _ = dispatch(&mut scheduler, 0);
    let vertex = scheduler.vertex(instance(0, 0, 0));
    let _ = scheduler.hand_over(1, FIRST, vertex, SECOND, &mut ());
}
