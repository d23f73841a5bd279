//! The recorded walk on the machine: the same bits as on the host.

mod support;

use fass::Policy;
use harness::Guest;
use support::{File, walk};

#[test]
fn the_machine_computes_the_bits_of_the_host() {
    let file = File::new();
    let wanted = walk(&file.read(), 1, Policy::Edf).digest();
    let outcome = Guest::new("gait").cores(2).module(&file.0).succeed();
    let line = outcome.transcript.of_kind("gait").next();
    let line = line.expect("the app's line");
    let number = |name: &str| line.number_at(name).expect(name);
    assert_eq!(number("digest"), wanted, "{}", line.text);
    assert_eq!(number("jobs"), 3_511, "{}", line.text);
    for none in ["deadline_misses", "violations", "allocations"] {
        assert_eq!(number(none), 0, "{}", line.text);
    }
    let angles = outcome.transcript.of_kind("gait_knee");
    let angles = angles.map(|line| {
        line.value
            .get("angles_udeg")
            .map_or(0, |list| list.elements().len())
    });
    assert_eq!(angles.sum::<usize>(), 3_511);
}
