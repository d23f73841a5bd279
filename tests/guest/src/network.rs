//! An echo next to a control loop. The loop prints the state of the wire's link, at first and after
//! each change.
//!
//! With two clusters the loop is in the first cluster and the echo in the second.

use core::sync::atomic::{AtomicU64, Ordering};
use core::time::Duration;

use executive::memory::heap;
use fass::{Occupation, create_dag, execute_for, finish_create_dags};
use kernel::{AppError, Machine, json, println};

use crate::single::named;

/// The heap's number of allocations in the loop's first job, and in its latest job.
static ALLOCATIONS: [AtomicU64; 2] = [const { AtomicU64::new(0) }; 2];

/// Runs both until the end of the run is requested.
pub(crate) fn run(machine: &Machine) -> Result<(), AppError> {
    let wire = echo::wire();
    machine.connect(&wire)?;
    machine.offer_clusters()?;
    machine.options().finish(&["test", "clusters"])?;
    let (ms, us) = (Duration::from_millis(1), Duration::from_micros);
    let control = create_dag();
    control.name("control").period(ms).relative_deadline(ms);
    let mut before = None;
    let compute = move |is_up: bool| {
        execute_for(us(300), Occupation::Spin);
        let allocations = heap::usage().allocations;
        ALLOCATIONS[usize::from(before.is_some())].store(allocations, Ordering::Relaxed);
        if before.replace(is_up) != Some(is_up) {
            println!("the link is {}", if is_up { "up" } else { "down" });
        }
    };
    (control.using(wire.link().reading()).source(compute)).register(named("compute").wcet(us(400)));
    let [echo, clock] = echo::build(&wire, ms, 0);
    if machine.clusters().sizes().len() > 1 {
        control.cluster(0);
        clock.cluster(0);
        echo.cluster(1);
    }
    finish_create_dags(&[control, echo, clock])?;
    // A person ends it, and then there is no report.
    let ended = machine.run();
    let [first, last] = ALLOCATIONS
        .each_ref()
        .map(|count| count.load(Ordering::Relaxed));
    json::emit("control", |line| {
        line.number("allocations", last - first);
    });
    ended.map(drop)
}
