//! Random sets of DAGs under preemption, overload, faults, pauses and stops: all rules hold in
//! each run. `examples/soak.rs` goes on with it for minutes.
//!
//! `LINUX_SETS` says how many sets (12), `LINUX_SEED` which (1).

mod support;

use linux::Mechanism;
use support::sets::{self, Random};
use support::{alone, breaches};

fn number(name: &str, otherwise: u64) -> u64 {
    let text = std::env::var(name).ok();
    text.map_or(otherwise, |text| text.parse().expect("a whole number"))
}

#[test]
fn random_sets_keep_the_rules() {
    let (sets, first) = (number("LINUX_SETS", 12), number("LINUX_SEED", 1));
    for seed in first..first + sets {
        let mut random = Random(seed);
        let (policy, cores) = sets::terms(&mut random);
        let alone = alone(cores, Mechanism::Fifo).with(|machine| machine.policy(policy));
        let (run, _) = sets::run(&alone.machine, &mut random);
        let found = breaches(&run);
        assert!(found.is_empty(), "LINUX_SEED={seed}: {found:?}");
    }
}
