//! Every delay of an instance is charged: with the kernel's measured overheads, bounds hold next to
//! everything that takes time besides the model (`docs/proving.md`).

use harness::{Guest, Members, Said};
use tool::Outcome;

/// The number of causes of delays provoked by the guest.
const CAUSES: usize = 10;

/// If a bound is exceeded, the guest's own verdict is a failure, too.
#[test]
fn whatever_delays_an_instance_is_charged() {
    for cores in [1, 2, 4] {
        for preemption in ["on", "off"] {
            let guest = Guest::test("delays").cores(cores).memory_mib(64);
            let words = format!("overheads=measured status=1 preemption={preemption}");
            let outcome = guest.word(&words).boot();
            let rows = outcome.lines("delay");
            for row in &rows {
                println!("{cores} cores, preemption {preemption}: {}", row.text);
            }
            assert_eq!(rows.len(), 2 * CAUSES, "{}", outcome.tail());
            for row in rows {
                let (bound_ns, longest_ns) = (row.number("bound_ns"), row.number("longest_ns"));
                assert!(row.number("jobs") > 60, "{}", row.text);
                // No job was as short, so the figures are of this run.
                let least_ns = 19_000;
                // Of the calibration before, whose last event is a fault, nothing is left.
                let is_alone = row.text.contains(r#""none","dag_name":"urgent""#);
                let most_ns = if is_alone { 25_000 } else { bound_ns };
                assert!((least_ns..=most_ns).contains(&longest_ns), "{}", row.text);
                if row.text.contains(r#""sections""#) {
                    row.has([("entered", 305), ("allocations", 0), ("violations", 0)]);
                }
            }
        }
    }
}

/// Boots a test printing the row of one DAG with a bound, and checks the bound.
#[track_caller]
fn keep_the_bound(test: &str, cores: u64, jobs: u64, least_ns: u64) -> Outcome {
    let guest = Guest::test(test).cores(cores).word("overheads=measured");
    let outcome = guest.boot();
    let row = outcome.line("delay");
    println!("{}", row.text);
    row.has([("jobs", jobs)]);
    let (bound_ns, longest_ns) = (row.number("bound_ns"), row.number("longest_ns"));
    assert!((least_ns..=bound_ns).contains(&longest_ns), "{}", row.text);
    outcome
}

#[test]
fn where_core_0_is_never_idle_faults_are_told_later_if_anything_has_a_bound() {
    let outcome = keep_the_bound("starved", 1, 900, 800_000);
    assert!(!outcome.lines("fault").is_empty(), "{}", outcome.tail());
}

#[test]
fn an_event_costs_nobody_who_does_not_wait_for_it() {
    keep_the_bound("events", 2, 65, 19_000);
}
