//! Locks on threads.

use std::hint;
use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread;

use crate::support::{alone, breaches, every, mechanisms, ms, spin};
use fass::shared::Lock;
use fass::{SubtaskAttributes, finish_create_dags};
use linux::Mechanism;

#[test]
fn sections_of_a_lock_exclude_each_other() {
    static BOTH: Lock<[u64; 2]> = Lock::new("both", [0; 2]);
    for mechanism in mechanisms() {
        let alone = alone(2, mechanism);
        let of = |name: &str| {
            let dag = every(ms(1), name);
            dag.jobs(100);
            let add = |[first, second]: &mut [u64; 2]| {
                *first += 1;
                spin(20);
                *second += 1;
                assert_eq!(first, second);
            };
            let add_twice = move |()| (0..2).for_each(|_| BOTH.with(add));
            let source = dag.using(BOTH.entering(2)).source(add_twice);
            source.register(SubtaskAttributes::named("adds"));
            dag
        };
        finish_create_dags(&[of("a"), of("b")]).unwrap();
        let run = alone.machine.run().unwrap();
        assert_eq!((breaches(&run), run.faults()), (vec![], &[][..]));
        assert_eq!(BOTH.with(std::mem::take), [400; 2]);
    }
}

/// Has a section end by a fault that leaves its thread there, while another instance waits.
pub(crate) fn lose(section: fn(), cause: &str) {
    for mechanism in mechanisms() {
        let alone = alone(2, mechanism);
        let lost: &Lock<()> = Box::leak(Box::new(Lock::new("lost", ())));
        let is_in: &AtomicBool = Box::leak(Box::default());
        let dags = ["ends", "waits"].map(|name| every(ms(50), name).jobs(1).clone());
        let end = move |()| {
            lost.with(|()| {
                is_in.store(true, Relaxed);
                section();
            });
        };
        let wait = move |()| {
            while !is_in.load(Relaxed) {
                thread::yield_now();
            }
            lost.with(|()| ());
        };
        let attributes = |priority| SubtaskAttributes::named("enters").priority(priority);
        let source = dags[0].using(lost.entering(1)).source(end);
        source.register(attributes(0).budget(ms(20)));
        let source = dags[1].using(lost.entering(1)).source(wait);
        source.register(attributes(1));
        finish_create_dags(&dags).expect("they are right");
        let run = alone.machine.run().expect("it is committed");
        let causes: Vec<&str> = run.faults().iter().map(|fault| &*fault.cause).collect();
        let said = "lock `lost`: a fault has ended a section, and its data may be half changed";
        assert_eq!(causes, [cause, said]);
    }
}

#[test]
fn a_section_that_a_budget_ends_loses_the_lock_and_keeps_nobody_waiting() {
    static IS_OVER: AtomicBool = AtomicBool::new(false);
    let compute = || {
        while !IS_OVER.load(Relaxed) {
            hint::spin_loop();
        }
    };
    lose(compute, "its budget was exceeded");
    IS_OVER.store(true, Relaxed);
}

#[test]
fn a_thread_of_the_apps_own_enters_no_section_while_a_run_goes_on() {
    static FREE: Lock<u64> = Lock::new("free", 0);
    let enter = || thread::spawn(|| FREE.with(|count| *count += 1)).join();
    let alone = alone(1, Mechanism::Normal);
    let dag = every(ms(20), "spawns");
    dag.jobs(1);
    let spawns = move |_| resume_unwind(enter().expect_err("it is refused"));
    dag.register_untyped_subtask(spawns, SubtaskAttributes::named("spawns"));
    finish_create_dags(&[dag]).unwrap();
    assert!(enter().is_ok());
    let run = alone.machine.run().unwrap();
    let said = "lock `free`: a thread that is no instance enters a section while a run goes on; \
                enter it in a subtask, or before or after the run";
    assert_eq!(run.faults()[0].cause, said);
    assert!(enter().is_ok());
    assert_eq!(FREE.with(|count| *count), 2);
}
