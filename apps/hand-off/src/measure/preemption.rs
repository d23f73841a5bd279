//! From a release to the preemptor's first instruction, and back.
//!
//! A low subtask reads the clock all the time, and keeps the longest time between
//! two readings of a job: that is when it was preempted. The preemptor stamps. The journal has the
//! kernel's own times of request, suspension, start, finish and continuation, which no body can see.

use alloc::vec::Vec;
use core::time::Duration;

use fass::{ConstructionPolicy, Dag, SubtaskAttributes, create_dag, finish_create_dags_with};
use hand_off::{Pen, Stamps};
use kernel::{Ending, Machine, Run};
use sched_dag::journal::{Event, What};
use sched_dag::{CoreId, DagId, Instance, SubtaskId};

use super::{run, since};
use crate::row::emit;

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
    emit(name, "release_to_start", 1, to_start);
    if !is_told {
        let out = jobs().filter_map(|job| since(first(job), Some(gap(job)?.0)));
        emit(name, "preempted_to_start", 1, out);
    }
    let back = jobs().filter_map(|job| since(Some(gap(job)?.1), last(job)));
    emit(name, "return_to_resumed", 1, back);
    let preemptor = run.task_set().find(&dags[0]);
    for (part, samples) in parts(&run, preemptor, is_told) {
        emit(name, part, 1, samples);
    }
    Ok(())
}

/// Takes preemptions apart by the kernel's own times: those of core 0, or of all others.
fn parts(run: &Run, preemptor: DagId, is_told: bool) -> [(&'static str, Vec<u64>); 3] {
    let mut parts = [
        ("request_to_suspended", Vec::new()),
        ("suspended_to_start", Vec::new()),
        ("finish_to_resumed", Vec::new()),
    ];
    // They are in order of time only core by core.
    let mut events: Vec<Event> = run.journal().events().collect();
    events.sort_by_key(|event| event.time_ns);
    for (place, request) in events.iter().enumerate() {
        let is_meant = request.what == What::Request && request.dag == preemptor;
        if !is_meant || (request.core != CoreId(0)) != is_told {
            continue;
        }
        // What happened next on that core, each after the one before.
        let mut later = events[place..].iter();
        let mut next = |what, is_preemptors: bool| {
            let event = later.find(|event| {
                (event.what, event.core) == (what, request.core)
                    && (event.dag == preemptor) == is_preemptors
            })?;
            Some(event.time_ns)
        };
        let times = [
            next(What::Suspend, false),
            next(What::Start, true),
            next(What::Finish, true),
            next(What::Resume, false),
        ];
        if let [Some(suspended), Some(start), Some(finish), Some(resumed)] = times {
            parts[0].1.push(suspended - request.time_ns);
            parts[1].1.push(start - suspended);
            parts[2].1.push(resumed - finish);
        }
    }
    parts
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
