//! The suite of scenarios on the machine, by counts.

use harness::Guest;
use scenarios::Scenario;

#[test]
fn each_scenario_is_as_it_says() {
    let mut ran = 0;
    for cores in 1..=5 {
        let guest = Guest::new("guest-tests").word("test=scenarios");
        let outcome = guest.cores(cores).succeed();
        for line in outcome.transcript.of_kind("scenario") {
            ran += 1;
            let [title, wrong] = ["title", "wrong"].map(|name| line.text_at(name));
            assert_eq!(wrong, Some(""), "{title:?} on {cores} cores");
        }
    }
    let stated = Scenario::suite().expect("scenarios");
    assert_eq!(ran, stated.len(), "each scenario ran");
}
