//! Panics that are contained: what is kept, reset and made anew. (Which jobs a fault costs, and
//! when, the scenarios tell.)

use crate::support::{Seen, every, job_numbers, ms, named, one_in, run, ticking, work};
use fass::shared::Sample;
use fass::{Dag, FaultLimit, Unique, create_dag, finish_create_dags};
use virtual_time::VirtualTime;

/// At most one fault within three jobs.
const FAULT_LIMIT: FaultLimit = one_in(3, 8);

/// A DAG that drops jobs, with a source that counts them.
fn counting(jobs: u64) -> Dag {
    let dag = every(10, "counting");
    dag.jobs(jobs).survive_faults(FAULT_LIMIT);
    let source = dag.source(job_numbers(0));
    source.writes(&["job"]).register(named("source"));
    dag
}

#[test]
fn each_fault_costs_one_job_and_makes_the_function_anew_for_what_waits() {
    let machine = VirtualTime::new().cores(2).contain_panics();
    // The source runs ahead, so values wait for a function that is lost.
    let dag = create_dag();
    dag.name("ahead").jobs(12).in_flight(12);
    dag.survive_faults(FAULT_LIMIT);
    let mut jobs = 0_u64..;
    let source = move || (Unique::new(jobs.next().expect("it has no end")),);
    dag.register_periodic_subtask(source, vec!["job"], ms(10), named("source"));
    let (kept, keep) = Seen::shared();
    let make = move || {
        let keep = keep.clone();
        let mut calls = 0;
        move |(job,): (Unique<u64>,)| {
            calls += 1;
            work(25);
            assert!(calls != 5, "it is worn out");
            keep.add((*job, calls));
        }
    };
    let sink = dag.restarting(make).reads(&["job"]).due(ms(10));
    sink.register(named("sink"));
    let report = run(&machine, &[dag]);
    let first = (0..4).map(|job| (job, job + 1));
    let expected = first.chain((5..9).map(|job| (job, job - 4)));
    let expected: Vec<(u64, u64)> = expected.chain([(10, 1), (11, 2)]).collect();
    assert_eq!(kept.all(), expected);
    let ahead = report.dag("ahead");
    assert_eq!((ahead.statistics().faults, ahead.is_degraded()), (2, false));
}

#[test]
fn a_fault_while_the_next_function_is_made_ends_the_dag() {
    let machine = VirtualTime::new().contain_panics();
    let dag = counting(12);
    dag.survive_faults(one_in(1, 8));
    let mut made = 0;
    let make = move || {
        made += 1;
        assert!(made < 3, "there is no third one");
        |(job,): (u64,)| assert!(job != 2 && job != 4, "job {job}")
    };
    let sink = dag.restarting(make).reads(&["job"]);
    sink.register(named("sink"));
    let report = run(&machine, &[dag]);
    // Jobs 2 and 4 are lost; the function for job 5 cannot be made.
    let counts = report.dag("counting").statistics();
    let lost = (counts.faults, counts.restarts, counts.failed);
    assert_eq!((lost, counts.completed), ((3, 2, 2), 3));
}

#[test]
fn states_that_it_used_are_reset_and_others_are_not() {
    let machine = VirtualTime::new().contain_panics();
    let dag = counting(7);
    let (sum, count) = (dag.state("sum", 100_u64), dag.state("count", 0_u64));
    sum.reset_to(|| 200);
    let add = || {
        |sum: &mut u64, (job,): (u64,)| {
            *sum += 1000;
            assert!(job != 2 && job != 5, "in the middle of a change");
            *sum -= 1000 - job;
            (*sum,)
        }
    };
    let add = dag.using(sum.update()).restarting(add).reads(&["job"]);
    add.writes(&["sum"]).register(named("add"));
    let (kept, keep) = Seen::shared();
    let sink = move |(sum, count): (&u64, &mut u64), (sent,): (u64,)| {
        *count += 1;
        assert_eq!(*sum, sent);
        keep.add((sent, *count));
    };
    let sink = dag.using((sum.read(), count.update())).subtask(sink);
    sink.reads(&["sum"]).register(named("sink"));
    run(&machine, &[dag]);
    let expected = [(100, 1), (101, 2), (203, 3), (207, 4), (206, 5)];
    assert_eq!(kept.all(), expected);
}

#[test]
fn a_source_restarts_and_until_then_its_latest_value_stays() {
    let machine = VirtualTime::new().contain_panics();
    let dag = every(10, "pose");
    dag.jobs(4).survive_faults(FAULT_LIMIT);
    let make = || {
        let mut calls = 0_u32;
        move |()| {
            calls += 1;
            assert!(calls != 3, "the third one is broken");
            (calls,)
        }
    };
    let localize = dag.restarting(make).writes(&["pose"]);
    localize.register(named("localize"));
    let pose = dag.latest::<u32>("pose");
    let reader = every(10, "reader");
    reader.jobs(4).offset(ms(5));
    let (kept, keep) = Seen::shared();
    let read = move |pose: Option<Sample<'_, u32>>| {
        keep.add(pose.map(|pose| (pose.job, *pose.value)));
    };
    let read = reader.using(pose.sample()).source(read);
    read.register(named("read"));
    run(&machine, &[dag, reader]);
    let expected = [(0, 1), (1, 2), (1, 2), (3, 1)].map(Some);
    assert_eq!(kept.all(), expected);
}

#[test]
fn a_call_that_is_to_fail_must_be_in_the_commit() {
    let _machine = VirtualTime::new().fault("healthy", "drain", 1);
    let said = finish_create_dags(&[ticking("healthy", 1)]).expect_err("no such subtask");
    let expected = "subtask `drain` of dag `healthy`, which is to fail, is not in the commit; \
                    name one that is";
    assert!(said.to_string().contains(expected), "{said}");
}
