//! The Autoware reference system on four cores.

use harness::{Guest, Members, Said};

#[test]
fn the_hot_path_keeps_its_bounds() {
    for policy in ["policy=static", "policy=edf"] {
        let guest = Guest::new("autoware").cores(4).word("jobs=40");
        let outcome = guest.word(policy).succeed();
        let line = outcome.line("autoware");
        line.has([("subtasks", 24), ("allocations", 0)]);
        line.has([("violations", 0), ("deadline_misses", 0)]);
        // Kernel times are not in the bounds, which are not met with so little room.
        for path in ["hot_path", "to_vehicle"] {
            let longest = line.number(&format!("{path}_ns.max"));
            let bound = line.number(&format!("{path}_bound_ns"));
            assert!(0 < longest && longest < bound, "{}", line.text);
        }
    }
}
