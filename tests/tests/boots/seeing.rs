//! A person and a guest: a conversation at the console with a guest running until told to end, its
//! status, and its graph.

use harness::{Guest, Members, Said, lawful_runs};
use recording::Counted;
use sched_dag::{DagId, SubtaskId};
use tool::Outcome;
use views::json::Value;
use views::notes;
use views::protocol::MachineLine;

/// The answer to a command.
const SAID: &str = "console\",\"command\"";

/// Waits until virtual time has gone on by asking again and again.
const PAUSE: [(&str, &str); 3] = [(SAID, "help"); 3];

fn endless() -> Guest {
    Guest::test("endless").cores(2)
}

/// The lines of kind `dag_status` of a DAG, in their order.
fn statuses<'o>(outcome: &'o Outcome, name: &str) -> Vec<&'o MachineLine> {
    let mut lines = outcome.lines("dag_status");
    lines.retain(|line| line.text_at("name") == Some(name));
    lines
}

fn answers(outcome: &Outcome) -> Vec<(&str, bool)> {
    let lines = outcome.lines("console").into_iter();
    let is_accepted = |line: &MachineLine| line.text.contains("\"accepted\":true");
    let answers = lines.map(|line| (line.member("command"), is_accepted(line)));
    answers.collect()
}

/// Pauses one of two endless DAGs; the other DAG is in a cluster of its own, or in the same.
#[test]
fn a_dag_is_paused_and_resumed_while_the_other_goes_on_and_both_are_shut_down() {
    talk(endless());
    talk(endless().word("clusters=1,1"));
}

fn talk(guest: Guest) {
    let begin = [
        ("\"kind\":\"boot\"", "help"),
        (SAID, "dags"),
        (SAID, "pause left"),
    ];
    let mut conversation = begin.to_vec();
    conversation.extend(PAUSE);
    conversation.push((SAID, "stats"));
    conversation.extend(PAUSE);
    conversation.extend([(SAID, "stats"), (SAID, "resume 0")]);
    conversation.extend(PAUSE);
    conversation.extend([(SAID, "stats left"), (SAID, "shutdown")]);
    let outcome = guest.conversation(&conversation).succeed();

    let left = statuses(&outcome, "left");
    let [listed, first, second, third, last] = left[..] else {
        panic!("{} lines of `left`\n{}", left.len(), outcome.tail());
    };
    listed.reads([("state", "running")]);
    for paused in [first, second] {
        paused.reads([("state", "paused")]);
        paused.has([("in_flight", 0)]);
    }
    assert_eq!(first.number("released"), second.number("released"));
    assert!(first.number("skips") < second.number("skips"));
    third.reads([("state", "running")]);
    assert!(second.number("released") < third.number("released"));
    last.has([("in_flight", 0), ("completed", last.number("released"))]);

    // The other one goes on all the time.
    let right = statuses(&outcome, "loop");
    right[..3].iter().for_each(|line| line.has([("skips", 0)]));
    assert!(right[1].number("released") < right[2].number("released"));
    assert!(answers(&outcome).iter().all(|(_, accepted)| *accepted));
}

#[test]
fn a_trace_that_was_off_for_a_while_holds_what_came_after() {
    let mut conversation = vec![("\"kind\":\"boot\"", "help")];
    conversation.extend(PAUSE);
    conversation.push((SAID, "trace off"));
    conversation.extend(PAUSE);
    conversation.extend([(SAID, "trace on"), (SAID, "pause left")]);
    conversation.extend(PAUSE);
    conversation.extend([(SAID, "resume left"), (SAID, "help"), (SAID, "shutdown")]);
    // In real time only the order is judged, not how long anybody waits.
    for (guest, bound_ns) in [
        (endless(), 1_000_000_000),
        (endless().in_real_time(), u64::MAX),
    ] {
        let guest = guest.word("events=on").conversation(&conversation);
        let runs = lawful_runs(&guest.succeed(), bound_ns);
        let [run] = &runs[..] else {
            panic!("{} runs", runs.len());
        };
        assert!(run.lost > 0, "what came before is lost");
        assert!(run.events.len() > 20, "{}", run.events.len());
    }
}

#[test]
fn a_person_is_heard_and_told_under_overload() {
    // Two subtasks of 25.5 ms every 25 ms: this core never comes to its background.
    let conversation = [
        ("\"kind\":\"status\"", "help"),
        (SAID, "stats"),
        (SAID, "pause fork-join"),
        (SAID, "shutdown"),
    ];
    let guest = Guest::new("fork-join").word("jobs=0 subtasks=2 status=1");
    let outcome = guest.conversation(&conversation).succeed();
    assert!(answers(&outcome).iter().all(|(_, accepted)| *accepted));
    let status = outcome.line("status");
    assert!(loads(status)[0] > 950, "{}", status.text);
    let last = statuses(&outcome, "fork-join");
    let last = last.last().expect("the last one");
    assert_eq!(last.number("released"), last.number("completed"));
}

/// Returns the load of each core, in permille.
fn loads(status: &MachineLine) -> Vec<u64> {
    elements(status, "load_permille")
        .iter()
        .filter_map(Value::as_u64)
        .collect()
}

