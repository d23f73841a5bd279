//! Values left behind by cancelled instances, large values and some with a failing `drop`, next to
//! a DAG that must not notice.
//!
//! Giving up a value must neither need the value's size on a handler's stack nor run its `drop`
//! there. A value too large for a subtask's own stack is a fault like others.

use alloc::vec;
use core::hint::spin_loop;
use core::time::Duration;

use fass::{
    Dag, Occupation, OverrunPolicy, SubtaskAttributes, Unique, create_dag, execute_for,
    finish_create_dags,
};
use faults::{JOBS, healthy};
use kernel::{AppError, Machine};

const PERIOD: Duration = Duration::from_millis(10);

/// Runs each of the faulting DAGs, next to the healthy DAG.
pub(crate) fn run(machine: &Machine) -> Result<(), AppError> {
    machine.options().finish(&["test"])?;
    machine.accept_faults();
    let doomed: [fn() -> Dag; 4] = [
        fork::<{ 24 << 10 }>,
        fork::<{ 64 << 10 }>,
        || overloaded(|| panic!("it cannot be dropped")),
        || {
            overloaded(|| {
                loop {
                    spin_loop();
                }
            })
        },
    ];
    for doomed in doomed {
        finish_create_dags(&[healthy(), doomed()])?;
        let run = machine.run()?;
        let [healthy, doomed] = ["healthy", "doomed"].map(|dag| *run.statistics(dag));
        let violations = run.violations().count();
        let is_unharmed = (healthy.completed, healthy.misses) == (JOBS, 0);
        if !is_unharmed || doomed.faults != 1 || violations != 0 {
            return Err(AppError::Failure(alloc::format!(
                "{healthy:?}, {doomed:?}, {violations} violations"
            )));
        }
    }
    Ok(())
}

fn dag() -> Dag {
    let dag = create_dag();
    dag.name("doomed").jobs(JOBS);
    dag
}

/// Makes a DAG with a large value waiting for a join; the join's other predecessor panics in job 3.
fn fork<const BYTES: usize>() -> Dag {
    let dag = dag();
    let named = |name| SubtaskAttributes::named(name).priority(1);
    let mut jobs = 0_u64;
    let source = move || {
        jobs += 1;
        ([1_u8; BYTES], jobs - 1)
    };
    dag.register_periodic_subtask(source, vec!["large", "job"], PERIOD, named("source"));
    let panics = |(job,): (u64,)| {
        assert_ne!(job, 3, "a panic on purpose");
        (job,)
    };
    dag.register_subtask(panics, vec!["job"], vec!["same job"], named("panics"));
    let join = |(large, _): ([u8; BYTES], u64)| assert!(large.iter().all(|byte| *byte == 1));
    dag.register_sink_subtask(join, vec!["large", "same job"], PERIOD, named("join"));
    dag
}

/// A value with a `drop` of its own.
struct Sharp(fn());

impl Drop for Sharp {
    fn drop(&mut self) {
        (self.0)();
    }
}

/// Makes a DAG with a slow job 0, which is aborted. The value waiting for job 0's sink is then in
/// the way of job 1's value.
fn overloaded(on_drop: fn()) -> Dag {
    let dag = dag();
    dag.in_flight(1).overrun(OverrunPolicy::Abort);
    let named = |name| SubtaskAttributes::named(name).priority(1);
    let source = move || (Unique::new(Sharp(on_drop)), ());
    let attributes = named("source").budget(PERIOD / 2);
    dag.register_periodic_subtask(source, vec!["sharp", "go"], PERIOD, attributes);
    let slow = |((),): ((),)| {
        execute_for(PERIOD, Occupation::Hold);
        ((),)
    };
    dag.register_subtask(slow, vec!["go"], vec!["went"], named("slow"));
    let sink = |(sharp, ()): (Unique<Sharp>, ())| core::mem::forget(sharp);
    dag.register_sink_subtask(sink, vec!["sharp", "went"], PERIOD, named("sink"));
    dag
}
