//! Instances that wait: for a time, for a device that another DAG stands for, and for bytes of a wire.

use alloc::sync::Arc;
use alloc::vec;
use core::sync::atomic::{AtomicU64, Ordering};
use core::time::Duration;

use fass::shared::{Asker, DeviceDriver, Wire, WireReader, WireWriter, create_device};
use fass::{Dag, Occupation, create_dag, execute_for, finish_create_dags, sleep};
use kernel::{AppError, Machine, json};

use crate::single::{named, single_every};

const PERIOD: Duration = Duration::from_millis(20);

/// For how long the device computes for each question; the second answer comes too late.
const COMPUTES_MS: [u64; 4] = [2, 7, 0, 3];

/// The outcomes of the questions.
#[derive(Default)]
struct Answers {
    right: AtomicU64,
    timed_out: AtomicU64,
    /// Answers that were given back.
    returned: AtomicU64,
}

fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

fn hold(ms: u64) {
    execute_for(Duration::from_millis(ms), Occupation::Hold);
}

fn count(counter: &AtomicU64) {
    counter.fetch_add(1, Ordering::Relaxed);
}

/// Runs a camera that asks an accelerator, next to a control loop; in several clusters the
/// accelerator is in the last one.
pub(crate) fn run(machine: &Machine) -> Result<(), AppError> {
    machine.offer_clusters()?;
    machine.options().finish(&["test", "clusters"])?;
    let answers = Arc::new(Answers::default());
    let (device, driver) = create_device("accelerator");

    let camera = create_dag();
    (camera.name("camera").jobs(4).period(PERIOD)).relative_deadline(PERIOD);
    let (tally, mut job) = (Arc::clone(&answers), 0_u64);
    let ask = move |accelerator: Asker<u64, u64>| {
        let (tally, question) = (Arc::clone(&tally), job);
        job += 1;
        async move {
            hold(1);
            match accelerator.ask(question).await {
                Ok(answer) => {
                    assert_eq!(answer, question * 10);
                    count(&tally.right);
                }
                Err(_) => count(&tally.timed_out),
            }
            hold(1);
            sleep(ms(2)).await;
            hold(1);
        }
    };
    let ask = camera.using(device.asking()).async_source(ask);
    ask.register(named("ask").priority(1).wait(ms(5)).wait(ms(3)));

    let control = || execute_for(Duration::from_micros(300), Occupation::Hold);
    let attributes = named("control").priority(0);
    let control = single_every(PERIOD / 2, "control", 8, attributes, control);
    control.offset(Duration::from_micros(4_500));
    let accelerator = accelerator(driver, &answers);
    let clusters = machine.clusters().sizes().len();
    if let Some(last) = u32::try_from(clusters)
        .ok()
        .and_then(|count| count.checked_sub(1))
    {
        camera.cluster(0);
        control.cluster(0);
        accelerator.cluster(last);
    }
    finish_create_dags(&[control, camera, accelerator])?;
    let run = machine.run()?;
    json::emit("waits", |line| {
        line.number("right", answers.right.load(Ordering::Relaxed))
            .number("timed_out", answers.timed_out.load(Ordering::Relaxed))
            .number("returned", answers.returned.load(Ordering::Relaxed))
            .number("allocations", run.allocations())
            .number("violations", run.violations().count() as u64);
    });
    Ok(())
}

/// Builds the DAG that stands for the device, which gives each answer twice.
fn accelerator(mut driver: DeviceDriver<u64, u64>, answers: &Arc<Answers>) -> Dag {
    let (tally, mut times_ms) = (Arc::clone(answers), COMPUTES_MS.into_iter());
    let serve = move || {
        let Some((ticket, question)) = driver.question() else {
            return;
        };
        hold(times_ms.next().unwrap_or(0));
        for _ in 0..2 {
            if driver.answer(ticket, question * 10).is_err() {
                count(&tally.returned);
            }
        }
    };
    let attributes = named("serve").priority(2);
    let dag = single_every(PERIOD, "accelerator", 4, attributes, serve);
    dag.offset(ms(2));
    dag
}

/// Runs a modem, which is written a question and read for an answer, and says what came: the sum of
/// it, and how often there was nothing. In two clusters it is not in that of the port.
pub(crate) fn wire(machine: &Machine) -> Result<(), AppError> {
    let modem = Wire::new("modem");
    machine.connect(&modem)?;
    machine.offer_clusters()?;
    machine.options().finish(&["test", "input", "clusters"])?;
    let (answers, mut job) = (Arc::new(Answers::default()), 0_u64);
    let tally = Arc::clone(&answers);
    let ask = move |(input, output): (WireReader<u64>, WireWriter)| {
        let (tally, question) = (Arc::clone(&tally), job);
        job += 1;
        async move {
            hold(1);
            let line = [b'0' + (question % 10) as u8, b'\n'];
            if output.write(&line).await.is_err() {
                count(&tally.returned);
            }
            match input.read().await {
                Ok(answer) => _ = tally.right.fetch_add(answer, Ordering::Relaxed),
                Err(_) => count(&tally.timed_out),
            }
            hold(1);
        }
    };
    let decode = |line: &[u8]| {
        line.iter()
            .fold(0, |sum, byte| sum * 10 + u64::from(byte - b'0'))
    };
    let uses = (modem.reading(decode), modem.writing());
    let dag = create_dag();
    (dag.name("modem").jobs(4).period(PERIOD)).relative_deadline(PERIOD);
    let attributes = named("ask").wait(ms(10)).wait(ms(5));
    dag.using(uses).async_source(ask).register(attributes);
    if machine.clusters().sizes().len() > 1 {
        dag.cluster(1);
    }
    finish_create_dags(&[dag])?;
    let run = machine.run()?;
    json::emit("waits_wire", |line| {
        line.number("sum", answers.right.load(Ordering::Relaxed))
            .number("timed_out", answers.timed_out.load(Ordering::Relaxed))
            .number("unsent", answers.returned.load(Ordering::Relaxed))
            .number("allocations", run.allocations())
            .number("violations", run.violations().count() as u64);
    });
    Ok(())
}

/// How many waits [`cost`] takes one after the other.
const NAPS: u32 = 32;

/// Counts what a wait and its wake add to an instance that has the machine for itself: of no time,
/// and of a millisecond beyond that.
pub(crate) fn cost(machine: &Machine) -> Result<(), AppError> {
    machine.options().finish(&["test"])?;
    for (word, time) in [("at_once", Duration::ZERO), ("later", ms(1))] {
        let longest = Arc::new(AtomicU64::new(0));
        let found = Arc::clone(&longest);
        let naps = move || {
            let found = Arc::clone(&found);
            async move {
                let from_ns = fass::now_ns();
                for _ in 0..NAPS {
                    sleep(time).await;
                }
                found.fetch_max(fass::now_ns() - from_ns, Ordering::Relaxed);
            }
        };
        let attributes = (0..NAPS).fold(named("naps"), |naps, _| naps.wait(time));
        let dag = create_dag();
        (dag.name("naps").jobs(3)).relative_deadline(ms(100));
        dag.register_periodic_async_subtask(naps, vec![], ms(100), attributes);
        finish_create_dags(&[dag])?;
        let run = machine.run()?;
        let waited_ns = u64::try_from((time * NAPS).as_nanos()).unwrap_or(u64::MAX);
        let added_ns = longest.load(Ordering::Relaxed).saturating_sub(waited_ns);
        json::emit("waits_cost", |line| {
            line.text("wait", word)
                .number("instructions", added_ns / u64::from(NAPS))
                .number("allocations", run.allocations());
        });
    }
    Ok(())
}
