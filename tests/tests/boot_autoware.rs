//! The Autoware reference system on four cores.

use harness::Guest;

#[test]
fn the_hot_path_keeps_its_bounds() {
    for policy in ["static", "edf"] {
        let policy = format!("policy={policy}");
        let guest = Guest::new("autoware")
            .cores(4)
            .word("jobs=40")
            .word(&policy);
        let outcome = guest.succeed();
        let mut lines = outcome.transcript.of_kind("autoware");
        let line = lines.next().expect("the app's line");
        let number = |name: &str| line.number_at(name).expect(name);
        assert_eq!(number("subtasks"), 24);
        assert_eq!((number("violations"), number("deadline_misses")), (0, 0));
        assert_eq!(number("allocations"), 0);
        // Kernel times are not in the bounds, which are not met with so little room.
        for path in ["hot_path", "to_vehicle"] {
            let longest = number(&format!("{path}_ns.max"));
            let bound = number(&format!("{path}_bound_ns"));
            assert!(0 < longest && longest < bound, "{}", line.text);
        }
    }
}
