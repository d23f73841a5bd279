//! DAGs with recorded topics: honest, cheating, or too much for the buffer.

use alloc::string::ToString;
use alloc::sync::Arc;
use alloc::{format, vec};
use core::slice;
use core::sync::atomic::{AtomicU64, Ordering};
use core::time::Duration;

use fass::shared::{UnixTime, WallClock};
use fass::{Occupation, OverrunPolicy, SubtaskAttributes};
use fass::{create_dag, execute_for, finish_create_dags};
use kernel::{AppError, Machine, json};

const PERIOD: Duration = Duration::from_millis(20);

/// The value recorded for a link of [`long`]: 2 KiB.
type Block = [u64; 256];

/// The number of links of [`long`].
const LINKS: usize = 8;

/// Runs a fork and a join. Both branches ask for the time, or share a counter behind the
/// scheduler's back.
pub(crate) fn run(machine: &Machine) -> Result<(), AppError> {
    let options = machine.options();
    let cheats = options.choice("cheats", &[("no", false), ("yes", true)])?;
    let step = options.number("step", 1..=1000, 1)?;
    machine.offer_clusters()?;
    options.finish(&["test", "clusters", "cheats", "step"])?;
    let named = SubtaskAttributes::named;
    let dag = create_dag();
    dag.name("counts").jobs(50);
    (dag.record::<u64>("input").record::<u64>("first")).record::<u64>("second");
    let mut input = 0;
    let source = move || {
        input += step;
        (input,)
    };
    dag.register_periodic_subtask(source, vec!["input"], PERIOD, named("source"));
    let calls = Arc::new(AtomicU64::new(0));
    for (wait, waited, output, ms) in [("slow", "a", "first", 3), ("quick", "b", "second", 1)] {
        let pass = move |(input,): (u64,)| {
            execute_for(Duration::from_millis(ms), Occupation::Hold);
            (input,)
        };
        dag.register_subtask(pass, vec!["input"], vec![waited], named(wait));
        let calls = Arc::clone(&calls);
        let count = move |(input,): (u64,)| {
            let more = match cheats {
                true => calls.fetch_add(1, Ordering::Relaxed),
                false => fass::now_ns(),
            };
            (input + more,)
        };
        dag.register_subtask(count, vec![waited], vec![output], named(output));
    }
    dag.register_sink_subtask(
        |_: (u64, u64)| (),
        vec!["first", "second"],
        PERIOD,
        named("sink"),
    );
    machine.spread(slice::from_ref(&dag));
    finish_create_dags(&[dag])?;
    machine.run().map(drop)
}

/// Runs a source reading the wall clock, and a sink stamping its start, and prints the last stamp.
pub(crate) fn stamped(machine: &Machine) -> Result<(), AppError> {
    machine.options().finish(&["test"])?;
    let clock = WallClock::new();
    machine.set_clock(&clock)?;
    let dag = create_dag();
    dag.name("stamps")
        .jobs(5)
        .period(PERIOD)
        .record::<UnixTime>("time")
        .record::<u64>("stamp");
    let read = dag.using(clock.reading()).source(|time: UnixTime| (time,));
    read.writes(&["time"])
        .register(SubtaskAttributes::named("read"));
    let stamp = |(time,): (UnixTime,)| (time.of(fass::now_ns()).unwrap_or(0),);
    dag.register_subtask(
        stamp,
        ["time"],
        ["stamp"],
        SubtaskAttributes::named("stamp"),
    );
    let (last, shown) = (
        Arc::new(AtomicU64::new(0)),
        SubtaskAttributes::named("show"),
    );
    let kept = Arc::clone(&last);
    let keep = move |(stamp,): (u64,)| kept.store(stamp, Ordering::Relaxed);
    dag.register_sink_subtask(keep, ["stamp"], PERIOD, shown);
    finish_create_dags(&[dag])?;
    machine.run()?;
    json::emit("stamped", |line| {
        line.number("last_ns", last.load(Ordering::Relaxed));
    });
    Ok(())
}

/// Runs a chain leaving one core no pause, with each link recorded.
pub(crate) fn long(machine: &Machine) -> Result<(), AppError> {
    machine.options().finish(&["test"])?;
    let dag = create_dag();
    (dag.name("chain").jobs(20)).overrun(OverrunPolicy::Queue);
    let topics = (0..LINKS).map(|link| format!("link {link}"));
    let topics: vec::Vec<_> = topics.collect();
    for topic in &topics {
        dag.record::<Block>(topic);
    }
    let mut job = 0_u64;
    let first = move || {
        job += 1;
        ([job; 256],)
    };
    let attributes = |link: usize| SubtaskAttributes::named(&link.to_string());
    dag.register_periodic_subtask(first, [topics[0].as_str()], PERIOD, attributes(0));
    for link in 1..LINKS {
        let pass = |(block,): (Block,)| (block.map(|word| word + 1),);
        let (from, to) = (&topics[link - 1], &topics[link]);
        dag.register_subtask(pass, [from.as_str()], [to.as_str()], attributes(link));
    }
    let last = |_: (Block,)| execute_for(2 * PERIOD, Occupation::Hold);
    dag.register_sink_subtask(
        last,
        [topics[LINKS - 1].as_str()],
        PERIOD,
        attributes(LINKS),
    );
    finish_create_dags(&[dag])?;
    let run = machine.run()?;
    match run.allocations() {
        0 => Ok(()),
        count => Err(AppError::Failure(format!("{count} allocations"))),
    }
}
