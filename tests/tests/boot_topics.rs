//! Topics at the console of the machine: values as they are completed, and how often.

use std::fs;

use harness::Guest;
use recording::Recording;
use tool::protocol::MachineLine;
use tool::{Outcome, recordings, system};

#[test]
fn values_are_echoed_and_what_is_left_out_is_counted() {
    let said = "console\",\"command\"";
    let echoed = "\"kind\":\"echo\"";
    let conversation = [
        ("\"kind\":\"tuned\"", "echo gain"),
        (echoed, "set gain 1.5"),
        ("\"value\":\"1.5\"", "echo off"),
        ("\"command\":\"echo off\"", "hz steps"),
        (said, "hz gain"),
        (said, "echo steps"),
        (said, "echo gian"),
        (said, "hz velocity"),
        (said, "echo"),
        (said, "shutdown"),
    ];
    let guest = Guest::new("guest-tests").word("test=tuned").cores(2);
    let divided = guest.clone().word("clusters=1,1");
    for guest in [guest, divided] {
        is_echoed(&guest.conversation(&conversation).succeed());
    }
}

fn is_echoed(outcome: &Outcome) {
    let echoed = "\"kind\":\"echo\"";
    let lines = |kind: &'static str| outcome.transcript.of_kind(kind).collect::<Vec<_>>();
    let number = |line: &MachineLine, name| line.number_at(name).expect(name);

    let echoes = lines("echo");
    assert!(echoes.len() >= 2, "{}", outcome.serial);
    assert_eq!(echoes[0].text_at("value"), Some("0.5"));
    assert_eq!(
        echoes.last().expect("there are some").text_at("value"),
        Some("1.5")
    );
    for pair in echoes.windows(2) {
        // None is lost but those that are counted.
        let between = number(pair[1], "left_out") + 1;
        assert_eq!(number(pair[1], "job") - number(pair[0], "job"), between);
    }
    for line in lines("hz") {
        let of = |name| number(line, name);
        assert!(
            of("values") > 2 && of("least_ns") <= of("mean_ns"),
            "{}",
            line.text
        );
        assert!(of("mean_ns") <= of("most_ns"), "{}", line.text);
    }
    assert_eq!(lines("hz").len(), 2);
    for line in [
        "topic `steps` is not recorded; let the app name it by `Dag::record`",
        "there is no topic `gian`; did you mean `gain`?",
        "there is no topic `velocity`; there are `both` `gain` `steps`",
        "`echo` wants the name of a topic, or `off`",
    ] {
        let mut found = outcome.serial.lines();
        assert!(
            found.any(|found| found == line),
            "{line}\n{}",
            outcome.serial
        );
    }
    let quiet = outcome.serial.split("\"command\":\"echo off\"").nth(1);
    assert!(
        quiet.is_some_and(|rest| !rest.contains(echoed)),
        "{}",
        outcome.serial
    );
}

#[test]
fn what_is_echoed_while_a_run_is_recorded_is_in_the_recording() {
    let log = system::new_log("echoed").expect("a folder for logs");
    let file = log.with_extension("rec");
    let conversation = [
        ("\"kind\":\"tuned\"", "echo gain"),
        ("\"kind\":\"echo\"", "set gain 1.5"),
        ("\"kind\":\"echo\",\"topic\":\"gain\"", "echo off"),
        ("\"command\":\"echo off\"", "shutdown"),
    ];
    let guest = Guest::new("guest-tests").word("test=tuned").cores(2);
    let outcome = guest.records(&file, 64).conversation(&conversation);
    let outcome = outcome.succeed();
    let bytes = recordings::received(&file).expect("the guest has sent it");
    let _ = fs::remove_file(&file);

    let recording = Recording::read(&bytes).expect("it is whole");
    assert_eq!(recording.lost(), 0);
    let values = recording.values::<f64>("loop", "gain").expect("there are");
    let values = values.collect::<Vec<_>>();
    assert!((0..).zip(&values).all(|(job, value)| job == value.0));
    let echoes = outcome.transcript.of_kind("echo").collect::<Vec<_>>();
    assert!(echoes.len() >= 2, "{}", outcome.serial);
    for echo in echoes {
        let job = echo.number_at("job").expect("a job");
        let recorded = values.iter().find(|(of, _)| *of == job);
        let recorded = recorded.map(|(_, value)| value.to_string());
        assert_eq!(recorded.as_deref(), echo.text_at("value"));
    }
}
