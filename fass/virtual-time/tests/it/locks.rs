//! Locks: what the commit charges for their sections, and what a section may not do.

use std::time::Duration;

use crate::support::{every, job_numbers, ms, named, one_in, taking, work};
use fass::shared::Lock;
use fass::{Dag, Preemption, finish_create_dags};
use virtual_time::{Report, VirtualTime};

/// A DAG of one subtask that takes 2 ms, in the cluster if one is given.
fn one(name: &str, uses: Option<(&Lock<u32>, u32)>, cluster: Option<u32>) -> Dag {
    let dag = every(50, name);
    dag.jobs(1);
    if let Some(cluster) = cluster {
        dag.cluster(cluster);
    }
    let attributes = taking("of", 2).priority(0);
    match uses {
        Some((lock, sections)) => {
            let source = dag.using(lock.entering(sections)).source(|()| ());
            source.register(attributes);
        }
        None => {
            dag.register_untyped_subtask(|_| (), attributes);
        }
    }
    dag
}

/// Returns the beginning of the answer about the first of the DAGs.
fn first(_machine: &VirtualTime, dags: &[Dag]) -> String {
    let commit = finish_create_dags(dags).expect("nothing is wrong");
    let answer = commit.answers()[0].to_string();
    answer.split(", by").next().unwrap_or_default().to_owned()
}

#[test]
fn sections_are_charged_as_blocking_and_waits_for_the_other_cores() {
    let on = |cores| VirtualTime::new().cores(cores);
    let lock = Lock::new("registers", 0).longest(Duration::from_micros(100));
    let other = Lock::new("other", 0).longest(Duration::from_micros(50));
    let quiet = || one("quiet", None, None);
    let user = |name, sections| one(name, Some((&lock, sections)), None);
    let takes = |name, time: &str| format!("dag `{name}` takes at most {time}");
    assert_eq!(first(&on(1), &[quiet()]), takes("quiet", "2ms"));
    // A section delays an instance at its start, and what it preempts when that goes on.
    let alone = [quiet(), user("a", 3), one("b", Some((&other, 1)), None)];
    assert_eq!(first(&on(4), &alone), takes("quiet", "2.2ms"));
    // One of several users waits for three other cores anew if it is preempted while it waits.
    let shared = || [quiet(), user("a", 3), user("b", 1)];
    assert_eq!(first(&on(1), &shared()), takes("quiet", "2.2ms"));
    assert_eq!(first(&on(4), &shared()), takes("quiet", "2.5ms"));
    // Each of its sections waits for as many.
    let shared = || [user("a", 3), user("b", 1)];
    assert_eq!(first(&on(4), &shared()), takes("a", "3.4ms"));
    // Nobody is preempted, so nobody waits but to enter; the other DAG keeps one core of four.
    let keeps = on(4).preemption(Preemption::Disabled);
    assert_eq!(first(&keeps, &shared()), takes("a", "3.475ms"));
}

#[test]
fn a_lock_without_a_longest_section_bars_the_proof_of_its_cluster_by_name() {
    let lock = Lock::new("registers", 0);
    let machine = VirtualTime::new().cores(2).clusters(&[1, 1]);
    let dags = [
        one("quiet", None, Some(0)),
        one("user", Some((&lock, 1)), Some(0)),
        one("far", None, Some(1)),
    ];
    let commit = finish_create_dags(&dags).expect("nothing is wrong");
    let said = "is not proven to meet its deadlines: subtask `of` of dag `user` enters lock \
                `registers`, which has no longest section, and keeps what shares its cores waiting \
                there; state one by `Lock::longest`";
    for name in ["quiet", "user"] {
        let answer = commit.answer(name).to_string();
        assert!(answer.contains(said), "{answer}");
    }
    assert_eq!(commit.answer("far").verdict.bound(), Some(ms(2)));
    drop(machine);
}

