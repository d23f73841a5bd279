//! What subtasks share, on real cores: a state, latest values, signals.
//!
//! `writer` has two subtasks on one state, in an order that nothing but the state
//! gives, and offers what they make as a latest value. Two readers of other rates
//! sample it, on other cores as it comes, and check that what they get is whole,
//! complete, and never older than what they had. One of them raises the signal of
//! `answers` each time, far more often than that may run. With `input=yes` a DAG
//! waits for two bytes from the serial port, too. With `later_ms=N` the releases
//! count from N milliseconds later, and nothing may begin before.

use alloc::sync::Arc;
use alloc::vec;
use core::sync::atomic::{AtomicU64, Ordering};
use core::time::Duration;

use fass::{Dag, Latest, Raiser, Sample, Signal, create_dag, finish_create_dags};
use kernel::{Ending, Machine, json};

use crate::times::{hold, ms, taking};

const ANSWERS_APART: Duration = Duration::from_millis(20);

/// When the releases count from.
static EPOCH_NS: AtomicU64 = AtomicU64::new(0);

/// Time for the cores to get ready.
const LEAD_NS: u64 = 100_000;

/// A value that cannot be half written without showing it.
#[derive(Clone)]
struct Whole([u64; 16]);

pub(crate) fn run(machine: &Machine) -> Result<(), Ending> {
    let options = machine.options();
    let with_input = options.choice("input", &[("no", false), ("yes", true)])?;
    let later_ms = options.number("later_ms", 0..=10_000, 0)?;
    options.finish(&["test", "input", "later_ms"])?;
    let (writer, latest) = writer();
    let (answers, signal) = answers("answers");
    let counters = [(); 2].map(|()| Arc::new(AtomicU64::new(0)));
    let mut dags = vec![
        answers,
        writer,
        reader("often", 3, 200, &latest, None, &counters[0]),
        reader("seldom", 7, 90, &latest, Some(&signal), &counters[1]),
    ];
    let button = with_input.then(|| {
        // Of two bytes before time 0 one is kept.
        let (dag, button) = answers_to_bytes(if later_ms == 0 { 2 } else { 1 });
        dags.push(dag);
        button
    });
    let commit = finish_create_dags(&dags)?;
    if let Some(button) = &button {
        machine.raise_on_input(button);
        json::emit("listening", |_| {});
        // Time for the host to type, so that the byte is there before the epoch.
        let typed_ns = fass::now_ns() + later_ms * 1_000_000;
        while fass::now_ns() < typed_ns {
            core::hint::spin_loop();
        }
    }
    for staleness in commit.staleness() {
        kernel::println!("{staleness}");
    }
    let epoch_ns = fass::now_ns() + LEAD_NS + later_ms * 1_000_000;
    EPOCH_NS.store(epoch_ns, Ordering::Relaxed);
    let run = machine.run_from(epoch_ns)?;
    let apart_ns = u64::try_from(ANSWERS_APART.as_nanos()).unwrap_or(u64::MAX);
    let of_answers = *run.statistics("answers");
    let of_input = button.map(|_| run.statistics("input").completed);
    json::emit("sharing", |line| {
        line.number("violations", run.violations().count() as u64)
            .number("allocations", run.allocations())
            .number("often", counters[0].load(Ordering::Relaxed))
            .number("seldom", counters[1].load(Ordering::Relaxed))
            .number("minimum_inter_arrival_ns", apart_ns)
            .number("answers", of_answers.completed)
            .number("signals", of_answers.signals)
            .number("dropped", of_answers.dropped_signals)
            .number("answers_to_bytes", of_input.unwrap_or(0));
    });
    Ok(())
}

/// source -> (first, second) -> join, where `second` sees what `first` has counted.
fn writer() -> (Dag, Latest<Whole>) {
    let dag = create_dag();
    let period = ms(5);
    dag.name("writer").jobs(120).relative_deadline(period);
    let count = dag.state("count", 0_u64);
    let source = || {
        let epoch_ns = EPOCH_NS.load(Ordering::Relaxed);
        assert!(fass::now_ns() >= epoch_ns, "released before the epoch");
        (1_u64,)
    };
    dag.register_periodic_subtask(source, vec!["tick"], period, taking("source", 100));
    dag.using(count.update())
        .subtask(|count: &mut u64, (tick,): (u64,)| {
            hold(400);
            *count += tick;
            (*count,)
        })
        .reads(&["tick"])
        .writes(&["first"])
        .register(taking("first", 600));
    dag.using(count.read())
        .subtask(|count: &u64, (_,): (u64,)| {
            hold(200);
            (*count,)
        })
        .reads(&["tick"])
        .writes(&["second"])
        .register(taking("second", 400));
    dag.register_subtask(
        |(first, second): (u64, u64)| {
            assert_eq!(first, second, "the order that the state gives");
            (Whole([first; 16]),)
        },
        vec!["first", "second"],
        vec!["whole"],
        taking("join", 200),
    );
    let latest = dag.latest("whole");
    (dag, latest)
}

fn reader(
    name: &str,
    period_ms: u64,
    jobs: u64,
    latest: &Latest<Whole>,
    signal: Option<&Signal>,
    seen: &Arc<AtomicU64>,
) -> Dag {
    let dag = create_dag();
    dag.name(name).jobs(jobs).relative_deadline(ms(period_ms));
    let (seen, mut last) = (Arc::clone(seen), None);
    let mut check = move |whole: Option<Sample<'_, Whole>>| {
        let Some(whole) = whole else { return };
        assert!(whole.completed_ns <= fass::now_ns(), "complete");
        assert_eq!(whole.value.0, [whole.job + 1; 16], "whole, of its job");
        assert!(last <= Some(whole.job), "never backwards");
        if last < Some(whole.job) {
            seen.fetch_add(1, Ordering::Relaxed);
        }
        last = Some(whole.job);
    };
    let attributes = taking("sample", 300);
    match signal {
        None => {
            dag.period(ms(period_ms))
                .using(latest.sample())
                .source(check)
                .register(attributes);
        }
        Some(signal) => {
            let check = move |(whole, mut signal): (Option<Sample<'_, Whole>>, Raiser<'_>)| {
                check(whole);
                signal.raise();
            };
            dag.period(ms(period_ms))
                .using((latest.sample(), signal.raising()))
                .source(check)
                .register(attributes);
        }
    }
    dag
}

/// A sporadic DAG without a limit of jobs.
fn answers(name: &str) -> (Dag, Signal) {
    let dag = create_dag();
    dag.name(name).relative_deadline(ms(5));
    let attributes = taking("answer", 500);
    let signal = dag.sporadic(ANSWERS_APART);
    dag.source(|| hold(300)).register(attributes);
    (dag, signal)
}

fn answers_to_bytes(jobs: u64) -> (Dag, Signal) {
    let dag = create_dag();
    dag.name("input").jobs(jobs).relative_deadline(ms(5));
    let attributes = taking("byte", 500);
    let button = dag.sporadic(ms(1));
    dag.source(|| hold(100)).register(attributes);
    (dag, button)
}
