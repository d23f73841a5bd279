//! The publish/subscribe conditions: a synchronizer's callbacks, on all cores.
//!
//! The executor's workers are the parallel subtasks of a DAG that has one job: its
//! source sets the epoch, then there is a worker on each core until all is joined.
//! So the two worlds have the same kernel, the same cores and the same clock.

use alloc::sync::Arc;
use alloc::vec::Vec;
use core::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use core::time::Duration;

use fass::{Dag, SubtaskAttributes, Untyped, create_dag};
use join_latency::{Experiment, Message, Part, Samples};
use kernel::{Ending, Event, Lock, Machine};
use pub_sub::graph::{Graph, Host, work};

use super::Outcome;

/// Longer than any run.
const FOREVER: Duration = Duration::from_secs(1_000_000);

/// Runs all jobs.
pub(crate) fn run(machine: &Machine, experiment: Experiment) -> Result<Outcome, Ending> {
    let shared = Arc::new(Cores {
        graph: Lock::new(experiment.graph()),
        event: Event::new(),
        epoch_ns: AtomicU64::new(u64::MAX),
        has_keeper: AtomicBool::new(false),
        latest_seen: AtomicU64::new(0),
    });
    fass::finish_create_dags(&[workers(machine.cores(), &shared)])?;
    let run = machine.run()?;
    // The workers are at their end, and whatever they still hold of it stays.
    let graph = shared.graph.with(core::mem::take);
    Ok(Outcome {
        samples: Samples::of(graph),
        allocations: run.allocations(),
        violations: run.violations().count() as u64,
    })
}

/// Builds the DAG of workers.
fn workers(cores: u32, shared: &Arc<Cores>) -> Dag {
    let dag = create_dag();
    dag.name("executor")
        .jobs(1)
        .in_flight(1)
        .period(FOREVER)
        .relative_deadline(FOREVER);
    let own = Arc::clone(shared);
    let begin = move |_| own.begin();
    let source = dag.register_untyped_subtask(begin, SubtaskAttributes::named("begin"));
    let workers: Vec<Untyped> = (0..cores)
        .map(|_| {
            let own = Arc::clone(shared);
            let worker = move |_| {
                own.wait_for_epoch();
                work::<Message, Part, _>(&*own);
            };
            dag.register_untyped_subtask(worker, SubtaskAttributes::default())
        })
        .collect();
    let sink = dag.register_untyped_subtask(|_| (), SubtaskAttributes::named("end"));
    for worker in &workers {
        dag.precede(&source, worker).precede(worker, &sink);
    }
    dag
}

/// The cores as the executor's host.
struct Cores {
    graph: Lock<Graph<Message, Part>>,
    event: Event,
    /// Time 0 of the graph on the kernel's clock.
    epoch_ns: AtomicU64,
    /// Whether a worker watches the clock for all that wait.
    has_keeper: AtomicBool,
    /// The latest version that a worker had seen when it began to wait.
    latest_seen: AtomicU64,
}

impl Cores {
    /// Sets the epoch, a little ahead so that all workers are there.
    fn begin(&self) {
        const LEAD_NS: u64 = 1_000_000;
        self.epoch_ns
            .store(fass::now_ns() + LEAD_NS, Ordering::Relaxed);
    }

    /// Waits for time 0, before which the graph's time stands still. One worker has an
    /// alarm, as in any wait: which of two cores comes first whose timers end at one
    /// time depends on the host, also in `deterministic` mode.
    fn wait_for_epoch(&self) {
        let epoch_ns = self.epoch_ns.load(Ordering::Relaxed);
        while fass::now_ns() < epoch_ns {
            self.wait(self.version(), 0);
        }
    }
}

impl Host<Message, Part> for Cores {
    fn now_ns(&self) -> u64 {
        fass::now_ns().saturating_sub(self.epoch_ns.load(Ordering::Relaxed))
    }

    fn with_graph<R>(&self, section: impl FnOnce(&mut Graph<Message, Part>) -> R) -> R {
        self.graph.with(section)
    }

    fn version(&self) -> u64 {
        self.event.version()
    }

    /// As in ROS 2's executor one idle worker at a time watches the clock, the others
    /// wait for a notice. When it leaves, for whatever reason, one of them takes over.
    fn wait(&self, seen: u64, until_ns: u64) {
        self.latest_seen.fetch_max(seen, Ordering::SeqCst);
        if self.has_keeper.swap(true, Ordering::SeqCst) {
            self.event.wait(seen, u64::MAX);
            return;
        }
        let epoch_ns = self.epoch_ns.load(Ordering::Relaxed);
        self.event.wait(seen, until_ns.saturating_add(epoch_ns));
        self.has_keeper.store(false, Ordering::SeqCst);
        // A worker that found the place taken had noted before what it has seen. If that
        // is all that has happened, it sleeps now, and nobody would wake it.
        if self.latest_seen.load(Ordering::SeqCst) >= self.event.version() {
            self.event.notify();
        }
    }

    fn notify(&self) {
        self.event.notify();
    }
}
