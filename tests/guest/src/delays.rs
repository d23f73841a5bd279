//! Delays of an instance besides the model, provoked at all moments around its release.
//!
//! In each run a disturbance comes every 1.003 ms, next to two DAGs of 1 kHz with a bound, the
//! first more urgent than the disturbance, the second less urgent. So from job to job the
//! disturbance comes 3 us later to them. All functions hold their cores, and the overheads are the
//! kernel's measurements. Each run prints the longest responses next to the bounds.

use alloc::boxed::Box;
use alloc::format;
use alloc::vec::Vec;
use core::time::Duration;

use fass::shared::Switch;
use fass::{Dag, FaultLimit, Occupation, create_dag, execute_for, finish_create_dags, sleep};
use faults::crimes::RECURRING;
use kernel::{AppError, Event, Lock, Machine, json, println};

use crate::single::{named, single_every};

/// The number of disturbances, and of the bounded DAGs' releases during them.
const TIMES: u64 = 60;

/// The number of lines in the text of a disturbance.
const LINES: u64 = 10;

/// A lock of a counter: the number of sections entered.
static LOCK: Lock<u64> = Lock::new("shared", 0).longest(us(25));

type Work = Box<dyn FnMut() + Send>;

/// A disturbance: its name, and the function making its DAGs.
type Cause = (&'static str, fn() -> Vec<Dag>);

/// All disturbances.
const CAUSES: [Cause; 10] = [
    ("none", Vec::new),
    ("releases", releases),
    ("wakes", wakes),
    ("panics", || faults(40, || panic!("on purpose"))),
    ("exceptions", || faults(60, || _ = RECURRING[1]())),
    ("overruns", || faults(30, || hold(1_000))),
    ("log", || {
        lines(|line| fass::log!(Info, "flood", line = line))
    }),
    ("text", || lines(|line| println!("{line:>60}"))),
    ("backlog", backlog),
    ("sections", sections),
];

const fn us(us: u64) -> Duration {
    Duration::from_micros(us)
}

fn hold(time_us: u64) {
    execute_for(us(time_us), Occupation::Hold);
}

/// Runs all disturbances one after the other.
pub(crate) fn run(machine: &Machine) -> Result<(), AppError> {
    machine.offer_overheads()?;
    machine.options().finish(&["test", "overheads"])?;
    machine.accept_faults();
    for (cause, disturb) in CAUSES {
        let bounded = |name, priority| {
            let attributes = named(name).priority(priority).wcet(us(20));
            single_every(us(1_000), name, TIMES + 5, attributes, || hold(19))
        };
        let mut dags = alloc::vec![bounded("urgent", 0)];
        dags.extend(disturb());
        if cause != "sections" {
            dags.push(bounded("modest", 9));
        }
        tell(machine, cause, &dags, &["urgent", "modest"])?;
    }
    Ok(())
}

/// Runs DAGs keeping core 0 busy for longer than its background may wait, during faults.
pub(crate) fn starved(machine: &Machine) -> Result<(), AppError> {
    // Heartbeats come at another moment of each period.
    let (jobs, period) = (900, us(1_007));
    let mut dags = faults(5, || hold(60));
    dags[0].jobs(jobs).period(period).relative_deadline(period);
    let urgent = named("urgent").priority(0).wcet(us(851));
    // What interrupts a hold before its end delays nothing, so there are many.
    let work = || (0..80).for_each(|_| hold(10));
    dags.push(single_every(period, "urgent", jobs, urgent, work));
    let busy = named("busy").priority(99);
    dags.push(single_every(us(20_000), "busy", 5, busy, || hold(20_000)));
    run_one(machine, "starved", &dags)
}

/// Runs a DAG waiting for many events, while another DAG notifies them and others run.
pub(crate) fn events(machine: &Machine) -> Result<(), AppError> {
    static EVENTS: [Event; 1_000] = [const { Event::new() }; 1_000];
    let period = us(1_000);
    let of =
        |name, jobs, attributes, work: fn()| single_every(period, name, jobs, attributes, work);
    let urgent = named("urgent").priority(0).wcet(us(20));
    let urgent = of("urgent", TIMES + 5, urgent, || hold(19));
    let waiter = of("waiter", TIMES, named("waiter").priority(6), || {
        EVENTS.iter().for_each(|event| event.wait(u64::MAX, 0));
    });
    waiter.offset(us(950));
    let notifier = named("notifier").priority(6).budget(us(900));
    let notifier = of("notifier", TIMES, notifier, || {
        (0..30).for_each(|_| EVENTS.iter().for_each(Event::notify));
    });
    notifier.offset(us(955));
    run_one(machine, "events", &[urgent, waiter, notifier])
}

fn run_one(machine: &Machine, cause: &str, dags: &[Dag]) -> Result<(), AppError> {
    machine.offer_overheads()?;
    machine.options().finish(&["test", "overheads"])?;
    machine.accept_faults();
    tell(machine, cause, dags, &["urgent"])
}

/// Runs DAGs, and prints the longest responses of the DAGs in `names`.
fn tell(machine: &Machine, cause: &str, dags: &[Dag], names: &[&str]) -> Result<(), AppError> {
    finish_create_dags(dags)?;
    let run = machine.run()?;
    for &name in names {
        json::emit("delay", |line| {
            line.text("cause", cause)
                .text("dag_name", name)
                .number("bound_ns", run.bound_ns(name).unwrap_or(0))
                .number("longest_ns", run.response_times_ns(name).max().unwrap_or(0))
                .number("jobs", run.statistics(name).completed)
                .number("entered", LOCK.with(|entered| *entered))
                .number("allocations", run.allocations())
                .number("violations", run.violations().count() as u64);
        });
    }
    Ok(())
}

/// Makes a disturbing DAG, without subtasks yet.
fn disturbance(name: &str) -> Dag {
    let dag = create_dag();
    (dag.name(name).jobs(TIMES).period(us(1_003))).relative_deadline(us(1_003));
    dag.offset(us(900));
    dag
}

/// Makes DAGs released together, more of them than cores.
fn releases() -> Vec<Dag> {
    let single = |number| {
        let dag = disturbance(&format!("release-{number}"));
        dag.source(|| hold(4))
            .register(named("holds").priority(5).wcet(us(5)));
        dag
    };
    (0..9).map(single).collect()
}

/// Makes DAGs with waits ending at the same time.
fn wakes() -> Vec<Dag> {
    let single = |number| {
        let dag = disturbance(&format!("wake-{number}"));
        let attributes = named("waits")
            .priority(5)
            .wcet(us(4))
            .wait(us(20))
            .wcet(us(4));
        (dag.async_source(|| async { sleep(us(20)).await })).register(attributes);
        dag
    };
    (0..4).map(single).collect()
}

/// Makes a DAG losing each job to a fault.
fn faults(budget_us: u64, work: fn()) -> Vec<Dag> {
    let dag = disturbance("faulty");
    dag.survive_faults(FaultLimit::new(1, 1, 1_000));
    let attributes = named("fails").priority(5).wcet(us(budget_us));
    let made = move || move |()| work();
    (dag.restarting(made)).register(attributes.budget(us(budget_us)));
    alloc::vec![dag]
}

/// Makes a DAG saying much in each job.
fn lines(say: fn(u64)) -> Vec<Dag> {
    let dag = disturbance("talkative");
    let work: Work = Box::new(move || (0..LINES).for_each(say));
    dag.source(work)
        .register(named("talks").priority(5).wcet(us(150)));
    alloc::vec![dag]
}

/// Makes a DAG paused while thousands of its jobs wait, and the DAG pausing it.
fn backlog() -> Vec<Dag> {
    let over = create_dag();
    (over.name("over").jobs(2 * TIMES * 50).period(us(20))).relative_deadline(us(100));
    over.in_flight(1);
    let switch = disturbance("switch");
    let mut job = 0;
    let pause = move |mut of: Switch<'_>| {
        job += 1;
        if job == TIMES / 2 {
            of.pause();
        }
    };
    let attributes = named("pauses").priority(5).wcet(us(5));
    switch
        .using(over.switching())
        .source(pause)
        .register(attributes);
    over.source(|| hold(100))
        .register(named("holds").priority(99).wcet(us(100)));
    alloc::vec![switch, over]
}

/// Makes DAGs entering sections of one lock, on each core; the less urgent DAG with a bound does
/// the same.
fn sections() -> Vec<Dag> {
    let entering = |dag: Dag, priority| {
        let enter = |entered: &mut u64| {
            hold(15);
            *entered += 1;
        };
        let attributes = named("enters").priority(priority).wcet(us(30));
        dag.using(LOCK.entering(1))
            .source(move |()| LOCK.with(enter))
            .register(attributes);
        dag
    };
    let modest = disturbance("modest");
    (modest.jobs(TIMES + 5).period(us(1_000))).relative_deadline(us(1_000));
    modest.offset(Duration::ZERO);
    let others = (0..4).map(|number| entering(disturbance(&format!("section-{number}")), 5));
    others.chain([entering(modest, 9)]).collect()
}
