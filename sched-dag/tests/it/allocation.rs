//! From the first release to the last completion nothing is allocated: in random sets with tables and
//! groups of cores, whose jobs overrun and fail.

use crate::counting::allocated;
use crate::support::set::{self, Set};
use random::Random;
use sched_dag::virtual_time::{RunOutcome, VirtualTime, Workload};
use sched_dag::{DagId, Instance};

/// Executes and fails as its set says.
struct Work<'s>(&'s Set);

impl Workload for Work<'_> {
    fn execute(&mut self, instance: &mut Instance, _now_ns: u64) -> Option<u64> {
        Some(self.0.execution_ns(*instance))
    }

    fn fails(&mut self, instance: Instance) -> bool {
        self.0.fails(instance)
    }
}

#[test]
fn nothing_is_allocated_from_first_release_to_last_completion() {
    let mut all = [0; 5];
    for seed in 1..=2_000 {
        let mut random = Random::new(seed);
        let set = set::draw(&mut random, set::Overruns::Often);
        let set = set::with_tables(set, &mut random);
        let none = allocated().0;
        let mut run = VirtualTime::new(&set.commit(), set.options);
        let before = allocated().0;
        assert!(before > none, "the counter counts");
        assert_eq!(run.run(&mut Work(&set)), RunOutcome::Finished);
        assert_eq!(allocated().0 - before, 0, "seed {seed}: {set:?}");
        for dag in (0..).map(DagId).take(set.specs.len()) {
            let of = run.scheduler_of(dag).statistics(dag);
            let counts = [of.queued, of.skips, of.aborts, of.faults, of.dropped];
            (all.iter_mut().zip(counts)).for_each(|(sum, count)| *sum += count);
        }
    }
    // The runs were worth counting.
    assert!(all.iter().all(|count| *count > 50), "{all:?}");
}
