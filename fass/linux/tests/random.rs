//! Random sets of DAGs under preemption, overload and faults: R1 to R4 hold in each run.
//!
//! `LINUX_SETS` says how many sets (12), `LINUX_SEED` which (1).

mod support;

use fass::{
    ConstructionPolicy, OverrunPolicy, Policy, SubtaskAttributes, create_dag,
    finish_create_dags_with,
};
use linux::Mechanism;
use support::{alone, ms, spin};

/// SplitMix64 (doi 10.1145/2660193.2660195).
struct Random(u64);

impl Random {
    fn below(&mut self, limit: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut mixed = self.0;
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (mixed ^ (mixed >> 31)) % limit
    }
}

fn number(name: &str, otherwise: u64) -> u64 {
    let text = std::env::var(name).ok();
    text.map_or(otherwise, |text| text.parse().expect("a whole number"))
}

#[test]
fn random_sets_keep_the_rules() {
    let (sets, first) = (number("LINUX_SETS", 12), number("LINUX_SEED", 1));
    for seed in first..first + sets {
        let mut random = Random(seed);
        let policy = [Policy::StaticPriority, Policy::Edf][usize::from(random.below(2) == 1)];
        let cores = 1 + u32::from(random.below(2) == 1);
        let alone = alone(cores, Mechanism::Fifo).with(|machine| machine.policy(policy));
        let dags: Vec<_> = (0..1 + random.below(4))
            .map(|number| {
                let dag = create_dag();
                let period = ms(2 + random.below(9));
                dag.name(&format!("dag {number}"))
                    .jobs(5 + random.below(20));
                dag.period(period).relative_deadline(period);
                dag.in_flight(1 + u32::try_from(random.below(3)).unwrap_or(0));
                let overruns = [
                    OverrunPolicy::Queue,
                    OverrunPolicy::Skip,
                    OverrunPolicy::Abort,
                ];
                dag.overrun(overruns[usize::try_from(random.below(3)).unwrap_or(0)]);
                let faulty = (random.below(8) == 0).then(|| random.below(10));
                let subtasks: Vec<_> = (0..1 + random.below(6))
                    .map(|subtask| {
                        let us = random.below(1_500);
                        let priority = u32::try_from(random.below(10)).unwrap_or(0);
                        let mut attributes =
                            SubtaskAttributes::named(&format!("subtask {subtask}"))
                                .priority(priority);
                        if random.below(5) == 0 {
                            attributes = attributes.non_preemptive();
                        }
                        let function = move |job| {
                            spin(us);
                            assert!(subtask > 0 || faulty != Some(job), "meant");
                        };
                        dag.register_untyped_subtask(function, attributes)
                    })
                    .collect();
                for (place, later) in subtasks.iter().enumerate().skip(1) {
                    let earlier = usize::try_from(random.below(place as u64)).unwrap_or(0);
                    dag.precede(&subtasks[earlier], later);
                }
                dag
            })
            .collect();
        finish_create_dags_with(&dags, ConstructionPolicy::any_graph()).unwrap();
        let run = alone.machine.run().unwrap();
        let found: Vec<_> = run.violations().collect();
        assert!(found.is_empty(), "LINUX_SEED={seed}: {found:?}");
        let found = run.dispatch_violations(u64::MAX).expect("all is recorded");
        assert!(found.is_empty(), "LINUX_SEED={seed}: {found:?}");
    }
}
