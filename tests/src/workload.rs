//! The paper's workload under a policy of publish and subscribe, in virtual time.
//!
//! Every period a source starts a job. Each of N parallel subtasks takes the jobs in
//! order, one at a time, on a core of its own: it starts a job when that has been
//! released and the job before is done, executes for a given time, and publishes on
//! its topic when it finishes. A synchronizer joins the N topics. Inputs of the
//! parallel subtasks are unbounded, and nothing else takes any time: publications,
//! the source and the synchronizer itself cost nothing. So what is seen is what the
//! policy does by its rules, which no implementation of it can better.
//!
//! The same execution times make the same publications. The result
//! depends on nothing but the arguments.

use fork_join::PERIOD;
use join_latency::{Joined, Samples, Span};
use pub_sub::{Outlet, Set, Stamped, Synchronizer};

/// Which time a parallel subtask stamps its messages with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stamping {
    /// The job's release: the source's stamp is passed on, so that all messages of a
    /// job carry the same. [`ExactTime`](pub_sub::ExactTime) needs this.
    Release,
    /// The publication: every parallel subtask stamps anew when it finishes. The
    /// paper joins these with [`ApproximateTime`](pub_sub::ApproximateTime).
    Publication,
}

/// Runs jobs through a synchronizer that holds nothing yet. `times_ns` has for each of its topics
/// the execution time of each job.
///
/// Publications of the same instant arrive in the order of their topics.
pub fn run(
    synchronizer: &mut dyn Synchronizer<u64>,
    stamping: Stamping,
    times_ns: &[Vec<u64>],
) -> Samples {
    let mut samples = Samples {
        parallel: times_ns
            .iter()
            .map(|times_ns| executions(times_ns))
            .collect(),
        ..Samples::default()
    };
    let topics = samples.parallel.iter().enumerate();
    let of_topic = |(topic, spans): (usize, &Vec<Span>)| {
        let jobs = (0..).zip(spans.clone());
        jobs.map(move |(job, span)| (span.finish_ns, topic, job))
    };
    let mut publications: Vec<(u64, usize, u64)> = topics.flat_map(of_topic).collect();
    publications.sort_unstable();
    for (ready_ns, topic, job) in publications {
        let message = Stamped {
            stamp_ns: match stamping {
                Stamping::Release => release_ns(job),
                Stamping::Publication => ready_ns,
            },
            message: job,
        };
        let samples = &mut samples;
        synchronizer.arrive(topic, message, &mut Ready { ready_ns, samples });
    }
    samples
}

/// Returns the executions of a parallel subtask.
fn executions(times_ns: &[u64]) -> Vec<Span> {
    let mut finish_ns: u64 = 0;
    let jobs = (0..).zip(times_ns);
    let execution = jobs.map(|(job, time_ns)| {
        let start_ns = release_ns(job).max(finish_ns);
        finish_ns = start_ns + time_ns;
        Span {
            start_ns,
            finish_ns,
        }
    });
    execution.collect()
}

fn release_ns(job: u64) -> u64 {
    let period_ns = u64::try_from(PERIOD.as_nanos()).expect("25 ms");
    job * period_ns
}

/// Writes down what comes out while one publication is handled.
struct Ready<'a> {
    ready_ns: u64,
    samples: &'a mut Samples,
}

impl Outlet<u64> for Ready<'_> {
    fn emitted(&mut self, set: Set<'_, u64>) {
        let ready_ns = self.ready_ns;
        self.samples.joins.push(Joined {
            ready_ns,
            span: Span {
                start_ns: ready_ns,
                finish_ns: ready_ns,
            },
        });
        let indices = set.map(|stamped| stamped.message);
        self.samples.indices.extend(indices);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pub_sub::ExactTime;

    #[test]
    fn jobs_of_a_parallel_subtask_wait_for_each_other() {
        let spans = executions(&[60_000_000, 1_000_000, 1_000_000, 1]);
        let finishes_ns: Vec<_> = spans.iter().map(|span| span.finish_ns).collect();
        assert_eq!(
            finishes_ns,
            [60_000_000, 61_000_000, 62_000_000, 75_000_001]
        );
    }

    #[test]
    fn a_join_is_ready_when_its_last_message_is_published() {
        let mut exact = ExactTime::new(2, 5);
        let samples = run(&mut exact, Stamping::Release, &[vec![9; 2], vec![4; 2]]);
        let ready_ns: Vec<_> = samples.joins.iter().map(|join| join.ready_ns).collect();
        assert_eq!(ready_ns, [9, 25_000_009]);
        assert_eq!(samples.counts(), [2, 2, 0, 0]);
    }
}
