//! Bodies of subtasks that wait, driven by hand: what each turn asks for, when a future is dropped,
//! and that nothing is allocated.

use core::time::Duration;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Barrier};
use std::thread;

use crate::no_allocation::counting::allocated;
use crate::support::{PERIOD, answers, commit, named, panic_message};
use fass::platform::{Request, SubtaskCode};
use fass::shared::{
    Asker, Device, DeviceEnd, Raiser, Sample, TimedOut, Wire, WireReader, WireWriter, create_device,
};
use fass::{Dag, create_dag, sleep, until};
use sched_dag::DagId;
use sched_dag::lifecycle::WaitId;
use sched_dag::lifecycle::WaitLimit::{self, For, SinceRelease};

fn dag() -> Dag {
    let dag = create_dag();
    dag.period(PERIOD).relative_deadline(PERIOD);
    dag
}

/// Takes a turn, and returns what its end asks for, or the wait that it ends in.
fn turn(body: &mut SubtaskCode, job: u64) -> Result<Vec<Request>, WaitLimit> {
    let mut asked = Vec::new();
    body.run(job);
    let wait = body.complete(0, &mut |request| asked.push(request));
    assert!(wait.is_none() || asked.is_empty(), "{asked:?}");
    wait.map_or(Ok(asked), Err)
}

/// Keeps a number for a test.
fn number() -> (Arc<AtomicU64>, Arc<AtomicU64>) {
    let number = Arc::<AtomicU64>::default();
    (Arc::clone(&number), number)
}

#[test]
fn a_turn_that_ends_in_a_wait_asks_for_that_alone() {
    let (dag, other, reader) = (dag(), create_dag(), dag());
    other.relative_deadline(PERIOD);
    let signal = other.sporadic(PERIOD);
    other.source(|| ()).register(named("other"));
    let us = Duration::from_micros;
    let (returned, counter) = number();
    let f = move || {
        let counter = Arc::clone(&counter);
        async move {
            sleep(us(3)).await;
            until(us(4)).await;
            (counter.fetch_add(1, Relaxed) + 1,)
        }
    };
    let f = dag.async_source(f).writes(&["count"]);
    f.register(named("f").wait(us(3)).wait(us(4)));
    let raise = |mut raiser: Raiser<'_>, (_,): (u64,)| raiser.raise();
    let raise = dag.using(signal.raising()).subtask(raise);
    raise.reads(&["count"]).register(named("raise"));
    let (sampled, keep) = number();
    let sample = move |of: Option<Sample<'_, u64>>| {
        keep.store(of.map_or(0, |of| *of.value), Relaxed);
    };
    let latest = dag.latest::<u64>("count");
    let sample = reader.using(latest.sample()).source(sample);
    sample.register(named("sample"));
    let mut plan = commit(&[dag, other, reader]);
    let [of_dag, _, of_reader] = &mut plan.bodies[..] else {
        panic!("three DAGs");
    };
    for job in 0..3 {
        assert!(of_dag[0].has_effects() && !of_dag[0].goes_on(job));
        assert_eq!(turn(&mut of_dag[0], job), Err(For(3_000)));
        of_dag[0].wake(true);
        assert_eq!(turn(&mut of_dag[0], job), Err(SinceRelease(4_000)));
        assert!(of_dag[0].goes_on(job) && returned.load(Relaxed) == job);
        of_dag[0].wake(true);
        // The latest value is that of the job before, until this one is complete.
        of_dag[0].run(job);
        _ = turn(&mut of_reader[0], job);
        assert_eq!(sampled.load(Relaxed), job);
        of_dag[0].complete(0, &mut |request| panic!("{request:?}"));
        _ = turn(&mut of_reader[0], job);
        assert_eq!(sampled.load(Relaxed), job + 1);
        assert_eq!(
            turn(&mut of_dag[1], job),
            Ok(vec![Request::Signal(DagId(1))])
        );
    }
}

/// Counts how often one was dropped.
struct Dropped(Arc<AtomicU64>);

impl Drop for Dropped {
    fn drop(&mut self) {
        self.0.fetch_add(1, Relaxed);
    }
}

