//! Waits that another thread ends. (The scenarios tell what else ends one.)

use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::RecvError;
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use crate::support::{alone, breaches, every, mechanisms, ms};
use fass::shared::{Asker, TimedOut, create_device};
use fass::{SubtaskAttributes, finish_create_dags};
use linux::Mechanism;

const MINUTE: Duration = Duration::from_secs(60);

#[test]
fn a_call_that_blocks_is_made_in_a_thread_of_its_own() {
    for mechanism in mechanisms() {
        let (send, receive) = std::sync::mpsc::channel::<u64>();
        let host = linux::blocking("host", move |factor: u64| {
            receive.recv().map(|it| it * factor)
        });
        let alone = alone(1, mechanism);
        let dag = every(ms(20), "asks");
        dag.jobs(3);
        let (mut job, give) = (0, send.clone());
        let ask = move |host: Asker<u64, Result<u64, RecvError>>| {
            job += 1;
            let give = give.clone();
            async move {
                let limit = if job == 2 { ms(1) } else { MINUTE };
                let answer = host.ask(job).within(limit).await;
                // The second call blocks for longer, and the third one comes after it.
                let expected = [Ok(Ok(10)), Err(TimedOut), Ok(Ok(90))];
                assert_eq!(answer, expected[usize::try_from(job).unwrap() - 1]);
                // For the call that is too late, and for the one behind it.
                (0..if job == 2 { 2 } else { 0 }).for_each(|_| give.send(30).expect("it waits"));
            }
        };
        let ask = dag.using(host.asking()).async_source(ask);
        ask.register(SubtaskAttributes::named("ask").wait(MINUTE));
        // Another DAG, on the only core, which a waiting instance has left, gives the first number.
        let gives = every(ms(10), "gives");
        gives.jobs(1);
        let give = move || send.send(10).expect("the first call waits");
        gives
            .source(give)
            .register(SubtaskAttributes::named("give"));
        finish_create_dags(&[dag, gives]).unwrap();
        let run = alone.machine.run().unwrap();
        assert_eq!((breaches(&run), run.faults()), (vec![], &[][..]));
        assert_eq!(run.statistics("asks").completed, 3);
    }
}

/// The driver's thread answers about when the wait ends by its limit.
#[test]
fn an_answer_at_the_limit_counts_for_both_ends_or_for_neither() {
    let us = Duration::from_micros;
    let alone = alone(1, Mechanism::Normal);
    let (device, mut driver) = create_device::<u64, u64>("close");
    let asks = every(ms(1), "asks");
    asks.jobs(300).in_flight(1);
    let got = Arc::new(Mutex::new(Vec::with_capacity(300)));
    let (of_jobs, mut job) = (Arc::clone(&got), 0);
    let ask = move |device: Asker<u64, u64>| {
        let (asked, got) = (job, Arc::clone(&of_jobs));
        job += 1;
        async move {
            if let Ok(answer) = device.ask(asked).await {
                got.lock().unwrap().push(answer);
            }
        }
    };
    let ask = asks.using(device.asking()).async_source(ask);
    ask.register(SubtaskAttributes::named("ask").wait(us(200)));
    finish_create_dags(&[asks]).unwrap();
    let is_over = Arc::<AtomicBool>::default();
    let has_ended = Arc::clone(&is_over);
    let server = thread::spawn(move || {
        let mut given = Vec::new();
        while !has_ended.load(Relaxed) {
            let Some((ticket, asked)) = driver.question() else {
                thread::yield_now();
                continue;
            };
            let due = Instant::now() + us(asked % 40 * 10);
            while Instant::now() < due {
                std::hint::spin_loop();
            }
            if driver.answer(ticket, asked).is_ok() {
                given.push(asked);
            }
        }
        given
    });
    let run = alone.machine.run().unwrap();
    is_over.store(true, Relaxed);
    assert_eq!(run.faults(), []);
    assert_eq!(*got.lock().unwrap(), server.join().unwrap());
}
