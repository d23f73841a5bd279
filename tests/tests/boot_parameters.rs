//! Parameters on the machine: set by a word at boot, and by a person while it runs.

use harness::Guest;
use tool::Outcome;
use tool::protocol::Status;

fn tuned() -> Guest {
    Guest::new("guest-tests").word("test=tuned")
}

/// What jobs have found, each value once.
fn found(outcome: &Outcome) -> Vec<(String, u64)> {
    let lines = outcome.transcript.of_kind("tuned");
    let found = lines
        .filter_map(|line| Some((line.text_at("gain")?.to_string(), line.number_at("steps")?)));
    found.collect()
}

#[test]
fn a_person_sets_what_the_next_jobs_find() {
    let said = "console\",\"command\"";
    let conversation = [
        ("\"kind\":\"tuned\"", "params"),
        (said, "set gain 1.25"),
        ("\"gain\":\"1.25\"", "set steps=9"),
        ("\"steps\":9", "set steps 10"),
        (said, "set gian 1"),
        (said, "set gain"),
        (said, "help"),
        (said, "hlep"),
        (said, "shutdown"),
    ];
    let guest = tuned().word("set=steps=4").cores(2);
    for guest in [guest.clone(), guest.word("clusters=1,1")] {
        let outcome = guest.conversation(&conversation).succeed();
        let found = found(&outcome);
        let expected = [("0.5", 4), ("1.25", 4), ("1.25", 9)];
        let expected = expected.map(|(gain, steps)| (gain.to_string(), steps));
        assert_eq!(found, expected, "{}", outcome.tail());
        for line in [
            "  gain = 0.5 (f64 from 0 to 2, at first 0.5)",
            "  steps = 4 (u32 from 1 to 9, at first 3)",
            "`steps=10`: parameter `steps` takes u32 from 1 to 9",
            "there is no parameter `gian`; did you mean `gain`?",
            "`set` wants a name and a value; `params` lists them",
            "  set NAME VALUE set a parameter, for the jobs to come",
        ] {
            let mut lines = outcome.serial.lines();
            assert!(
                lines.any(|found| found == line),
                "{line}\n{}",
                outcome.serial
            );
        }
        assert!(outcome.serial.contains("shutdown, params, set NAME VALUE"));
        let lines = outcome.transcript.of_kind("console");
        let accepted = lines.map(|line| line.value.get("accepted").and_then(|it| it.as_bool()));
        let accepted: Vec<bool> = accepted.map(|it| it.expect("a truth value")).collect();
        let expected = [true, true, true, false, false, false, true, false, true];
        assert_eq!(accepted, expected);
    }
}

#[test]
fn a_bad_word_is_refused_in_one_line_with_type_and_range() {
    for (word, why) in [
        (
            "set=gain=2.5",
            "`gain=2.5`: parameter `gain` takes f64 from 0 to 2",
        ),
        (
            "set=gain=1,steps=x",
            "`steps=x`: parameter `steps` takes u32 from 1 to 9",
        ),
        (
            "set=stesp=1",
            "there is no parameter `stesp`; did you mean `steps`?",
        ),
        ("set=gain", "`set=gain`: give it as NAME=VALUE"),
    ] {
        let outcome = tuned().word(word).end_in(Status::Usage);
        assert!(outcome.serial.contains(why), "{why}\n{}", outcome.serial);
    }
    // An app without parameters knows no such word.
    let outcome = Guest::new("guest-tests")
        .word("test=endless")
        .word("set=gain=1");
    let outcome = outcome.end_in(Status::Usage);
    assert!(
        outcome.serial.contains("`set` is no option"),
        "{}",
        outcome.serial
    );
}