/// The body of a source that has one of these while it waits.
fn holding() -> (SubtaskCode, Arc<AtomicU64>) {
    let (dag, drops) = (dag(), Arc::<AtomicU64>::default());
    let counter = Arc::clone(&drops);
    let f = move || {
        let held = Dropped(Arc::clone(&counter));
        async move {
            sleep(Duration::ZERO).await;
            drop(held);
        }
    };
    dag.async_source(f)
        .register(named("f").wait(Duration::ZERO));
    let mut plan = commit(&[dag]);
    (plan.bodies.remove(0).remove(0), drops)
}

#[test]
fn a_future_is_dropped_by_the_next_turn_or_with_its_body_and_not_by_discarding() {
    let (mut body, drops) = holding();
    assert_eq!(turn(&mut body, 0), Err(For(0)));
    body.discard(0);
    assert_eq!(drops.load(Relaxed), 0, "that is the app's code");
    assert_eq!(turn(&mut body, 1), Err(For(0)));
    assert_eq!(drops.load(Relaxed), 1);
    assert_eq!(turn(&mut body, 1), Ok(vec![]));
    assert_eq!(drops.load(Relaxed), 2);
    _ = turn(&mut body, 2);
    drop(body);
    assert_eq!(drops.load(Relaxed), 3);
    let (mut body, drops) = holding();
    _ = turn(&mut body, 0);
    body.forget();
    // After a fault it may be half changed.
    assert_eq!(drops.load(Relaxed), 0);
}

#[test]
fn a_function_that_has_panicked_is_not_called_again() {
    let dag = dag();
    let f = || async {
        sleep(Duration::ZERO).await;
        panic!("worn out")
    };
    dag.async_source::<_, _, ()>(f)
        .register(named("f").wait(Duration::ZERO));
    let mut plan = commit(&[dag]);
    let body = &mut plan.bodies[0][0];
    _ = turn(body, 0);
    assert_eq!(panic_message(|| body.run(0)), "worn out");
    let again = "the subtask panicked in job 0 and cannot continue";
    assert_eq!(panic_message(|| body.run(1)), again);
}

/// Asks a device for a sum between two other waits; each third answer is late.
fn asking(device: &Device<[u64; 8], u64>) -> Dag {
    let (dag, us) = (dag(), Duration::from_micros);
    let mut job = 0;
    let ask = move |adder: Asker<[u64; 8], u64>| {
        job += 1;
        async move {
            sleep(Duration::ZERO).await;
            let sum = adder.ask([job; 8]).await;
            assert_eq!(
                sum,
                if job % 3 == 0 {
                    Err(TimedOut)
                } else {
                    Ok(8 * job)
                }
            );
            until(us(1)).await;
            (sum.is_ok(),)
        }
    };
    let ask = dag.using(device.asking()).async_source(ask).writes(&["is"]);
    ask.register(named("ask").wait(us(1)).wait(us(1)).wait(us(1)));
    let sink = |(_,): (bool,)| sleep(Duration::ZERO);
    let sink = dag.async_subtask(sink).reads(&["is"]);
    sink.register(named("sink").wait(us(0)));
    dag
}

#[test]
fn waits_and_answers_allocate_nothing() {
    let (device, mut driver) = create_device("adder");
    let mut plan = commit(&[asking(&device)]);
    let [ask, sink] = &mut plan.bodies[0][..] else {
        panic!("two subtasks");
    };
    let turn = |body: &mut SubtaskCode, job, has_timed_out| {
        body.wake(has_timed_out);
        body.run(job);
        body.complete(job, &mut |_| ());
    };
    answers(); // so that there is room for one
    let before = allocated().0;
    for job in 0..999 {
        let is_late = job % 3 == 2;
        turn(ask, job, true);
        assert!(driver.question().is_none(), "it comes with its wait");
        turn(ask, job, true);
        let (ticket, question) = driver.question().expect("the wait has begun");
        assert_eq!((ticket.job(), question), (job, [job + 1; 8]));
        assert!(driver.question().is_none(), "it was taken");
        let sum = question.iter().sum();
        if !is_late {
            assert_eq!(driver.answer(ticket, sum), Ok(()));
            assert_eq!(answers().map(|wait| wait.number), Some(1));
        }
        turn(ask, job, is_late);
        assert_eq!(driver.answer(ticket, sum), Err(sum), "late, or given");
        assert_eq!(answers(), None::<WaitId>);
        turn(ask, job, true);
        turn(sink, job, true);
        match job % 2 {
            0 => turn(sink, job, true),
            // It is cancelled while it waits.
            _ => sink.discard(job),
        }
    }
    assert_eq!(allocated().0 - before, 0);
}

