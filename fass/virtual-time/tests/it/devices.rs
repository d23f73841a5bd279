//! Answers of devices: which of them are taken, and which are given back.

use crate::support::{Seen, commit, every, ms, taking, work};
use fass::commit::{ConstructionPolicy, finish_create_dags_with};
use fass::shared::{Asker, DeviceDriver, TimedOut, create_device};
use fass::{Dag, OverrunPolicy};
use virtual_time::VirtualTime;

type OneQuestion = (Dag, DeviceDriver<(), u32>);

/// A DAG of a subtask that asks a device of its name once, with that limit, and keeps what it gets.
fn asking_once(name: &str, limit: u64, keep: &Seen<Result<u32, TimedOut>>) -> OneQuestion {
    let (device, driver) = create_device(name);
    let dag = every(20, name);
    dag.jobs(1);
    let keep = keep.clone();
    let ask = dag.using(device.asking());
    let ask = ask.async_source(move |device: Asker<(), u32>| {
        let keep = keep.clone();
        async move { keep.add(device.ask(()).await) }
    });
    let stated = taking(name, 1).wait(ms(limit)).wcet(ms(1));
    ask.register(stated.priority(1));
    (dag, driver)
}

/// A DAG that has the core for 10 ms from then on.
fn busy(from: u64) -> Dag {
    let dag = every(100, "busy");
    dag.jobs(1).offset(ms(from));
    dag.register_untyped_subtask(|_| work(10), taking("busy", 10).priority(0));
    dag
}

#[test]
fn a_device_answers_its_own_questions_only() {
    let machine = VirtualTime::new().cores(2);
    let (kept, keep) = Seen::shared();
    let [(a, mut of_a), (b, mut of_b)] = ["a", "b"].map(|name| asking_once(name, 5, &keep));
    commit(&[a, b]);
    machine.run_for(ms(2));
    let (ticket, ()) = of_a.question().expect("a asks");
    assert!(of_b.question().is_some());
    assert_eq!(of_b.answer(ticket, 3), Err(3));
    assert_eq!(of_a.answer(ticket, 4), Ok(()));
    assert_eq!(machine.run().violations(), []);
    assert_eq!(kept.all(), [Ok(4), Err(TimedOut)]);
}

#[test]
fn an_answer_behind_the_limit_is_given_back_and_one_that_is_taken_arrives() {
    // Its wait ends at 6 ms, and it has a core at 12 ms.
    for (at, is_taken) in [(6, true), (7, false)] {
        let machine = VirtualTime::new();
        let (kept, keep) = Seen::shared();
        let (ask, mut driver) = asking_once("ask", 5, &keep);
        let busy = busy(2);
        commit(&[ask, busy]);
        machine.run_for(ms(at));
        let (ticket, ()) = driver.question().expect("it asks");
        assert_eq!(driver.answer(ticket, 3).is_ok(), is_taken);
        assert_eq!(driver.answer(ticket, 4), Err(4));
        assert_eq!(machine.run().violations(), []);
        assert_eq!(kept.all(), [if is_taken { Ok(3) } else { Err(TimedOut) }]);
    }
}

#[test]
fn an_answer_whose_job_is_gone_is_given_back() {
    let machine = VirtualTime::new().contain_panics();
    let (kept, keep) = Seen::shared();
    let [aborted, ended] = ["aborted", "ended"].map(|name| asking_once(name, 50, &keep));
    let ((by_abort, mut of_aborted), (by_fault, mut of_ended)) = (aborted, ended);
    by_abort.jobs(2).in_flight(1).overrun(OverrunPolicy::Abort);
    let fails = taking("fails", 4).priority(2);
    let fail = |_| {
        work(4);
        panic!("worn out")
    };
    by_fault.register_untyped_subtask(fail, fails);
    // At the abort, 20 ms, this has the core, so the next job does not start.
    let busy = busy(15);
    let any_graph = ConstructionPolicy::any_graph();
    finish_create_dags_with(&[by_abort, by_fault, busy], any_graph).expect("nothing is wrong");
    machine.run_for(ms(3));
    let tickets = [&mut of_aborted, &mut of_ended].map(|of| of.question().expect("it asks").0);
    machine.run_for(ms(18));
    assert_eq!(of_aborted.answer(tickets[0], 3), Err(3));
    assert_eq!(of_ended.answer(tickets[1], 4), Err(4));
    machine.run();
    assert_eq!(kept.all(), [Err(TimedOut)], "of the second job");
}
