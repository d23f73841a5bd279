//! One machine at a time, that cannot take the computer from others for long.

#![allow(dead_code, reason = "each test program uses its part of it")]

use std::fs;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use fass::{Dag, Occupation, Preemption, SubtaskAttributes, create_dag, execute_for};
use linux::{Linux, Mechanism, Run};
use sched_dag::CoreId;
use sched_dag::journal::EventKind;
use sched_dag::law::Violation;

/// Returns the mechanisms that this computer has, and names them: with `sched_ext` if our policy
/// is loaded.
pub(crate) fn mechanisms() -> impl Iterator<Item = Mechanism> {
    let mut all = vec![Mechanism::Fifo, Mechanism::Normal, Mechanism::Poll];
    if fs::exists("/sys/kernel/sched_ext/root/ops").unwrap_or_default() {
        all.push(Mechanism::SchedExt);
    }
    all.into_iter()
        .inspect(|mechanism| println!("by {mechanism:?}"))
}

/// A machine, and the right to be the only one.
pub(crate) struct Alone {
    pub(crate) machine: Linux,
    _right: MutexGuard<'static, ()>,
}

/// Makes the only machine of the program.
pub(crate) fn alone(cores: u32, mechanism: Mechanism) -> Alone {
    let cores = cores.min(linux::processors());
    alone_on(|| Linux::new(cores, mechanism).expect("so many processors are there"))
}

/// Makes the only machine of the program, in this way.
pub(crate) fn alone_on(make: impl FnOnce() -> Linux) -> Alone {
    static RIGHT: Mutex<()> = Mutex::new(());
    let right = RIGHT.lock().unwrap_or_else(PoisonError::into_inner);
    let machine = make();
    machine
        .limit_real_time(Duration::from_secs(5))
        .expect("a limit may be set");
    Alone {
        machine,
        _right: right,
    }
}

pub(crate) fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

/// Computes for a time.
pub(crate) fn spin(us: u64) {
    execute_for(Duration::from_micros(us), Occupation::Spin);
}

/// A DAG whose deadline is its period.
pub(crate) fn every(period: Duration, name: &str) -> Dag {
    let dag = create_dag();
    dag.name(name).period(period).relative_deadline(period);
    dag
}

/// A DAG that is a chain of so many subtasks, each of which computes for `us` in each job.
pub(crate) fn chain(name: &str, links: usize, jobs: u64, period: Duration, us: u64) -> Dag {
    let dag = every(period, name);
    dag.jobs(jobs);
    let compute =
        |_| dag.register_untyped_subtask(move |_job| spin(us), SubtaskAttributes::default());
    let subtasks: Vec<_> = (0..links).map(compute).collect();
    for pair in subtasks.windows(2) {
        dag.precede(&pair[0], &pair[1]);
    }
    dag
}

/// Returns every breach of R1 to R4, and those of R5 that last for longer than this bound: a
/// second with SCHED_FIFO, ten without. An instance waits for what Linux and a hypervisor
/// do and, without SCHED_FIFO, for other programs. A breach that lasts longer is ours. Nothing of
/// a DAG may ever have been on a core of another cluster.
pub(crate) fn breaches(run: &Run) -> Vec<Violation> {
    let task_set = run.task_set();
    for event in run.journal().events() {
        let own = task_set.cores_of(task_set.dag(event.dag).cluster(), run.options().cores);
        assert!(own.contains(&event.core.0), "{event:?} is not on {own:?}");
    }
    for core in (0..run.options().cores).map(CoreId) {
        let of_core = run.journal().events().filter(|event| event.core == core);
        // These two are about another time.
        let own = of_core.filter(|of| !matches!(of.what, EventKind::Request | EventKind::Due));
        assert!(own.is_sorted_by_key(|event| event.time_ns), "{core:?}");
    }
    let bound_ns = match run.options().preemption {
        Preemption::Enabled => 1_000_000_000,
        Preemption::Disabled => 10_000_000_000,
    };
    let of_dispatch = run.dispatch_violations(bound_ns);
    let of_dispatch = of_dispatch.expect("all is recorded");
    run.violations().chain(of_dispatch).collect()
}