fn elements<'l>(line: &'l MachineLine, list: &str) -> &'l [Value] {
    line.value.get(list).expect(list).elements()
}

#[test]
fn each_commit_is_in_the_record() {
    let guest = Guest::new("fork-join").word("jobs=2 subtasks=2,3");
    let outcome = guest.cores(4).word("events=on").succeed();
    let record = outcome.record().expect("it is whole");
    let [first, second] = &record.commits[..] else {
        panic!("{} commits\n{}", record.commits.len(), outcome.tail());
    };
    assert_eq!((first.number, second.number), (0, 1));
    let dag = &first.told.dags[0];
    let answer = &first.told.answers[0];
    let begin = format!("dag `{}` is not proven to meet its deadlines: ", dag.name);
    let reason = "subtask `parallel-0` alone takes more than a period";
    assert!(
        answer.starts_with(&begin) && answer.contains(reason),
        "{answer}"
    );
    let names: Vec<&str> = dag.subtasks.iter().map(|subtask| &*subtask.name).collect();
    assert_eq!(names, ["source", "parallel-0", "parallel-1", "sink"]);
    let names: Vec<&str> = dag.topics.iter().map(|topic| &*topic.name).collect();
    assert_eq!(names, ["job", "part-0", "part-1"]);
    let job = &dag.topics[0];
    assert_eq!(
        (&*job.type_name, job.writer, &job.readers[..]),
        ("u64", 0, &[1, 2][..])
    );

    let notes = notes::of_dag(first, DagId(0));
    let topic = "topic `job`: u64 of source, read by parallel-0, parallel-1";
    assert!(notes.iter().any(|note| note == topic), "{notes:?}");
    let of_parallel = notes::of_subtask(first, DagId(0), SubtaskId(1));
    assert_eq!(of_parallel, ["priority 1"]);
}

#[test]
fn a_fast_dag_without_end_hides_no_progress_and_makes_none() {
    let ten = "\"done\":10,\"total\":10";
    let conversation = [
        ("kind\":\"status\"", "help"),
        (SAID, "dags"),
        (ten, "shutdown"),
    ];
    let guest = Guest::test("endless").word("status=1");
    let outcome = guest.conversation(&conversation).succeed();
    let numbers = |kind: &str| -> Vec<(u64, u64)> {
        let lines = outcome.lines(kind).into_iter();
        let of = |line: &MachineLine| (line.number("done"), line.number("total"));
        lines.map(of).collect()
    };
    let expected: Vec<(u64, u64)> = (1..=10).map(|done| (done, 10)).collect();
    assert_eq!(numbers("progress"), expected, "{}", outcome.tail());
    assert!(numbers("status").iter().all(|(done, total)| done <= total));
    // What has become of each DAG is said to people, too.
    let left = "`ten`: ended; 10 jobs released, 10 completed";
    let mut lines = outcome.serial.lines();
    let is_said = lines.any(|line| line.starts_with("  dag ") && line.contains(left));
    assert!(is_said, "{}", outcome.serial);
}

#[test]
fn a_run_longer_than_its_journal_keeps_its_latest_jobs_and_all_statistics() {
    let guest = Guest::new("fork-join").cores(4).word("subtasks=2 jobs=300");
    let guest = guest.word("trace_events=1000 events=on");
    let outcome = guest.succeed();
    let record = outcome.record().expect("it is whole");
    let (_, times) = &record.times[0];
    let count = |of: &Counted| -> u64 { of.buckets.iter().map(|(_, count)| count).sum() };
    let [dag] = &times.dags[..] else { panic!() };
    assert_eq!([&dag.response, &dag.release_jitter].map(count), [300, 300]);
    let subtasks = dag.subtasks.iter();
    let counts = subtasks.map(|of| (count(&of.execution), count(&of.join_latency)));
    let joins: Vec<(u64, u64)> = counts.collect();
    assert_eq!(joins, [(300, 0), (300, 300), (300, 300), (300, 300)]);
    let runs = lawful_runs(&outcome, 1_000_000);
    assert_eq!(runs[0].events.len(), 1000);
    assert!(runs[0].lost > 1000, "{}", runs[0].lost);
}

#[test]
fn the_status_is_printed_only_if_asked_for() {
    let guest = Guest::new("fork-join").word("jobs=120 subtasks=2").cores(4);
    let outcome = guest.succeed();
    assert_eq!(outcome.lines("status").len(), 0);
    let outcome = guest.word("status=1").succeed();
    let lines = outcome.lines("status");
    // 120 jobs every 25 ms take three seconds at least.
    assert!(lines.len() >= 2, "{}", outcome.tail());
    let done: Vec<u64> = lines.iter().map(|line| line.number("done")).collect();
    assert!(done.is_sorted() && done.last() <= Some(&120), "{done:?}");
    for line in lines {
        line.has([("total", 120)]);
        let loads = loads(line);
        assert_eq!(loads.len(), 4, "{}", line.text);
        // Two subtasks of 25.5 ms every 25 ms keep about two cores busy.
        let sum: u64 = loads.iter().sum();
        assert!((1000..=4000).contains(&sum), "{}", line.text);
        assert!(loads.iter().all(|&load| load <= 1000), "{}", line.text);
    }
}
