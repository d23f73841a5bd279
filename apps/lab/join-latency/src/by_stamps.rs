//! The publish/subscribe conditions: the workload as callbacks, on all cores.
//!
//! One source, N parallel subtasks and one join, as in `fork-join`. But here they are callbacks
//! publishing on topics, and a synchronizer matching stamps makes the join. Each callback is a
//! group of its own, so different callbacks run side by side and none overlaps with itself.
//!
//! The executor's workers are the parallel subtasks of a DAG with a single job: the DAG's source
//! sets the epoch, then each core has a worker until everything is joined. So both worlds have the
//! same kernel, the same cores and the same clock.

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::num::NonZeroUsize;
use core::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use core::time::Duration;

use fass::{Dag, Occupation, SubtaskAttributes, UntypedSubtask, create_dag};
use fork_join::{ExecutionTimes, PERIOD};
use join_latency::{CompletedJoin, ExecutionSpan, RunSamples};
use kernel::{AppError, Event, Lock, Machine};
use pub_sub::graph::{Graph, NextCallback};
use pub_sub::{ApproximateTime, ExactTime, Outlet, Parameters, Set, Stamped, Synchronizer};

use super::ConditionOutcome;

/// Longer than any run.
const FOREVER: Duration = Duration::from_secs(1_000_000);

/// Runs all jobs.
pub(crate) fn run(machine: &Machine, experiment: Experiment) -> Result<ConditionOutcome, AppError> {
    let shared = Arc::new(ExecutorCores {
        graph: Lock::new("graph", experiment.graph()),
        event: Event::new(),
        epoch_ns: AtomicU64::new(u64::MAX),
        has_keeper: AtomicBool::new(false),
        latest_seen: AtomicU64::new(0),
    });
    fass::finish_create_dags(&[workers(machine.cores(), &shared)])?;
    let run = machine.run()?;
    // The workers have ended, and their clones of the cores stay: only the graph leaves.
    let graph = shared
        .graph
        .with(|graph| core::mem::replace(graph, Graph::new(0)));
    Ok(ConditionOutcome {
        samples: samples(graph),
        allocations: run.allocations(),
        violations: run.violations().count() as u64,
    })
}

/// Builds the DAG of workers.
fn workers(cores: u32, shared: &Arc<ExecutorCores>) -> Dag {
    let dag = create_dag();
    dag.name("executor")
        .jobs(1)
        .in_flight(1)
        .period(FOREVER)
        .relative_deadline(FOREVER);
    let own = Arc::clone(shared);
    let begin = move |_| own.set_epoch();
    let source = dag.register_untyped_subtask(begin, SubtaskAttributes::named("begin"));
    let workers: Vec<UntypedSubtask> = (0..cores)
        .map(|_| {
            let own = Arc::clone(shared);
            let worker = move |(), _| {
                own.wait_for_epoch();
                own.work();
            };
            dag.using(shared.graph.entering(u32::MAX))
                .register_untyped_subtask(worker, SubtaskAttributes::default())
        })
        .collect();
    let sink = dag.register_untyped_subtask(|_| (), SubtaskAttributes::named("end"));
    for worker in &workers {
        dag.precede(&source, worker).precede(worker, &sink);
    }
    dag
}

/// The cores as the host of the executor.
struct ExecutorCores {
    graph: Lock<Graph<Message, GroupPart>>,
    event: Event,
    /// Time 0 of the graph on the kernel's clock.
    epoch_ns: AtomicU64,
    /// Whether a worker watches the clock for all waiting workers.
    has_keeper: AtomicBool,
    /// The latest event version seen by a worker that began to wait.
    latest_seen: AtomicU64,
}

impl ExecutorCores {
    /// Sets the epoch, a little ahead so that all workers are there in time.
    fn set_epoch(&self) {
        const LEAD_NS: u64 = 1_000_000;
        self.epoch_ns
            .store(fass::now_ns() + LEAD_NS, Ordering::Relaxed);
    }

    /// Waits for time 0, before which the graph's time stands still. As in any wait, one worker has
    /// an alarm. If two cores had timers ending at the same time, the host would decide which core
    /// comes first, even in `deterministic` mode.
    fn wait_for_epoch(&self) {
        let epoch_ns = self.epoch_ns.load(Ordering::Relaxed);
        while fass::now_ns() < epoch_ns {
            self.wait(self.event.version(), 0);
        }
    }

