//! What to run, and the graph of callbacks that runs it.

use alloc::boxed::Box;
use alloc::vec::Vec;
use core::num::NonZeroUsize;
use core::time::Duration;

use fork_join::ExecutionTimes;
use pub_sub::graph::{Graph, TopicId};
use pub_sub::workload::Stamping;
use pub_sub::{ApproximateTime, ExactTime, Parameters, Synchronizer};

use crate::part::{Message, Part};
use crate::samples::Samples;

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
