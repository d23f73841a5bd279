//! The suite in virtual time: each scenario event by event.

use std::fs;

use scenarios::Scenario;
use virtual_time::VirtualTime;

/// Runs a scenario, and returns what is wrong.
fn judge(scenario: &Scenario) -> Vec<String> {
    let mut machine = VirtualTime::new()
        .cores(scenario.cores)
        .policy(scenario.policy)
        .preemption(scenario.preemption)
        .contain_panics();
    if !scenario.clusters.is_empty() {
        machine = machine.clusters(&scenario.clusters);
    }
    if let Some(judged) = scenario.judge_commit(scenario.commit()) {
        return judged;
    }
    let report = machine.run();
    let mut wrong = scenario.judge_events(&report.event_lines());
    let statistics = |dag: sched_dag::DagId| report.dag(dag).statistics();
    wrong.extend(scenario.judge_counts(report.task_set(), statistics, true));
    wrong.extend(report.violations().iter().map(|it| format!("{it:?}")));
    wrong
}

#[test]
fn each_scenario_is_as_it_says() {
    let mut wrong = String::new();
    for scenario in Scenario::suite().expect("scenarios") {
        for line in judge(&scenario) {
            wrong += &format!("{}: {line}\n", scenario.title);
        }
    }
    assert!(wrong.is_empty(), "{wrong}");
}

#[test]
fn each_text_is_in_the_suite() {
    let files = fs::read_dir(env!("CARGO_MANIFEST_DIR")).expect("the folder");
    let names = files.map(|file| file.expect("a file").file_name().into_string());
    let names = names.map(|name| name.expect("ASCII"));
    let names = names.filter_map(|name| name.strip_suffix(".txt").map(str::to_owned));
    let mut names: Vec<String> = names.collect();
    names.sort();
    let stated: Vec<&str> = scenarios::SUITE.iter().map(|(name, _)| *name).collect();
    assert_eq!(names, stated);
}
