//! DAGs that are added to a run and removed, again and again, while another one goes on.
//!
//! `drive` has a job every 10 ms, whose proof is demanded, and no last one. In core 0's background
//! a DAG `photo N` is added, runs three jobs or more, is removed, and has to give back what its
//! functions hold and its stacks; then the next one is added. In between, additions are refused.

use alloc::format;
use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec;
use core::slice;
use core::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use core::time::Duration;

use fass::{Commit, Dag, FaultLimit, Occupation, Shutdown, SubtaskAttributes};
use fass::{create_dag, execute_for, finish_create_dags, shutting_down};
use kernel::{Ending, Machine, Offers, Resources, Run, json};
use sched_dag::{DagId, DagStatistics};

/// How often a DAG is added and removed.
const CYCLES: u64 = 120;

/// The jobs of `drive` that have ended in this run.
static DRIVEN: AtomicU64 = AtomicU64::new(0);

/// Whether the run is to end.
static IS_DONE: AtomicBool = AtomicBool::new(false);

/// Changes a run that many times; then one in which each third added DAG panics.
pub(crate) fn run(machine: &Machine) -> Result<(), Ending> {
    machine.options().finish(&["test"])?;
    machine.accept_faults();
    // What a first run takes for good is taken.
    change(machine, 3, false)?;
    let before = machine.resources();
    let growth_bytes = change(machine, CYCLES, false)?;
    let leaks = machine.resources() != before;
    change(machine, CYCLES / 4, true)?;
    json::emit("added", |line| {
        line.number("growth_bytes", growth_bytes as u64)
            .flag("leaks", leaks);
    });
    Ok(())
}

/// Runs `drive` until so many DAGs were added and removed, and prints what became of all. Returns
/// what all but the first left behind, in bytes.
fn change(machine: &Machine, cycles: u64, are_careless: bool) -> Result<usize, Ending> {
    IS_DONE.store(false, Ordering::Relaxed);
    DRIVEN.store(0, Ordering::Relaxed);
    let mut changes = Changes {
        machine,
        commit: finish_create_dags(&[drive()])?,
        taken: Arc::new(AtomicU64::new(0)),
        stage: Stage::Begins,
        cycle: 0,
        cycles,
        are_careless,
        first: None,
        growth_bytes: 0,
    };
    let run = machine.run_with(|| changes.step())?;
    changes.report(&run);
    Ok(changes.growth_bytes)
}

/// What the background does to a run.
struct Changes<'m> {
    machine: &'m Machine,
    commit: Commit,
    /// Counts the jobs of added DAGs; their functions hold it.
    taken: Arc<AtomicU64>,
    stage: Stage,
    cycle: u64,
    cycles: u64,
    /// Whether each third added DAG panics.
    are_careless: bool,
    /// What was in use after the first removal.
    first: Option<Resources>,
    /// How much more is in use since then.
    growth_bytes: usize,
}

/// Where the latest added DAG is.
enum Stage {
    /// It is still to be added.
    Begins,
    /// It runs until so many jobs were taken.
    Runs(Dag, u64),
    /// It was removed.
    Leaves,
}

impl Changes<'_> {
    fn is_careless(&self) -> bool {
        self.are_careless && self.cycle % 3 == 1
    }

    fn step(&mut self) {
        match &self.stage {
            Stage::Begins if self.cycle == self.cycles => IS_DONE.store(true, Ordering::Relaxed),
            Stage::Begins => {
                if self.cycle % 40 == 1 {
                    self.refusals();
                }
                let dag = photo(
                    &format!("photo {}", self.cycle),
                    &self.taken,
                    self.is_careless(),
                );
                let until = self.taken.load(Ordering::Relaxed) + 3;
                let added = self.commit.add(slice::from_ref(&dag));
                added.unwrap_or_else(|error| panic!("{error}"));
                self.stage = Stage::Runs(dag, until);
            }
            Stage::Runs(dag, until) => {
                if self.taken.load(Ordering::Relaxed) >= *until {
                    let removed = self.commit.remove(dag);
                    removed.unwrap_or_else(|error| panic!("{error}"));
                    self.stage = Stage::Leaves;
                }
            }
            Stage::Leaves => {
                if Arc::strong_count(&self.taken) == 1 {
                    self.compare();
                    self.cycle += 1;
                    self.stage = Stage::Begins;
                }
            }
        }
    }

    /// Compares what is in use with what was after the first removal.
    fn compare(&mut self) {
        let after = self.machine.resources();
        let first = self.first.get_or_insert(after);
        if !self.are_careless {
            assert_eq!(after.contexts, first.contexts, "stacks are used again");
            self.growth_bytes = after.heap_bytes.saturating_sub(first.heap_bytes);
        }
    }

    /// Tries what is refused, which changes nothing.
    fn refusals(&mut self) {
        for (what, make) in [
            ("proof", heavy as fn() -> Dag),
            ("name", namesake),
            ("stacks", enduring),
            ("stack", deep),
            ("fault", create_dag),
        ] {
            let before = self.machine.resources();
            let refused = self.commit.add(&[make()]);
            let text = refused.map_or_else(|error| format!("{error}"), |_| String::new());
            let is_same = self.machine.resources().contexts == before.contexts;
            json::emit("refused", |line| {
                line.text("what", what)
                    .text("text", &text)
                    .flag("same", is_same);
            });
        }
    }

    fn report(&self, run: &Run) {
        let drive = run.statistics(DagId(0));
        let added = run.task_set().ids().skip(1);
        let sum = |of: fn(&DagStatistics) -> u64| -> u64 {
            let added = added.clone();
            added.map(|dag| of(run.statistics(dag))).sum()
        };
        json::emit("adding", |line| {
            line.number("cycles", self.cycle)
                .number("drives", drive.completed)
                .number("driven", DRIVEN.load(Ordering::Relaxed))
                .number("taken", self.taken.load(Ordering::Relaxed))
                .number("photos", sum(|of| of.released))
                .number("faults", sum(|of| of.faults))
                .number("misses", drive.misses + sum(|of| of.misses))
                .number("violations", run.violations().count() as u64);
            if let Some(broken) = run.dispatch_violations(100_000) {
                line.number("dispatch_violations", broken.len() as u64);
            }
        });
    }
}

