//! Many DAGs preempting each other while every instance checks itself.
//!
//! Six fork-join DAGs of different rates share the cores, the faster DAGs with the higher
//! priorities. Each instance repeats work with a known result: any register or byte not restored by
//! an interrupt, a preemption, or a move to another core shows as a difference. With AVX, its
//! registers are checked, too.
//!
//! With `budgets=yes` each instance has a budget of 1.5 times its time alone. It would exceed this
//! budget if suspensions, or other instances' computing, counted as its own time.
//!
//! With `held=yes` some instance is preempted however late the host is: instances of the least
//! urgent DAG hold all cores but one until two instances of the most urgent DAG have run at the
//! same time.

use alloc::format;
use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use core::time::Duration;

use fass::commit::{ConstructionPolicy, finish_create_dags_with};
use fass::shared::Raiser;
use fass::{Dag, SubtaskAttributes, create_dag};
use kernel::{AppError, Machine, json};

use crate::checksum::checksum;
use crate::upper_halves;

/// The periods in milliseconds; the shortest gets the highest priority.
const PERIODS_MS: [u64; 6] = [2, 3, 5, 7, 11, 13];

/// The default number of repetitions of an instance's work: about 0.15 ms, 70 % of one core in all.
const ROUNDS: u64 = 12;

/// The work of each instance.
struct Work {
    rounds: u64,
    diverged: AtomicU64,
    budget: Option<Duration>,
}

/// Runs the DAGs for `ms` milliseconds of releases.
pub(crate) fn run(machine: &Machine) -> Result<(), AppError> {
    let options = machine.options();
    let ms = options.number("ms", 1..=3_600_000, 500)?;
    let rounds = options.number("rounds", 1..=1_000_000, ROUNDS)?;
    let has_budgets = options.choice("budgets", &[("no", false), ("yes", true)])?;
    let is_held = options.choice("held", &[("no", false), ("yes", true)])?;
    options.finish(&["test", "ms", "rounds", "budgets", "held"])?;

    let mut work = Work {
        rounds,
        diverged: AtomicU64::new(0),
        budget: None,
    };
    let start_ns = fass::now_ns();
    work.compute();
    let alone = Duration::from_nanos(fass::now_ns() - start_ns);
    work.budget = has_budgets.then(|| alone * 3 / 2);
    let work = Arc::new(work);
    let mut dags: Vec<Dag> = (0..)
        .zip(PERIODS_MS)
        .map(|(priority, period_ms)| fork_join(priority, period_ms, ms, &work))
        .collect();
    if is_held {
        dags.extend(holding(machine.cores(), &work));
    }
    finish_create_dags_with(&dags, ConstructionPolicy::any_graph())?;
    let run = machine.run()?;

    let violations = run.violations().count() as u64;
    // In real time the host may take a core away for longer.
    let passed_over = run.dispatch_violations(50_000).unwrap_or_default();
    let diverged = work.diverged.load(Ordering::Relaxed);
    let instances = || run.record().all_instances(run.task_set());
    json::emit("preemption", |line| {
        line.number("instances", instances().count() as u64)
            .number(
                "preemptions",
                instances()
                    .map(|(_, times)| u64::from(times.preemptions))
                    .sum::<u64>(),
            )
            .number("interrupts", kernel::timer_interrupts())
            .number("diverged", diverged)
            .number("violations", violations)
            .number("allocations", run.allocations())
            .number("passed_over", passed_over.len() as u64)
            .flag("avx", kernel::has_avx())
            .number("cpus", machine.cores());
    });
    if diverged + violations > 0 {
        let message = format!("{diverged} results diverged, {violations} violations");
        return Err(AppError::Failure(message));
    }
    Ok(())
}

/// Builds source -> three parallel subtasks -> sink, all of one priority.
fn fork_join(priority: u32, period_ms: u64, ms: u64, work: &Arc<Work>) -> Dag {
    let period = Duration::from_millis(period_ms);
    let dag = create_dag();
    dag.name(&format!("every-{period_ms}-ms"))
        .jobs(ms.div_ceil(period_ms))
        .in_flight(8);
    let attributes = |name: &str| SubtaskAttributes::named(name).priority(priority);
    let computing = |name: &str| match work.budget {
        Some(budget) => attributes(name).budget(budget),
        None => attributes(name),
    };
    let topic = |name: &str| format!("{period_ms}-{name}");
    let (start, parts) = (topic("start"), [topic("a"), topic("b"), topic("c")]);

    let mut job = 0u64;
    let count = move || {
        job += 1;
        (job,)
    };
    dag.register_periodic_subtask(count, [start.as_str()], period, attributes("source"));
    for part in &parts {
        let work = work.clone();
        let pass = move |(job,): (u64,)| {
            work.compute();
            (job,)
        };
        dag.register_subtask(pass, [start.as_str()], [part.as_str()], computing(part));
    }
    let work = work.clone();
    let join = move |(a, b, c): (u64, u64, u64)| {
        work.compute();
        assert!(a == b && b == c, "a join of the jobs {a}, {b} and {c}");
    };
    let parts: Vec<&str> = parts.iter().map(String::as_str).collect();
    dag.register_sink_subtask(join, parts, period, computing("sink"));
    dag
}

/// Builds the DAG holding the cores, and the DAG called for by it when the cores are held.
fn holding(cores: u32, work: &Arc<Work>) -> [Dag; 2] {
    let [ms, longest] = [Duration::from_millis(2), Duration::from_secs(100)];
    // How many hold a core, and how many of those that preempt them have run.
    let counts = Arc::new([const { AtomicU32::new(0) }; 2]);
    let compute_until = |place: usize, count: u32| {
        let (counts, work) = (counts.clone(), work.clone());
        move || {
            while counts[place].load(Ordering::Relaxed) < count {
                work.compute();
            }
        }
    };
    let urgent = create_dag();
    let called = urgent.name("urgent").jobs(1).sporadic(ms);
    let first = SubtaskAttributes::default().priority(0);
    let source = urgent.source(|| (1_u8,)).writes(&["now"]);
    source.register(first.clone());
    for _ in 0..2 {
        let counts = counts.clone();
        let preempt = move |(_,): (u8,)| _ = counts[1].fetch_add(1, Ordering::Relaxed);
        urgent.register_sink_subtask(preempt, ["now"], ms, first.clone());
    }
    let held = create_dag();
    held.name("held").jobs(1);
    let last = SubtaskAttributes::default().priority(9);
    held.register_periodic_subtask(|| (1_u8,), ["go"], longest, last.clone());
    for _ in 1..cores {
        let (hold, counts) = (compute_until(1, 2), counts.clone());
        let hold = move |(_,): (u8,)| {
            counts[0].fetch_add(1, Ordering::Relaxed);
            hold();
        };
        held.register_sink_subtask(hold, ["go"], longest, last.clone());
    }
    let wait = compute_until(0, cores - 1);
    let call = move |mut called: Raiser<'_>, (_,): (u8,)| {
        wait();
        called.raise();
    };
    let call = held.using(called.raising()).subtask(call).reads(&["go"]);
    call.due(longest).register(last);
    [urgent, held]
}

impl Work {
    fn compute(&self) {
        let expected = checksum();
        for _ in 0..self.rounds {
            if !upper_halves::are_kept_besides_others(expected) {
                self.diverged.fetch_add(1, Ordering::Relaxed);
            }
        }
    }
}
