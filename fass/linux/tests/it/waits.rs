//! Subtasks that wait: what ends a wait, who has the core meanwhile, and what a fault leaves.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::sync::mpsc::RecvError;
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use crate::support::{alone, breaches, chain, mechanisms, ms, spin};
use fass::commit::{ConstructionPolicy, finish_create_dags_with};
use fass::shared::{Asker, DeviceDriver, TimedOut, create_device};
use fass::{
    Dag, OverrunPolicy, SubtaskAttributes, WaitFault, create_dag, finish_create_dags, sleep, until,
};
use linux::Mechanism;

const MINUTE: Duration = Duration::from_secs(60);

fn every(period: Duration, name: &str) -> Dag {
    let dag = create_dag();
    dag.name(name).period(period).relative_deadline(period);
    dag
}

/// Serves a device in a thread of its own, until a flag is set.
fn serve<Q: Send + Sync + 'static>(
    mut driver: DeviceDriver<Q, u64>,
    is_over: &Arc<AtomicBool>,
    mut answer: impl FnMut(&mut DeviceDriver<Q, u64>, fass::shared::Ticket, Q) + Send + 'static,
) -> thread::JoinHandle<()> {
    let is_over = Arc::clone(is_over);
    thread::spawn(move || {
        while !is_over.load(Relaxed) {
            if let Some((ticket, question)) = linux::next_question(&mut driver, ms(5)) {
                answer(&mut driver, ticket, question);
            }
        }
    })
}

