//! DAGs of a single subtask, with behaviour for the kernel to notice, to outlast or to name.

use alloc::format;
use alloc::vec;
use alloc::vec::Vec;
use core::hint::black_box;
use core::time::Duration;

use fass::{
    Dag, FaultLimit, Occupation, SubtaskAttributes, create_dag, execute_for, finish_create_dags,
};
use kernel::{AppError, Machine, println};
use sched_dag::DagId;

use crate::kernel_crimes;

const PERIOD: Duration = Duration::from_millis(10);

pub(crate) fn named(name: &str) -> SubtaskAttributes {
    SubtaskAttributes::named(name)
}

/// Builds a DAG of one subtask, released every 10 ms.
pub(crate) fn single(
    name: &str,
    jobs: u64,
    attributes: SubtaskAttributes,
    work: impl FnMut() + Send + 'static,
) -> Dag {
    single_every(PERIOD, name, jobs, attributes, work)
}

/// Works like [`single`], with another period.
pub(crate) fn single_every(
    period: Duration,
    name: &str,
    jobs: u64,
    attributes: SubtaskAttributes,
    work: impl FnMut() + Send + 'static,
) -> Dag {
    let dag = create_dag();
    dag.name(name).jobs(jobs).relative_deadline(period);
    dag.register_periodic_subtask(work, vec![], period, attributes);
    dag
}

fn run(machine: &Machine, dags: &[Dag]) -> Result<(), AppError> {
    machine.options().finish(&["test"])?;
    finish_create_dags(dags)?;
    machine.run().map(drop)
}

/// Prints more text in one job than can wait for output.
pub(crate) fn talkative(machine: &Machine) -> Result<(), AppError> {
    let talk = || (0..20).for_each(|_| println!("{:>1000}", "much"));
    run(machine, &[single("talkative", 1, named("talks"), talk)])
}

/// Panics in job 1, and the app does not look at faults. A log line comes before the panic.
pub(crate) fn unnoticed(machine: &Machine) -> Result<(), AppError> {
    let mut jobs = 0;
    let panics = move || {
        jobs += 1;
        fass::log!(Warn, "counted", jobs = jobs, of = "careless");
        assert_eq!(jobs, 1, "a panic on purpose");
    };
    fass::log!(Info, "begins");
    run(machine, &[single("careless", 3, named("panics"), panics)])
}

/// Holds its core until the budget ends the hold, long after the kernel has noticed, next to a DAG
/// with a good end.
pub(crate) fn stalled(machine: &Machine) -> Result<(), AppError> {
    machine.accept_faults();
    let good = single("good", 3, named("returns"), || ());
    let holds = named("holds").budget(Duration::from_secs(10));
    let hold = || execute_for(Duration::MAX, Occupation::Hold);
    run(machine, &[good, single("endless", 3, holds, hold)])
}

/// Takes longer than its WCET in jobs 2 and 3 of 5, with a bound demanded and proven. With
/// `accept=yes` the app announces this beforehand.
pub(crate) fn exceeded(machine: &Machine) -> Result<(), AppError> {
    let accepts = (machine.options()).choice("accept", &[("no", false), ("yes", true)])?;
    machine.options().finish(&["test", "accept"])?;
    if accepts {
        machine.accept_exceeded_bounds();
    }
    let mut times_ms = [0, 0, 3, 4, 0].into_iter();
    let takes = move || {
        let time = Duration::from_millis(times_ms.next().unwrap_or(0));
        execute_for(time, Occupation::Hold);
    };
    let attributes = named("takes").wcet(Duration::from_millis(1));
    let dag = single("guess", 5, attributes, takes);
    dag.demand_proof();
    finish_create_dags(&[dag])?;
    machine.run().map(drop)
}

/// Takes no interrupts any more, for another core to notice: on the first core given by the
/// scheduler, or, if `is_beside`, on another core while the first holds.
pub(crate) fn deaf(machine: &Machine, is_beside: bool) -> Result<(), AppError> {
    let deaf = single("deaf", 1, named("deaf"), || {
        kernel_crimes::take_no_interrupts();
    });
    let hold = || execute_for(Duration::from_secs(60), Occupation::Hold);
    match is_beside {
        false => run(machine, &[deaf]),
        true => run(machine, &[single("holds", 1, named("holds"), hold), deaf]),
    }
}

/// Keeps 1000 bytes in each of three faults, next to a DAG keeping as much without a fault.
pub(crate) fn keep(machine: &Machine) -> Result<(), AppError> {
    machine.accept_faults();
    let mut kept = Vec::new();
    let keep = move || kept.push(vec![1_u8; 1000]);
    let tidy = single("tidy", 3, named("keep"), keep);
    let careless = create_dag();
    careless.name("careless").jobs(3).relative_deadline(PERIOD);
    careless.survive_faults(FaultLimit::new(1, 1, 3));
    let lose = |()| {
        let bytes = black_box(vec![1_u8; 1000]);
        assert!(bytes.is_empty(), "they are lost");
    };
    let loses = careless.period(PERIOD).restarting(move || lose);
    loses.register(named("lose"));
    run(machine, &[tidy, careless])
}

struct Stubborn {
    loops: bool,
}

impl Drop for Stubborn {
    fn drop(&mut self) {
        while black_box(self.loops) {}
        panic!("it cannot be dropped");
    }
}

/// Gives a function a value with a failing `drop`, next to a DAG with a good end.
pub(crate) fn leave(machine: &Machine, loops: bool) -> Result<(), AppError> {
    let good = single("good", 3, named("return"), || ());
    let owned = Stubborn { loops };
    let own = move || {
        black_box(&owned);
    };
    run(machine, &[good, single("stubborn", 3, named("own"), own)])
}

/// Makes many DAGs panic at once, again and again. They cannot be suspended, so no stacks were made
/// for them. The stacks come back.
pub(crate) fn spend_stacks(machine: &Machine) -> Result<(), AppError> {
    machine.options().finish(&["test"])?;
    machine.accept_faults();
    let mut first = None;
    for _ in 0..4 {
        let careless = |number: u32| {
            let attributes = named("panics").non_preemptive();
            single(&format!("careless-{number}"), 1, attributes, || {
                panic!("on purpose")
            })
        };
        finish_create_dags(&(0..40).map(careless).collect::<Vec<_>>())?;
        let run = machine.run()?;
        assert!((0..40).all(|dag| run.statistics(DagId(dag)).faults == 1));
        let now = machine.resources();
        let stacks = (now.contexts, now.contexts_free);
        assert_eq!((stacks.0, *first.get_or_insert(stacks)), (stacks.1, stacks));
    }
    Ok(())
}
