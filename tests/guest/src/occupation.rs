//! Checks that an instance occupying its core for a time does so for all of this time.
//!
//! On one core a long instance is preempted again and again while it computes for a stated time.
//! Its time in the record, without the times of the preempting instances, must not be below the
//! stated time. Times differ a little from job to job, so the preemptions come at all places of the
//! loop reading the clock, and, where instructions are counted, also at all places between its
//! first two readings.

use core::hint::black_box;
use core::time::Duration;

use fass::{Occupation, execute_for, finish_create_dags};
use kernel::{AppError, Machine, json};

use crate::single::{named, single_every};

const LONG_NS: u64 = 1_200_000;
const STEP_NS: u64 = 3_001;
const JOBS: u64 = 150;

/// The time from the long DAG's release to the next preemption. Its first reading of the clock is
/// before the preemption in job 0, and after it in the last job.
const BEFORE_NS: u64 = 2_000;

const fn time_ns(job: u64) -> u64 {
    LONG_NS + job * STEP_NS
}

/// Runs both DAGs, and counts the long jobs with too short a time.
pub(crate) fn run(machine: &Machine) -> Result<(), AppError> {
    machine.options().finish(&["test"])?;
    let mut job = 0_u64;
    let interrupt = move || {
        job += 1;
        execute_for(Duration::from_micros(500), Occupation::Spin);
        // Some nanoseconds more or less.
        (0..job % 64).for_each(|step| {
            black_box(step);
        });
    };
    let (urgent, ms) = (named("short").priority(0), Duration::from_millis(1));
    let short = single_every(ms, "short", 5 * JOBS, urgent, interrupt);
    let mut job = 0;
    let compute = move || {
        (0..job).for_each(|step| {
            black_box(step);
        });
        execute_for(Duration::from_nanos(time_ns(job)), Occupation::Spin);
        job += 1;
    };
    let long = single_every(5 * ms, "long", JOBS, named("long").priority(1), compute);
    long.offset(ms - Duration::from_nanos(BEFORE_NS));
    finish_create_dags(&[short, long])?;
    let run = machine.run()?;

    let times = |of: &str| {
        let of = run.task_set().find(of);
        let instances = run.record().all_instances(run.task_set());
        let of_dag = instances.filter(move |(instance, _)| instance.dag == of);
        of_dag
            .filter_map(|(instance, times)| Some((instance.job, times.start_ns?, times.finish_ns?)))
    };
    let mut too_short = 0_u64;
    for (job, start_ns, finish_ns) in times("long") {
        let others = times("short").filter(|(_, start, end)| start_ns < *start && *end < finish_ns);
        let others_ns: u64 = others.map(|(_, start, end)| end - start).sum();
        let own_ns = finish_ns - start_ns - others_ns;
        too_short += u64::from(own_ns < time_ns(job));
    }
    json::emit("occupation", |line| {
        line.number("jobs", JOBS).number("too_short", too_short);
    });
    if too_short > 0 {
        return Err(AppError::Failure("a core was left too early".into()));
    }
    Ok(())
}
