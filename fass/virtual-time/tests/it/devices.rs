//! Answers of devices: which of them are taken, and which are given back.

use std::future::poll_fn;
use std::pin::Pin;
use std::sync::{Arc, Mutex};
use std::task::Poll;

use crate::support::{Seen, commit, every, ms, named, run, taking, work};
use fass::commit::{ConstructionPolicy, finish_create_dags_with};
use fass::shared::{Asker, DeviceDriver, TimedOut, create_device};
use fass::{Dag, OverrunPolicy, Unique, WaitFault, create_dag, finish_create_dags, sleep};
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

/// Runs a DAG whose first subtask asks a device that echoes after 1 ms, and whose second one gets what
/// the first one returns; both wait once, and the second one asks. Returns the message of its fault.
fn fault_of_asking<Fut>(ask: impl FnMut(Asker<u8, u8>) -> Fut + Send + 'static) -> String
where
    Fut: Future<Output = (Unique<Asker<u8, u8>>,)> + Send + 'static,
{
    let machine = VirtualTime::new().contain_panics();
    let (device, driver) = create_device("echo");
    machine.answers(driver, |number, _| [(ms(1), number)]);
    let dag = every(20, "faulty");
    let ask = dag.jobs(2).using(device.asking()).async_source(ask);
    ask.writes(&["echo"]).register(named("ask").wait(ms(3)));
    let passed =
        |(echo,): (Unique<Asker<u8, u8>>,)| async move { _ = echo.into_inner().ask(2).await };
    let passed = dag.async_subtask(passed).reads(&["echo"]);
    passed.register(named("passed").wait(ms(3)));
    let report = run(&machine, &[dag]);
    report.panics[0].message.clone()
}

#[test]
fn a_wait_is_of_one_instance_once_and_an_asker_of_one_subtask() {
    let outside = WaitFault::Outside.to_string();
    let polled_again = |echo: Asker<u8, u8>| async move {
        let mut answer = echo.ask(1);
        assert_eq!((&mut answer).await, Ok(1));
        _ = (&mut answer).await;
        unreachable!("it has no second answer");
    };
    assert_eq!(fault_of_asking(polled_again), outside);
    let passed_on = |echo: Asker<u8, u8>| async move {
        assert_eq!(echo.ask(1).await, Ok(1));
        (Unique::new(echo),)
    };
    assert_eq!(fault_of_asking(passed_on), outside);
}

#[test]
fn a_wait_that_is_kept_for_a_later_job_is_a_fault_there() {
    type Kept = Arc<Mutex<Option<Pin<Box<dyn Future<Output = ()> + Send>>>>>;
    let machine = VirtualTime::new().contain_panics();
    let (dag, kept) = (every(20, "keeps"), Kept::default());
    let keep = move || {
        let kept = Arc::clone(&kept);
        async move {
            let older = kept.lock().unwrap().take();
            if let Some(older) = older {
                return older.await;
            }
            let mut own = Some(Box::pin(sleep(ms(1))));
            poll_fn(|context| {
                let Some(mut wait) = own.take() else {
                    return Poll::Ready(());
                };
                let polled = wait.as_mut().poll(context);
                *kept.lock().unwrap() = Some(wait);
                polled
            })
            .await;
        }
    };
    dag.jobs(2)
        .async_source(keep)
        .register(named("keep").wait(ms(1)));
    let report = run(&machine, &[dag]);
    assert_eq!(report.dag("keeps").statistics().completed, 1);
    assert_eq!(report.panics[0].message, WaitFault::Outside.to_string());
}

#[test]
fn a_question_releases_the_dag_that_serves_it_and_that_time_counts() {
    // The DAG that serves is of another cluster, or takes longer than the wait.
    for (sizes, delayed, expected) in [
        (&[][..], false, [Ok(7), Ok(7)]),
        (&[1, 1], false, [Ok(7), Ok(7)]),
        (&[], true, [Err(TimedOut), Ok(7)]),
    ] {
        let machine = VirtualTime::new().contain_panics();
        let machine = machine.cores(2).clusters(sizes);
        let (kept, keep) = Seen::shared();
        let (device, mut driver) = create_device::<(), u32>("served");
        let (asks, serves) = (every(20, "asks"), create_dag());
        let ask = move |device: Asker<(), u32>| {
            let keep = keep.clone();
            async move {
                work(2);
                keep.add(device.ask(()).await);
            }
        };
        let ask = asks.jobs(2).using(device.asking()).async_source(ask);
        ask.register(named("ask").wait(ms(4)));
        serves.name("serves").relative_deadline(ms(10));
        assert!(device.served_by(&serves.sporadic(ms(10))));
        // One alone counts.
        assert!(!device.served_by(&serves.sporadic(ms(10))));
        let mut is_first = delayed;
        let serve = move || {
            work(if std::mem::take(&mut is_first) { 5 } else { 3 });
            let (ticket, ()) = driver.question().expect("it was released for one");
            let answered = driver.answer(ticket, 7);
            assert!(answered.is_ok() || delayed);
        };
        serves.source(serve).register(named("serve"));
        if !sizes.is_empty() {
            asks.cluster(0);
            serves.cluster(1);
        }
        let report = run(&machine, &[asks, serves]);
        assert_eq!(kept.all(), expected);
        let released: Vec<u64> = report
            .dag("serves")
            .jobs()
            .filter_map(|job| job.release_ns)
            .collect();
        // Not before the wait has begun (R3).
        assert_eq!(released, [2_000_000, 22_000_000]);
        assert_eq!(report.dag("asks").statistics().misses, 0);
    }
}

#[test]
fn a_device_that_a_dag_serves_needs_that_dag_in_the_commit() {
    let _machine = VirtualTime::new();
    let (device, _driver) = create_device::<(), u32>("served");
    let (asks, serves) = (every(20, "asks"), create_dag());
    device.served_by(&serves.sporadic(ms(10)));
    let ask = |device: Asker<(), u32>| async move { _ = device.ask(()).await };
    let ask = asks.using(device.asking()).async_source(ask);
    ask.register(named("ask").wait(ms(4)));
    let error = finish_create_dags(&[asks]).expect_err("nobody serves it");
    assert_eq!(error.faults()[0].code(), "signal_not_committed", "{error}");
}

#[test]
fn behind_the_commit_no_signal_is_a_devices_server() {
    let machine = VirtualTime::new();
    let (device, _driver) = create_device::<(), u32>("served");
    let asks = every(20, "asks");
    let ask = |device: Asker<(), u32>| async move { _ = device.ask(()).await };
    let ask = asks.jobs(2).using(device.asking()).async_source(ask);
    ask.register(named("ask").wait(ms(4)));
    finish_create_dags(&[asks]).unwrap();
    // Its DAG is in no plan, or in another one.
    assert!(!device.served_by(&create_dag().sporadic(ms(10))));
    assert_eq!(machine.run().jobs.len(), 2);
}
