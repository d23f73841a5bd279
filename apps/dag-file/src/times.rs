//! The times for which an instance executes and waits.
//!
//! The time drawn by an instance follows only from the seed, the subtask's position in its set, and
//! the job. So two policies, or two numbers of cores, get the same load. A sample contains the
//! times of all segments and waits. Without a sample, the segments of a subtask divide the
//! instance's time in the same proportions as the subtask's WCET.
//!
//! A wait lasts until a simulated device answers, or to its limit. Where each instance takes its
//! WCET, no device answers, which is the worst case of waits. Without a sample the time of an
//! answer is drawn, too: one in five answers comes beyond the limit.

use alloc::sync::Arc;
use alloc::vec::Vec;

use fass_dag_file::{Execution, WHOLE, executed_ns};
use random::{nth, scale};
use sched_dag::Wait;

/// The execution times of one subtask.
#[derive(Clone, Debug)]
pub(crate) struct ExecutionTimes {
    pub(crate) execution: Execution,
    pub(crate) wcet_ns: u64,
    pub(crate) samples_ns: Arc<[u64]>,
    pub(crate) seed: u64,
    pub(crate) waits: Vec<Wait>,
}

impl ExecutionTimes {
    /// Returns the execution time of a segment of a job's instance, in nanoseconds.
    pub(crate) fn of_segment(&self, job: u64, number: usize) -> u64 {
        if let Some(sample) = self.sample(job) {
            return sample[2 * number];
        }
        let (of_job, whole) = (
            u128::from(self.of_job(job)),
            u128::from(self.wcet_ns.max(1)),
        );
        let up_to = |segments: usize| {
            let later = self.waits.get(segments - 1..).unwrap_or_default();
            let later_ns: u64 = later.iter().filter_map(|wait| wait.segment_ns).sum();
            let part = u128::from(self.wcet_ns.saturating_sub(later_ns));
            // Rounded down at both ends, the segments add up to the whole. The whole is at most the
            // WCET, so no segment exceeds its own WCET.
            u64::try_from(of_job * part / whole).unwrap_or(u64::MAX)
        };
        let before = if number == 0 { 0 } else { up_to(number) };
        up_to(number + 1) - before
    }

    /// Returns the wait of a job's instance after a segment, in nanoseconds; `None` after the last
    /// segment.
    pub(crate) fn of_wait(&self, job: u64, number: usize) -> Option<u64> {
        let limit_ns = self.waits.get(number)?.limit_ns;
        if self.execution == Execution::Wcet {
            return Some(limit_ns);
        }
        if let Some(sample) = self.sample(job) {
            return Some(sample[2 * number + 1].min(limit_ns));
        }
        let drawn = nth(!self.seed, job.wrapping_mul(256) + number as u64);
        let latest_ns = limit_ns.saturating_add(limit_ns / 4);
        Some(scale(drawn, 0..=latest_ns).min(limit_ns))
    }

    /// Returns the execution time of a job's instance, in nanoseconds.
    pub(crate) fn of_job(&self, job: u64) -> u64 {
        if let Some(sample) = self.sample(job) {
            return executed_ns(sample);
        }
        match self.execution {
            Execution::Uniform { least, most } => {
                let part = |of: u64| {
                    let ns = u128::from(self.wcet_ns) * u128::from(of) / u128::from(WHOLE);
                    u64::try_from(ns).unwrap_or(self.wcet_ns)
                };
                scale(nth(self.seed, job), part(least)..=part(most))
            }
            _ => self.wcet_ns,
        }
    }

    /// Returns the sample used by a job's instance, if any.
    fn sample(&self, job: u64) -> Option<&[u64]> {
        let len = 2 * self.waits.len() + 1;
        let count = self.samples_ns.len() / len;
        let last = count.checked_sub(1)?;
        let place = match self.execution {
            Execution::Samples => scale(nth(self.seed, job), 0..=last),
            Execution::Sequence => usize::try_from(job % count as u64).ok()?,
            Execution::Wcet | Execution::Uniform { .. } => return None,
        };
        self.samples_ns.chunks(len).nth(place)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_stay_within_what_was_asked_and_depend_on_the_seed_alone() {
        let times = |execution, seed| ExecutionTimes {
            execution,
            wcet_ns: 1_000_000,
            samples_ns: [10, 20, 30].into(),
            seed,
            waits: Vec::new(),
        };
        let uniform = Execution::parse("uniform:0.5..0.75").unwrap();
        let draw = |seed| -> Vec<u64> {
            (0..1000)
                .map(|job| times(uniform, seed).of_job(job))
                .collect()
        };
        assert!(draw(1).iter().all(|ns| (500_000..=750_000).contains(ns)));
        assert_eq!(draw(1), draw(1));
        assert_ne!(draw(1), draw(2));
        let samples = times(Execution::Samples, 1);
        let mut drawn: Vec<u64> = (0..100).map(|job| samples.of_job(job)).collect();
        drawn.sort_unstable();
        drawn.dedup();
        assert_eq!(drawn, [10, 20, 30]);
        let none = ExecutionTimes {
            samples_ns: Arc::default(),
            ..samples
        };
        assert_eq!(none.of_job(3), 1_000_000);
        assert_eq!(times(Execution::Wcet, 9).of_job(5), 1_000_000);
        let sequence = times(Execution::Sequence, 1);
        assert_eq!(
            [0, 1, 2, 3].map(|job| sequence.of_job(job)),
            [10, 20, 30, 10]
        );
    }

    #[test]
    fn segments_divide_the_time_and_devices_answer_in_time_or_not() {
        let wait = |limit_ns, segment_ns| Wait {
            limit_ns,
            segment_ns: Some(segment_ns),
        };
        let times = |execution| ExecutionTimes {
            execution: Execution::parse(execution).unwrap(),
            wcet_ns: 1_000,
            samples_ns: [10, 300, 20, 0, 30, 600, 401, 301, 9, 99].into(),
            seed: 3,
            waits: [wait(400, 301), wait(0, 99)].into(),
        };
        let of =
            |times: &ExecutionTimes, job| [0, 1, 2].map(|number| times.of_segment(job, number));
        let wcet = times("wcet");
        assert_eq!(of(&wcet, 5), [600, 301, 99]);
        assert_eq!(
            [0, 1, 2].map(|at| wcet.of_wait(5, at)),
            [Some(400), Some(0), None]
        );
        let drawn = times("uniform:0.2..1");
        for job in 0..100 {
            let segments = of(&drawn, job);
            assert_eq!(segments.iter().sum::<u64>(), drawn.of_job(job));
            let most = [600, 301, 99];
            assert!(
                segments.iter().zip(most).all(|(ns, most)| *ns <= most),
                "{segments:?}"
            );
        }
        let waits: Vec<_> = (0..1_000).filter_map(|job| drawn.of_wait(job, 0)).collect();
        let late = waits.iter().filter(|ns| **ns == 400).count();
        assert!((150..250).contains(&late), "{late}");
        assert!(waits.iter().any(|ns| *ns < 40) && waits.iter().all(|ns| *ns <= 400));
        // A sample has all times; a wait that lasted beyond the limit lasts to the limit.
        let sequence = times("sequence");
        assert_eq!(
            [0, 1].map(|job| of(&sequence, job)),
            [[10, 20, 30], [600, 301, 99]]
        );
        assert_eq!(
            [0, 1].map(|job| sequence.of_wait(job, 0)),
            [Some(300), Some(400)]
        );
        assert_eq!(sequence.of_job(3), 1_000);
    }
}
