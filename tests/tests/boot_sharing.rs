//! States, latest values and signals on the machine.

use harness::Guest;
use tool::Outcome;
use tool::protocol::MachineLine;

fn sharing(policy: &str) -> Guest {
    let policy = format!("policy={policy}");
    let guest = Guest::new("guest-tests").word("test=sharing").word(&policy);
    guest.cores(3).word("trace=dump")
}

fn line(outcome: &Outcome) -> &MachineLine {
    let mut lines = outcome.transcript.of_kind("sharing");
    lines.next().expect("the test's line")
}

fn number(outcome: &Outcome, name: &str) -> u64 {
    line(outcome).number_at(name).expect("a number")
}

#[test]
fn samples_are_whole_and_signals_keep_their_distance() {
    for policy in ["static", "edf"] {
        let outcome = sharing(policy).succeed();
        assert_eq!(number(&outcome, "violations"), 0);
        assert_eq!(number(&outcome, "allocations"), 0);
        // 600 ms in which 120 values come; `often` looks 200 times, `seldom` 90.
        let (often, seldom) = (number(&outcome, "often"), number(&outcome, "seldom"));
        assert!((115..=120).contains(&often), "{often}");
        assert!((83..=90).contains(&seldom), "{seldom}");
        // A signal every 7 ms for 630 ms, and one answer every 20 ms.
        assert_eq!(number(&outcome, "signals"), 90);
        let (answers, dropped) = (number(&outcome, "answers"), number(&outcome, "dropped"));
        assert!((31..=33).contains(&answers), "{answers}");
        assert_eq!(answers + dropped, 90);
        let runs = tool::trace::read(&outcome.serial).expect("a trace");
        let findings = tool::trace::check(&runs[0], 1_000_000);
        assert_eq!(findings.breaches, [], "{policy}");
    }
}

#[test]
fn samples_are_whole_where_cores_really_run_side_by_side() {
    let outcome = sharing("edf").in_real_time().succeed();
    assert_eq!(number(&outcome, "violations"), 0);
    assert_eq!(number(&outcome, "signals"), 90);
}

#[test]
fn bytes_release_a_dag() {
    // A text ends its line: two bytes. The second comes early and is kept. Both come
    // while jobs run: before time 0 one of them would be dropped.
    let typed = [("\"kind\":\"progress\"", "a")];
    let outcome = sharing("edf").word("input=yes").typing(&typed).succeed();
    assert_eq!(number(&outcome, "answers_to_bytes"), 2);
    assert_eq!(number(&outcome, "violations"), 0);
}

#[test]
fn what_comes_before_time_0_releases_nothing_yet() {
    let typed = [("\"kind\":\"listening\"", "a")];
    let guest = sharing("static").word("input=yes").word("later_ms=400");
    let outcome = guest.typing(&typed).succeed();
    assert_eq!(number(&outcome, "answers_to_bytes"), 1);
    assert_eq!(number(&outcome, "violations"), 0);
    assert_eq!(outcome.transcript.of_kind("fault").count(), 0);
    let before_time_0 = "[0,\"signalled\",0,4,0,-1]";
    assert!(outcome.serial.contains(before_time_0), "the byte came late");
}
