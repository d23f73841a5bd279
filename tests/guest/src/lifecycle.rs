//! A run that its own functions change: one DAG pauses and resumes another, and one ends all.
//!
//! `ticks` has a job every 2 ms, and begins paused. `asks`, every 10 ms, resumes it in every
//! fourth job from job 1 on and pauses it two jobs later, so it is on for 20 ms and off for as
//! long. `ends` shuts the run down in job 10, at 200 ms. None of them has a last job.

use alloc::vec;

use fass::{Dag, Shutdown, Switch, create_dag, finish_create_dags, shutting_down};
use kernel::{Ending, Machine, json};
use sched_dag::DagId;

use crate::times::{hold, ms, taking};

/// Runs them, and prints what became of their jobs.
pub(crate) fn run(machine: &Machine) -> Result<(), Ending> {
    report(machine, |_| ())
}

/// Does so on divided cores, where `ticks` is in another cluster than the others.
pub(crate) fn divided(machine: &Machine) -> Result<(), Ending> {
    machine.divide(&[1, 1]);
    report(machine, |[ticks, asks, ends]| {
        ticks.cluster(1);
        asks.cluster(0);
        ends.cluster(0);
    })
}

fn report(machine: &Machine, place: impl FnOnce(&[Dag; 3])) -> Result<(), Ending> {
    machine.options().finish(&["test"])?;
    let ticks = ticks();
    let asks = asks(&ticks);
    let dags = [ticks, asks, ends()];
    place(&dags);
    finish_create_dags(&dags)?;
    let run = machine.run()?;
    let [ticks, asks, ends] = [0, 1, 2].map(|dag| *run.statistics(DagId(dag)));
    json::emit("lifecycle", |line| {
        line.number("ticks", ticks.released)
            .number("skips", ticks.skips)
            .number("asks", asks.released)
            .number("ends", ends.released);
        let unfinished = [ticks, asks, ends].map(|dag| dag.released - dag.completed);
        line.number("unfinished", unfinished.iter().sum::<u64>())
            .number("violations", run.violations().count() as u64)
            .number("allocations", run.allocations());
    });
    Ok(())
}

fn ticks() -> Dag {
    let dag = create_dag();
    dag.name("ticks").starts_paused();
    let mut next = 0_u64;
    let source = move || {
        next += 1;
        hold(50);
        (next,)
    };
    dag.register_periodic_subtask(source, vec!["tick"], ms(2), taking("tick", 200));
    let mut last = 0;
    let sink = move |(tick,): (u64,)| {
        hold(50);
        assert_eq!(tick, last + 1, "each value comes once, in its order");
        last = tick;
    };
    dag.register_sink_subtask(sink, vec!["tick"], ms(2), taking("count", 200));
    dag
}

fn asks(ticks: &Dag) -> Dag {
    let dag = create_dag();
    dag.name("asks").relative_deadline(ms(2));
    let mut job = 0_u64;
    let ask = move |mut ticks: Switch<'_>| {
        match job % 4 {
            1 => ticks.resume(),
            3 => ticks.pause(),
            _ => {}
        }
        job += 1;
        hold(100);
    };
    dag.using(ticks.switching())
        .register_periodic_subtask(ask, vec![], ms(10), taking("ask", 300));
    dag
}

fn ends() -> Dag {
    let dag = create_dag();
    dag.name("ends").relative_deadline(ms(20));
    let mut job = 0_u64;
    let end = move |mut shutdown: Shutdown<'_>| {
        if job == 10 {
            shutdown.request();
        }
        job += 1;
        hold(5000);
    };
    dag.using(shutting_down())
        .register_periodic_subtask(end, vec![], ms(20), taking("end", 6000));
    dag
}