#[test]
fn of_two_questions_the_later_one_counts_whatever_the_driver_does() {
    let (device, mut driver) = create_device::<u64, u64>("device");
    let dag = dag();
    let mut job = 0;
    let ask = move |device: Asker<u64, u64>| {
        job += 1;
        async move {
            let answer = device.ask(job).await;
            assert_eq!(answer.ok(), (job == 4).then_some(40));
        }
    };
    let ask = dag.using(device.asking()).async_source(ask);
    ask.register(named("ask").wait(Duration::ZERO));
    let mut plan = commit(&[dag]);
    let body = &mut plan.bodies[0][0];
    let mut tickets = Vec::new();
    for job in 0..4 {
        _ = turn(body, job);
        // The second and the third are never taken.
        if job % 3 == 0 {
            tickets.push(driver.question().expect("there is one").0);
        }
        if job < 3 {
            body.wake(true);
            _ = turn(body, job);
            assert!(driver.question().is_none());
        }
    }
    assert_eq!(driver.answer(tickets[0], 10), Err(10));
    assert_eq!(driver.answer(tickets[1], 40), Ok(()));
    assert_eq!(answers().map(|wait| wait.instance.job), Some(3));
    body.wake(false);
    assert_eq!(turn(body, 3), Ok(vec![]));
}

/// Takes a turn while another thread does something, and returns the requests and the answer.
fn turn_while(
    body: &mut SubtaskCode,
    job: u64,
    other: impl FnOnce() + Send,
) -> (Result<Vec<Request>, WaitLimit>, Option<WaitId>) {
    let start = Barrier::new(2);
    thread::scope(|scope| {
        let other = scope.spawn(|| {
            start.wait();
            other();
            answers()
        });
        start.wait();
        let asked = turn(body, job);
        (asked, other.join().expect("it does not panic"))
    })
}

#[test]
fn bytes_that_come_or_go_as_a_wait_for_them_begins_end_it_once() {
    let (wire, dag) = (Wire::new("wire"), dag());
    let ask = |(input, output): (WireReader<usize>, WireWriter)| async move {
        assert_eq!(input.read().await, Ok(1));
        assert_eq!(output.write(b"x").await, Ok(()));
    };
    let uses = dag.using((wire.reading(|packet| packet.len()), wire.writing()));
    let limit = Duration::from_nanos(9);
    let stated = named("ask").wait(limit).wait(limit);
    uses.async_source(ask).register(stated);
    let mut plan = commit(&[dag]);
    let body = &mut plan.bodies[0][0];
    let device = DeviceEnd::of(&wire).unwrap();
    assert!(DeviceEnd::of(&wire).is_none(), "there is one");
    let (arrive, depart) = (
        || _ = device.arrive(b"a\n", 0),
        || while device.depart().is_none() {},
    );
    for job in 0..1_000 {
        let others: [&(dyn Fn() + Sync); 2] = [&arrive, &depart];
        for (number, other) in (0..).zip(others) {
            let (asked, answered) = turn_while(body, job, other);
            let found = answered.map(|wait| (wait.instance.job, wait.number));
            match asked {
                Err(For(0)) => assert_eq!(found, None),
                Err(For(9)) => assert_eq!(found, Some((job, number))),
                _ => panic!("{asked:?}"),
            }
            body.wake(answered.is_none());
        }
        assert_eq!(turn(body, job), Ok(vec![]));
    }
}
