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
    for cores in [1, 2, 4] {
        let guest = Guest::new("guest-tests").word("test=lifecycle");
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
