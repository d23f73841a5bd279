//! A person at the console: a conversation with a guest that runs until it is told
//! to end.

use harness::protocol::MachineLine;
use harness::{Guest, Mode, Outcome};

/// Waits until virtual time has gone on by asking again and again.
const PAUSE: [(&str, &str); 3] = [("console\",\"command\"", "help"); 3];

fn endless() -> Guest {
    Guest::new("guest-tests").word("test=endless").cores(2)
}

/// The lines of kind `dag_status` of a DAG, in their order.
fn statuses<'o>(outcome: &'o Outcome, name: &str) -> Vec<&'o MachineLine> {
    let lines = outcome.transcript.of_kind("dag_status");
    lines
        .filter(|line| line.text_at("name") == Some(name))
        .collect()
}

fn answers(outcome: &Outcome) -> Vec<(String, bool)> {
    let lines = outcome.transcript.of_kind("console");
    let answer = |line: &MachineLine| {
        let accepted = line.value.get("accepted").and_then(|it| it.as_bool());
        let command = line.text_at("command").unwrap_or_default();
        (command.to_string(), accepted.expect("a truth value"))
    };
    lines.map(answer).collect()
}

#[test]
fn a_dag_is_stopped_started_and_the_machine_shut_down() {
    let said = "console\",\"command\"";
    let mut conversation = vec![("\"kind\":\"boot\"", "help"), (said, "dags")];
    conversation.push((said, "stop left"));
    conversation.extend(PAUSE);
    conversation.push((said, "stats"));
    conversation.extend(PAUSE);
    conversation.extend([(said, "stats"), (said, "start 0")]);
    conversation.extend(PAUSE);
    conversation.extend([(said, "stats left"), (said, "shutdown")]);
    let outcome = endless().conversation(&conversation).succeed();

    let left = statuses(&outcome, "left");
    let [listed, first, second, third, last] = left[..] else {
        panic!("{} lines of `left`\n{}", left.len(), outcome.tail());
    };
    let count = |line: &MachineLine, name| line.number_at(name).expect("a count");
    let state = |line: &MachineLine| line.text_at("state").map(String::from);
    assert_eq!(state(listed).as_deref(), Some("running"));
    for stopped in [first, second] {
        assert_eq!(state(stopped).as_deref(), Some("stopped"));
        assert_eq!(count(stopped, "in_flight"), 0, "{}", stopped.text);
    }
    assert_eq!(count(first, "released"), count(second, "released"));
    assert!(count(first, "skips") < count(second, "skips"));
    assert_eq!(state(third).as_deref(), Some("running"));
    assert!(count(second, "released") < count(third, "released"));
    assert_eq!(count(last, "in_flight"), 0);
    assert_eq!(count(last, "released"), count(last, "completed"));

    // The other one goes on all the time.
    let right = statuses(&outcome, "right");
    let skips: Vec<u64> = right.iter().map(|line| count(line, "skips")).collect();
    assert_eq!(skips[..3], [0, 0, 0], "{}", outcome.tail());
    assert!(count(right[1], "released") < count(right[2], "released"));
    assert!(answers(&outcome).iter().all(|(_, accepted)| *accepted));
}

#[test]
fn what_is_no_command_is_answered_by_the_list_of_commands() {
    let said = "console\",\"command\"";
    let conversation = [
        ("\"kind\":\"boot\"", "hlep"),
        (said, "stop nothing"),
        (said, "trace"),
        (said, "stats 1"),
        (said, "shutdown"),
    ];
    let outcome = endless().conversation(&conversation).succeed();
    let expected = [
        ("hlep", false),
        ("stop nothing", false),
        ("trace", false),
        ("stats 1", true),
        ("shutdown", true),
    ];
    let expected = expected.map(|(command, accepted)| (command.to_string(), accepted));
    assert_eq!(answers(&outcome), expected);
    assert!(
        outcome
            .serial
            .contains("`hlep` is no command; there are help, dags, stats [DAG]")
    );
    assert!(
        outcome
            .serial
            .contains("there is no dag `nothing`; `dags` lists them")
    );
}

#[test]
fn a_trace_that_was_off_for_a_while_holds_what_came_after() {
    let said = "console\",\"command\"";
    let mut conversation = vec![("\"kind\":\"boot\"", "help")];
    conversation.extend(PAUSE);
    conversation.push((said, "trace off"));
    conversation.extend(PAUSE);
    conversation.extend([(said, "trace on"), (said, "stop left")]);
    conversation.extend(PAUSE);
    conversation.extend([(said, "start left"), (said, "help"), (said, "shutdown")]);
    for mode in [Mode::Deterministic, Mode::Threads] {
        let guest = endless().mode(mode).word("trace=dump");
        let outcome = guest.conversation(&conversation).succeed();
        let runs = harness::trace::read(&outcome.serial).expect("a trace");
        let [run] = &runs[..] else {
            panic!("{} runs\n{}", runs.len(), outcome.tail());
        };
        assert!(run.lost > 0, "what came before is lost");
        assert!(run.events.len() > 20, "{}", run.events.len());
        // Threads of a busy host get their turn late.
        let findings = harness::trace::check(run, 1_000_000_000);
        let texts: Vec<String> = findings.breaches.iter().map(ToString::to_string).collect();
        assert_eq!(texts, [""; 0], "{}", outcome.tail());
    }
}
