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
use alloc::vec;
use alloc::vec::Vec;
use core::num::NonZeroUsize;
use core::time::Duration;

use fork_join::ExecutionTimes;
use pub_sub::graph::{Call, Callbacks, Context, Graph, TopicId};
use pub_sub::workload::{Record, RecordedSet, Stamping};
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
    pub fn graph(&self) -> Graph<Message, Part> {
        let mut graph = Graph::new();
        let input = graph.add_topic();
        let outputs: Vec<TopicId> = (0..self.parallel).map(|_| graph.add_topic()).collect();
        let source = graph.add_group(Part::Source {
            output: input,
            spans: Vec::with_capacity(self.jobs),
            jobs: self.jobs,
        });
        graph.add_timer(source, 0, self.period_ns);
        for (branch, &output) in outputs.iter().enumerate() {
            let parallel = graph.add_group(Part::Parallel {
                branch,
                output,
                times: ExecutionTimes::new(self.seed, branch),
                execute: self.execute,
                stamping: self.stamping(),
                spans: Vec::with_capacity(self.jobs),
            });
            graph.subscribe(parallel, input, self.depth.get());
        }
        let (joins, indices) = Samples::room_for_joins(self.parallel, self.jobs);
        let join = graph.add_group(Part::Join {
            synchronizer: self.synchronizer(),
            inputs: outputs.clone(),
            joins,
            indices,
            expected: self.parallel * self.jobs,
        });
        for &output in &outputs {
            graph.subscribe(join, output, self.depth.get());
        }
        graph
    }

    /// Takes what a graph has seen when it was shut down and no worker uses it.
    #[must_use]
    pub fn samples(&self, graph: Graph<Message, Part>) -> Samples {
        let mut samples = Samples::empty(self.parallel);
        samples.lost_inputs = graph.dropped();
        for part in graph.into_callbacks() {
            part.add_to(&mut samples);
        }
        samples
    }

    /// Returns what publications are stamped with.
    #[must_use]
    pub const fn stamping(&self) -> Stamping {
        match self.matching {
            Matching::Exact => Stamping::Release,
            Matching::Approximate { .. } => Stamping::Publication,
        }
    }

    /// Makes the synchronizer.
    #[must_use]
    pub fn synchronizer(&self) -> Box<dyn Synchronizer<u64> + Send> {
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
pub enum Part {
    /// Publishes a job at each call of its timer, until all are published.
    Source {
        /// Where the jobs are published.
        output: TopicId,
        /// Its executions so far, one a job.
        spans: Vec<Span>,
        /// How many jobs there are.
        jobs: usize,
    },
    /// Executes each job it receives for a drawn time, and publishes it.
    Parallel {
        /// Which parallel subtask it is.
        branch: usize,
        /// Where the jobs are published.
        output: TopicId,
        /// How long the next executions take.
        times: ExecutionTimes,
        /// How an execution passes its time.
        execute: fn(Duration),
        /// With what its publications are stamped.
        stamping: Stamping,
        /// Its executions so far, one a job.
        spans: Vec<Span>,
    },
    /// Joins what the parallel subtasks publish.
    Join {
        /// The policy by which it joins.
        synchronizer: Box<dyn Synchronizer<u64> + Send>,
        /// The topics of the parallel subtasks, in their order.
        inputs: Vec<TopicId>,
        /// The joins so far.
        joins: Vec<Joined>,
        /// The jobs that were joined, as in [`Samples::indices`].
        indices: Vec<u64>,
        /// How many messages are to come; after that, nothing can happen any more.
        expected: usize,
    },
}

impl Callbacks<Message> for Part {
    fn call(&mut self, call: Call<Message>, context: &dyn Context<Message>) {
        let start_ns = context.now_ns();
        match (self, call) {
            (
                Self::Source {
                    output,
                    spans,
                    jobs,
                },
                Call::Timer { .. },
            ) => {
                if spans.len() < *jobs {
                    let stamp_ns = context.now_ns();
                    let job = spans.len() as u64;
                    spans.push(Span {
                        start_ns,
                        finish_ns: stamp_ns,
                    });
                    context.publish(
                        *output,
                        Stamped {
                            stamp_ns,
                            message: job,
                        },
                    );
                } else if context.dropped() > 0 {
                    // The join waits for messages that will never come.
                    context.shut_down();
                }
            }
            (
                Self::Parallel {
                    output,
                    times,
                    execute,
                    stamping,
                    spans,
                    ..
                },
                Call::Message { message: job, .. },
            ) => {
                execute(times.next_time());
                let finish_ns = context.now_ns();
                spans.push(Span {
                    start_ns,
                    finish_ns,
                });
                let stamp_ns = match stamping {
                    Stamping::Release => job.stamp_ns,
                    Stamping::Publication => finish_ns,
                };
                context.publish(*output, Stamped { stamp_ns, ..job });
            }
            (
                Self::Join {
                    synchronizer,
                    inputs,
                    joins,
                    indices,
                    expected,
                },
                Call::Message { topic, message },
            ) => {
                if let Some(position) = inputs.iter().position(|input| *input == topic) {
                    let mut outlet = Joining {
                        context,
                        joins,
                        indices,
                    };
                    synchronizer.arrive(position, message, &mut outlet);
                    *expected -= 1;
                }
                if *expected == 0 {
                    context.shut_down();
                }
            }
            (Self::Source { .. }, Call::Message { .. })
            | (Self::Parallel { .. } | Self::Join { .. }, Call::Timer { .. }) => {
                unreachable!("the graph registers no such callback for it")
            }
        }
    }
}

/// Where sets go: to the join's function, which is called at once, as the original
/// calls it.
struct Joining<'a> {
    context: &'a dyn Context<Message>,
    joins: &'a mut Vec<Joined>,
    indices: &'a mut Vec<u64>,
}

impl Outlet<u64> for Joining<'_> {
    fn emitted(&mut self, set: Set<'_, u64>) {
        let ready_ns = self.context.now_ns();
        let span = join(self.context, set, self.indices);
        self.joins.push(Joined { ready_ns, span });
    }
}

/// The function that uses what was joined: like the DAG's sink, it only looks.
fn join(context: &dyn Context<Message>, set: Set<'_, u64>, indices: &mut Vec<u64>) -> Span {
    let start_ns = context.now_ns();
    indices.extend(set.map(|stamped| stamped.message));
    Span {
        start_ns,
        finish_ns: context.now_ns(),
    }
}

impl Part {
    /// Adds what this part has seen to the samples of the run.
    pub(crate) fn add_to(self, samples: &mut Samples) {
        match self {
            Self::Source { spans, .. } => samples.source = spans,
            Self::Parallel { branch, spans, .. } => samples.parallel[branch] = spans,
            Self::Join { joins, indices, .. } => {
                samples.joins = joins;
                samples.indices = indices;
            }
        }
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

    /// Makes room for `jobs` jobs, with joins of `parallel` values.
    pub(crate) fn room_for_joins(parallel: usize, jobs: usize) -> (Vec<Joined>, Vec<u64>) {
        (
            Vec::with_capacity(jobs),
            Vec::with_capacity(jobs * parallel),
        )
    }

    /// Makes samples without any.
    pub(crate) fn empty(parallel: usize) -> Self {
        Self {
            parallel: vec![Vec::new(); parallel],
            ..Self::default()
        }
    }
}