    /// Executes callbacks until the graph is shut down.
    fn work(&self) {
        loop {
            let seen = self.event.version();
            let now_ns = self.now_ns();
            match self.graph.with(|graph| graph.take(now_ns)) {
                NextCallback::Call(group, mut callbacks, message) => {
                    callbacks.call(message, self);
                    let now_ns = self.now_ns();
                    let is_awaited = |graph: &mut Graph<Message, GroupPart>| {
                        graph.give_back(group, callbacks, now_ns)
                    };
                    if self.graph.with(is_awaited) {
                        self.event.notify();
                    }
                }
                NextCallback::WaitUntil(until_ns) => self.wait(seen, until_ns),
                NextCallback::End => return,
            }
        }
    }

    /// Returns the time of the graph.
    fn now_ns(&self) -> u64 {
        fass::now_ns().saturating_sub(self.epoch_ns.load(Ordering::Relaxed))
    }

    fn publish(&self, topic: usize, message: Message) {
        self.graph.with(|graph| graph.publish(topic, message));
        self.event.notify();
    }

    /// Makes all workers end after their current callbacks.
    fn shut_down(&self) {
        self.graph.with(Graph::shut_down);
        self.event.notify();
    }

    /// Waits for a notice or the given time. As in ROS 2's executor, one idle worker at a time
    /// watches the clock; the others wait for a notice. When the watching worker leaves, for any
    /// reason, another takes over.
    fn wait(&self, seen: u64, until_ns: u64) {
        self.latest_seen.fetch_max(seen, Ordering::SeqCst);
        if self.has_keeper.swap(true, Ordering::SeqCst) {
            self.event.wait(seen, u64::MAX);
            return;
        }
        let epoch_ns = self.epoch_ns.load(Ordering::Relaxed);
        self.event.wait(seen, until_ns.saturating_add(epoch_ns));
        self.has_keeper.store(false, Ordering::SeqCst);
        // A worker that found the place taken had noted its seen version before. If nothing newer
        // has happened, that worker sleeps by now, and nobody else would wake it.
        if self.latest_seen.load(Ordering::SeqCst) >= self.event.version() {
            self.event.notify();
        }
    }
}

/// The rule for matching messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum MatchingPolicy {
    /// By equal stamps. Parallel subtasks pass on the source's stamp.
    Exact,
    /// By stamps within an interval. Parallel subtasks stamp anew.
    Approximate {
        /// The longest interval, inclusive, in nanoseconds.
        max_interval_ns: u64,
    },
}

/// A run of the workload with a synchronizer.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Experiment {
    /// The number N of parallel subtasks, at least 1.
    pub(crate) parallel: usize,
    /// The number of jobs, at least 1.
    pub(crate) jobs: usize,
    /// The seed of the execution times.
    pub(crate) seed: u64,
    /// The rule for matching messages.
    pub(crate) matching: MatchingPolicy,
    /// The synchronizer's queue size.
    pub(crate) queue: NonZeroUsize,
    /// The depth of all subscriptions. If a subscription drops a message, the run is useless: jobs
    /// and publications no longer have the same numbers.
    pub(crate) depth: NonZeroUsize,
}

impl Experiment {
    /// Builds the graph. Time 0 of the graph is the run's epoch; the graph shuts down when
    /// everything has been published and joined.
    fn graph(self) -> Graph<Message, GroupPart> {
        let mut graph = Graph::new(1 + self.parallel);
        let part = |role, executions| GroupPart {
            experiment: self,
            role,
            spans: Vec::with_capacity(executions),
        };
        let source = graph.add_group(part(CallbackRole::Source, self.jobs));
        let period_ns = u64::try_from(PERIOD.as_nanos()).unwrap_or(u64::MAX);
        graph.add_timer(source, 0, period_ns);
        for branch in 0..self.parallel {
            let times = ExecutionTimes::new(self.seed, branch);
            let output = FIRST_OUTPUT + branch;
            let parallel =
                graph.add_group(part(CallbackRole::Parallel { output, times }, self.jobs));
            graph.subscribe(parallel, INPUT, self.depth.get());
        }
        let join = CallbackRole::Join {
            synchronizer: self.synchronizer(),
            joins: Vec::with_capacity(self.jobs),
            indices: Vec::with_capacity(self.jobs * self.parallel),
            expected: self.parallel * self.jobs,
        };
        let join = graph.add_group(part(join, 0));
        for branch in 0..self.parallel {
            graph.subscribe(join, FIRST_OUTPUT + branch, self.depth.get());
        }
        graph
    }

    fn synchronizer(&self) -> Box<dyn Synchronizer<u64> + Send> {
        match self.matching {
            MatchingPolicy::Exact => Box::new(ExactTime::new(self.parallel, self.queue.get())),
            MatchingPolicy::Approximate { max_interval_ns } => {
                let mut parameters = Parameters::new(self.parallel, self.queue);
                parameters.max_interval_ns = Some(max_interval_ns);
                Box::new(ApproximateTime::new(parameters))
            }
        }
    }
}

