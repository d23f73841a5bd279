//! Locks on threads.

use crate::support::{alone, breaches, mechanisms, ms, spin};
use fass::shared::Lock;
use fass::{FaultLimit, SubtaskAttributes, create_dag, finish_create_dags};
use linux::Mechanism;

#[test]
fn sections_of_a_lock_exclude_each_other() {
    static BOTH: Lock<[u64; 2]> = Lock::new("both", [0; 2]);
    for mechanism in mechanisms() {
        let alone = alone(2, mechanism);
        let of = |name: &str| {
            let dag = create_dag();
            dag.name(name)
                .jobs(100)
                .period(ms(1))
                .relative_deadline(ms(1));
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

#[test]
fn a_panic_in_a_section_loses_the_lock_and_what_is_not_stated_is_refused() {
    static LOST: Lock<u64> = Lock::new("lost", 0);
    static OTHER: Lock<u64> = Lock::new("other", 0);
    let alone = alone(1, Mechanism::Normal);
    let dag = create_dag();
    dag.name("careless")
        .jobs(3)
        .period(ms(20))
        .relative_deadline(ms(20));
    dag.survive_faults(FaultLimit {
        faults: 1,
        window: 1,
        in_all: 9,
    });
    let mut jobs = 0_u32..;
    let source = dag.source(move || (jobs.next().unwrap_or(3),));
    source
        .writes(&["job"])
        .register(SubtaskAttributes::named("source"));
    let make = || {
        |(), (job,): (u32,)| match job {
            0 => LOST.with(|_| panic!("in a section")),
            1 => LOST.with(|_| ()),
            _ => OTHER.with(|_| ()),
        }
    };
    let enter = dag.using(LOST.entering(1)).restarting(make);
    (enter.reads(&["job"]).due(ms(20))).register(SubtaskAttributes::named("enter"));
    finish_create_dags(&[dag]).unwrap();
    let run = alone.machine.run().unwrap();
    let causes: Vec<&str> = run
        .faults()
        .iter()
        .map(|fault| fault.cause.as_str())
        .collect();
    let expected = [
        "in a section",
        "lock `lost`: a fault has ended a section, and its data may be half changed",
        "lock `other`: the subtask enters a section and has not stated that, by \
         `dag.using(lock.entering(N))`",
    ];
    assert_eq!(causes, expected);
}
