//! Workloads of empty bodies, and the stamps that measure the time between them.
//!
//! A *body* here only reads the clock, so the time between two bodies is the system's alone.
//! [`Shape`] describes the graphs, purely; [`build()`] makes DAGs of them through the API of every
//! app; [`BodyStamps`] holds the times read by the bodies. Chains and fork-joins are typed, with
//! one `u64` on each edge, because an app would write them so; random graphs are made at run time,
//! without values.
//!
//! The library does not use the kernel: the tests run the workloads in virtual time.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

extern crate alloc;

mod empty;
mod shape;

use alloc::format;
use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;
use core::sync::atomic::{AtomicU64, Ordering};
use core::time::Duration;

use fass::{Dag, Occupation, SubtaskAttributes, VecToSubs, create_dag};
use fork_join::each_arity;

pub use empty::{Tick, commit, empty};
pub use shape::Shape;

/// The bodies that stamp.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stamping {
    /// Every body.
    All,
    /// Only the source and the sink: no stamp lies within the times in between.
    Ends,
}

/// A DAG to be measured.
#[derive(Clone, Copy, Debug)]
pub struct Workload {
    /// The graph.
    pub shape: Shape,
    /// The number of jobs.
    pub jobs: u64,
    /// The time between two jobs, and the relative deadline.
    pub period: Duration,
    /// The bodies that stamp.
    pub stamping: Stamping,
    /// The time for which each subtask between source and sink computes; mostly zero.
    pub work: Duration,
    /// The WCET of each subtask, if stated; each subtask then has a budget by default.
    pub wcet: Option<Duration>,
}

/// Builds the DAG, and returns it with the place where its bodies leave their times.
///
/// # Panics
///
/// If a fork-join has no or more than 16 parallel subtasks.
pub fn build(workload: &Workload) -> (Dag, BodyStamps) {
    let dag = create_dag();
    dag.jobs(workload.jobs).in_flight(1);
    let mut builder = Builder {
        workload,
        dag: &dag,
        stamps: BodyStamps::default(),
    };
    match workload.shape {
        Shape::Chain(subtasks) => builder.chain(subtasks),
        Shape::ForkJoin(parallel) => builder.fork_join(parallel),
        Shape::Layered { .. } => builder.at_run_time(),
    }
    let stamps = builder.stamps;
    (dag, stamps)
}

struct Builder<'a> {
    workload: &'a Workload,
    dag: &'a Dag,
    stamps: BodyStamps,
}

impl Builder<'_> {
    fn chain(&mut self, subtasks: usize) {
        self.dag.name("chain");
        let topics: Vec<String> = (0..subtasks).map(|number| format!("t{number}")).collect();
        self.source(&topics[0]);
        for number in 1..subtasks - 1 {
            self.between(number, &topics[number - 1], &topics[number]);
        }
        self.sink::<(u64,)>(subtasks - 1, vec![&topics[subtasks - 2]]);
    }

    fn fork_join(&mut self, parallel: usize) {
        self.dag.name("fork-join");
        self.source("job");
        let topics: Vec<String> = (0..parallel).map(|number| format!("t{number}")).collect();
        for (number, topic) in (1..).zip(&topics) {
            self.between(number, "job", topic);
        }
        let inputs = topics.iter().map(String::as_str).collect();
        self.typed_join(parallel, inputs);
    }

    fn typed_join(&mut self, parallel: usize, inputs: Vec<&str>) {
        macro_rules! join {
            ($($number:literal: $($part:ident)+;)+) => {
                match parallel {
                    $($number => self.sink::<($(join!(@u64 $part),)+)>(parallel + 1, inputs),)+
                    _ => panic!("a fork-join has 1 to 16 parallel subtasks, not {parallel}"),
                }
            };
            (@u64 $part:ident) => { u64 };
        }
        each_arity!(join);
    }

    fn at_run_time(&mut self) {
        self.dag.name("layered");
        self.dag.period(self.workload.period);
        self.dag.relative_deadline(self.workload.period);
        let shape = self.workload.shape;
        let register = |number| {
            let attributes = self.attributes(number);
            match self.pen(number) {
                Some(mut pen) => {
                    let body = move |_| twice(&mut pen);
                    self.dag.register_untyped_subtask(body, attributes)
                }
                None => self.dag.register_untyped_subtask(|_| (), attributes),
            }
        };
        let subtasks: Vec<_> = (0..shape.subtasks()).map(register).collect();
        for (earlier, later) in shape.edges() {
            self.dag.precede(&subtasks[earlier], &subtasks[later]);
        }
    }

    fn source(&mut self, output: &str) {
        let (dag, attributes) = (self.dag, self.attributes(0));
        let mut pen = self.stamps.pen(self.workload.jobs);
        let body = move || {
            twice(&mut pen);
            (0u64,)
        };
        dag.register_periodic_subtask(body, vec![output], self.workload.period, attributes);
    }

    fn between(&mut self, number: usize, input: &str, output: &str) {
        let (dag, attributes) = (self.dag, self.attributes(number));
        let (inputs, outputs) = (vec![input], vec![output]);
        match self.pen(number) {
            Some(mut pen) if !self.workload.work.is_zero() => {
                let work = self.workload.work;
                let body = move |(value,): (u64,)| {
                    pen.stamp();
                    fass::execute_for(work, Occupation::Spin);
                    pen.stamp();
                    (value,)
                };
                dag.register_subtask(body, inputs, outputs, attributes);
            }
            Some(mut pen) => {
                let body = move |(value,): (u64,)| {
                    twice(&mut pen);
                    (value,)
                };
                dag.register_subtask(body, inputs, outputs, attributes);
            }
            None => dag.register_subtask(|value: (u64,)| value, inputs, outputs, attributes),
        }
    }

    fn sink<Args: VecToSubs>(&mut self, number: usize, inputs: Vec<&str>) {
        let (dag, attributes) = (self.dag, self.attributes(number));
        let mut pen = self.stamps.pen(self.workload.jobs);
        let body = move |_: Args| twice(&mut pen);
        dag.register_sink_subtask(body, inputs, self.workload.period, attributes);
    }

    fn pen(&mut self, number: usize) -> Option<StampPen> {
        let is_end = number == 0 || number + 1 == self.workload.shape.subtasks();
        if is_end || self.workload.stamping == Stamping::All {
            return Some(self.stamps.pen(self.workload.jobs));
        }
        self.stamps.no_pen();
        None
    }

    fn attributes(&self, number: usize) -> SubtaskAttributes {
        let attributes = SubtaskAttributes::named(&format!("s{number}"));
        match self.workload.wcet {
            Some(wcet) => attributes.wcet(wcet),
            None => attributes,
        }
    }
}

