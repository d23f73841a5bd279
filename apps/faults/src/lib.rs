//! Each fault a subtask can commit, next to a DAG that must not notice.
//!
//! Two DAGs run at once. The *healthy* DAG has a deadline that it meets with ease. The *doomed* DAG
//! does the same work until its job [`FATAL_JOB`], in which its middle subtask commits a crime. The
//! app shows how many jobs of the healthy DAG met their deadlines before, during and after the
//! crime, and the price paid by the doomed DAG, under each [`FaultPolicy`].
//!
//! The crime may be a [driver's](served): the questions of a third DAG release the driver's DAG.
//!
//! A [`restless`] DAG commits one crime after the other, thousands of them, and goes on.

#![no_std]

extern crate alloc;

#[allow(unsafe_code, reason = "what the processor must stop")]
pub mod crimes;

use alloc::format;
use alloc::vec;
use core::time::Duration;

use fass::shared::{Asker, LockUse, TimedOut, create_device};
use fass::{Dag, FaultLimit, Occupation, SubtaskAttributes, create_dag};

use crimes::{Crime, LOCKS, RECURRING, Unpunished};

/// The time between two jobs of either DAG, and their relative deadline.
pub const PERIOD: Duration = Duration::from_millis(10);

/// How long each middle subtask executes.
const EXECUTION: Duration = Duration::from_millis(2);

/// The budget of a middle subtask.
pub const BUDGET: Duration = Duration::from_millis(6);

/// The job in which the doomed DAG commits its crime.
pub const FATAL_JOB: u64 = 10;

/// The faults survived by the doomed DAG, unless its policy is [`FaultPolicy::End`].
const FAULT_LIMIT: FaultLimit = FaultLimit::new(1, 10, 2);

/// The jobs of each DAG.
pub const JOBS: u64 = 30;

/// The fate of the doomed DAG after its crime.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaultPolicy {
    /// The crime ends the DAG.
    End,
    /// The DAG goes on with the next job, and the middle subtask is made anew.
    Restart,
    /// The DAG goes on with the next job, and the middle subtask falls back on a second function.
    FallBack,
}

/// Every policy, by name.
pub const POLICIES: [(&str, FaultPolicy); 3] = [
    ("end", FaultPolicy::End),
    ("restart", FaultPolicy::Restart),
    ("fall_back", FaultPolicy::FallBack),
];

/// Builds the DAG that must not notice anything.
pub fn healthy() -> Dag {
    pipeline("healthy", 0, None, Some(BUDGET), FaultPolicy::End)
}

/// The time between two jobs where faults come thick and fast.
const SHORT_PERIOD: Duration = Duration::from_millis(1);

/// Builds a healthy DAG, and a restless DAG that survives `faults` faults, one in every second job.
pub fn restless(faults: u32) -> [Dag; 2] {
    let jobs = u64::from(faults) * 2;
    let healthy = create_dag();
    healthy.name("healthy").jobs(jobs);
    let dag = create_dag();
    let limit = FaultLimit::new(1, 1, faults);
    dag.name("restless").jobs(jobs).survive_faults(limit);
    for (dag, name, priority) in [(&healthy, "healthy", 0), (&dag, "restless", 1)] {
        let mut jobs = 0_u64..;
        let attributes = SubtaskAttributes::named("read").priority(priority);
        let read = move || (jobs.next().unwrap_or_default(),);
        dag.register_periodic_subtask(read, vec![name], SHORT_PERIOD, attributes);
    }
    let attributes = |priority| {
        let attributes = SubtaskAttributes::named("process").priority(priority);
        attributes.budget(SHORT_PERIOD / 4)
    };
    let execute = |(_,): (u64,)| fass::execute_for(SHORT_PERIOD / 20, Occupation::Hold);
    healthy.register_sink_subtask(execute, ["healthy"], SHORT_PERIOD, attributes(0));
    let commit = |(job,): (u64,)| {
        let number = usize::try_from(job / 2).unwrap_or(0) % RECURRING.len();
        if job % 2 == 1 {
            let Unpunished = RECURRING[number]();
        }
    };
    dag.restarting(move || commit)
        .reads(&["restless"])
        .due(SHORT_PERIOD)
        .register(attributes(1));
    [healthy, dag]
}

/// Builds the DAG that commits `crime` in its job [`FATAL_JOB`].
pub fn doomed(crime: Crime, policy: FaultPolicy) -> Dag {
    pipeline("doomed", 1, Some(crime), Some(BUDGET), policy)
}

