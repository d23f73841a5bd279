//! Topics at the console of the machine: values as they are completed, and how often.

use harness::file::File;
use harness::{Guest, Members, Said};
use recording::Recording;
use tool::{Outcome, recordings};

#[test]
fn values_are_echoed_and_what_is_left_out_is_counted() {
    let said = "console\",\"command\"";
    let conversation = [
        ("\"kind\":\"tuned\"", "echo gain"),
        ("\"kind\":\"echo\"", "set gain 1.5"),
        ("\"value\":\"1.5\"", "echo off"),
        ("\"command\":\"echo off\"", "hz steps"),
        (said, "hz gain"),
        (said, "echo steps"),
        (said, "echo gian"),
        (said, "hz velocity"),
        (said, "echo"),
        (said, "shutdown"),
    ];
    let guest = Guest::test("endless").cores(2);
    let divided = guest.clone().word("clusters=1,1");
    for guest in [guest, divided] {
        is_echoed(&guest.conversation(&conversation).succeed());
    }
}

fn is_echoed(outcome: &Outcome) {
    let echoes = outcome.lines("echo");
    let values: Vec<&str> = echoes.iter().map(|line| line.member("value")).collect();
    let ends = (values.first(), values.last());
    assert_eq!(ends, (Some(&"0.5"), Some(&"1.5")), "{}", outcome.serial);
    for pair in echoes.windows(2) {
        // None is lost but those that are counted.
        let between = pair[1].number("left_out") + 1;
        assert_eq!(pair[1].number("job") - pair[0].number("job"), between);
    }
    let rates = outcome.lines("hz");
    assert_eq!(rates.len(), 2);
    for line in rates {
        let times = ["least_ns", "mean_ns", "most_ns"].map(|name| line.number(name));
        assert!(line.number("values") > 2, "{}", line.text);
        assert!(times.is_sorted(), "{}", line.text);
    }
    for line in [
        "topic `steps` is not recorded; let the app name it by `Dag::record`",
        "there is no topic `gian`; did you mean `gain`?",
        "there is no topic `velocity`; there are `l` `l-a` `l-b` `both` `gain` `steps`",
        "`echo` wants the name of a topic, or `off`",
    ] {
        let mut found = outcome.serial.lines();
        let is_said = found.any(|found| found == line);
        assert!(is_said, "{line}\n{}", outcome.serial);
    }
    let quiet = outcome.serial.split("\"command\":\"echo off\"").nth(1);
    let is_quiet = quiet.is_some_and(|rest| !rest.contains("\"kind\":\"echo\""));
    assert!(is_quiet, "{}", outcome.serial);
}

#[test]
fn what_is_echoed_while_a_run_is_recorded_is_in_the_recording() {
    let file = File::new("echoed", "rec");
    let conversation = [
        ("\"kind\":\"tuned\"", "echo gain"),
        ("\"kind\":\"echo\"", "set gain 1.5"),
        ("\"kind\":\"echo\",\"topic\":\"gain\"", "echo off"),
        ("\"command\":\"echo off\"", "shutdown"),
    ];
    let guest = Guest::test("endless").cores(2).records(&file.0, 64);
    let outcome = guest.conversation(&conversation).succeed();
    let bytes = recordings::received(&file.0).expect("the guest has sent it");

    let recording = Recording::read(&bytes).expect("it is whole");
    assert_eq!(recording.lost(), 0);
    let values = recording.values::<f64>("loop", "gain").expect("there are");
    let values = values.collect::<Vec<_>>();
    assert!((0..).zip(&values).all(|(job, value)| job == value.0));
    let echoes = outcome.lines("echo");
    assert!(echoes.len() >= 2, "{}", outcome.serial);
    for echo in echoes {
        let recorded = values.iter().find(|(of, _)| *of == echo.number("job"));
        let recorded = recorded.map(|(_, value)| value.to_string());
        assert_eq!(recorded.as_deref(), Some(echo.member("value")));
    }
}