/// Runs `drive`, and lets people add and remove a DAG.
pub(crate) fn offers(machine: &Machine) -> Result<(), Ending> {
    machine.options().finish(&["test"])?;
    let mut commit = finish_create_dags(&[drive()])?;
    let mut offers = Offers::new();
    offers.dag("photo", || photo("photo", &Arc::default(), false));
    offers.dag("heavy", heavy);
    machine.run_with(|| offers.serve(&mut commit))?;
    Err(Ending::Failure("the run has ended by itself".into()))
}

/// Adds a DAG where the cores are divided, which is refused.
pub(crate) fn divided(machine: &Machine) -> Result<(), Ending> {
    machine.divide(&[1, 1]);
    machine.options().finish(&["test"])?;
    let in_cluster = |name| {
        let dag = photo(name, &Arc::default(), false);
        dag.cluster(0);
        dag
    };
    let first = in_cluster("first");
    first.jobs(5);
    let mut commit = finish_create_dags(&[first])?;
    let mut refusal = None;
    machine.run_with(|| {
        if refusal.is_none() {
            refusal = commit.add(&[in_cluster("photo")]).err();
        }
    })?;
    let refusal = refusal.map_or_else(String::new, |error| format!("{error}"));
    Err(Ending::Failure(refusal))
}

fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

fn hold() {
    execute_for(Duration::from_micros(200), Occupation::Hold);
}

fn taking(name: &str) -> SubtaskAttributes {
    SubtaskAttributes::named(name).wcet(ms(1))
}

/// A chain of two, whose jobs are counted, and which ends the run when it is to end.
fn drive() -> Dag {
    let dag = create_dag();
    dag.name("drive").demand_proof();
    let mut job = 0_u64;
    let read = move |mut end: Shutdown<'_>| {
        if IS_DONE.load(Ordering::Relaxed) {
            end.request();
        }
        hold();
        job += 1;
        (job,)
    };
    dag.using(shutting_down()).register_periodic_subtask(
        read,
        vec!["read"],
        ms(10),
        taking("read"),
    );
    let mut last = 0;
    let act = move |(job,): (u64,)| {
        hold();
        assert_eq!(job, last + 1, "each value comes once, in its order");
        last = job;
        DRIVEN.fetch_add(1, Ordering::Relaxed);
    };
    dag.register_sink_subtask(act, vec!["read"], ms(10), taking("act"));
    dag
}

/// A fork and a join whose functions hold a counter of its jobs. If it is careless, the join
/// panics in job 2.
fn photo(name: &str, taken: &Arc<AtomicU64>, is_careless: bool) -> Dag {
    let dag = create_dag();
    dag.name(name).demand_proof();
    let count = Arc::clone(taken);
    let mut job = 0_u64;
    let take = move || {
        hold();
        count.fetch_add(1, Ordering::Relaxed);
        job += 1;
        (job,)
    };
    dag.register_periodic_subtask(take, vec!["image"], ms(20), taking("take"));
    for side in ["left", "right"] {
        let held = Arc::clone(taken);
        let develop = move |(job,): (u64,)| {
            let _ = &held;
            hold();
            (job,)
        };
        dag.register_subtask(develop, vec!["image"], vec![side], taking(side));
    }
    let mut job = 0;
    let join = move |(left, right): (u64, u64)| {
        job += 1;
        assert_eq!((left, right), (job, job), "a join of values of one job");
        assert!(!is_careless || job < 3, "on purpose");
    };
    dag.register_sink_subtask(join, vec!["left", "right"], ms(20), taking("join"));
    dag
}

/// A DAG with the name of the one that runs.
fn namesake() -> Dag {
    photo("drive", &Arc::default(), false)
}

/// A DAG beside which no other has a proof: four subtasks take 9 of 10 ms, and are more urgent.
fn heavy() -> Dag {
    let dag = create_dag();
    dag.name("heavy");
    let urgent = |name| SubtaskAttributes::named(name).wcet(ms(9)).priority(0);
    dag.register_periodic_subtask(|| (1_u8,), vec!["load"], ms(10), urgent("source"));
    let sides = ["a", "b", "c", "d"];
    for side in sides {
        dag.register_subtask(
            |(load,): (u8,)| (load,),
            vec!["load"],
            vec![side],
            urgent(side),
        );
    }
    let sink = |_: (u8, u8, u8, u8)| ();
    dag.register_sink_subtask(sink, sides.to_vec(), ms(10), urgent("sink"));
    dag
}

/// A DAG that would survive more faults than there are stacks.
fn enduring() -> Dag {
    let dag = create_dag();
    dag.name("enduring").survive_faults(FaultLimit {
        faults: 1,
        window: 1,
        in_all: 1000,
    });
    dag.restarting(|| |()| ())
        .register_periodic_subtask(vec![], ms(20), taking("endure"));
    dag.relative_deadline(ms(20));
    dag
}

/// A DAG with a larger stack than the first commit has settled.
fn deep() -> Dag {
    let dag = create_dag();
    dag.name("deep").relative_deadline(ms(20));
    let deep = taking("deep").stack_bytes(1 << 20);
    dag.register_periodic_subtask(|| (), vec![], ms(20), deep);
    dag
}
