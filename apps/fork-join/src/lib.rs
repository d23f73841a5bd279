//! The paper's workload: one source -> N parallel subtasks -> one sink.
//!
//! The source starts a job every 25 ms. Each of the N parallel subtasks executes for a time drawn
//! uniformly from 1 to 50 ms; the sink joins them. The mean load of a parallel subtask is 25.5 /
//! 25, so backlogs grow slowly, however many cores there are, until jobs miss their
//! deadlines. Such misses are the workload's nature, not an error. An error is a *mixed join*: a
//! sink receiving values of different jobs. [`JoinCount`] counts mixed joins; there must be none.
//!
//! The library does not use the kernel: the tests run the workload in virtual time.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

extern crate alloc;

mod draw;
mod execution;
mod sink;
mod work;

use alloc::format;
use core::time::Duration;

use fass::{Dag, SubtaskAttributes, create_dag};

pub use draw::ExecutionTimes;
pub use execution::{CorePace, ExecutionWork};
pub use sink::JoinCount;
pub use work::compute;

/// The time between two jobs.
pub const PERIOD: Duration = Duration::from_millis(25);

/// The relative deadline of a job: four periods, so jobs meet their deadlines until the backlog has
/// grown.
pub const RELATIVE_DEADLINE: Duration = Duration::from_millis(100);

/// The longest execution time of a parallel subtask.
pub const WCET: Duration = Duration::from_millis(50);

/// The longest execution time of the source or the sink, with much room: both only count.
pub const WCET_OF_ENDS: Duration = Duration::from_millis(1);

/// The budget of every subtask, after which the subtask is at fault. The budget is generous,
/// because a virtual processor on a busy host can lose its core to others for long.
pub const BUDGET: Duration = Duration::from_secs(5);

/// The most jobs in flight.
pub const MOST_IN_FLIGHT: u32 = 256;

/// The most parallel subtasks, limited because the sink's arguments are a tuple.
pub const MOST_PARALLEL: usize = sched_dag::MAX_ARITY;

/// The workload of a fork-join run.
#[derive(Clone, Copy, Debug)]
pub struct Workload {
    /// The number N of parallel subtasks, 1 to [`MOST_PARALLEL`].
    pub parallel: usize,
    /// The longest execution time of a parallel subtask; [`WCET`] in the paper.
    pub longest: Duration,
    /// The number of jobs; 0 for a run without end.
    pub jobs: u64,
    /// The seed of the execution times.
    pub seed: u64,
    /// How the parallel subtasks spend their execution times.
    pub work: ExecutionWork,
}

impl Workload {
    /// Builds the DAG, and the counts kept by its sink.
    ///
    /// As many jobs may be in flight as there are, up to 256: the slowest parallel subtask, behind
    /// by some 130 jobs after 2000, must not hold back the releases.
    ///
    /// # Panics
    ///
    /// If `parallel` is 0 or more than [`MOST_PARALLEL`].
    pub fn build(&self) -> (Dag, JoinCount) {
        let dag = create_dag();
        dag.name("fork-join").in_flight(match self.jobs {
            0 => MOST_IN_FLIGHT,
            jobs => u32::try_from(jobs).map_or(MOST_IN_FLIGHT, |jobs| jobs.min(MOST_IN_FLIGHT)),
        });
        if self.jobs > 0 {
            dag.jobs(self.jobs);
        }

        let mut next_job = 0u64;
        let source = move || {
            let job = next_job;
            next_job += 1;
            (job,)
        };
        let attributes = SubtaskAttributes::named("source")
            .wcet(WCET_OF_ENDS)
            .budget(BUDGET);
        dag.register_periodic_subtask(source, ["job"], PERIOD, attributes);

        for branch in 0..self.parallel {
            let mut times = ExecutionTimes::up_to(self.longest, self.seed, branch);
            let work = self.work;
            let execute = move |(job,): (u64,)| {
                work.execute_for(times.next_time());
                (job,)
            };
            let attributes = SubtaskAttributes::named(&format!("parallel-{branch}"));
            let attributes = attributes.wcet(self.longest).budget(BUDGET);
            let output = format!("part-{branch}");
            dag.register_subtask(execute, ["job"], [output.as_str()], attributes);
        }

        let joins = JoinCount::default();
        sink::register(&dag, self.parallel, &joins);
        (dag, joins)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fass::Occupation;
    use virtual_time::VirtualTime;

    fn workload(parallel: usize) -> Workload {
        Workload {
            parallel,
            longest: WCET,
            jobs: 100,
            seed: 1,
            work: ExecutionWork::Simulate(Occupation::Hold),
        }
    }

    #[test]
    fn joins_every_job_whatever_the_number_of_cores() {
        for (parallel, cores) in [(1, 1), (2, 1), (2, 4), (4, 3), (6, 8), (16, 64)] {
            let machine = VirtualTime::new().cores(cores);
            let (dag, joins) = workload(parallel).build();
            fass::finish_create_dags(&[dag]).unwrap();
            let report = machine.run();
            assert_eq!(
                report.violations().len(),
                0,
                "N = {parallel}, {cores} cores"
            );
            assert_eq!((joins.total(), joins.mixed()), (100, 0));
        }
    }

    #[test]
    #[should_panic(expected = "1 to 16")]
    fn refuses_a_sink_without_arguments() {
        let _ = workload(0).build();
    }
}
