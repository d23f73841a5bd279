//! A run in two modes, which a DAG of no mode changes.
//!
//! `cruise` and `descend` have a job every 4 ms, of two milliseconds and less; each is a mode of
//! its own. `pilot`, every 6 ms, asks for the landing when idle and for the flight at once, in
//! turns of three jobs. At last it shuts the run down.

use alloc::vec;

use fass::{Dag, Entrance, Modes, Shutdown, create_dag, finish_create_dags, shutting_down};
use kernel::{Ending, Machine, json};

use crate::times::{hold, ms, taking};

/// What the pilot changes.
type Uses<'a> = (Entrance<'a>, Entrance<'a>, Shutdown<'a>);

/// Runs them, and prints how that went.
pub(crate) fn run(machine: &Machine) -> Result<(), Ending> {
    report(machine, |_| ())
}

/// Does so on divided cores, where the pilot is in another cluster than what it changes.
pub(crate) fn divided(machine: &Machine) -> Result<(), Ending> {
    machine.divide(&[1, 1]);
    report(machine, |[cruise, descend, pilot]| {
        cruise.cluster(1);
        descend.cluster(1);
        pilot.cluster(0);
    })
}

fn report(machine: &Machine, place: impl FnOnce(&[Dag; 3])) -> Result<(), Ending> {
    machine.options().finish(&["test"])?;
    let (cruise, descend) = (working("cruise"), working("descend"));
    let modes = Modes::new();
    let flight = modes.mode("flight", &[&cruise]);
    let landing = modes.mode("landing", &[&descend]);

    let pilot = create_dag();
    pilot.name("pilot").relative_deadline(ms(6));
    let mut job = 0_u64;
    let fly = move |(mut flight, mut landing, mut end): Uses<'_>| {
        job += 1;
        match job % 6 {
            _ if job == 40 => end.request(),
            2 => landing.when_idle(),
            5 => flight.at_once(),
            _ => {}
        }
        hold(100);
    };
    pilot
        .using((flight.entering(), landing.entering(), shutting_down()))
        .register_periodic_subtask(fly, vec![], ms(6), taking("fly", 300));
    let dags = [cruise, descend, pilot];
    place(&dags);
    finish_create_dags(&dags)?;
    let run = machine.run()?;
    json::emit("modes", |line| {
        line.number("violations", run.violations().count() as u64)
            .number("allocations", run.allocations());
    });
    Ok(())
}

/// A fork-join that keeps its cores busy for most of the time.
fn working(name: &str) -> Dag {
    let dag = create_dag();
    dag.name(name).period(ms(4)).relative_deadline(ms(4));
    let work = |_job| hold(500);
    let step = |subtask| dag.register_untyped_subtask(work, taking(subtask, 700));
    let (first, left, right, last) = (step("first"), step("left"), step("right"), step("last"));
    dag.precede(&first, &left).precede(&first, &right);
    dag.precede(&left, &last).precede(&right, &last);
    dag
}
