//! The drone on one core and on several.

use harness::{Guest, Members, Said, lawful_runs};
use sched_dag::journal::EventKind;
use views::record::COUNTED_TOLERANCE_NS;

/// Describes the drone on two cores.
fn drone(words: &str) -> Guest {
    Guest::new("drone").cores(2).word(words)
}

#[test]
fn it_flies_without_a_miss_on_one_core_and_on_four() {
    for cores in [1, 4] {
        let outcome = drone("seconds=3").cores(cores).succeed();
        let line = outcome.line("drone");
        assert!(line.number("waypoints") >= 2, "{}", line.text);
        line.has([("deadline_misses", 0), ("violations", 0)]);
        line.has([("allocations", 0), ("frames_skipped", 0), ("descents", 0)]);
    }
}

#[test]
fn no_wcet_of_it_is_exceeded_on_four_cores() {
    let outcome = drone("seconds=8").cores(4).succeed();
    outcome.line("drone").has([("landed", 1)]);
    assert_eq!(outcome.transcript.of_kind("wcet_exceeded").count(), 0);
}

#[test]
fn a_camera_that_fails_costs_a_frame_within_its_limit_and_beyond_it_the_drone_is_sent_down() {
    for place in ["linux", "machine"] {
        for (survived, costs) in [(0, ["dag"].as_slice()), (1, &["job"]), (1, &["job", "dag"])] {
            let seconds = 2 * costs.len();
            // However long the host lets an instance wait, it is within its budget.
            let own = "budget_factor=0";
            let words = format!("seconds={seconds} fault_at=30 survived={survived} {own}");
            let words = ["--on", place, "--cores", "2", "--append", &words];
            let transcript = harness::run("drone", &words);
            let faults = transcript.of_kind("fault");
            let found: Vec<_> = faults.filter_map(|line| line.text_at("cost")).collect();
            assert_eq!(found, costs, "{words:?}");
            let line = transcript.line("drone");
            let lands = costs.contains(&"dag");
            line.has([("landed", u64::from(lands)), ("violations", 0)]);
            assert_eq!(line.number("descents") >= 5, lands, "{}", line.text);
            if place == "machine" {
                line.has([("attitude_misses", 0)]);
            }
        }
    }
}

#[test]
fn a_reserve_that_is_set_at_boot_sends_it_down_early_in_the_mode_of_the_landing() {
    let outcome = drone("seconds=2 set=reserve=95 events=on").succeed();
    let line = outcome.line("drone");
    line.has([
        ("landed", 1),
        ("deadline_misses", 0),
        ("violations", 0),
        ("allocations", 0),
    ]);
    assert!(line.number("descents") >= 10, "{}", line.text);
    let runs = lawful_runs(&outcome, COUNTED_TOLERANCE_NS);
    let entered = runs[0].events.iter();
    let entered = entered.filter(|event| event.what == EventKind::Entered);
    let modes: Vec<u64> = entered.map(|event| event.job).collect();
    assert_eq!(modes, [0, 1]);
}
