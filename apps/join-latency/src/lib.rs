//! The paper's workload in publish/subscribe form, to be compared with the DAG.
//!
//! One source, N parallel subtasks, one join, as in `fork-join`; but they are
//! callbacks that publish on topics, and the join is made by a synchronizer that
//! matches stamps. Each is a group of its own, so that different ones run side by
//! side and none overlaps with itself. Whatever is joined, parallel subtask b
//! executes its i-th job for the same time, which depends on the seed, b and i alone
//! ([`fork_join::ExecutionTimes`]).
//!
//! - [`Experiment`] says what to run and builds the graph of callbacks;
//! - [`Part`] is the callbacks of one group, and what they have seen;
//! - [`Samples`] are the times of a run, the same whatever joined.
//!
//! Nothing here knows the kernel: the tests run it on threads. How an execution
//! passes its time is given from outside.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

extern crate alloc;

use alloc::boxed::Box;
use alloc::vec::Vec;
use core::num::NonZeroUsize;
use core::time::Duration;

use fork_join::ExecutionTimes;
use pub_sub::graph::{Call, Callbacks, Context, Graph, TopicId};
use pub_sub::workload::{Record, RecordedSet};
use pub_sub::{ApproximateTime, ExactTime, Outlet, Parameters, Set, Stamped, Synchronizer};

/// How messages are matched.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Matching {
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
pub struct Experiment {
    /// The number N of parallel subtasks, at least 1.
    pub parallel: usize,
    /// The number of jobs, at least 1.
    pub jobs: usize,
    /// The seed of the execution times.
    pub seed: u64,
    /// How messages are matched.
    pub matching: Matching,
    /// The synchronizer's queue size.
    pub queue: NonZeroUsize,
    /// The depth of all subscriptions. If one drops a message, the run is of no use:
    /// then jobs and publications no longer have the same numbers.
    pub depth: NonZeroUsize,
    /// The time between two jobs in nanoseconds.
    pub period_ns: u64,
    /// How an execution passes its time.
    pub execute: fn(Duration),
}

impl Experiment {
    /// Builds the graph. Its time 0 is the run's epoch; it shuts down when all has
    /// been published and joined.
    #[must_use]
    pub fn graph(self) -> Graph<Message, Part> {
        let mut graph = Graph::new();
        let input = graph.add_topic();
        let outputs: Vec<TopicId> = (0..self.parallel).map(|_| graph.add_topic()).collect();
        let part = |role| Part {
            experiment: self,
            role,
            spans: Vec::with_capacity(self.jobs),
        };
        let source = graph.add_group(part(Role::Source { output: input }));
        graph.add_timer(source, 0, self.period_ns);
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

/// What is published: a job's number, and a stamp.
pub type Message = Stamped<u64>;

/// The callbacks of one group, with what they have seen so far.
pub struct Part {
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

impl Callbacks<Message> for Part {
    fn call(&mut self, call: Call<Message>, context: &dyn Context<Message>) {
        let start_ns = context.now_ns();
        let spans = &mut self.spans;
        match (&mut self.role, call) {
            (Role::Source { output }, _) if spans.len() < self.experiment.jobs => {
                let stamp_ns = context.now_ns();
                let message = spans.len() as u64;
                spans.push(Span {
                    start_ns,
                    finish_ns: stamp_ns,
                });
                context.publish(*output, Stamped { stamp_ns, message });
            }
            // The join waits for messages that will never come.
            (Role::Source { .. }, _) if context.dropped() > 0 => context.shut_down(),
            (Role::Parallel { output, times }, Call::Message { message: job, .. }) => {
                (self.experiment.execute)(times.next_time());
                let finish_ns = context.now_ns();
                spans.push(Span {
                    start_ns,
                    finish_ns,
                });
                let stamp_ns = match self.experiment.matching {
                    Matching::Exact => job.stamp_ns,
                    Matching::Approximate { .. } => finish_ns,
                };
                context.publish(*output, Stamped { stamp_ns, ..job });
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
                        context,
                        ready_ns,
                        spans,
                        indices,
                    };
                    synchronizer.arrive(position, message, &mut outlet);
                    *expected -= 1;
                }
                if *expected == 0 {
                    context.shut_down();
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
    context: &'a dyn Context<Message>,
    ready_ns: &'a mut Vec<u64>,
    spans: &'a mut Vec<Span>,
    indices: &'a mut Vec<u64>,
}

impl Outlet<u64> for Joining<'_> {
    fn emitted(&mut self, set: Set<'_, u64>) {
        self.ready_ns.push(self.context.now_ns());
        let start_ns = self.context.now_ns();
        self.indices.extend(set.map(|stamped| stamped.message));
        self.spans.push(Span {
            start_ns,
            finish_ns: self.context.now_ns(),
        });
    }
}

/// From when to when something executed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Span {
    /// The function's first instruction.
    pub start_ns: u64,
    /// For the source and the parallel subtasks: the publication. For a join: the
    /// function's last instruction.
    pub finish_ns: u64,
}

/// A join that happened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Joined {
    /// When all that is joined had been put together.
    pub ready_ns: u64,
    /// When the function that uses it executed.
    pub span: Span,
}

/// The times of a run.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Samples {
    /// For each job the source's execution.
    pub source: Vec<Span>,
    /// For each parallel subtask and job its execution.
    pub parallel: Vec<Vec<Span>>,
    /// The joins in their order.
    pub joins: Vec<Joined>,
    /// For each join the jobs whose values it joined, one a parallel subtask; all
    /// joins one after the other.
    pub indices: Vec<u64>,
    /// Messages that queues before the synchronizer dropped. More than 0 means that
    /// the i-th publication is not job i.
    pub lost_inputs: u64,
}

impl Samples {
    /// Takes what a graph has seen when it was shut down and no worker uses it.
    #[must_use]
    pub fn of(graph: Graph<Message, Part>) -> Self {
        let lost_inputs = graph.dropped();
        let mut samples = Self {
            lost_inputs,
            ..Self::default()
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

    /// Returns the jobs whose values a join has joined.
    #[must_use]
    pub fn indices_of(&self, join: usize) -> &[u64] {
        let parallel = self.parallel.len();
        &self.indices[join * parallel..(join + 1) * parallel]
    }

    /// Returns what the metrics are computed from.
    #[must_use]
    pub fn record(&self) -> Record {
        let publications = |spans: &Vec<Span>| spans.iter().map(|span| span.finish_ns).collect();
        let to_index = |index: &u64| usize::try_from(*index).unwrap_or(usize::MAX);
        let sets = self
            .joins
            .iter()
            .enumerate()
            .map(|(join, joined)| RecordedSet {
                ready_ns: joined.ready_ns,
                indices: self.indices_of(join).iter().map(to_index).collect(),
            });
        Record {
            publications_ns: self.parallel.iter().map(publications).collect(),
            sets: sets.collect(),
        }
    }
}