/// Stamps the first and the last instruction of a body: the whole body.
#[inline]
fn twice(pen: &mut StampPen) {
    pen.stamp();
    pen.stamp();
}

/// The times of all stamping bodies of a DAG, in nanoseconds on the clock of
/// [`fass::now_ns`].
#[derive(Clone, Debug, Default)]
pub struct BodyStamps {
    /// By subtask; job by job, within a job first and last instruction.
    times: Vec<Arc<[AtomicU64]>>,
}

/// A pen for the times of one body.
pub struct StampPen {
    times: Arc<[AtomicU64]>,
    next: usize,
}

impl StampPen {
    /// Makes a separate pen with room for a given number of times.
    pub fn new(times: usize) -> Self {
        Self {
            times: (0..times).map(|_| AtomicU64::new(0)).collect(),
            next: 0,
        }
    }

    /// Reads the clock and keeps the time, as long as there is room.
    #[inline]
    pub fn stamp(&mut self) {
        self.put(fass::now_ns());
    }

    /// Keeps a time, as long as there is room.
    #[inline]
    pub fn put(&mut self, time_ns: u64) {
        if let Some(place) = self.times.get(self.next) {
            place.store(time_ns, Ordering::Relaxed);
        }
        self.next += 1;
    }

    /// Returns all times.
    pub fn times(&self) -> impl Iterator<Item = u64> + Clone {
        self.times.iter().map(|time| time.load(Ordering::Relaxed))
    }
}

impl BodyStamps {
    /// Makes a pen for the next subtask's body, with room for two stamps in each job.
    pub fn pen(&mut self, jobs: u64) -> StampPen {
        let pen = StampPen::new(
            usize::try_from(jobs)
                .unwrap_or(usize::MAX)
                .saturating_mul(2),
        );
        self.times.push(Arc::clone(&pen.times));
        pen
    }

    /// Leaves the next subtask without times.
    fn no_pen(&mut self) {
        self.times.push(Arc::new([]));
    }

    /// Returns the time of a body's first instruction, if the body stamped.
    pub fn first(&self, subtask: usize, job: u64) -> Option<u64> {
        self.time(subtask, job, 0)
    }

    /// Returns the time of a body's last instruction, if the body stamped.
    pub fn last(&self, subtask: usize, job: u64) -> Option<u64> {
        self.time(subtask, job, 1)
    }

    fn time(&self, subtask: usize, job: u64, which: usize) -> Option<u64> {
        let index = usize::try_from(job).ok()?.checked_mul(2)? + which;
        let time = self.times.get(subtask)?.get(index)?.load(Ordering::Relaxed);
        (time > 0).then_some(time)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use virtual_time::VirtualTime;

    #[test]
    fn every_shape_runs_and_stamps() {
        let shapes = [
            Shape::Chain(64),
            Shape::ForkJoin(1),
            Shape::ForkJoin(16),
            Shape::Layered {
                subtasks: 100,
                seed: 7,
            },
        ];
        for shape in shapes {
            for (stamping, expected) in [(Stamping::All, shape.subtasks()), (Stamping::Ends, 2)] {
                let machine = VirtualTime::new();
                let (dag, stamps) = build(&Workload {
                    shape,
                    jobs: 3,
                    // Time 0 would count as no time.
                    period: Duration::from_millis(10),
                    stamping,
                    work: Duration::ZERO,
                    wcet: None,
                });
                dag.offset(Duration::from_millis(1));
                fass::finish_create_dags(&[dag]).unwrap();
                assert_eq!(machine.run().violations().len(), 0, "{shape:?}");
                let count = |job| {
                    let times = |subtask| stamps.first(subtask, job).and(stamps.last(subtask, job));
                    (0..shape.subtasks()).filter_map(times).count()
                };
                assert_eq!(
                    [count(0), count(2)],
                    [expected; 2],
                    "{shape:?}, {stamping:?}"
                );
                assert_eq!(count(3), 0);
            }
        }
    }
}
