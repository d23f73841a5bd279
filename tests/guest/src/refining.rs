//! Refinements that never end, cut in each job, below a more urgent DAG.

use alloc::vec;
use core::hint::{black_box, spin_loop};
use core::sync::atomic::{AtomicU64, Ordering};
use core::time::Duration;

use fass::{
    Dag, Occupation, Refinements, SubtaskAttributes, create_dag, execute_for, finish_create_dags,
};
use kernel::{Ending, Lock, Machine, json};
use sched_dag::{DagId, Instance, SubtaskId};

const PERIOD: Duration = Duration::from_millis(2);
const JOBS: u64 = 1000;

/// How long the optional part may execute.
const OPTIONAL: Duration = Duration::from_micros(300);

/// How many refinements end in each job.
const STEPS: u64 = 2;

const HEALTHY: DagId = DagId(0);
const REFINED: DagId = DagId(1);
const PLAN: SubtaskId = SubtaskId(1);

/// The results that reached the sink, and those among them that were right.
static RESULTS: [AtomicU64; 2] = [const { AtomicU64::new(0) }; 2];

/// What an endless refinement takes again and again.
static LOCK: Lock<u64> = Lock::new(0);

/// Runs it, and prints what came of it.
pub(crate) fn run(machine: &Machine) -> Result<(), Ending> {
    machine.options().finish(&["test"])?;
    // What the first run takes for good is no leak.
    jobs(machine, 10)?;
    let before = machine.resources();
    let (run, refinements) = jobs(machine, JOBS)?;
    let suspensions = (0..JOBS).filter_map(|job| {
        let plan = Instance {
            dag: REFINED,
            job,
            subtask: PLAN,
        };
        Some(u64::from(run.record().instance(plan)?.preemptions))
    });
    let suspensions: u64 = suspensions.sum();
    let violations = run.violations().count();
    let allocations = run.allocations();
    let [healthy, refined] = [HEALTHY, REFINED].map(|dag| *run.statistics(dag));
    let [complete, cut] = [refinements.complete(), refinements.cut()];
    drop((run, refinements));
    let leaks = machine.resources() != before;
    let results = [0, 1].map(|at| RESULTS[at].load(Ordering::Relaxed));
    json::emit("refining", |line| {
        line.number("jobs", JOBS)
            .number("steps", STEPS)
            .number("results", results[0])
            .number("right", results[1])
            .number("complete", complete)
            .number("cut", cut)
            .number("completed", refined.completed)
            .number("faults", refined.faults)
            .number("suspensions", suspensions)
            .number("healthy_completed", healthy.completed)
            .number("healthy_misses", healthy.misses)
            .number("violations", violations as u64)
            .number("allocations", allocations)
            .number("leaks", u64::from(leaks));
    });
    Ok(())
}

/// Runs it with a third refinement that keeps a lock, so that it cannot be cut.
pub(crate) fn run_in_section(machine: &Machine) -> Result<(), Ending> {
    machine.options().finish(&["test"])?;
    machine.accept_faults(); // the one that is looked for
    let in_section = |_| {
        LOCK.with(|uses| {
            while black_box(true) {
                *uses = uses.wrapping_add(1);
            }
        });
    };
    let (refined, refinements) = refined(JOBS, in_section);
    finish_create_dags(&[healthy(JOBS), refined])?;
    let run = machine.run()?;
    let [healthy, refined] = [HEALTHY, REFINED].map(|dag| *run.statistics(dag));
    json::emit("refining", |line| {
        line.number("jobs", JOBS)
            .number("cut", refinements.cut())
            .number("completed", refined.completed)
            .number("faults", refined.faults)
            .number("healthy_completed", healthy.completed)
            .number("healthy_faults", healthy.faults)
            .number("violations", run.violations().count() as u64);
    });
    Ok(())
}

/// Runs so many jobs of both DAGs.
fn jobs(machine: &Machine, jobs: u64) -> Result<(kernel::Run, Refinements), Ending> {
    let (refined, refinements) = refined(jobs, endless);
    finish_create_dags(&[healthy(jobs), refined])?;
    RESULTS
        .iter()
        .for_each(|count| count.store(0, Ordering::Relaxed));
    Ok((machine.run()?, refinements))
}

/// A DAG that preempts refinements.
fn healthy(jobs: u64) -> Dag {
    let dag = create_dag();
    dag.name("healthy").jobs(jobs).relative_deadline(PERIOD / 4);
    dag.offset(OPTIONAL / 3);
    let tick = SubtaskAttributes::named("tick").priority(1);
    dag.register_periodic_subtask(|| (), vec![], PERIOD, tick);
    dag
}

/// A DAG whose third refinement ends in no job: what it calls again and again gets the job.
fn refined(jobs: u64, taking: fn(u64)) -> (Dag, Refinements) {
    let dag = create_dag();
    dag.name("refined").jobs(jobs);
    let attributes = |name| SubtaskAttributes::named(name).priority(2);
    let mut next = 0_u64..;
    let read = move || (next.next().unwrap_or(0),);
    dag.register_periodic_subtask(read, vec!["job"], PERIOD, attributes("read"));
    let plan = |&(job,): &(u64,)| (job, 0_u64);
    let refine = move |&(job,): &(u64,), &(_, steps): &(u64, u64)| {
        if steps == STEPS {
            loop {
                taking(job);
            }
        }
        Some((job, steps + 1))
    };
    let planning = attributes("plan").budget(PERIOD / 2);
    // SAFETY: it has nothing but numbers, and changes what the lock guards.
    let refinements = unsafe { dag.refining(OPTIONAL, plan, refine) }.register_subtask(
        vec!["job"],
        vec!["planned", "steps"],
        planning,
    );
    let mut expected = 0_u64..;
    let check = move |(planned, steps): (u64, u64)| {
        RESULTS[0].fetch_add(1, Ordering::Relaxed);
        let is_right = (Some(planned), steps) == (expected.next(), STEPS);
        RESULTS[1].fetch_add(u64::from(is_right), Ordering::Relaxed);
        LOCK.with(|uses| *uses += 1);
    };
    let topics = vec!["planned", "steps"];
    dag.register_sink_subtask(check, topics, PERIOD, attributes("check"));
    (dag, refinements)
}

/// Takes time, in one of the ways that there are.
fn endless(job: u64) {
    let long = PERIOD * 1000;
    match job % 4 {
        0 => execute_for(long, Occupation::Hold),
        1 => execute_for(long, Occupation::Spin),
        2 => LOCK.with(|uses| *uses = black_box(*uses) + 1),
        _ => spin_loop(),
    }
}
