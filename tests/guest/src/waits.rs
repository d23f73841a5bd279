//! Instances waiting for bytes of a wire, and the cost of a wait.

use alloc::sync::Arc;
use alloc::vec;
use core::sync::atomic::{AtomicU64, Ordering};
use core::time::Duration;

use fass::shared::{Wire, WireReader, WireWriter};
use fass::{Occupation, create_dag, execute_for, finish_create_dags, sleep};
use kernel::{AppError, Machine, json};

use crate::single::named;

const PERIOD: Duration = Duration::from_millis(20);

fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

fn hold(ms: u64) {
    execute_for(Duration::from_millis(ms), Occupation::Hold);
}

/// Runs a modem's DAG, writing questions and reading answers. Prints the sum of the answers, and
/// the numbers of missing answers and of unsent questions. With two clusters, the DAG is in the
/// second, away from the port's cluster.
pub(crate) fn wire(machine: &Machine) -> Result<(), AppError> {
    let modem = Wire::new("modem");
    machine.connect(&modem)?;
    machine.offer_clusters()?;
    machine.options().finish(&["test", "input", "clusters"])?;
    // The sum, and how often nothing came, and nothing went.
    let counts = Arc::new([const { AtomicU64::new(0) }; 3]);
    let (tally, mut job) = (Arc::clone(&counts), 0_u64);
    let ask = move |(input, output): (WireReader<u64>, WireWriter)| {
        let (tally, question) = (Arc::clone(&tally), job);
        job += 1;
        async move {
            hold(1);
            let line = [b'0' + (question % 10) as u8, b'\n'];
            let is_unsent = output.write(&line).await.is_err();
            let answer = input.read().await;
            let found = [
                answer.unwrap_or(0),
                answer.is_err().into(),
                is_unsent.into(),
            ];
            for (count, more) in tally.iter().zip(found) {
                count.fetch_add(more, Ordering::Relaxed);
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
    let [sum, timed_out, unsent] = [0, 1, 2].map(|which| counts[which].load(Ordering::Relaxed));
    json::emit("waits_wire", |line| {
        line.number("sum", sum)
            .number("timed_out", timed_out)
            .number("unsent", unsent)
            .number("allocations", run.allocations())
            .number("violations", run.violations().count() as u64);
    });
    Ok(())
}

/// The number of waits taken by [`cost`], one after the other.
const NAPS: u32 = 32;

/// Counts the instructions added by a wait and its wake to an instance alone on the machine: for a
/// wait of no time, and for a wait of a millisecond, without the millisecond.
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
