//! The short form of `./scripts/soak`: random DAG sets with every kind of incident, and all checks.

use lab::soak::{self, SoakPlan};

#[test]
fn random_sets_break_no_rule_and_leave_nothing_behind() {
    let plan = SoakPlan {
        round_ms: 250,
        side_by_side: 2,
        ..SoakPlan::SHORT
    };
    let report = soak::run(&plan, |_| {}).expect("the guests start");
    assert_eq!(report.failures, Vec::<String>::new());
    assert_eq!((report.passed, report.failed), (16, 0));
    // The run must be one in which a fault could show.
    let least = [
        ("completed", 1000),
        ("missed", 50),
        ("skipped", 50),
        ("aborted", 50),
        ("suspend", 1000),
        ("ended", 10),
        ("restarted", 5),
        ("dag_ended", 5),
        ("off", 10),
        ("on", 10),
        ("wake", 500),
        ("signalled", 100),
        ("entered", 20),
    ];
    for (what, least) in least {
        assert!(report.events[what] >= least, "{what}: {report:#?}");
    }
    assert!(report.dags.len() > 24, "{:#?}", report.dags);
    for policy in ["StaticPriority", "Edf"] {
        for overrun in ["Queue", "Skip", "Abort"] {
            for cores in ["Together", "Clusters"] {
                let kind = format!("{policy} {overrun} {cores}");
                let mut had = report.dags.keys();
                assert!(had.any(|it| it.starts_with(&kind)), "{kind}");
            }
        }
    }
}