/// Builds the doomed DAG without a budget, so its crime may take any time to end it.
pub fn doomed_at_leisure(crime: Crime) -> Dag {
    pipeline("doomed", 1, Some(crime), None, FaultPolicy::End)
}

/// Builds a DAG that asks a device once a job, and the doomed DAG serving the device. The questions
/// release the doomed DAG, which answers until it commits `crime` in its job [`FATAL_JOB`]. The
/// asking DAG expects answers and then timeouts, and is at fault itself on a difference.
pub fn served(crime: Crime) -> [Dag; 2] {
    let (device, mut driver) = create_device::<u64, u64>("served");
    let (asks, serves) = (create_dag(), create_dag());
    let attributes = |part: &str| SubtaskAttributes::named(part).priority(1);
    let mut jobs = 0_u64..;
    let ask = move |device: Asker<u64, u64>| {
        let job = jobs.next().unwrap_or_default();
        async move {
            let expected = if job < FATAL_JOB {
                Ok(job)
            } else {
                Err(TimedOut)
            };
            assert_eq!(device.ask(job).await, expected);
        }
    };
    asks.name("asks").jobs(JOBS).period(PERIOD);
    let ask = asks
        .relative_deadline(PERIOD)
        .using(device.asking())
        .async_source(ask);
    ask.register(attributes("ask").wait(3 * EXECUTION));
    serves.name("doomed").relative_deadline(PERIOD);
    device.served_by(&serves.sporadic(PERIOD / 2));
    let serve = move || {
        fass::execute_for(EXECUTION, Occupation::Hold);
        if let Some((ticket, job)) = driver.question() {
            if job == FATAL_JOB {
                let Unpunished = crime();
            }
            let _ = driver.answer(ticket, job);
        }
    };
    let process = attributes("process").wcet(EXECUTION).budget(BUDGET);
    serves.source(serve).register(process);
    [asks, serves]
}

/// The uses of locks lent to the middle subtask.
type Locked = ((), (), (), ());

fn locks() -> (LockUse, LockUse, LockUse, LockUse) {
    let [free, shared, twice, held] = LOCKS.each_ref().map(|lock| lock.entering(u32::MAX));
    (free, shared, twice, held)
}

/// Builds source -> middle -> sink; the middle subtask has a WCET if it has a budget.
fn pipeline(
    name: &str,
    priority: u32,
    crime: Option<Crime>,
    budget: Option<Duration>,
    policy: FaultPolicy,
) -> Dag {
    let dag = create_dag();
    dag.name(name).jobs(JOBS);
    let attributes = |part: &str| SubtaskAttributes::named(part).priority(priority);
    let topic = |part: &str| format!("{name}-{part}");
    let (input, output) = (topic("input"), topic("output"));

    let mut next_job = 0u64;
    let read = move || {
        let job = next_job;
        next_job += 1;
        (job,)
    };
    dag.register_periodic_subtask(read, [input.as_str()], PERIOD, attributes("read"));
    let process = move |_: Locked, (job,): (u64,)| {
        fass::execute_for(EXECUTION, Occupation::Hold);
        if let Some(crime) = crime.filter(|_| job == FATAL_JOB) {
            let Unpunished = crime();
        }
        (job,)
    };
    let middle = match budget {
        Some(budget) => attributes("process").wcet(EXECUTION).budget(budget),
        None => attributes("process"),
    };
    let locks = locks();
    let topics = (vec![&*input], vec![&*output]);
    match policy {
        FaultPolicy::End => {
            (dag.using(locks).subtask(process))
                .reads(&topics.0)
                .writes(&topics.1)
                .register(middle);
        }
        FaultPolicy::Restart => {
            dag.survive_faults(FAULT_LIMIT);
            dag.using(locks)
                .restarting(move || process)
                .reads(&topics.0)
                .writes(&topics.1)
                .register(middle);
        }
        FaultPolicy::FallBack => {
            dag.survive_faults(FAULT_LIMIT);
            let innocent = |_: Locked, (job,): (u64,)| {
                fass::execute_for(EXECUTION, Occupation::Hold);
                (job,)
            };
            dag.using(locks)
                .falling_back(process, innocent)
                .reads(&topics.0)
                .writes(&topics.1)
                .register(middle);
        }
    }
    dag.register_sink_subtask(
        |(_,): (u64,)| (),
        [output.as_str()],
        PERIOD,
        attributes("store"),
    );
    dag
}
