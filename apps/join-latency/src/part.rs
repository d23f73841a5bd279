//! The callbacks: source, parallel subtask, join.

use alloc::boxed::Box;
use alloc::vec::Vec;
use core::time::Duration;

use fork_join::ExecutionTimes;
use pub_sub::graph::{Call, Callbacks, Context, TopicId};
use pub_sub::workload::Stamping;
use pub_sub::{Outlet, Set, Stamped, Synchronizer};

use crate::samples::{Joined, Samples, Span};

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