/// A published message: a job's number, and a stamp.
type Message = Stamped<u64>;

/// The source's topic.
const INPUT: usize = 0;

/// The topic of the first parallel subtask; the topics of the others follow, in their order.
const FIRST_OUTPUT: usize = 1;

/// The callbacks of one group, with their observations so far.
struct GroupPart {
    experiment: Experiment,
    role: CallbackRole,
    /// The executions of the source or of a parallel subtask, in the order of jobs.
    spans: Vec<ExecutionSpan>,
}

enum CallbackRole {
    /// Publishes a job at each call of its timer, until all jobs are published.
    Source,
    /// Executes each received job for a drawn time, and publishes the job.
    Parallel {
        output: usize,
        times: ExecutionTimes,
    },
    /// Joins the publications of the parallel subtasks.
    Join {
        synchronizer: Box<dyn Synchronizer<u64> + Send>,
        joins: Vec<CompletedJoin>,
        /// The joined jobs, as in [`RunSamples::indices`].
        indices: Vec<u64>,
        /// The number of messages still to come; after the last, nothing more can happen.
        expected: usize,
    },
}

impl GroupPart {
    /// Executes a callback: for a message, given with its topic, or for the timer.
    fn call(&mut self, message: Option<(usize, Message)>, cores: &ExecutorCores) {
        let start_ns = cores.now_ns();
        let spans = &mut self.spans;
        match (&mut self.role, message) {
            (CallbackRole::Source, _) if spans.len() < self.experiment.jobs => {
                let stamp_ns = cores.now_ns();
                let message = spans.len() as u64;
                spans.push(ExecutionSpan {
                    start_ns,
                    finish_ns: stamp_ns,
                });
                cores.publish(INPUT, Stamped { stamp_ns, message });
            }
            // The join waits for messages that will never come.
            (CallbackRole::Source, _) if cores.graph.with(|graph| graph.dropped()) > 0 => {
                cores.shut_down();
            }
            (CallbackRole::Parallel { output, times }, Some((_, job))) => {
                // The core is held while the processor halts.
                fass::execute_for(times.next_time(), Occupation::Hold);
                let finish_ns = cores.now_ns();
                spans.push(ExecutionSpan {
                    start_ns,
                    finish_ns,
                });
                let stamp_ns = match self.experiment.matching {
                    MatchingPolicy::Exact => job.stamp_ns,
                    MatchingPolicy::Approximate { .. } => finish_ns,
                };
                cores.publish(*output, Stamped { stamp_ns, ..job });
            }
            (
                CallbackRole::Join {
                    synchronizer,
                    joins,
                    indices,
                    expected,
                },
                Some((topic, message)),
            ) => {
                let mut outlet = JoinOutlet {
                    cores,
                    joins,
                    indices,
                };
                synchronizer.arrive(topic - FIRST_OUTPUT, message, &mut outlet);
                *expected -= 1;
                if *expected == 0 {
                    cores.shut_down();
                }
            }
            // A source after its last job; the graph registers no other timer.
            (CallbackRole::Source, _) | (_, None) => {}
        }
    }
}

/// The outlet for sets: the function of the join, called at once, as in the original. Like the
/// DAG's sink, the function only looks.
struct JoinOutlet<'a> {
    cores: &'a ExecutorCores,
    joins: &'a mut Vec<CompletedJoin>,
    indices: &'a mut Vec<u64>,
}

impl Outlet<u64> for JoinOutlet<'_> {
    fn emitted(&mut self, set: Set<'_, u64>) {
        let ready_ns = self.cores.now_ns();
        let start_ns = self.cores.now_ns();
        self.indices.extend(set.map(|stamped| stamped.message));
        let span = ExecutionSpan {
            start_ns,
            finish_ns: self.cores.now_ns(),
        };
        self.joins.push(CompletedJoin { ready_ns, span });
    }
}

/// Takes the samples out of a graph that is shut down and used by no worker.
fn samples(graph: Graph<Message, GroupPart>) -> RunSamples {
    let mut samples = RunSamples {
        lost_inputs: graph.dropped(),
        ..RunSamples::default()
    };
    for GroupPart { role, spans, .. } in graph.into_callbacks() {
        match role {
            CallbackRole::Source => samples.source = spans,
            CallbackRole::Parallel { .. } => samples.parallel.push(spans),
            CallbackRole::Join { joins, indices, .. } => {
                (samples.joins, samples.indices) = (joins, indices);
            }
        }
    }
    samples
}
