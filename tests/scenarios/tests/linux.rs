//! The suite on Linux by each mechanism available on every computer: counts, R1 to R4, and
//! allocations.

#[path = "../../../sched-dag/tests/it/counting.rs"]
mod counting;

use linux::{Linux, Mechanism};
use scenarios::Scenario;

fn judge(scenario: &Scenario, mechanism: Mechanism) -> Vec<String> {
    let machine = Linux::sharing(scenario.cores, mechanism).expect("a machine");
    let machine = machine.allocations(|| counting::allocated().2);
    machine.change(|terms| {
        terms.scheduler.policy = scenario.policy;
        terms.scheduler.preemption = scenario.preemption;
        terms.divide(&scenario.clusters);
    });
    let judged = scenario.judge_commit(scenario.commit());
    judged.unwrap_or_else(|| scenario.judge_run(&machine.run().expect("it is committed")))
}

#[test]
fn each_scenario_is_as_it_says() {
    let mut wrong = String::new();
    counting::COUNTED.get_or_init(|| linux::is_of_run);
    for scenario in Scenario::suite().expect("scenarios") {
        for mechanism in [Mechanism::Fifo, Mechanism::Normal, Mechanism::Poll] {
            for line in judge(&scenario, mechanism) {
                wrong += &format!("{}: {mechanism:?}: {line}\n", scenario.title);
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong}");
}
