//! DAGs that are added to a run on the machine, and removed, while others go on.

use harness::Guest;
use tool::Outcome;
use tool::protocol::{MachineLine, Status};

/// How often a DAG is added and removed in the long run.
const CYCLES: u64 = 120;

/// What a removed DAG of four subtasks may leave behind: its model and its statistics.
const MOST_GROWTH_BYTES: u64 = 9 << 10;

fn number(line: &MachineLine, name: &str) -> u64 {
    line.number_at(name)
        .unwrap_or_else(|| panic!("`{name}` in {}", line.text))
}

fn changed(cores: u64, policy: &str) -> Outcome {
    let guest = Guest::new("guest-tests").word("test=adding").cores(cores);
    guest.word(policy).word("trace=dump").succeed()
}

#[test]
fn dags_come_and_go_and_another_goes_on() {
    for (cores, policy) in [(1, "policy=edf"), (4, "policy=static")] {
        let outcome = changed(cores, policy);
        let lines: Vec<_> = outcome.transcript.of_kind("adding").collect();
        let [_, long, careless] = lines[..] else {
            panic!("{} runs\n{}", lines.len(), outcome.tail());
        };
        assert_eq!(number(long, "cycles"), CYCLES, "{}", long.text);
        for line in [long, careless] {
            assert_eq!(number(line, "drives"), number(line, "driven"));
            assert_eq!(number(line, "photos"), number(line, "taken"));
            assert!(number(line, "taken") >= 3 * number(line, "cycles"));
            for zero in ["misses", "violations", "dispatch_violations"] {
                assert_eq!(number(line, zero), 0, "{}", line.text);
            }
        }
        // A fault in an added DAG ends that alone.
        let faults = [long, careless].map(|line| number(line, "faults"));
        assert_eq!(faults, [0, CYCLES / 4 / 3]);

        let mut added = outcome.transcript.of_kind("added");
        let added = added.next().expect("what was left behind");
        assert_eq!(
            added.value.get("leaks").and_then(|it| it.as_bool()),
            Some(false)
        );
        let growth = number(added, "growth_bytes");
        assert!(
            growth <= CYCLES * MOST_GROWTH_BYTES,
            "{growth} bytes in use more"
        );

        let runs = tool::trace::read(&outcome.serial).expect("a trace");
        assert_eq!(runs.len(), 3);
        for run in &runs {
            let findings = tool::trace::check(run, 1_000_000);
            assert_eq!(findings.breaches, [], "{cores} cores");
        }
    }
}

#[test]
fn a_refused_addition_says_why_and_takes_nothing() {
    let outcome = changed(2, "policy=static");
    let refused: Vec<_> = outcome.transcript.of_kind("refused").collect();
    assert!(refused.len() >= 15, "{}", outcome.tail());
    for (what, why) in [
        ("proof", "dag `drive`"),
        ("name", "has one of this name"),
        ("stacks", "more than there is memory for"),
        ("stack", "the first commit has settled"),
        ("fault", "has no subtask;"),
    ] {
        let mut of = refused
            .iter()
            .filter(|line| line.text_at("what") == Some(what));
        assert!(of.clone().count() >= 3, "{what}");
        assert!(
            of.all(|line| {
                let is_same = line.value.get("same").and_then(|it| it.as_bool());
                line.text_at("text").is_some_and(|text| text.contains(why)) && is_same == Some(true)
            }),
            "{what}: {refused:?}"
        );
    }
}

#[test]
fn people_add_and_remove_dags_at_the_console() {
    let (said, offer) = ("console\",\"command\"", "\"kind\":\"offer\"");
    let conversation = [
        ("\"kind\":\"boot\"", "offers"),
        (said, "add nothing"),
        (said, "add photo"),
        (offer, "stats photo"),
        (said, "add photo"),
        (offer, "add heavy"),
        (offer, "remove heavy"),
        (offer, "remove photo"),
        (offer, "remove photo"),
        (offer, "dags"),
        (said, "shutdown"),
    ];
    let guest = Guest::new("guest-tests").word("test=offers").cores(2);
    let outcome = guest.conversation(&conversation).succeed();
    let offers = outcome.transcript.of_kind("offer").map(|line| {
        let done = line.value.get("done").and_then(|it| it.as_bool());
        let text = |name| line.text_at(name).unwrap_or_default().to_string();
        let wish = format!("{} {}", text("wish"), text("dag_name"));
        (wish, done.expect("a truth value"), text("reason"))
    });
    let offers: Vec<_> = offers.collect();
    let done: Vec<_> = offers
        .iter()
        .map(|(wish, done, _)| (&wish[..], *done))
        .collect();
    assert_eq!(
        done,
        [
            ("add photo", true),
            ("add photo", false),
            ("add heavy", false),
            ("remove heavy", false),
            ("remove photo", true),
            ("remove photo", false),
        ],
        "{}",
        outcome.tail()
    );
    assert!(
        offers[1].2.contains("has one of this name"),
        "{}",
        offers[1].2
    );
    assert!(offers[2].2.contains("dag `drive`"), "{}", offers[2].2);
    assert!(offers[3].2.contains("not in the run"), "{}", offers[3].2);
    let unknown = "no dag `nothing` is offered; `offers` lists those that are";
    assert!(outcome.serial.contains(unknown), "{}", outcome.tail());
    let mut statuses = outcome.transcript.of_kind("dag_status");
    assert!(statuses.any(|line| line.text_at("name") == Some("photo")));
}

#[test]
fn where_cores_are_divided_an_addition_is_refused() {
    let guest = Guest::new("guest-tests").word("test=adding_divided");
    let outcome = guest.cores(2).end_in(Status::Failure);
    let expected = "the cores are divided, and a dag is added or removed";
    assert!(outcome.serial.contains(expected), "{}", outcome.tail());
}
