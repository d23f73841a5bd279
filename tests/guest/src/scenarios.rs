//! The suite of scenarios on the machine: those for as many cores as it has.

use kernel::{Ending, Machine, json};
use scenarios::Scenario;

/// Runs the scenarios, and prints of each what is wrong.
pub(crate) fn run(machine: &Machine) -> Result<(), Ending> {
    machine.options().finish(&["test"])?;
    machine.accept_faults();
    machine.accept_exceeded_bounds();
    let all = Scenario::suite().map_err(Ending::Failure)?.into_iter();
    for scenario in all.filter(|scenario| scenario.cores == machine.cores()) {
        machine.configure(scenario.policy, scenario.preemption);
        machine.divide(&scenario.clusters);
        let wrong = match scenario.judge_commit(scenario.commit()) {
            Some(judged) => judged,
            None => scenario.judge_run(&machine.run()?),
        };
        json::emit("scenario", |line| {
            line.text("title", &scenario.title)
                .text("wrong", wrong.join("; "));
        });
    }
    Ok(())
}