#[test]
fn a_thread_answers_and_what_is_late_or_told_twice_changes_nothing() {
    for mechanism in mechanisms() {
        const JOBS: u64 = 30;
        let alone = alone(2, mechanism);
        let (device, driver) = create_device::<u64, u64>("accelerator");
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
        let server = serve(driver, &is_over, move |driver, ticket, question| {
            // Late, for the wait of a job that is gone, in the midst of this one.
            if let Some(last) = last.replace(ticket) {
                assert_eq!(driver.answer(last, 99), Err(99));
            }
            if question % 3 != 0 && driver.answer(ticket, question * 10).is_ok() {
                assert_eq!(driver.answer(ticket, 98), Err(98), "it has its answer");
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

#[test]
fn a_question_releases_the_dag_that_answers_and_its_fault_is_that_dags() {
    for (mechanism, fails) in mechanisms().flat_map(|of| [(of, false), (of, true)]) {
        const JOBS: u64 = 12;
        let alone = alone(2, mechanism);
        let (device, mut driver) = create_device::<u64, u64>("served");
        let (asks, serves) = (every(ms(5), "asks"), create_dag());
        let counts = Arc::new([const { AtomicU64::new(0) }; 2]);
        let (seen, mut job) = (Arc::clone(&counts), 0);
        let ask = move |device: Asker<u64, u64>| {
            let (asked, seen) = (job, Arc::clone(&seen));
            job += 1;
            async move {
                let answer = device.ask(asked).await;
                assert!(answer.is_err() || answer == Ok(asked * 10));
                seen[usize::from(answer.is_err())].fetch_add(1, Relaxed);
            }
        };
        asks.jobs(JOBS).in_flight(1);
        let ask = asks.using(device.asking()).async_source(ask);
        let limit = if fails { ms(4) } else { MINUTE };
        ask.register(SubtaskAttributes::named("ask").wait(limit));
        serves.name("serves").relative_deadline(MINUTE).in_flight(1);
        device.served_by(&serves.sporadic(Duration::from_micros(1)));
        let serve = move || {
            let (ticket, asked) = driver.question().expect("it was released for one");
            assert!(!fails, "the driver fails");
            driver.answer(ticket, asked * 10).expect("it waits");
        };
        serves
            .source(serve)
            .register(SubtaskAttributes::named("serve"));
        finish_create_dags(&[asks, serves]).unwrap();
        let run = alone.machine.run().unwrap();
        assert_eq!(breaches(&run), []);
        let counts = [0, 1].map(|which| counts[which].load(Relaxed));
        assert_eq!(counts, if fails { [0, JOBS] } else { [JOBS, 0] });
        let faults = run.faults().iter();
        let faults: Vec<_> = faults.map(|fault| fault.instance.dag.0).collect();
        assert_eq!(faults, if fails { vec![1] } else { vec![] });
        assert_eq!(run.statistics("asks").completed, JOBS);
    }
}

#[test]
fn what_waits_has_no_core_so_a_function_on_the_only_one_can_answer() {
    for mechanism in mechanisms() {
        let alone = alone(1, mechanism);
        let (device, mut driver) = create_device::<(), u64>("mate");
        let asks = every(ms(10), "asks");
        asks.jobs(5);
        let ask = |device: Asker<(), u64>| async move {
            assert!(device.ask(()).await.is_ok());
        };
        let ask = asks.using(device.asking()).async_source(ask);
        ask.register(SubtaskAttributes::named("ask").priority(0).wait(MINUTE));
        let answers = every(ms(1), "answers");
        answers.jobs(500);
        let answer = move || {
            if let Some((ticket, ())) = driver.question() {
                driver.answer(ticket, 1).expect("it waits");
            }
        };
        let named = SubtaskAttributes::named("answer").priority(1);
        answers.source(answer).register(named);
        finish_create_dags(&[asks, answers]).unwrap();
        let run = alone.machine.run().unwrap();
        assert_eq!(breaches(&run), []);
        assert_eq!(run.faults(), []);
        assert_eq!(run.statistics("asks").completed, 5);
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
fn a_fault_ends_the_waits_of_its_dag() {
    let alone = alone(1, Mechanism::Normal);
    let drops = Arc::<AtomicU64>::default();
    let dag = every(2 * MINUTE, "faulty");
    dag.jobs(2);
    wait_in(&dag, &drops);
    let foreign = SubtaskAttributes::named("foreign").wait(MINUTE);
    let pending = std::future::pending::<()>;
    dag.async_source(pending).register(foreign.priority(9));
    finish_create_dags_with(&[dag], ConstructionPolicy::any_graph()).unwrap();
    let run = alone.machine.run().unwrap();
    assert_eq!(breaches(&run), []);
    let [fault] = run.faults() else {
        panic!("{:?}", run.faults());
    };
    assert_eq!(fault.cause, WaitFault::Foreign.to_string());
    drop(run);
    assert_eq!(drops.load(Relaxed), 1);
}

#[test]
fn a_budget_is_of_all_turns_and_of_no_wait() {
    let alone = alone(1, Mechanism::Fifo);
    let budget = |name: &str, turn_us: u64| {
        let dag = every(ms(500), name);
        dag.jobs(1);
        let f = move || async move {
            for _ in 0..3 {
                spin(turn_us);
                sleep(ms(30)).await;
            }
        };
        let named = SubtaskAttributes::named(name).budget(ms(20));
        let named = (0..3).fold(named, |named, _| named.wait(ms(30)));
        dag.async_source(f).register(named);
        dag
    };
    finish_create_dags(&[budget("within", 1_000), budget("beyond", 15_000)]).unwrap();
    let run = alone.machine.run().unwrap();
    assert_eq!(breaches(&run), []);
    let completed = ["within", "beyond"].map(|dag| run.statistics(dag).completed);
    assert_eq!(completed, [1, 0]);
    assert!(run.faults()[0].is_overrun);
}

#[test]
fn a_call_that_blocks_is_made_in_a_thread_of_its_own() {
    let (send, receive) = std::sync::mpsc::channel::<u64>();
    let host = linux::blocking("host", move |factor: u64| {
        receive.recv().map(|it| it * factor)
    });
    let alone = alone(1, Mechanism::Normal);
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
    // Another DAG, on the same core, gives what the calls wait for.
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
