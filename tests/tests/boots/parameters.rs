//! Parameters on the machine: set by a word at boot, and by a person during the run.

use harness::{Guest, Members, Said};

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
        (said, "pause nothing"),
        (said, "stats +1"),
        (said, "shutdown"),
    ];
    let guest = Guest::test("endless").word("set=steps=4").cores(2);
    for guest in [guest.clone(), guest.word("clusters=1,1")] {
        let outcome = guest.conversation(&conversation).succeed();
        // What jobs have found, each value once.
        let found = outcome.lines("tuned").into_iter();
        let found = found.map(|line| (line.member("gain"), line.number("steps")));
        let expected = [("0.5", 4), ("1.25", 4), ("1.25", 9)];
        assert_eq!(found.collect::<Vec<_>>(), expected, "{}", outcome.tail());
        for line in [
            "  gain = 0.5 (f64 from 0 to 2, at first 0.5)",
            "  steps = 4 (u32 from 1 to 9, at first 3)",
            "`steps=10`: parameter `steps` takes u32 from 1 to 9",
            "there is no parameter `gian`; did you mean `gain`?",
            "`set` wants a name and a value; `params` lists them",
            "  set NAME VALUE set a parameter, for the jobs to come",
            "there is no dag `nothing`; `dags` lists them",
        ] {
            let mut lines = outcome.serial.lines();
            let is_said = lines.any(|found| found == line);
            assert!(is_said, "{line}\n{}", outcome.serial);
        }
        for part in [
            "`hlep` is no command; there are help, dags, stats [DAG]",
            "shutdown, params, set NAME VALUE",
        ] {
            assert!(outcome.serial.contains(part), "{}", outcome.serial);
        }
        let answers = outcome.lines("console").into_iter();
        let accepted = answers.map(|line| line.text.contains("\"accepted\":true"));
        let expected = [(true, 3), (false, 3), (true, 1), (false, 3), (true, 1)];
        let expected = expected.map(|(accepted, count)| vec![accepted; count]);
        assert_eq!(accepted.collect::<Vec<_>>(), expected.concat());
    }
}

#[test]
fn a_bad_word_is_refused_in_one_line_with_type_and_range() {
    let tuned = || Guest::test("endless");
    for (guest, word, why) in [
        (
            tuned(),
            "gain=2.5",
            "`gain=2.5`: parameter `gain` takes f64 from 0 to 2",
        ),
        (
            tuned(),
            "gain=1,steps=x",
            "`steps=x`: parameter `steps` takes u32 from 1 to 9",
        ),
        (
            tuned(),
            "stesp=1",
            "there is no parameter `stesp`; did you mean `steps`?",
        ),
        (tuned(), "gain", "`set=gain`: give it as NAME=VALUE"),
        // An app without parameters knows no such word.
        (Guest::new("fork-join"), "gain=1", "`set` is no option"),
    ] {
        let said = guest.word(&format!("set={word}")).refusal();
        assert!(said.contains(why), "{why}\n{said}");
    }
}
