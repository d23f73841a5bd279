//! What people see of a guest and say to it: a conversation at the console with a
//! guest that runs until it is told to end, its status, and its graph.

use harness::Guest;
use tool::Outcome;
use tool::json::Value;
use tool::protocol::MachineLine;

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
    talk(endless());
}

#[test]
fn a_dag_of_one_cluster_is_stopped_and_started_and_the_other_goes_on() {
    talk(endless().word("clusters=1,1"));
}

/// Stops and starts one of two endless DAGs, and ends both.
fn talk(guest: Guest) {
    let said = "console\",\"command\"";
    let mut conversation = vec![("\"kind\":\"boot\"", "help"), (said, "dags")];
    conversation.push((said, "stop left"));
    conversation.extend(PAUSE);
    conversation.push((said, "stats"));
    conversation.extend(PAUSE);
    conversation.extend([(said, "stats"), (said, "start 0")]);
    conversation.extend(PAUSE);
    conversation.extend([(said, "stats left"), (said, "shutdown")]);
    let outcome = guest.conversation(&conversation).succeed();

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
        (said, "stats +1"),
        (said, "shutdown"),
    ];
    let outcome = endless().conversation(&conversation).succeed();
    let expected = [
        ("hlep", false),
        ("stop nothing", false),
        ("trace", false),
        ("stats 1", true),
        ("stats +1", false),
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
    // In real time only the order is judged, not how long anybody waits.
    let guests = [
        (endless(), 1_000_000_000),
        (endless().in_real_time(), u64::MAX),
    ];
    for (guest, bound_ns) in guests {
        let guest = guest.word("trace=dump");
        let outcome = guest.conversation(&conversation).succeed();
        let runs = tool::trace::read(&outcome.serial).expect("a trace");
        let [run] = &runs[..] else {
            panic!("{} runs\n{}", runs.len(), outcome.tail());
        };
        assert!(run.lost > 0, "what came before is lost");
        assert!(run.events.len() > 20, "{}", run.events.len());
        let findings = tool::trace::check(run, bound_ns);
        let texts: Vec<String> = findings.breaches.iter().map(ToString::to_string).collect();
        assert_eq!(texts, [""; 0], "{}", outcome.tail());
    }
}

#[test]
fn a_person_is_heard_and_told_under_overload() {
    // Two subtasks of 25.5 ms every 25 ms: this core never comes to its background.
    let guest = Guest::new("fork-join").word("jobs=0").word("subtasks=2");
    let said = "console\",\"command\"";
    let conversation = [
        ("\"kind\":\"status\"", "help"),
        (said, "stats"),
        (said, "stop fork-join"),
        (said, "shutdown"),
    ];
    let outcome = guest.word("status=1").conversation(&conversation).succeed();
    assert!(answers(&outcome).iter().all(|(_, accepted)| *accepted));
    let status = outcome.transcript.of_kind("status").next().expect("one");
    let loads = status.value.get("load_permille").expect("loads").elements();
    assert!(loads[0].as_u64() > Some(950), "{}", status.text);
    let last = *statuses(&outcome, "fork-join")
        .last()
        .expect("the last one");
    assert_eq!(last.number_at("released"), last.number_at("completed"));
}

