//! The suite in virtual time: each scenario event by event.

use std::cell::RefCell;
use std::fs;

use std::time::Duration;

use scenarios::Scenario;
use sched_dag::{DagId, DagStatistics};
use virtual_time::{Report, VirtualTime};

/// Runs a scenario, and returns the faults of the run as `judge` finds them in the report. Returns
/// none for a scenario refused as expected.
fn run(scenario: &Scenario, judge: impl FnOnce(&Report) -> Vec<String>) -> Vec<String> {
    let mut machine = VirtualTime::new()
        .cores(scenario.cores)
        .policy(scenario.policy)
        .preemption(scenario.preemption)
        .contain_panics();
    if !scenario.clusters.is_empty() {
        machine = machine.clusters(&scenario.clusters);
    }
    let answers = |device| machine.answers(device, |after, _job| [(after, ())]);
    if let Some(judged) = scenario.judge_commit(scenario.commit_with(answers)) {
        return judged;
    }
    let report = machine.run();
    let mut wrong = judge(&report);
    wrong.extend(report.violations().iter().map(|it| format!("{it:?}")));
    wrong
}

/// Returns the faults in the run of a scenario of the suite.
fn judge(scenario: &Scenario) -> Vec<String> {
    run(scenario, |report| {
        let mut wrong = scenario.judge_events(&report.event_lines());
        let statistics = |dag: DagId| report.dag(dag).statistics();
        wrong.extend(scenario.judge_counts(report.task_set(), statistics, true));
        wrong
    })
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
fn random_rounds_are_accounted_for_and_no_two_are_the_same() {
    const LENGTH: Duration = Duration::from_millis(200);
    let total: RefCell<DagStatistics> = RefCell::default();
    let mut wrong = String::new();
    for (cores, round) in [1, 2, 4]
        .into_iter()
        .flat_map(|cores| (0..24).map(move |it| (cores, it)))
    {
        let scenario = Scenario::random(1, round, cores, LENGTH);
        let drawn = format!("{scenario:?}");
        let text = |seed, round| format!("{:?}", Scenario::random(seed, round, cores, LENGTH));
        assert_eq!(drawn, text(1, round));
        assert!(drawn != text(1, round + 1) && drawn != text(2, round));
        let judged = run(&scenario, |report| {
            let statistics = |dag: DagId| report.dag(dag).statistics();
            for dag in (0..).map(DagId).take(report.task_set().dags().len()) {
                let (of_dag, mut total) = (statistics(dag), total.borrow_mut());
                total.completed += of_dag.completed;
                total.misses += of_dag.misses;
                total.skips += of_dag.skips;
                total.aborts += of_dag.aborts;
                total.faults += of_dag.faults;
                total.restarts += of_dag.restarts;
            }
            scenario.judge_accounts(report.task_set(), report.record(), statistics)
        });
        for line in judged {
            wrong += &format!("{}: {line}\n", scenario.title);
        }
    }
    assert!(wrong.is_empty(), "{wrong}");
    let total = total.into_inner();
    let most = [total.completed, total.misses, total.skips, total.aborts];
    assert!(most.iter().all(|count| *count > 100), "{total:?}");
    assert!(
        total.restarts > 20 && total.faults - total.restarts > 10,
        "{total:?}"
    );
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
