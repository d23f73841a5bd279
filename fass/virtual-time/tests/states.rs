//! States that subtasks of one DAG share, in virtual time.

mod support;

use support::run;

use fass::{Dag, create_dag, finish_create_dags};
use support::sharing::{Seen, job_numbers, ms, named, taking, work};
use virtual_time::VirtualTime;

/// source -> (left, middle, right) -> sink, where the three share a list.
fn sharing(jobs: u64) -> (Dag, Seen<(u64, Vec<&'static str>)>) {
    let dag = create_dag();
    dag.name("sharing").jobs(jobs);
    let order = dag.state("order", Vec::new());
    let source = job_numbers(0);
    dag.register_periodic_subtask(source, vec!["job"], ms(20), named("source"));
    for (name, time_ms) in [("left", 5), ("middle", 3), ("right", 1)] {
        dag.using(order.update())
            .subtask(move |order: &mut Vec<&'static str>, (job,): (u64,)| {
                work(time_ms);
                order.push(name);
                (job,)
            })
            .reads(&["job"])
            .writes(&[name])
            .register(named(name));
    }
    let (seen, keep) = Seen::shared();
    dag.using(order.read())
        .subtask(
            move |order: &Vec<&'static str>, (job, _, _): (u64, u64, u64)| {
                keep.add((job, order.clone()));
            },
        )
        .reads(&["left", "middle", "right"])
        .due(ms(20))
        .register(named("sink"));
    (dag, seen)
}

#[test]
fn updaters_take_turns_in_the_order_of_registration_and_keep_the_state_over_jobs() {
    let machine = VirtualTime::new().cores(4);
    let (dag, seen) = sharing(2);
    let report = run(&machine, &[dag]);
    let once = ["left", "middle", "right"];
    let twice = [once, once].concat();
    let seen = seen.all();
    assert_eq!(seen[..], [(0, once.to_vec()), (1, twice)]);
    let starts = |name| report.dag("sharing").subtask(name)[0].start_ns.unwrap();
    assert_eq!(starts("middle"), 5_000_000);
    assert_eq!(starts("right"), 8_000_000);
}

#[test]
fn the_bound_counts_the_precedence_of_a_state() {
    let bound = |shares| {
        let _machine = VirtualTime::new().cores(3);
        let dag = create_dag();
        dag.jobs(1);
        let state = dag.state("state", 0);
        dag.register_periodic_subtask(|| (1,), vec!["a"], ms(100), taking("source", 1));
        for name in ["left", "right"] {
            if shares {
                dag.using(state.update())
                    .subtask(|_: &mut i32, (a,): (i32,)| (a,))
                    .reads(&["a"])
                    .writes(&[name])
                    .register(taking(name, 10));
            } else {
                dag.register_subtask(|(a,): (i32,)| (a,), vec!["a"], vec![name], taking(name, 10));
            }
        }
        let sink = |_: &mut i32, (_, _): (i32, i32)| ();
        dag.using(state.update())
            .subtask(sink)
            .reads(&["left", "right"])
            .due(ms(100))
            .register(taking("sink", 1));
        let commit = finish_create_dags(&[dag]).unwrap();
        commit.answers()[0].verdict.bound().unwrap()
    };
    assert_eq!(bound(false), ms(12));
    assert_eq!(bound(true), ms(22));
}

#[test]
fn several_uses_are_a_tuple() {
    let machine = VirtualTime::new();
    let dag = create_dag();
    dag.jobs(3).relative_deadline(ms(10));
    let (sum, count) = (dag.state("sum", 0_u64), dag.state("count", 0_u64));
    dag.period(ms(10))
        .using((sum.update(), count.update()))
        .source(|(sum, count): (&mut u64, &mut u64)| {
            *count += 1;
            *sum += *count;
            (*sum,)
        })
        .writes(&["sum"])
        .register(named("add"));
    let check = |(sum, count): (&u64, &u64), (sent,): (u64,)| {
        assert_eq!((*sum, *sum), (sent, count * (count + 1) / 2));
    };
    dag.using((sum.read(), count.read()))
        .subtask(check)
        .reads(&["sum"])
        .due(ms(10))
        .register(named("check"));
    finish_create_dags(std::slice::from_ref(&dag)).unwrap();
    assert_eq!(machine.run().dag(&dag).statistics().completed, 3);
}

#[test]
#[should_panic(expected = "a state of another DAG is used")]
fn a_state_stays_in_its_dag() {
    let state = create_dag().state("state", 0);
    let _ = create_dag().using(state.update());
}
