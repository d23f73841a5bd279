//! Boots into random DAG sets, one after the other, and checks after each.
//!
//! Words of the command line: `rounds` of `round_ms` each, from round `first`
//! on, at `load` percent of the cores, with what `overrun` says; `work`, which is `hold`
//! or `compute`; `trouble`, which is `none` or `drawn`; and `seed`. The policy is the kernel's word.

#![no_std]
#![no_main]

extern crate alloc;

use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::time::Duration;

use fass::{ConstructionPolicy, OverrunPolicy, finish_create_dags_with};
use fork_join::Pace;
use kernel::{Ending, Machine, Resources, Run, json, println};
use soak::{Account, DagPlan, Executed, Trouble, build, draw_set, largest_set};

kernel::entry!(main);

const OVERRUNS: [(&str, OverrunPolicy); 3] = [
    ("queue", OverrunPolicy::Queue),
    ("skip", OverrunPolicy::Skip),
    ("abort", OverrunPolicy::Abort),
];

/// How many breaches of the rules are printed in words.
const SHOWN: usize = 10;

/// How much of the heap a fault keeps for good, at most: its body, and what that owns.
const KEPT_BYTES: usize = 1024;

/// What the command line says.
struct Soak<'a> {
    seed: u64,
    load: u64,
    length: Duration,
    /// How long a round of work takes, if instances compute.
    round_ns: Option<u64>,
    overrun: OverrunPolicy,
    overrun_name: &'a str,
    policy_name: &'a str,
    /// Whether faults, pauses and clusters are drawn.
    has_trouble: bool,
}

/// What a round has come to.
struct Outcome {
    account: Account,
    violations: u64,
    complaint: Option<String>,
}

fn main(machine: &Machine) -> Result<(), Ending> {
    let options = machine.options();
    let first = options.number("first", 0..=u64::MAX / 2, 0)?;
    let rounds = options.number("rounds", 1..=1_000_000, 2)?;
    let overrun = options.choice("overrun", &OVERRUNS)?;
    let soak = Soak {
        seed: options.number("seed", 0..=u64::MAX, 1)?,
        load: options.number("load", 1..=1000, 90)?,
        round_ns: options
            .choice("work", &[("hold", false), ("compute", true)])?
            .then(|| Pace::measure().round_ns()),
        length: Duration::from_millis(options.number("round_ms", 1..=3_600_000, 1000)?),
        overrun,
        overrun_name: options.text("overrun").unwrap_or(OVERRUNS[0].0),
        policy_name: options.text("policy").unwrap_or("static"),
        has_trouble: options.choice("trouble", &[("none", false), ("drawn", true)])?,
    };
    options.finish(&[
        "first", "rounds", "overrun", "seed", "load", "round_ms", "work", "trouble",
    ])?;
    if soak.round_ns.is_some() {
        // The WCETs are those of a core that computes alone.
        machine.accept_exceeded_bounds();
    }
    if soak.has_trouble {
        // Each one is held against what was drawn.
        machine.accept_faults();
    }
    println!(
        "{rounds} rounds of {} ms at {} % load of {} cores, overrun: {}",
        soak.length.as_millis(),
        soak.load,
        machine.cores(),
        soak.overrun_name
    );
    let all = first..first.saturating_add(rounds);
    let mut baseline = soak.warm_up(machine)?;
    let mut total = Account::default();
    let mut violations = 0;
    let mut complaint = None;
    for round in all {
        let outcome = soak.round(machine, round, &mut baseline)?;
        total.add(&outcome.account);
        violations += outcome.violations;
        if let Some(text) = outcome.complaint {
            let text = format!("round {round}: {text}");
            println!("{text}");
            complaint.get_or_insert(text);
        }
    }
    print_total(rounds, &total, violations);
    machine.report_memory();
    complaint.map_or(Ok(()), |text| Err(Ending::Failure(text)))
}

