//! The short form of `./scripts/soak`: random DAG sets under both policies, in
//! overload under every overrun policy, with everything checked.

use tool::soak;
use tool::soak::plan::{Length, Plan};

#[test]
fn random_sets_break_no_rule_and_leave_nothing_behind() {
    let plan = Plan {
        side_by_side: 2,
        ..Plan::new(Length::SHORT, 90, 130)
    };
    let report = soak::run(&plan, |_| {}).expect("the guests start");
    assert_eq!(report.failures, Vec::<String>::new());
    assert_eq!((report.passed, report.failed), (plan.rounds(), 0));
    let figures = |name: &str| {
        let part = report.parts.iter().find(|(part, _)| part == name);
        part.unwrap_or_else(|| panic!("there is no part {name}")).1
    };
    // The run has to be one in which something could have gone wrong.
    assert!(report.total.jobs > 2000, "{:?}", report.total);
    assert!(report.total.preemptions > 2000, "{:?}", report.total);
    assert!(report.total.events > 50_000, "{:?}", report.total);
    let coverage = &report.coverage;
    assert!(coverage.hit() > 24, "{}", coverage.table());
    for policy in ["static", "edf"] {
        assert!(figures(&format!("{policy}-130-queue")).misses > 0);
        assert!(figures(&format!("{policy}-130-skip")).skips > 0);
        assert!(figures(&format!("{policy}-130-abort")).aborts > 0);
    }
}
