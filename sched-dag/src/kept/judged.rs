//! What a journal shows once its run has ended.
//!
//! This is the law, read from a journal that is kept. Unlike the law, which takes any
//! events, it is not generic: it is compiled once, here, and for size, however fast the
//! driver that asks for it is to be.

use alloc::sync::Arc;
use alloc::vec::Vec;

use super::{FINEST, Journal};
use crate::law::{self, Costs, Record, Tally, Terms, Violation};
use crate::policy::SchedulerOptions;
use crate::task_set::TaskSet;

impl Journal {
    /// Computes the times of all jobs and instances; of the latest whole jobs if events
    /// are lost.
    ///
    /// # Panics
    ///
    /// If there is no memory for them.
    #[must_use]
    #[inline(never)]
    pub fn record(&self, task_set: &TaskSet) -> Record {
        let record = Record::of_events(task_set, self.is_whole(), self.events());
        record.expect("the times of a journal's events fit into memory")
    }

    /// Computes the statistics of the run; `None` if events were neither kept nor
    /// counted.
    #[must_use]
    pub fn statistics(&self, task_set: &Arc<TaskSet>) -> Option<Tally> {
        self.statistics_in(task_set, FINEST)
    }

    /// Works like [`statistics`](Self::statistics), with the coarsest histograms, which
    /// take little memory, unless finer ones were kept. Counts and maxima are exact.
    #[must_use]
    pub fn coarse_statistics(&self, task_set: &Arc<TaskSet>) -> Option<Tally> {
        self.statistics_in(task_set, 0)
    }

    #[inline(never)]
    fn statistics_in(&self, task_set: &Arc<TaskSet>, bits: u32) -> Option<Tally> {
        let mut tally = match &self.tally {
            Some(tally) => tally.clone(),
            None => Tally::new(task_set, bits),
        };
        self.events().for_each(|event| tally.take(&event));
        self.is_complete.then_some(tally)
    }

    /// Returns every breach of the rules R1 to R4, and whether each instance had one life
    /// and each core one instance at a time. However long something takes is right, for
    /// that is the machine's affair.
    #[must_use]
    #[inline(never)]
    pub fn violations(&self, task_set: &TaskSet) -> Vec<Violation> {
        law::violations(task_set, self.terms(u64::MAX), self.events())
    }

    /// Returns every breach of R5 (did the right instances run?) that lasts for longer
    /// than `bound_ns`: it takes a machine some time to carry a decision out. `None` if
    /// events are lost.
    #[must_use]
    #[inline(never)]
    pub fn dispatch_violations(
        &self,
        task_set: &TaskSet,
        options: &SchedulerOptions,
        bound_ns: u64,
    ) -> Option<Vec<Violation>> {
        let terms = self.terms(bound_ns);
        let judge = || law::dispatch_violations(task_set, options, terms, self.events());
        self.is_whole().then(judge)
    }

    /// Measures what the platform's own work has cost, core by core; `None` if events are lost.
    #[must_use]
    #[inline(never)]
    pub fn costs(&self, task_set: &TaskSet) -> Option<Costs> {
        let measure = || Costs::of_cores(task_set, self.events());
        self.is_whole().then(measure)
    }

    const fn is_whole(&self) -> bool {
        self.lost() == 0
    }

    const fn terms(&self, tolerance_ns: u64) -> Terms {
        Terms {
            is_whole: self.is_whole(),
            ..Terms::whole(tolerance_ns)
        }
    }
}
