//! The drone on one core and on several.

use harness::Guest;
use sched_dag::journal::What;

#[test]
fn it_flies_without_a_miss_on_one_two_and_four_cores() {
    for cores in [1, 2, 4] {
        let guest = Guest::new("drone").cores(cores).word("seconds=3");
        let outcome = guest.succeed();
        let line = outcome.transcript.of_kind("drone").next();
        let line = line.expect("the app's line");
        let number = |name: &str| line.number_at(name).expect(name);
        assert!(number("waypoints") >= 2, "{cores} cores: {}", line.text);
        for none in [
            "deadline_misses",
            "frames_skipped",
            "descents",
            "violations",
            "allocations",
        ] {
            assert_eq!(number(none), 0, "{cores} cores: {}", line.text);
        }
    }
}

#[test]
fn a_camera_that_is_too_slow_skips_frames_and_the_control_loop_keeps_its_deadlines() {
    let guest = Guest::new("drone").cores(2);
    let outcome = guest.word("seconds=2").word("delay_us=40000").succeed();
    let line = outcome.transcript.of_kind("drone").next();
    let line = line.expect("the app's line");
    let number = |name: &str| line.number_at(name).expect(name);
    assert!(number("frames_skipped") >= 20, "{}", line.text);
    assert_eq!(number("attitude_misses"), 0, "{}", line.text);
}

#[test]
fn a_camera_that_fails_costs_a_frame_within_its_limit_and_beyond_it_the_drone_is_sent_down() {
    for place in ["linux", "machine"] {
        for (survived, costs) in [(0, ["dag"].as_slice()), (1, &["job"]), (1, &["job", "dag"])] {
            let seconds = 2 * costs.len();
            let words = format!("seconds={seconds} fault_at=30 survived={survived}");
            let transcript = harness::run(
                "drone",
                &["--on", place, "--cores", "2", "--append", &words],
            );
            let faults = transcript.of_kind("fault");
            let found: Vec<_> = faults.filter_map(|line| line.text_at("cost")).collect();
            assert_eq!(found, costs, "{place}: {words}");
            let line = transcript.of_kind("drone").next();
            let line = line.expect("the app's line");
            let number = |name: &str| line.number_at(name).expect(name);
            let lands = costs.contains(&"dag");
            assert_eq!(number("landed"), u64::from(lands), "{place}: {}", line.text);
            assert_eq!(number("descents") >= 5, lands, "{place}: {}", line.text);
            assert_eq!(number("violations"), 0, "{place}: {}", line.text);
            if place == "machine" {
                assert_eq!(number("attitude_misses"), 0, "{}", line.text);
            }
        }
    }
}

#[test]
fn a_reserve_that_is_set_at_boot_sends_it_down_early_in_the_mode_of_the_landing() {
    let guest = Guest::new("drone").cores(2).word("trace=dump");
    let outcome = guest.word("seconds=2").word("set=reserve=95").succeed();
    let line = outcome.transcript.of_kind("drone").next();
    let line = line.expect("the app's line");
    let number = |name: &str| line.number_at(name).expect(name);
    assert_eq!(number("landed"), 1, "{}", line.text);
    assert!(number("descents") >= 10, "{}", line.text);
    for none in ["deadline_misses", "violations", "allocations"] {
        assert_eq!(number(none), 0, "{}", line.text);
    }
    let runs = tool::trace::read(&outcome.serial).expect("a trace");
    let modes: Vec<u64> = (runs[0].events.iter())
        .filter(|event| event.what == What::Entered)
        .map(|event| event.job)
        .collect();
    assert_eq!(modes, [0, 1]);
}

#[test]
fn a_reserve_that_is_set_on_linux_sends_it_down_early() {
    let words = "seconds=2 set=reserve=95";
    let transcript = harness::run("drone", &["--on", "linux", "--append", words]);
    let line = transcript.of_kind("drone").next();
    let line = line.expect("the app's line");
    let number = |name: &str| line.number_at(name).expect(name);
    assert_eq!(number("landed"), 1, "{}", line.text);
    assert_eq!(number("violations"), 0, "{}", line.text);
}