/// Runs a DAG that survives faults, whose subtask states two sections of the first lock.
fn faults(stated: &'static Lock<u32>, work: impl FnMut(u64) + Send + 'static) -> Report {
    let machine = VirtualTime::new().contain_panics();
    let (dag, mut work) = (every(10, "user"), work);
    dag.jobs(4).survive_faults(one_in(1, 8));
    let source = dag.source(job_numbers(0));
    source.writes(&["job"]).register(named("source"));
    let call = move |(), (job,): (u64,)| work(job);
    let enter = dag.using(stated.entering(2)).falling_back(call, |(), _| ());
    enter.reads(&["job"]).due(ms(10)).register(named("enter"));
    finish_create_dags(&[dag]).expect("nothing is wrong");
    machine.run()
}

#[track_caller]
fn is_refused(report: &Report, job: u64, said: &str) {
    let [panic] = &report.panics[..] else {
        panic!("{:?}", report.panics)
    };
    assert_eq!((panic.instance.job, panic.message.as_str()), (job, said));
}

#[test]
fn what_is_not_stated_is_a_contained_fault_before_it_enters() {
    static STATED: Lock<u32> = Lock::new("stated", 0);
    static OTHER: Lock<u32> = Lock::new("other", 0);
    let report = faults(&STATED, |job| {
        STATED.with(|count| *count += 1);
        if job == 1 {
            OTHER.with(|count| *count += 1);
        }
    });
    let said = "lock `other`: the subtask enters a section and has not stated that, by \
                `dag.using(lock.entering(N))`";
    is_refused(&report, 1, said);
    // The app's main function may, as no run goes on.
    assert_eq!(
        (STATED.with(|count| *count), OTHER.with(|count| *count)),
        (2, 0)
    );
    let report = faults(&STATED, |job| {
        (0..=2 * (job / 2)).for_each(|_| STATED.with(|count| *count += 1));
    });
    let said = "lock `stated`: the subtask enters more sections than it states; state them all, by \
                `dag.using(lock.entering(N))`";
    is_refused(&report, 2, said);
    assert_eq!(STATED.with(|count| *count), 2 + 1 + 1 + 2);
}

#[test]
fn a_section_in_a_section_is_refused_and_a_fault_in_one_loses_the_lock() {
    static NESTED: Lock<u32> = Lock::new("nested", 0);
    let report = faults(&NESTED, |_| NESTED.with(|_| NESTED.with(|_| ())));
    let said = "lock `nested`: the caller is in a section already; end that first";
    is_refused(&report, 0, said);
    let lost = std::panic::catch_unwind(|| NESTED.with(|_| ())).expect_err("it is lost");
    let said = "lock `nested`: a fault has ended a section, and its data may be half changed";
    assert_eq!(
        lost.downcast_ref::<String>().map(String::as_str),
        Some(said)
    );
}

#[test]
fn a_section_that_takes_longer_than_stated_is_said_once() {
    static SHORT: Lock<u32> = Lock::new("short", 0).longest(Duration::from_micros(10));
    let report = faults(&SHORT, |job| {
        SHORT.with(|_| work(job / 2));
    });
    let [said] = &report.logs[..] else {
        panic!("{:?}", report.logs)
    };
    let text = "a section has taken longer than its lock states, so no bound holds";
    let fields = r#"lock="short" took_ns=1000000 longest_ns=10000"#;
    assert!(said.starts_with("error user/enter[2] "), "{said}");
    assert!(said.ends_with(&format!("{text} {fields}")), "{said}");
}

#[test]
fn what_an_earlier_run_has_stated_lets_nobody_enter() {
    static STATED: Lock<u32> = Lock::new("stated", 0);
    let earlier = VirtualTime::new();
    finish_create_dags(&[one("user", Some((&STATED, 9)), None)]).expect("nothing is wrong");
    earlier.run();
    // That machine keeps its functions, with what they may enter, as a fault does.
    let later = VirtualTime::new().contain_panics();
    let dag = every(9, "user");
    dag.jobs(1);
    dag.register_untyped_subtask(|_| STATED.with(|_| ()), named("enters"));
    finish_create_dags(&[dag]).expect("nothing is wrong");
    let said = "lock `stated`: the subtask enters a section and has not stated that, by \
                `dag.using(lock.entering(N))`";
    is_refused(&later.run(), 0, said);
    drop(earlier);
}
