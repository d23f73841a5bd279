//! DAGs of the kernel's own, used to measure its overheads.
//!
//! Their functions do next to nothing, so the time between their instances is the platform's. In
//! each period, every core is busy with an instance when ten DAGs are released at one instant. A
//! single step releases them all, and preempts an instance on every core. Of the ten, one DAG forks
//! to 16 subtasks and joins, one is a chain, the others have a single subtask each. Four more fall
//! due while the step has interrupts disabled, and so are released late. Then the preempted
//! instances go on. All have budgets, so that each dispatch sets an alarm.
//!
//! Once the cores are idle, two more DAGs are released close to a DAG whose jobs all end in an
//! exception, in each job at a different moment. These faults are not reported.
//!
//! The more instances become ready at once, the longer the step takes. An app with more of them is
//! charged by their number (`Overheads::ready_ns`).

use alloc::format;
use alloc::vec::Vec;
use core::time::Duration;

use fass::commit::{ConstructionPolicy, OverheadSource, Overheads, finish_create_dags_with};
use fass::platform::Platform;
use fass::{
    Dag, FaultLimit, Occupation, SubtaskAttributes, UntypedSubtask, create_dag, execute_for,
};
use sched_dag::law::MeasuredCosts;

use executive::machine::{clock, cpu};
use executive::run::platform::KERNEL;
use executive::run::{containment, execution, worker};
use front::app::ending::AppError;
use front::json;

const PERIOD: Duration = Duration::from_micros(1_250);
const JOBS: u32 = 20;
/// The execution time of the instances to be preempted, and the time of their preemption.
const BUSY: Duration = Duration::from_micros(400);
const INTO_IT: Duration = Duration::from_micros(100);
const WIDE: usize = 16;
const LONG: usize = 16;
/// The number of DAGs released at the same instant.
const AT_ONCE: u64 = 10;
/// The number of DAGs due during that step, and the time between them.
const DURING_IT: u32 = 4;
const APART: Duration = Duration::from_micros(2);
/// The time in a period when the cores are idle.
const IDLE: Duration = Duration::from_micros(1_100);
/// The delay of the fault from job to job, and its lead over the two releases in the first job.
const STEP: Duration = Duration::from_micros(1);
const BEFORE: Duration = Duration::from_micros(15);
/// A budget that no instance comes near.
const BUDGET: Duration = Duration::from_secs(10);
/// Time for the cores to get ready.
const LEAD_NS: u64 = 100_000;

/// Measures the overheads, and charges them to the commits to come with this margin.
pub(super) fn charge(margin_percent: u32) -> Result<(), AppError> {
    let costs = run()?;
    let measured = Overheads::measured(&costs, margin_percent, AT_ONCE);
    // The charge of a network stays, even with frames arriving during the measurement: nothing else
    // has been charged before.
    let before = KERNEL.terms().overheads;
    let overheads = Overheads {
        device_ns: before.device_ns,
        device_distance_ns: before.device_distance_ns,
        dispatch_ns: measured.dispatch_ns.saturating_add(before.dispatch_ns),
        ..measured
    };
    KERNEL.change(|terms| {
        terms.overheads = overheads;
        terms.overhead_source = OverheadSource::Measured {
            dispatches: costs.dispatches,
            margin_percent,
        };
    });
    crate::println!(
        "overheads measured: {costs}; with a margin of {margin_percent} %: overheads_ns={}",
        overheads.stated()
    );
    json::emit("overheads", |line| {
        line.number("dispatches", costs.dispatches)
            .number("owed_ns", costs.owed_ns)
            .number("releases", costs.releases)
            .number("late_ns", costs.late_ns)
            .number("margin_percent", margin_percent);
    });
    Ok(())
}

/// Runs the DAGs, and returns the measured costs.
fn run() -> Result<MeasuredCosts, AppError> {
    KERNEL.set_calibration(true);
    let committed = finish_create_dags_with(&dags(), ConstructionPolicy::any_graph());
    // Before the error is returned: the commits to come are the app's in any case.
    KERNEL.set_calibration(false);
    committed?;
    let failure =
        |what: &str| AppError::Failure(format!("overheads could not be measured: {what}"));
    execution::set_epoch(clock::now_ns() + LEAD_NS)
        .ok_or_else(|| failure("nothing is committed"))?;
    execution::arm_all();
    worker::wait_in_background(containment::forget_fault);
    containment::take_last_faults(containment::forget_fault);
    let ended = execution::take_run().ok_or_else(|| failure("nothing was run"))?;
    let costs = ended.journal().costs(ended.task_set());
    costs.ok_or_else(|| failure("there is no memory for their journal; give the machine more"))
}

fn dags() -> Vec<Dag> {
    let busy = dag(Duration::ZERO, PERIOD * 2);
    for _ in 0..KERNEL.terms().scheduler.cores {
        subtask(&busy, 1, BUSY);
    }
    let wide = dag(INTO_IT, PERIOD);
    let [source, sink] = [(); 2].map(|()| urgent(&wide));
    for _ in 0..WIDE {
        let branch = urgent(&wide);
        wide.precede(&source, &branch).precede(&branch, &sink);
    }
    let long = dag(INTO_IT, PERIOD);
    let mut last = urgent(&long);
    for _ in 1..LONG {
        let next = urgent(&long);
        long.precede(&last, &next);
        last = next;
    }
    // The wide and the long DAG are among the ten.
    let at_once = (2..AT_ONCE).map(|_| Duration::ZERO);
    let during = (1..=DURING_IT).map(|number| APART * number);
    let singles = at_once.chain(during).map(|later| {
        let single = dag(INTO_IT + later, PERIOD);
        urgent(&single);
        single
    });
    let next_to_it = [IDLE; 2].map(|at| {
        let single = dag(at, PERIOD);
        urgent(&single);
        single
    });
    let dags = [busy, wide, long].into_iter().chain(singles);
    dags.chain(next_to_it).chain([faulty()]).collect()
}

/// Makes a DAG whose instances do nothing but fail.
fn faulty() -> Dag {
    let dag = dag(IDLE - BEFORE, PERIOD);
    dag.period(PERIOD + STEP).survive_faults(FaultLimit {
        faults: 1,
        window: 1,
        in_all: JOBS,
    });
    let fail = || |()| cpu::access_nothing();
    (dag.restarting(fail)).register(SubtaskAttributes::named("fails").budget(BUDGET));
    dag
}

fn dag(offset: Duration, deadline: Duration) -> Dag {
    let dag = create_dag();
    dag.period(PERIOD).relative_deadline(deadline);
    dag.offset(offset).jobs(JOBS.into());
    dag
}

fn urgent(dag: &Dag) -> UntypedSubtask {
    subtask(dag, 0, Duration::ZERO)
}

fn subtask(dag: &Dag, priority: u32, time: Duration) -> UntypedSubtask {
    let attributes = SubtaskAttributes::default()
        .priority(priority)
        .budget(BUDGET);
    let work = move |_job| execute_for(time, Occupation::Hold);
    dag.register_untyped_subtask(work, attributes)
}
