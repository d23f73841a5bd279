//! Clusters of cores on the machine: each schedules its own DAGs, and what passes between them
//! is whole, complete and counted.

use harness::Guest;
use sched_dag::journal::What;
use tool::Outcome;
use tool::protocol::Status;

fn clusters(words: &str) -> Guest {
    Guest::new("guest-tests").cores(4).word(words)
}

fn number(outcome: &Outcome, dag: &str, member: &str) -> u64 {
    let mut lines = outcome.transcript.of_kind("of_dag");
    let line = lines.find(|line| line.text_at("name") == Some(dag));
    let line = line.unwrap_or_else(|| panic!("no DAG `{dag}`\n{}", outcome.tail()));
    line.number_at(member).expect("a number")
}

/// What must be so whatever time means.
fn hold(outcome: &Outcome) {
    let mut lines = outcome.transcript.of_kind("clusters");
    let line = lines.next().expect("the test's line");
    assert_eq!(line.number_at("allocations"), Some(0), "{}", line.text);
    // Each completion is a letter to cluster 1, and each answer one back.
    let of = |dag, member| number(outcome, dag, member);
    assert_eq!(of("writer", "completed"), 40);
    assert_eq!(of("answers", "signals"), 40);
    assert_eq!(of("echoes", "signals"), of("answers", "completed"));
    for dag in ["answers", "echoes"] {
        let kept = of(dag, "completed") + of(dag, "dropped");
        assert_eq!(kept, of(dag, "signals"), "{dag}");
    }
    assert_eq!(number(outcome, "reader", "completed"), 80);
}

#[test]
fn an_overload_in_one_cluster_delays_nothing_in_another() {
    let guest = clusters("test=clusters").word("clusters=2,2");
    let outcome = guest.word("trace=dump").succeed();
    hold(&outcome);
    let line = outcome.transcript.of_kind("clusters").next();
    let line = line.expect("looked at before");
    assert_eq!(line.number_at("violations"), Some(0), "{}", outcome.tail());
    assert_eq!(number(&outcome, "echoes", "completed"), 40);
    let seen = line.number_at("seen").expect("a number");
    assert!((35..=40).contains(&seen), "{seen}");
    for (dag, misses) in [("writer", 0), ("echoes", 0)] {
        assert_eq!(number(&outcome, dag, "misses"), misses, "{dag}");
    }
    let lost = ["misses", "skips"].map(|member| number(&outcome, "overload", member));
    assert!(lost.iter().sum::<u64>() >= 60, "{lost:?}");

    let runs = tool::trace::read(&outcome.serial).expect("a trace");
    let findings = tool::trace::check(&runs[0], 1_000_000);
    assert_eq!(findings.breaches, []);
    let starts = runs[0].events.iter().filter(|it| it.what == What::Start);
    let mut cores: Vec<(u32, u32)> = starts
        .map(|start| (runs[0].task_set.dag(start.dag).cluster().0, start.core.0))
        .collect();
    cores.sort_unstable();
    cores.dedup();
    assert!(cores.iter().all(|(cluster, core)| core / 2 == *cluster));
    let both = [(1, 2), (1, 3)];
    assert!(both.iter().all(|core| cores.contains(core)), "{cores:?}");
}

#[test]
fn letters_pass_where_cores_really_run_side_by_side() {
    for words in ["clusters=2,2", "clusters=1,2"] {
        for idle in ["idle=halt", "idle=poll"] {
            let guest = clusters("test=clusters").word(words).word(idle);
            // Which instance runs when is the host's affair, so R5 is not asked for.
            hold(&guest.in_real_time().boot());
        }
    }
}

#[test]
fn the_commit_divides_the_cores_where_the_app_offers_it() {
    let outcome = clusters("test=clusters_auto")
        .word("clusters=auto")
        .succeed();
    let placed = |dag: &str, place: &str| {
        let text = format!("dag `{dag}`");
        let mut lines = outcome.serial.lines();
        let line = lines.find(|line| line.contains(&text) && line.contains("cluster"));
        let line = line.unwrap_or_else(|| panic!("nothing on {dag}\n{}", outcome.tail()));
        assert!(line.contains(place), "{line}");
    };
    placed("heavy", "in cluster 0, on 2 cores from core 0 on");
    placed("light", "on 1 core from core 2 on");
    placed("lighter", "on 1 core from core 3 on");
    for dag in ["light", "heavy", "lighter"] {
        assert_eq!(number(&outcome, dag, "completed"), 3, "{dag}");
    }
}

#[test]
fn a_division_that_cannot_be_is_refused_with_what_to_do() {
    for (words, code) in [
        ("test=clusters clusters=2,0", "cluster_without_cores"),
        ("test=clusters clusters=3,3", "clusters_beyond_cores"),
        ("test=clusters clusters=4", "unknown_cluster"),
        ("test=clusters policy=static", "unknown_cluster"),
        ("test=clusters_auto clusters=2,2", "no_cluster"),
    ] {
        let (test, word) = words.split_once(' ').expect("two words");
        let outcome = clusters(test).word(word).end_in(Status::Failure);
        let fault = outcome.transcript.of_kind("commit_fault").next();
        let found = fault.and_then(|line| line.text_at("fault"));
        assert_eq!(found, Some(code), "{}", outcome.tail());
    }
    let outcome = clusters("test=clusters").word("clusters=2,two");
    let outcome = outcome.end_in(Status::Usage);
    assert!(
        outcome.serial.contains("clusters=2,two"),
        "{}",
        outcome.tail()
    );
}
