//! Rounds in virtual time: the sets that the machine gets, under every policy.

use std::time::Duration;

use fass::{ConstructionPolicy, OverrunPolicy, Policy, Preemption, finish_create_dags_with};
use soak::{Account, DagPlan, Executed, Trouble, build, draw_set, largest_set};
use virtual_time::VirtualTime;

const LENGTH: Duration = Duration::from_millis(400);

/// A round, and how its set runs.
#[derive(Clone, Copy, Debug)]
struct Case {
    round: u64,
    load: u64,
    cores: u32,
    policy: Policy,
    preemption: Preemption,
    overrun: OverrunPolicy,
}

fn round(case: Case) -> Account {
    let plans = draw_set(1, case.round, case.load, case.cores);
    let quiet = judged(case, &plans, &Trouble::default());
    assert_eq!(quiet.faults, 0);
    let trouble = Trouble::draw(1, case.round, &plans, case.cores);
    let troubled = judged(case, &plans, &trouble);
    // Every fault that was drawn, at least where all jobs run, is in the account.
    let none_drawn = trouble.dags.iter().all(|dag| dag.fault.is_none());
    assert!(troubled.faults > 0 || none_drawn, "{case:?}, {trouble:?}");
    quiet
}

/// Runs a set with some trouble, in which nothing may be wrong.
fn judged(case: Case, plans: &[DagPlan], trouble: &Trouble) -> Account {
    let machine = VirtualTime::new().cores(case.cores).policy(case.policy);
    let machine = machine.preemption(case.preemption).contain_panics();
    let machine = machine.clusters(&trouble.clusters);
    let mut executed = Executed::default();
    let dags = build(plans, LENGTH, case.overrun, trouble, &mut executed);
    finish_create_dags_with(&dags, ConstructionPolicy::any_graph())
        .expect("a drawn set has no fault");
    let report = machine.run();
    assert_eq!(report.violations(), [], "{case:?}");
    let statistics = |dag: sched_dag::DagId| report.dag(dag).statistics();
    let (account, discrepancies) = Account::of_run(
        report.task_set(),
        report.record(),
        statistics,
        trouble,
        &executed,
    );
    assert_eq!(discrepancies, [], "{case:?}, {trouble:?}");
    account
}

const CASE: Case = Case {
    round: 0,
    load: 90,
    cores: 4,
    policy: Policy::StaticPriority,
    preemption: Preemption::Enabled,
    overrun: OverrunPolicy::Queue,
};

#[test]
fn every_job_is_accounted_for_at_ninety_percent() {
    for policy in [Policy::StaticPriority, Policy::Edf] {
        let mut total = Account::default();
        for number in 0..6 {
            total.add(&round(Case {
                round: number,
                policy,
                ..CASE
            }));
        }
        assert!(total.preemptions > 100, "{total:?}");
        assert_eq!(total.completed, total.jobs);
    }
}

#[test]
fn every_job_is_accounted_for_in_overload() {
    use OverrunPolicy::{Abort, Queue, Skip};
    for overrun in [Queue, Skip, Abort] {
        let mut total = Account::default();
        for number in 0..4 {
            for policy in [Policy::StaticPriority, Policy::Edf] {
                let on_four = Case {
                    round: number,
                    load: 130,
                    policy,
                    overrun,
                    ..CASE
                };
                let on_two = Case {
                    cores: 2,
                    preemption: Preemption::Disabled,
                    ..on_four
                };
                total.add(&round(on_four));
                total.add(&round(on_two));
            }
        }
        assert_eq!(total.skips > 0, overrun != Queue, "{total:?}");
        assert_eq!(total.aborts > 0, overrun == Abort, "{total:?}");
        assert!(total.misses > 0, "{total:?}");
    }
}

#[test]
fn the_largest_set_can_be_committed_and_run() {
    let machine = VirtualTime::new().cores(4);
    let mut executed = Executed::default();
    let dags = build(
        &largest_set(),
        Duration::ZERO,
        OverrunPolicy::Queue,
        &Trouble::default(),
        &mut executed,
    );
    finish_create_dags_with(&dags, ConstructionPolicy::any_graph())
        .expect("a drawn set has no fault");
    let report = machine.run();
    assert_eq!((report.jobs.len(), executed.instances()), (8, 96));
}
