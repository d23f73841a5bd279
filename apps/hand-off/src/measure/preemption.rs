//! From a release to the preemptor's first instruction, and back.
//!
//! A low subtask reads the clock all the time, and keeps the longest time between
//! two readings of a job: that is when it was preempted. The preemptor stamps.

use core::time::Duration;

use fass::{ConstructionPolicy, Dag, SubtaskAttributes, create_dag, finish_create_dags_with};
use hand_off::{Pen, Stamps};
use kernel::{Ending, Machine};
use sched_dag::{CoreId, Instance, SubtaskId};

use super::{run, since};
use crate::row::Row;

const PERIOD: Duration = Duration::from_millis(4);

/// When the preemptor is released: amid what it preempts.
const OFFSET: Duration = Duration::from_millis(1);

/// How long the low subtasks compute.
const WORK_NS: u64 = 2_000_000;

/// Preempts one of the low subtasks, of which each core has one.
pub(crate) fn preemption(machine: &Machine, jobs: u64) -> Result<(), Ending> {
    let mut stamps = Stamps::default();
    let mut dags = alloc::vec![preemptor(jobs, stamps.pen(jobs))];
    for priority in 1..=machine.cores() {
        dags.push(preempted(jobs, priority, stamps.pen(jobs)));
    }
    finish_create_dags_with(&dags, ConstructionPolicy::any_graph())?;
    let run = run(machine)?;
    let epoch_ns = run.epoch_ns();
    let [period_ns, offset_ns] =
        [PERIOD, OFFSET].map(|time| u64::try_from(time.as_nanos()).unwrap_or(u64::MAX));
    let core = |job| {
        let instance = Instance {
            dag: run.task_set().find(&dags[0]),
            job,
            subtask: SubtaskId(0),
        };
        run.record().instance(instance)?.core
    };
    // Of the lowest priority is the last, wherever it runs.
    let lowest = dags.len() - 1;
    // Only core 0 has the release timer; another core is told. Where there are
    // others, few jobs preempt core 0: they are left out.
    let is_told = machine.cores() > 1;
    let name = if is_told {
        "preemption of another core"
    } else {
        "preemption"
    };
    let jobs = || (0..jobs).filter(|job| (core(*job) != Some(CoreId(0))) == is_told);
    let release_ns = |job| Some(epoch_ns + offset_ns + job * period_ns);
    let (first, last) = (|job| stamps.first(0, job), |job| stamps.last(0, job));
    // Another gap than the preemptor's was longer, where the host is busy.
    let gap = |job| {
        let gap = (stamps.first(lowest, job)?, stamps.last(lowest, job)?);
        (gap.0 <= first(job)? && last(job)? <= gap.1).then_some(gap)
    };
    let to_start = jobs().filter_map(|job| since(first(job), release_ns(job)));
    Row::new(name, "release_to_start", to_start).emit();
    if !is_told {
        let out = jobs().filter_map(|job| since(first(job), Some(gap(job)?.0)));
        Row::new(name, "preempted_to_start", out).emit();
    }
    let back = jobs().filter_map(|job| since(Some(gap(job)?.1), last(job)));
    Row::new(name, "return_to_resumed", back).emit();
    Ok(())
}

fn preemptor(jobs: u64, mut pen: Pen) -> Dag {
    let body = move |_| {
        pen.stamp();
        pen.stamp();
    };
    let dag = periodic(jobs, "preemptor", 0, body);
    dag.offset(OFFSET);
    dag
}

fn preempted(jobs: u64, priority: u32, mut pen: Pen) -> Dag {
    let body = move |_| {
        let start_ns = fass::now_ns();
        let (mut last_ns, mut gap) = (start_ns, (0, 0));
        while last_ns - start_ns < WORK_NS {
            let now_ns = fass::now_ns();
            if now_ns - last_ns > gap.1 - gap.0 {
                gap = (last_ns, now_ns);
            }
            last_ns = now_ns;
            core::hint::spin_loop();
        }
        pen.put(gap.0);
        pen.put(gap.1);
    };
    periodic(jobs, "preempted", priority, body)
}

fn periodic(jobs: u64, name: &str, priority: u32, body: impl FnMut(u64) + Send + 'static) -> Dag {
    let dag = create_dag();
    dag.name(name).jobs(jobs).in_flight(1);
    dag.period(PERIOD).relative_deadline(PERIOD);
    let attributes = SubtaskAttributes::named(name).priority(priority);
    let _ = dag.register_untyped_subtask(body, attributes);
    dag
}
