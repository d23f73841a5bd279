//! The suite of scenarios on the machine: the scenarios for the machine's number of cores.

use alloc::string::String;
use alloc::vec::Vec;

use kernel::{AppError, Machine, Run, json};
use scenarios::Scenario;

/// Runs the scenarios, and prints the faults of each.
pub(crate) fn run(machine: &Machine) -> Result<(), AppError> {
    machine.options().finish(&["test"])?;
    let all = Scenario::suite().map_err(AppError::Failure)?.into_iter();
    for scenario in all.filter(|scenario| scenario.cores == machine.cores()) {
        let wrong = judged(machine, &scenario, |run| scenario.judge_run(run))?;
        print(&scenario, &wrong);
    }
    Ok(())
}

/// Runs a scenario, unless its commit is refused, and returns its faults.
pub(crate) fn judged(
    machine: &Machine,
    scenario: &Scenario,
    judge: impl FnOnce(&Run) -> Vec<String>,
) -> Result<Vec<String>, AppError> {
    machine.accept_faults();
    machine.accept_exceeded_bounds();
    machine.configure(scenario.policy, scenario.preemption);
    machine.divide(&scenario.clusters);
    let wrong = match scenario.judge_commit(scenario.commit()) {
        Some(judged) => judged,
        None => judge(&machine.run()?),
    };
    machine.divide(&[]); // its list of clusters is not to count as in use
    Ok(wrong)
}

pub(crate) fn print(scenario: &Scenario, wrong: &[String]) {
    json::emit("scenario", |line| {
        line.text("title", &scenario.title)
            .text("wrong", wrong.join("; "));
    });
}
