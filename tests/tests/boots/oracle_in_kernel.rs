//! The kernel against reference schedules: on the bare machine the public cases for up to four
//! cores run exactly as in the reference. Cases without two completions, or a completion and a
//! release, at the same instant run so without a window, too: with each event decided at once, as
//! in apps.

use lab::oracle::in_kernel::{Settings, run};
use lab::oracle::schedules::{Case, check, parse};

const PUBLIC: &str = include_str!("../../oracle/schedules.txt");

const CLUSTERS: &str = include_str!("../../oracle/clusters.txt");

const DISTINCT: &str = include_str!("../../oracle/distinct.txt");

/// Ten milliseconds: idle time is skipped, so a long unit costs nothing.
const UNIT_US: u64 = 10_000;

/// Returns the public cases for which `keep` holds.
fn cases(keep: impl Fn(&Case) -> bool) -> Vec<Case> {
    let mut cases = parse(PUBLIC).expect("the file is well formed");
    cases.retain(keep);
    cases
}

/// Runs cases on the machine, and compares each with its schedule.
#[track_caller]
fn are_reproduced(cases: &[Case], settings: &Settings) {
    let judged = run(cases, settings).expect("QEMU and an image");
    assert_eq!(judged.len(), cases.len());
    let failed: Vec<_> = judged.iter().filter(|case| case.outcome.is_err()).collect();
    assert!(failed.is_empty(), "{failed:#?}");
}

#[test]
fn the_machine_reproduces_the_public_schedules() {
    let cases = cases(|case| case.cores <= 4);
    assert_eq!(cases.len(), 24);
    are_reproduced(&cases, &Settings::for_unit(UNIT_US));
}

#[test]
fn the_machine_reproduces_the_schedules_of_clusters_and_sink_deadlines() {
    let cases = parse(CLUSTERS).expect("the file is well formed");
    assert_eq!(cases.len(), 30);
    are_reproduced(&cases, &Settings::for_unit(UNIT_US));
}

#[test]
fn the_machine_reproduces_schedules_of_functions_that_compute() {
    // Each unit is a million instructions: the short cases will do, and of those with
    // preemptions, one for each number of cores.
    let last = |case: &Case| case.instances.values().map(|times| times.finish_ns).max();
    let has_preemptions = |case: &Case| case.instances.values().any(|times| times.preemptions > 0);
    let cases = cases(|case| {
        let most = if has_preemptions(case) { 600 } else { 200 };
        [1, 2, 4, 8].contains(&case.cores) && last(case).is_some_and(|units| units <= most)
    });
    assert_eq!(cases.len(), 15);
    let preempted = cases.iter().filter(|case| has_preemptions(case));
    let preempted: Vec<u32> = preempted.map(|case| case.cores).collect();
    assert_eq!(preempted, [1, 4, 8, 2]);
    are_reproduced(&cases, &Settings::for_unit(2000).computing());
}

#[test]
fn events_apart_need_no_window() {
    let cases = parse(DISTINCT).expect("the file is well formed");
    assert_eq!(cases.len(), 10);
    for case in &cases {
        assert_eq!(check(case), Ok(()), "{} in virtual time", case.name);
    }
    let settings = Settings {
        window_us: 0,
        ..Settings::for_unit(1000)
    };
    are_reproduced(&cases, &settings);
}