impl Soak<'_> {
    /// Runs the largest set for a moment, on divided cores, in either cluster, and on others,
    /// so that all memory that is kept from run to run is there. Returns what then is in use.
    fn warm_up(&self, machine: &Machine) -> Result<Resources, Ending> {
        if self.has_trouble {
            let plans = largest_set();
            for most_in in [0, 1] {
                let mut divided = Trouble::default().divided(&plans, machine.cores());
                for (number, dag) in divided.dags.iter_mut().enumerate() {
                    dag.cluster = if number > 0 { most_in } else { 1 - most_in };
                }
                self.run(machine, &plans, Duration::ZERO, &divided)?;
            }
        }
        self.run(machine, &largest_set(), Duration::ZERO, &Trouble::default())?;
        Ok(machine.resources())
    }

    /// Draws a round's set, and what befalls it.
    fn draw(&self, machine: &Machine, round: u64) -> (Vec<DagPlan>, Trouble) {
        // Where instructions are counted, all cores together compute as much as one.
        let load = match self.round_ns {
            None => self.load,
            Some(_) => (self.load / u64::from(machine.cores())).max(1),
        };
        let plans = draw_set(self.seed, round, load, machine.cores());
        let trouble = match self.has_trouble {
            true => Trouble::draw(self.seed, round, &plans, machine.cores()),
            false => Trouble::default(),
        };
        (plans, trouble)
    }

    fn run(
        &self,
        machine: &Machine,
        plans: &[DagPlan],
        length: Duration,
        trouble: &Trouble,
    ) -> Result<(Run, Executed), Ending> {
        let mut executed = self
            .round_ns
            .map_or_else(Executed::default, Executed::by_computing);
        let dags = build(plans, length, self.overrun, trouble, &mut executed);
        machine.divide(&trouble.clusters);
        finish_create_dags_with(&dags, ConstructionPolicy::any_graph())?;
        let run = machine.run()?;
        machine.divide(&[]); // its list of clusters is not to count as in use
        Ok((run, executed))
    }

    fn round(
        &self,
        machine: &Machine,
        round: u64,
        baseline: &mut Resources,
    ) -> Result<Outcome, Ending> {
        let (plans, trouble) = self.draw(machine, round);
        let subtasks: usize = plans.iter().map(|dag| dag.subtasks.len()).sum();
        let (run, executed) = self.run(machine, &plans, self.length, &trouble)?;
        let dags = plans.len();
        let (account, discrepancies) = Account::of_run(
            run.task_set(),
            run.record(),
            |dag| run.statistics(dag),
            &trouble,
            &executed,
        );
        let violations = count_violations(&run);
        let (span_ns, executed_ns) = (span_ns(&run), executed.ns());
        let allocations = run.allocations();
        let clusters = trouble.clusters.len().max(1);
        drop((plans, trouble, run, executed));
        let mut complaint = (!discrepancies.is_empty()).then(|| {
            let lines: Vec<_> = discrepancies.iter().map(ToString::to_string).collect();
            lines.join("; ")
        });
        drop(discrepancies);
        // From here on nothing of the round is left but the complaint, if any.
        let resources = machine.resources();
        let expected = after_faults(*baseline, resources, account.faults);
        if complaint.is_none() {
            complaint = wrong(violations, allocations, resources, expected);
        }
        *baseline = expected;
        let available_ns = (span_ns / 100).saturating_mul(machine.cores().into());
        json::emit("soak", |line| {
            line.number("round", round)
                .text("policy", self.policy_name)
                .number("load", self.load)
                .text("overrun", self.overrun_name)
                .number("dags", dags as u64)
                .number("subtasks", subtasks as u64)
                .number("jobs", account.jobs)
                .number("released", account.released)
                .number("completed", account.completed)
                .number("misses", account.misses)
                .number("skips", account.skips)
                .number("aborts", account.aborts)
                .number("queued", account.queued)
                .number("instances", account.instances)
                .number("preemptions", account.preemptions)
                .number("faults", account.faults)
                .number("restarts", account.restarts)
                .number("clusters", clusters as u64)
                .number("violations", violations)
                .number("allocations", allocations)
                .number("span_ns", span_ns)
                .number("busy_percent", executed_ns / available_ns.max(1))
                .number("heap_bytes", resources.heap_bytes as u64)
                .number("contexts", resources.contexts as u64)
                .number("contexts_free", resources.contexts_free as u64);
            if let Some(text) = &complaint {
                line.text("complaint", text);
            }
        });
        Ok(Outcome {
            account,
            violations,
            complaint,
        })
    }
}

/// Returns what is to be in use after a round with so many faults: each has kept some of the heap,
/// how much to the byte depends on the heap's holes.
fn after_faults(before: Resources, now: Resources, faults: u64) -> Resources {
    let faults = usize::try_from(faults).unwrap_or(usize::MAX);
    let most = before.heap_bytes + faults.saturating_mul(KEPT_BYTES);
    Resources {
        heap_bytes: now.heap_bytes.clamp(before.heap_bytes, most),
        ..before
    }
}

/// Counts the breaches of the rules, and prints the first of them.
fn count_violations(run: &Run) -> u64 {
    let violations = run.violations().zip(0..);
    let shown = violations.inspect(|(violation, number)| {
        if *number < SHOWN {
            println!("violation: {violation}");
        }
    });
    shown.count() as u64
}

/// Returns when the last job ended, from the first possible release on.
fn span_ns(run: &Run) -> u64 {
    let dags = run.task_set().dags().iter();
    let ids = dags.map(|dag| run.task_set().find(dag.name()));
    let jobs = ids.flat_map(|dag| run.record().jobs(dag));
    jobs.filter_map(|job| job.ended_ns).max().unwrap_or(0)
}

/// Says what is wrong with a round whose jobs are all accounted for.
fn wrong(
    violations: u64,
    allocations: u64,
    resources: Resources,
    baseline: Resources,
) -> Option<String> {
    if violations > 0 {
        return Some(format!("{violations} breaches of the model's rules"));
    }
    if allocations > 0 {
        return Some(format!("{allocations} allocations while running"));
    }
    if resources.contexts != resources.contexts_free {
        return Some(format!(
            "of {} contexts only {} are free",
            resources.contexts, resources.contexts_free
        ));
    }
    (resources != baseline)
        .then(|| format!("in use are {resources:?}, that should be {baseline:?}"))
}

fn print_total(rounds: u64, total: &Account, violations: u64) {
    println!(
        "{rounds} rounds: {} jobs, {} completed, {} misses, {} skips, {} aborts,",
        total.jobs, total.completed, total.misses, total.skips, total.aborts
    );
    println!(
        "{} instances, {} preemptions, {} faults, {violations} breaches of the rules",
        total.instances, total.preemptions, total.faults
    );
}
