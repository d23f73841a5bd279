//! The paper's workload under a policy of publish and subscribe, in virtual time.
//!
//! Every period a source starts a job. Each of N parallel subtasks takes the jobs in order, one at
//! a time, on a core of its own: it starts a job after the job's release and the completion of the
//! job before, executes for a given time, and publishes on its topic at the finish. A synchronizer
//! joins the N topics. Inputs of the parallel subtasks are unbounded, and nothing else takes any
//! time: publications, the source and the synchronizer itself cost nothing. So the result shows the
//! policy's rules alone, and no implementation can do better.
//!
//! The same execution times make the same publications. The result depends on nothing but the
//! arguments.

use std::num::NonZeroUsize;

use fork_join::PERIOD;
use join_latency::{CompletedJoin, ExecutionSpan, RunSamples};
use pub_sub::{ApproximateTime, Outlet, Parameters, Set, Stamped, Synchronizer};

/// Runs jobs through a synchronizer joining close stamps, as the paper does: each parallel subtask
/// stamps its message anew when it finishes. `times_ns` has for each topic the execution time of
/// each job.
///
/// Publications of the same instant arrive in the order of their topics.
///
/// # Panics
///
/// If there is no topic.
pub fn run(max_interval_ms: u64, times_ns: &[Vec<u64>]) -> RunSamples {
    let queue_size = NonZeroUsize::new(1000).expect("not 0");
    let mut parameters = Parameters::new(times_ns.len(), queue_size);
    parameters.max_interval_ns = Some(max_interval_ms * 1_000_000);
    let mut synchronizer = ApproximateTime::new(parameters);
    let mut samples = RunSamples {
        parallel: times_ns
            .iter()
            .map(|times_ns| executions(times_ns))
            .collect(),
        ..RunSamples::default()
    };
    let topics = samples.parallel.iter().enumerate();
    let of_topic = |(topic, spans): (usize, &Vec<ExecutionSpan>)| {
        let jobs = (0..).zip(spans.clone());
        jobs.map(move |(message, span)| (span.finish_ns, topic, message))
    };
    let mut publications: Vec<(u64, usize, u64)> = topics.flat_map(of_topic).collect();
    publications.sort_unstable();
    for (stamp_ns, topic, message) in publications {
        let (ready_ns, samples) = (stamp_ns, &mut samples);
        let message = Stamped { stamp_ns, message };
        synchronizer.arrive(topic, message, &mut Ready { ready_ns, samples });
    }
    samples
}

/// Returns the executions of a parallel subtask.
fn executions(times_ns: &[u64]) -> Vec<ExecutionSpan> {
    let period_ns = u64::try_from(PERIOD.as_nanos()).expect("25 ms");
    let mut finish_ns: u64 = 0;
    let jobs = (0..).zip(times_ns);
    let execution = jobs.map(|(job, time_ns): (u64, &u64)| {
        let start_ns = (job * period_ns).max(finish_ns);
        finish_ns = start_ns + time_ns;
        ExecutionSpan {
            start_ns,
            finish_ns,
        }
    });
    execution.collect()
}

/// Records the sets emitted while one publication is handled.
struct Ready<'a> {
    ready_ns: u64,
    samples: &'a mut RunSamples,
}

impl Outlet<u64> for Ready<'_> {
    fn emitted(&mut self, set: Set<'_, u64>) {
        let ready_ns = self.ready_ns;
        self.samples.joins.push(CompletedJoin {
            ready_ns,
            span: ExecutionSpan {
                start_ns: ready_ns,
                finish_ns: ready_ns,
            },
        });
        let indices = set.map(|stamped| stamped.message);
        self.samples.indices.extend(indices);
    }
}
