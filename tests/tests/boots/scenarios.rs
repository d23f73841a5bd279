//! The suite of scenarios on the machine, and by mechanisms found only on a guest's Linux: by
//! counts.

use std::collections::BTreeSet;

use harness::{Guest, lawful_runs};
use scenarios::Scenario;
use tool::image;
use views::protocol::Transcript;
use views::record::COUNTED_TOLERANCE_NS;

/// Runs the scenarios for 1 to 5 cores: there are no others.
fn run(mut run: impl FnMut(u64) -> Transcript) {
    let mut ran = BTreeSet::new();
    for cores in 1..=5 {
        for line in run(cores).of_kind("scenario") {
            let [title, wrong] = ["title", "wrong"].map(|name| line.text_at(name));
            assert_eq!(wrong, Some(""), "{title:?} on {cores} cores");
            ran.extend(title.map(str::to_owned));
        }
    }
    let stated = Scenario::suite().expect("scenarios");
    let stated: BTreeSet<_> = stated.into_iter().map(|scenario| scenario.title).collect();
    assert_eq!(ran, stated);
}

/// By their traces, too, no instance waits for longer than the cores' time slices.
#[test]
fn each_scenario_is_as_it_says() {
    run(|cores| {
        let guest = Guest::test("scenarios").word("events=on").cores(cores);
        let outcome = guest.succeed();
        let runs = lawful_runs(&outcome, COUNTED_TOLERANCE_NS);
        assert!(runs.iter().all(|run| run.complete && run.lost == 0));
        outcome.transcript
    });
}

#[test]
fn each_scenario_is_as_it_says_where_cores_run_side_by_side() {
    for idle in ["idle=halt", "idle=poll"] {
        run(|cores| {
            let guest = Guest::test("scenarios").word(idle);
            guest.in_real_time().cores(cores).succeed().transcript
        });
    }
}

#[test]
#[ignore = "fetches 145 MB of Debian's; `cargo test -p harness --test boots -- --ignored` runs it"]
fn on_debians_linux_each_scenario_is_as_it_says_by_both_mechanisms() {
    let program = image::build_linux("guest-tests", None).expect("it is built");
    let program = program.to_string_lossy();
    for mechanism in ["fifo", "sched_ext"] {
        run(|cores| {
            let cores = cores.to_string();
            let words = [
                "--on",
                "debian",
                "--mechanism",
                mechanism,
                "--cores",
                &cores,
            ];
            harness::run(
                "guest-tests",
                &[&words[..], &["--image", &program]].concat(),
            )
        });
    }
}
