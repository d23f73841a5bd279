//! The publish/subscribe conditions: the workload as callbacks, on all cores.
//!
//! One source, N parallel subtasks, one join, as in `fork-join`; but they are
//! callbacks that publish on topics, and the join is made by a synchronizer that
//! matches stamps. Each is a group of its own, so that different ones run side by
//! side and none overlaps with itself.
//!
//! The executor's workers are the parallel subtasks of a DAG that has one job: its
//! source sets the epoch, then there is a worker on each core until all is joined.
//! So the two worlds have the same kernel, the same cores and the same clock.

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::num::NonZeroUsize;
use core::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use core::time::Duration;

use fass::{Dag, Occupation, SubtaskAttributes, UntypedSubtask, create_dag};
use fork_join::{ExecutionTimes, PERIOD};
use join_latency::{Joined, Samples, Span};
use kernel::{AppError, Event, Lock, Machine};
use pub_sub::graph::{Call, Graph, Next, TopicId};
use pub_sub::{ApproximateTime, ExactTime, Outlet, Parameters, Set, Stamped, Synchronizer};

use super::Outcome;

/// Longer than any run.
const FOREVER: Duration = Duration::from_secs(1_000_000);

/// Runs all jobs.
pub(crate) fn run(machine: &Machine, experiment: Experiment) -> Result<Outcome, AppError> {
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
        samples: samples(graph),
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
    let begin = move |_| own.set_epoch();
    let source = dag.register_untyped_subtask(begin, SubtaskAttributes::named("begin"));
    let workers: Vec<UntypedSubtask> = (0..cores)
        .map(|_| {
            let own = Arc::clone(shared);
            let worker = move |_| {
                own.wait_for_epoch();
                own.work();
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
    fn set_epoch(&self) {
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
            self.wait(self.event.version(), 0);
        }
    }

    /// Executes callbacks until the graph is shut down.
    fn work(&self) {
        loop {
            let seen = self.event.version();
            let now_ns = self.now_ns();
            match self.graph.with(|graph| graph.take(now_ns)) {
                Next::Call(group, mut callbacks, call) => {
                    callbacks.call(call, self);
                    let now_ns = self.now_ns();
                    let is_awaited = |graph: &mut Graph<Message, Part>| {
                        graph.give_back(group, callbacks, now_ns)
                    };
                    if self.graph.with(is_awaited) {
                        self.event.notify();
                    }
                }
                Next::WaitUntil(until_ns) => self.wait(seen, until_ns),
                Next::End => return,
            }
        }
    }

    /// Returns the time of the graph.
    fn now_ns(&self) -> u64 {
        fass::now_ns().saturating_sub(self.epoch_ns.load(Ordering::Relaxed))
    }

    fn publish(&self, topic: TopicId, message: Message) {
        self.graph.with(|graph| graph.publish(topic, message));
        self.event.notify();
    }

    /// Makes all workers end when they have executed what they are at.
    fn shut_down(&self) {
        self.graph.with(Graph::shut_down);
        self.event.notify();
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
}

/// How messages are matched.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Matching {
    /// By equal stamps. Parallel subtasks pass the source's stamp on.
    Exact,
    /// By stamps at most so far apart. Parallel subtasks stamp anew.
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
    /// How messages are matched.
    pub(crate) matching: Matching,
    /// The synchronizer's queue size.
    pub(crate) queue: NonZeroUsize,
    /// The depth of all subscriptions. If one drops a message, the run is of no use:
    /// then jobs and publications no longer have the same numbers.
    pub(crate) depth: NonZeroUsize,
}

impl Experiment {
    /// Builds the graph. Its time 0 is the run's epoch; it shuts down when all has
    /// been published and joined.
    fn graph(self) -> Graph<Message, Part> {
        let mut graph = Graph::new();
        let input = graph.add_topic();
        let outputs: Vec<TopicId> = (0..self.parallel).map(|_| graph.add_topic()).collect();
        let part = |role| Part {
            experiment: self,
            role,
            spans: Vec::with_capacity(self.jobs),
        };
        let source = graph.add_group(part(Role::Source { output: input }));
        let period_ns = u64::try_from(PERIOD.as_nanos()).unwrap_or(u64::MAX);
        graph.add_timer(source, 0, period_ns);
        for (branch, &output) in outputs.iter().enumerate() {
            let times = ExecutionTimes::new(self.seed, branch);
            let parallel = graph.add_group(part(Role::Parallel { output, times }));
            graph.subscribe(parallel, input, self.depth.get());
        }
        let join = graph.add_group(part(Role::Join {
            synchronizer: self.synchronizer(),
            inputs: outputs.clone(),
            ready_ns: Vec::with_capacity(self.jobs),
            indices: Vec::with_capacity(self.jobs * self.parallel),
            expected: self.parallel * self.jobs,
        }));
        for &output in &outputs {
            graph.subscribe(join, output, self.depth.get());
        }
        graph
    }

    fn synchronizer(&self) -> Box<dyn Synchronizer<u64> + Send> {
        match self.matching {
            Matching::Exact => Box::new(ExactTime::new(self.parallel, self.queue.get())),
            Matching::Approximate { max_interval_ns } => {
                let parameters = Parameters::new(self.parallel, self.queue);
                Box::new(ApproximateTime::new(
                    parameters.max_interval_ns(max_interval_ns),
                ))
            }
        }
    }
}

/// A published message: a job's number, and a stamp.
type Message = Stamped<u64>;

/// The callbacks of one group, with what they have seen so far.
struct Part {
    experiment: Experiment,
    role: Role,
    /// Its executions: of a source or a parallel subtask one a job, else one a join.
    spans: Vec<Span>,
}

enum Role {
    /// Publishes a job at each call of its timer, until all are published.
    Source { output: TopicId },
    /// Executes each job it receives for a drawn time, and publishes it.
    Parallel {
        output: TopicId,
        times: ExecutionTimes,
    },
    /// Joins what the parallel subtasks publish.
    Join {
        synchronizer: Box<dyn Synchronizer<u64> + Send>,
        /// The topics of the parallel subtasks, in their order.
        inputs: Vec<TopicId>,
        /// When each join was ready.
        ready_ns: Vec<u64>,
        /// The jobs that were joined, as in [`Samples::indices`].
        indices: Vec<u64>,
        /// How many messages are to come; after that, nothing can happen any more.
        expected: usize,
    },
}

impl Part {
    /// Executes one of them.
    fn call(&mut self, call: Call<Message>, cores: &Cores) {
        let start_ns = cores.now_ns();
        let spans = &mut self.spans;
        match (&mut self.role, call) {
            (Role::Source { output }, _) if spans.len() < self.experiment.jobs => {
                let stamp_ns = cores.now_ns();
                let message = spans.len() as u64;
                spans.push(Span {
                    start_ns,
                    finish_ns: stamp_ns,
                });
                cores.publish(*output, Stamped { stamp_ns, message });
            }
            // The join waits for messages that will never come.
            (Role::Source { .. }, _) if cores.graph.with(|graph| graph.dropped()) > 0 => {
                cores.shut_down();
            }
            (Role::Parallel { output, times }, Call::Message { message: job, .. }) => {
                // The core is held while the processor halts.
                fass::execute_for(times.next_time(), Occupation::Hold);
                let finish_ns = cores.now_ns();
                spans.push(Span {
                    start_ns,
                    finish_ns,
                });
                let stamp_ns = match self.experiment.matching {
                    Matching::Exact => job.stamp_ns,
                    Matching::Approximate { .. } => finish_ns,
                };
                cores.publish(*output, Stamped { stamp_ns, ..job });
            }
            (
                Role::Join {
                    synchronizer,
                    inputs,
                    ready_ns,
                    indices,
                    expected,
                },
                Call::Message { topic, message },
            ) => {
                if let Some(position) = inputs.iter().position(|input| *input == topic) {
                    let mut outlet = Joining {
                        cores,
                        ready_ns,
                        spans,
                        indices,
                    };
                    synchronizer.arrive(position, message, &mut outlet);
                    *expected -= 1;
                }
                if *expected == 0 {
                    cores.shut_down();
                }
            }
            // A source that is through; and the graph registers no other timer.
            (_, Call::Timer { .. }) | (Role::Source { .. }, _) => {}
        }
    }
}

/// Where sets go: to the join's function, which is called at once, as the original
/// calls it. Like the DAG's sink, it only looks.
struct Joining<'a> {
    cores: &'a Cores,
    ready_ns: &'a mut Vec<u64>,
    spans: &'a mut Vec<Span>,
    indices: &'a mut Vec<u64>,
}

impl Outlet<u64> for Joining<'_> {
    fn emitted(&mut self, set: Set<'_, u64>) {
        self.ready_ns.push(self.cores.now_ns());
        let start_ns = self.cores.now_ns();
        self.indices.extend(set.map(|stamped| stamped.message));
        self.spans.push(Span {
            start_ns,
            finish_ns: self.cores.now_ns(),
        });
    }
}

/// Takes what a graph has seen when it was shut down and no worker uses it.
fn samples(graph: Graph<Message, Part>) -> Samples {
    let lost_inputs = graph.dropped();
    let mut samples = Samples {
        lost_inputs,
        ..Samples::default()
    };
    for Part { role, spans, .. } in graph.into_callbacks() {
        match role {
            Role::Source { .. } => samples.source = spans,
            Role::Parallel { .. } => samples.parallel.push(spans),
            Role::Join {
                ready_ns, indices, ..
            } => {
                let joins = ready_ns.into_iter().zip(spans);
                let joined = |(ready_ns, span)| Joined { ready_ns, span };
                (samples.joins, samples.indices) = (joins.map(joined).collect(), indices);
            }
        }
    }
    samples
}
