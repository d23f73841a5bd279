//! What drivers of a real machine meet and virtual time does not: completions
//! of instances that are preempted meanwhile, clocks that go back, mistakes.

mod support;

use sched_dag::{CoreId, Decision, Instance, Scheduler};
use support::{PREEMPTIVE, cores, dag, instance, scheduler, start, step};

/// DAG 0, which DAG 1 preempts at 2.
fn preempted_at_2(count: u32) -> Scheduler {
    let mut urgent = dag(100, 100, 1, &[0], &[]);
    urgent.offset_ns = 2;
    let specs = [dag(100, 100, 1, &[5, 5], &[(0, 1)]), urgent];
    let mut scheduler = scheduler(&specs, cores(count));
    assert_eq!(step(&mut scheduler, 0, &[]), [start(0, instance(0, 0, 0))]);
    scheduler
}

fn resume(core: u32, instance: Instance) -> Decision {
    Decision::Resume {
        core: CoreId(core),
        instance,
    }
}

fn preempt(core: u32, instance: Instance) -> Decision {
    Decision::Preempt {
        core: CoreId(core),
        instance,
    }
}

#[test]
fn a_preempt_stands_right_before_the_start_on_its_core() {
    let mut scheduler = preempted_at_2(1);
    assert_eq!(
        step(&mut scheduler, 2, &[]),
        [preempt(0, instance(0, 0, 0)), start(0, instance(1, 0, 0))]
    );
    assert_eq!(scheduler.running(CoreId(0)), Some(instance(1, 0, 0)));
    assert_eq!(
        step(&mut scheduler, 5, &[instance(1, 0, 0)]),
        [resume(0, instance(0, 0, 0))]
    );
}

#[test]
fn a_preempted_instance_may_complete() {
    let mut scheduler = preempted_at_2(1);
    let _ = step(&mut scheduler, 2, &[]);
    // It had finished before the interrupt reached its core. Its successor is
    // ready, but the core belongs to DAG 1 now.
    assert_eq!(step(&mut scheduler, 3, &[instance(0, 0, 0)]), []);
    assert_eq!(scheduler.running(CoreId(0)), Some(instance(1, 0, 0)));
    // The successor starts; nothing resumes what has completed.
    assert_eq!(
        step(&mut scheduler, 6, &[instance(1, 0, 0)]),
        [start(0, instance(0, 0, 1))]
    );
    assert_eq!(step(&mut scheduler, 7, &[instance(0, 0, 1)]), []);
    assert!(scheduler.is_finished());
}

#[test]
fn a_preempted_instance_may_complete_at_the_instant_of_its_preemption() {
    let mut scheduler = preempted_at_2(1);
    let _ = step(&mut scheduler, 2, &[]);
    assert_eq!(
        step(&mut scheduler, 2, &[instance(0, 0, 0), instance(1, 0, 0)]),
        [start(0, instance(0, 0, 1))]
    );
}

#[test]
fn of_several_preempted_instances_each_may_complete() {
    let mut urgent = dag(100, 100, 1, &[0, 1], &[]);
    urgent.offset_ns = 2;
    let low = dag(100, 100, 1, &[7, 8], &[]);
    let mut scheduler = scheduler(&[low, urgent], cores(2));
    let _ = step(&mut scheduler, 0, &[]);
    // The largest key gives way first.
    assert_eq!(
        step(&mut scheduler, 2, &[]),
        [
            preempt(1, instance(0, 0, 1)),
            start(1, instance(1, 0, 0)),
            preempt(0, instance(0, 0, 0)),
            start(0, instance(1, 0, 1)),
        ]
    );
    assert_eq!(step(&mut scheduler, 3, &[instance(0, 0, 1)]), []);
    assert_eq!(
        step(&mut scheduler, 4, &[instance(1, 0, 1)]),
        [resume(0, instance(0, 0, 0))]
    );
    assert_eq!(step(&mut scheduler, 5, &[instance(1, 0, 0)]), []);
    assert_eq!(scheduler.running(CoreId(1)), None);
    assert_eq!(step(&mut scheduler, 6, &[instance(0, 0, 0)]), []);
    assert!(scheduler.is_finished());
}

#[test]
fn a_clock_that_goes_back_stands_still() {
    let mut scheduler = preempted_at_2(1);
    let _ = step(&mut scheduler, 50, &[]);
    let _ = step(&mut scheduler, 40, &[]);
    assert_eq!(scheduler.now_ns(), 50);
}

#[test]
fn next_event_covers_releases_and_deadlines() {
    let mut scheduler = scheduler(&[dag(10, 4, 2, &[0], &[])], PREEMPTIVE);
    assert_eq!(scheduler.next_event_ns(), Some(0));
    let _ = step(&mut scheduler, 0, &[]);
    assert_eq!(scheduler.next_event_ns(), Some(5));
    let _ = step(&mut scheduler, 5, &[]);
    assert_eq!(scheduler.next_event_ns(), Some(10));
    let _ = step(&mut scheduler, 6, &[instance(0, 0, 0)]);
    let _ = step(&mut scheduler, 10, &[]);
    let _ = step(&mut scheduler, 11, &[instance(0, 1, 0)]);
    assert_eq!(scheduler.next_event_ns(), None);
}

#[test]
#[should_panic(expected = "dag 0 job 0 subtask 1 is completed and has not started")]
fn completing_what_has_not_started_is_refused() {
    let mut scheduler = preempted_at_2(1);
    let _ = step(&mut scheduler, 1, &[instance(0, 0, 1)]);
}

#[test]
#[should_panic(expected = "complete each once")]
fn completing_twice_is_refused() {
    let mut scheduler = preempted_at_2(1);
    let _ = step(&mut scheduler, 1, &[instance(0, 0, 0), instance(0, 0, 0)]);
}

#[test]
#[should_panic(expected = "dag 0 job 1 subtask 0")]
fn completing_another_job_is_refused() {
    let mut scheduler = preempted_at_2(1);
    let _ = step(&mut scheduler, 1, &[instance(0, 1, 0)]);
}

#[test]
fn hundreds_of_cores_are_served() {
    let priorities: Vec<u32> = (0..500).collect();
    let mut scheduler = scheduler(&[dag(1000, 1000, 1, &priorities, &[])], cores(300));
    let decisions = step(&mut scheduler, 0, &[]);
    assert_eq!(decisions.len(), 300);
    for core in 0..300 {
        assert_eq!(scheduler.running(CoreId(core)), Some(instance(0, 0, core)));
    }
}

#[test]
fn an_idle_core_that_the_driver_prefers_is_taken_first() {
    // Core 1 would be; core 2 is taken if it is preferred, and a busy one is not.
    for (preferred, taken) in [(0, 1), (1, 1), (2, 2)] {
        let mut scheduler = preempted_at_2(3);
        let mut moment = scheduler.at(2);
        moment.prefer(CoreId(preferred));
        let decisions = moment.release_due(&mut ()).dispatch();
        assert_eq!(decisions, [start(taken, instance(1, 0, 0))]);
    }
}
