//! The vehicle with two cameras on one core and on several.

use harness::Guest;

#[test]
fn it_stops_without_a_miss_on_one_two_and_four_cores() {
    for cores in [1, 2, 4] {
        let outcome = Guest::new("vision").cores(cores).succeed();
        let line = outcome.transcript.of_kind("vision").next();
        let line = line.expect("the app's line");
        let number = |name: &str| line.number_at(name).expect(name);
        assert_eq!(number("frames"), 125, "{cores} cores: {}", line.text);
        assert!(number("seen") > 120, "{cores} cores: {}", line.text);
        assert!(
            number("error_permille") < 100,
            "{cores} cores: {}",
            line.text
        );
        let gap_mm = number("gap_mm");
        assert!(
            (2500..3600).contains(&gap_mm),
            "{cores} cores: {}",
            line.text
        );
        for none in ["deadline_misses", "violations", "allocations"] {
            assert_eq!(number(none), 0, "{cores} cores: {}", line.text);
        }
        assert_eq!(outcome.transcript.of_kind("wcet_exceeded").count(), 0);
    }
}
