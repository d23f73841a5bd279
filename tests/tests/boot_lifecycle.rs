//! Runs that their own functions change, on the machine.

use harness::Guest;
use sched_dag::journal::What;
use tool::Outcome;

fn number(outcome: &Outcome, kind: &str, name: &str) -> u64 {
    let mut lines = outcome.transcript.of_kind(kind);
    let line = lines.next().expect("the test's line");
    line.number_at(name).expect("a number")
}

#[test]
fn functions_pause_and_resume_a_dag_and_shut_the_run_down() {
    lifecycle("test=lifecycle", &[1, 2, 4]);
}

#[test]
fn requests_reach_other_clusters() {
    lifecycle("test=lifecycle_divided", &[2]);
    modes("test=modes_divided", &[2]);
}

fn lifecycle(test: &str, cores: &[u64]) {
    for &cores in cores {
        let guest = Guest::new("guest-tests").word(test);
        let outcome = guest.cores(cores).word("trace=dump").succeed();
        let number = |name| number(&outcome, "lifecycle", name);
        assert_eq!(number("violations"), 0);
        assert_eq!(number("allocations"), 0);
        assert_eq!(number("unfinished"), 0, "what was in flight has ended");
        // On from 10 to 30 ms and so on, five times; the first release comes 2 ms later.
        assert_eq!(number("ticks"), 50);
        assert!(number("skips") > 45);
        // At 200 ms, or shortly after it.
        assert_eq!((number("asks"), number("ends")), (21, 11));

        let runs = tool::trace::read(&outcome.serial).expect("a trace");
        let findings = tool::trace::check(&runs[0], 1_000_000);
        assert_eq!(findings.breaches, [], "{cores} cores");
        let count = |what| {
            let events = runs[0].events.iter();
            events.filter(|event| event.what == what).count()
        };
        let changes = [What::Off, What::On, What::Closed].map(count);
        assert_eq!(changes, [6, 5, 3], "{cores} cores");
    }
}

#[test]
fn modes_are_entered_at_once_and_when_what_leaves_is_idle() {
    modes("test=modes", &[1, 4]);
}

fn modes(test: &str, cores: &[u64]) {
    for &cores in cores {
        let guest = Guest::new("guest-tests").word(test);
        let outcome = guest.cores(cores).word("trace=dump").succeed();
        assert_eq!(number(&outcome, "modes", "violations"), 0);
        assert_eq!(number(&outcome, "modes", "allocations"), 0);

        let runs = tool::trace::read(&outcome.serial).expect("a trace");
        let findings = tool::trace::check(&runs[0], 1_000_000);
        assert_eq!(findings.breaches, [], "{cores} cores");
        // `cruise` is DAG 0 and mode 0, `descend` DAG 1 and mode 1.
        let (mut mode, mut entered, mut in_flight) = (0, Vec::new(), [0_u32; 3]);
        let mut events = runs[0].events.clone();
        events.sort_by_key(|event| event.time_ns);
        for event in &events {
            let dag = event.dag.index();
            match event.what {
                What::Released => {
                    assert!(dag == 2 || dag == mode, "{event:?} in mode {mode}");
                    in_flight[dag] += 1;
                }
                What::Completed => in_flight[dag] -= 1,
                What::Entered => {
                    mode = usize::try_from(event.job).expect("few modes");
                    entered.push(mode);
                    let is_idle = in_flight[0] == 0;
                    assert!(mode == 0 || is_idle, "`cruise` has a job in flight");
                }
                _ => {}
            }
        }
        // Mode 0 at first, then 1 and 0 in turns: each six jobs of 40.
        assert_eq!(entered.len(), 14, "{entered:?}");
        let turns = entered.iter().enumerate();
        assert!(turns.clone().all(|(turn, mode)| turn % 2 == *mode));
    }
}
