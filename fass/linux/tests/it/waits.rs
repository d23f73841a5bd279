//! Subtasks that wait: what ends a wait, and who has the core meanwhile.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::sync::mpsc::RecvError;
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use crate::support::{alone, breaches, chain, every, mechanisms, ms};
use fass::shared::{Asker, TimedOut, create_device};
use fass::{Dag, OverrunPolicy, SubtaskAttributes, finish_create_dags, sleep, until};
use linux::Mechanism;

const MINUTE: Duration = Duration::from_secs(60);

#[test]
fn a_thread_answers_and_what_is_late_or_told_twice_changes_nothing() {
    for mechanism in mechanisms() {
        const JOBS: u64 = 30;
        let alone = alone(2, mechanism);
        let (device, mut driver) = create_device::<u64, u64>("accelerator");
        let vision = every(ms(5), "vision");
        vision.jobs(JOBS).in_flight(1);
        let counts = Arc::new([const { AtomicU64::new(0) }; 2]);
        let (seen, mut job) = (Arc::clone(&counts), 0);
        let ask = move |device: Asker<u64, u64>| {
            let (asked, seen) = (job, Arc::clone(&seen));
            job += 1;
            async move {
                match device.ask(asked).await {
                    Ok(answer) => {
                        assert_eq!(answer, asked * 10, "it is for this question");
                        seen[0].fetch_add(1, Relaxed);
                    }
                    Err(TimedOut) => _ = seen[1].fetch_add(1, Relaxed),
                }
                until(ms(1)).await;
            }
        };
        let ask = vision.using(device.asking()).async_source(ask);
        let named = SubtaskAttributes::named("ask");
        ask.register(named.wait(ms(20)).wait(ms(1)));
        let control = chain("control", 3, 5 * JOBS, ms(1), 20);
        finish_create_dags(&[vision, control]).unwrap();

        let is_over = Arc::<AtomicBool>::default();
        let mut last = None;
        let has_ended = Arc::clone(&is_over);
        let server = thread::spawn(move || {
            while !has_ended.load(Relaxed) {
                let Some((ticket, question)) = linux::next_question(&mut driver, ms(5)) else {
                    continue;
                };
                // Late, for the wait of a job that is gone, in the midst of this one.
                if let Some(last) = last.replace(ticket) {
                    assert_eq!(driver.answer(last, 99), Err(99));
                }
                if question % 3 != 0 && driver.answer(ticket, question * 10).is_ok() {
                    assert_eq!(driver.answer(ticket, 98), Err(98), "it has its answer");
                }
            }
        });
        let run = alone.machine.run().unwrap();
        is_over.store(true, Relaxed);
        server
            .join()
            .expect("each answer is judged as it should be");
        assert_eq!(breaches(&run), []);
        assert_eq!(run.faults(), []);
        let completed = ["vision", "control"].map(|dag| run.statistics(dag).completed);
        assert_eq!(completed, [JOBS, 5 * JOBS]);
        let [answered, timed_out] = [0, 1].map(|which| counts[which].load(Relaxed));
        assert_eq!(answered + timed_out, JOBS);
        // How many are in time is Linux' business.
        assert!(timed_out >= JOBS / 3, "{answered} {timed_out}");
    }
}

/// Counts how often one was dropped.
struct Dropped(Arc<AtomicU64>);

impl Drop for Dropped {
    fn drop(&mut self) {
        self.0.fetch_add(1, Relaxed);
    }
}

/// Registers a source that waits for a minute in its first job, and then for a millisecond.
fn wait_in(dag: &Dag, drops: &Arc<AtomicU64>) {
    let (drops, mut times) = (Arc::clone(drops), [MINUTE].into_iter());
    let f = move || {
        let held = Dropped(Arc::clone(&drops));
        let time = times.next().unwrap_or(ms(1));
        async move {
            sleep(time).await;
            drop(held);
        }
    };
    let named = SubtaskAttributes::named("wait").priority(0);
    dag.async_source(f).register(named.wait(MINUTE));
}

#[test]
fn an_abort_or_an_end_takes_waits_back() {
    let alone = alone(1, Mechanism::Normal);
    let drops = Arc::<AtomicU64>::default();
    let (ended, aborted) = (every(2 * MINUTE, "ended"), every(ms(250), "aborted"));
    wait_in(&ended, &drops);
    let overrun = OverrunPolicy::Abort;
    aborted.jobs(3).in_flight(1).overrun(overrun);
    wait_in(&aborted, &drops);
    finish_create_dags(&[ended, aborted]).unwrap();
    let control = alone.machine.control().unwrap();
    let person = thread::spawn(move || {
        thread::sleep(ms(60));
        control.end("ended");
    });
    let run = alone.machine.run().unwrap();
    person.join().expect("it has asked for the end");
    assert_eq!(breaches(&run), []);
    let statistics = run.statistics("aborted");
    assert_eq!((statistics.completed, statistics.aborts), (2, 1));
    assert_eq!(run.faults(), []);
    drop(run);
    assert_eq!(drops.load(Relaxed), 4, "one with its subtask");
}

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
        let is_late = Arc::<AtomicBool>::default();
        let (mut job, late) = (0, Arc::clone(&is_late));
        let ask = move |host: Asker<u64, Result<u64, RecvError>>| {
            job += 1;
            let late = Arc::clone(&late);
            async move {
                let limit = if job == 2 { ms(1) } else { MINUTE };
                let answer = host.ask(job).within(limit).await;
                // The second call blocks for longer, and the third one comes after it.
                let expected = [Ok(Ok(10)), Err(TimedOut), Ok(Ok(90))];
                assert_eq!(answer, expected[usize::try_from(job).unwrap() - 1]);
                late.store(job == 2, Relaxed);
            }
        };
        let ask = dag.using(host.asking()).async_source(ask);
        ask.register(SubtaskAttributes::named("ask").wait(MINUTE));
        // Another DAG, on the only core, which what waits has left, gives what the calls wait for.
        let gives = every(ms(10), "gives");
        gives.jobs(20);
        let mut numbers = [10, 30, 30].into_iter();
        let give = move || {
            let count = match numbers.len() {
                3 => 1,
                _ if is_late.load(Relaxed) => 2,
                _ => 0,
            };
            let given = numbers.by_ref().take(count);
            given.for_each(|number| send.send(number).expect("somebody waits"));
        };
        gives
            .source(give)
            .register(SubtaskAttributes::named("give"));
        finish_create_dags(&[dag, gives]).unwrap();
        let run = alone.machine.run().unwrap();
        assert_eq!(run.faults(), []);
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