#[test]
fn each_commit_prints_its_dags_if_asked() {
    let guest = Guest::new("fork-join").word("jobs=2").word("subtasks=2,3");
    let outcome = guest.cores(4).word("graph=dump").succeed();
    let lines: Vec<_> = outcome.transcript.of_kind("graph").collect();
    let [first, second] = lines[..] else {
        panic!("{} lines\n{}", lines.len(), outcome.tail());
    };
    assert_eq!(first.number_at("commit"), Some(0));
    assert_eq!(second.number_at("commit"), Some(1));
    let names = |list: &str| -> Vec<String> {
        let elements = first.value.get(list).expect(list).elements();
        let name = |element: &Value| element.elements()[0].as_text().map(String::from);
        elements.iter().filter_map(name).collect()
    };
    assert_eq!(
        names("subtasks"),
        ["source", "parallel-0", "parallel-1", "sink"]
    );
    assert_eq!(names("topics"), ["job", "part-0", "part-1"]);
    let topics = first.value.get("topics").expect("topics").elements();
    let expected = tool::json::parse(r#"["job","u64",0,[1,2],0]"#).expect("JSON");
    assert_eq!(topics[0], expected);

    let dot = tool::dot::text(&outcome.transcript).expect("good lines");
    assert!(
        dot.contains("c0_d0_s0 -> c0_d0_s2 [label=\"job: u64\"];"),
        "{dot}"
    );
    assert!(
        dot.contains("label=\"parallel-0\\nWCET 50 ms\\npriority 1\""),
        "{dot}"
    );
    assert_eq!(dot.matches("subgraph").count(), 2);
}

#[test]
fn dags_that_sample_each_other_are_joined_by_dashed_arrows() {
    let guest = Guest::new("autoware").cores(4).word("jobs=1");
    let outcome = guest.word("graph=dump").succeed();
    let dot = tool::dot::text(&outcome.transcript).expect("good lines");
    let lines: Vec<_> = outcome.transcript.of_kind("graph").collect();
    let name = |dag: u64, list: &str, index: u64| -> String {
        let line = lines.iter().find(|line| line.number_at("dag") == Some(dag));
        let list = line.expect("the DAG").value.get(list).expect(list);
        let element = &list.elements()[usize::try_from(index).expect("small")];
        element.elements()[0].as_text().expect("a name").into()
    };
    let mut arrows = Vec::new();
    for line in &lines {
        let reader_dag = line.number_at("dag").expect("its number");
        for sample in line.value.get("samples").expect("a list").elements() {
            let numbers = sample.elements().iter().map(Value::as_u64);
            let numbers: Option<Vec<u64>> = numbers.collect();
            let [reader, writer_dag, topic, _] = numbers.expect("all are proven")[..] else {
                panic!("{}", line.text);
            };
            assert_ne!(reader_dag, writer_dag, "{}", line.text);
            let arrow = format!("  c0_d{writer_dag}_t{topic} -> c0_d{reader_dag}_s{reader} [");
            assert!(dot.contains(&arrow), "{arrow} is not in\n{dot}");
            let topic = name(writer_dag, "topics", topic);
            arrows.push(format!("{topic} {}", name(reader_dag, "subtasks", reader)));
        }
    }
    assert_eq!(
        arrows,
        [
            "PointCloudMapLoader NDTLocalizer",
            "EuclideanClusterSettings EuclideanClusterDetector",
            "Visualizer Lanelet2GlobalPlanner",
            "NDTLocalizer Lanelet2GlobalPlanner",
            "ObjectCollisionEstimator BehaviorPlanner",
            "NDTLocalizer BehaviorPlanner",
            "Lanelet2GlobalPlanner BehaviorPlanner",
            "Lanelet2MapLoader BehaviorPlanner",
            "ParkingPlanner BehaviorPlanner",
            "LanePlanner BehaviorPlanner",
        ]
    );
}

#[test]
fn a_fast_dag_without_end_hides_no_progress_and_makes_none() {
    let guest = Guest::new("guest-tests").word("test=busy").word("status=1");
    let said = "console\",\"command\"";
    let ten = "\"done\":10,\"total\":10";
    let conversation = [
        ("kind\":\"status\"", "help"),
        (said, "dags"),
        (ten, "shutdown"),
    ];
    let outcome = guest.conversation(&conversation).succeed();
    let numbers = |kind: &str| -> Vec<(u64, u64)> {
        let lines = outcome.transcript.of_kind(kind);
        let of = |line: &MachineLine| Some((line.number_at("done")?, line.number_at("total")?));
        lines.filter_map(of).collect()
    };
    let expected: Vec<(u64, u64)> = (1..=10).map(|done| (done, 10)).collect();
    assert_eq!(numbers("progress"), expected, "{}", outcome.tail());
    assert!(numbers("status").iter().all(|&(done, total)| done <= total));
    // What has become of each DAG is said to people, too.
    let left = outcome
        .serial
        .lines()
        .filter(|line| line.starts_with("  dag "));
    let left: Vec<&str> = left.skip(2).collect();
    assert!(
        left[1].contains("`ten`: ended; 10 jobs released, 10 completed"),
        "{left:?}"
    );
}

#[test]
fn a_run_longer_than_its_journal_keeps_its_latest_jobs_and_all_statistics() {
    let guest = Guest::new("fork-join").cores(4).word("subtasks=2");
    let guest = guest.word("jobs=300").word("trace_events=1000");
    let outcome = guest.word("trace=dump").word("times=dump").succeed();
    let line = outcome.transcript.of_kind("times_dag").next();
    let line = line.expect("statistics are asked for");
    let first = line
        .number_at("first_recorded_job")
        .expect("checked before");
    assert!((1..300).contains(&first), "{first}");
    for of_dag in ["response_time_ns", "release_jitter_ns"] {
        assert_eq!(count(line, of_dag), Some(300));
    }
    let subtasks: Vec<_> = outcome.transcript.of_kind("times_subtask").collect();
    assert_eq!(subtasks.len(), 4);
    for (number, line) in subtasks.into_iter().enumerate() {
        assert_eq!(count(line, "execution_time_ns"), Some(300));
        let joins = if number == 0 { 0 } else { 300 };
        assert_eq!(count(line, "join_latency_ns"), Some(joins));
    }
    let runs = tool::trace::read(&outcome.serial).expect("a trace");
    let events = runs[0].events.len();
    assert_eq!(events, 1000);
    assert!(runs[0].lost > 1000, "{}", runs[0].lost);
    let findings = tool::trace::check(&runs[0], 1_000_000);
    let texts: Vec<String> = findings.breaches.iter().map(ToString::to_string).collect();
    assert_eq!(texts, [""; 0], "{}", outcome.tail());
}

fn count(line: &MachineLine, times: &str) -> Option<u64> {
    line.value.get(times)?.get("count")?.as_u64()
}

#[test]
fn the_status_is_printed_only_if_asked_for() {
    let guest = Guest::new("fork-join")
        .word("jobs=120")
        .word("subtasks=2")
        .cores(4);
    let outcome = guest.clone().succeed();
    assert_eq!(outcome.transcript.of_kind("status").count(), 0);
    let outcome = guest.word("status=1").succeed();
    let lines: Vec<_> = outcome.transcript.of_kind("status").collect();
    // 120 jobs every 25 ms take three seconds at least.
    assert!(lines.len() >= 2, "{}", outcome.tail());
    let mut done = 0;
    for line in &lines {
        assert_eq!(line.number_at("total"), Some(120));
        let now = line.number_at("done").expect("a count");
        assert!(done <= now && now <= 120, "{}", line.text);
        done = now;
        let loads = line.value.get("load_permille").expect("loads").elements();
        let loads: Vec<u64> = loads.iter().filter_map(Value::as_u64).collect();
        assert_eq!(loads.len(), 4, "{}", line.text);
        // Two subtasks of 25.5 ms every 25 ms keep about two cores busy.
        let sum: u64 = loads.iter().sum();
        assert!((1000..=4000).contains(&sum), "{}", line.text);
        assert!(loads.iter().all(|&load| load <= 1000), "{}", line.text);
    }
}
