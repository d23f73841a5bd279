//! Rounds in virtual time: the sets that the machine gets, under every policy.

use std::time::Duration;

use fass::{ConstructionPolicy, OverrunPolicy, Policy, Preemption, finish_create_dags_with};
use soak::{Account, DagPlan, Executed, Trouble, build, draw_set, largest_set};
use virtual_time::VirtualTime;

const LENGTH: Duration = Duration::from_millis(400);

fn round(
    round: u64,
    load: u64,
    cores: u32,
    policy: Policy,
    preemption: Preemption,
    overrun: OverrunPolicy,
) -> Account {
    let plans = draw_set(1, round, load, cores);
    let case = (round, load, cores, policy, preemption, overrun);
    let quiet = judged(case, &plans, &Trouble::default());
    assert_eq!(quiet.faults, 0);
    let trouble = Trouble::draw(1, round, &plans, cores);
    let troubled = judged(case, &plans, &trouble);
    // Every fault that was drawn, at least where all jobs run, is in the account.
    assert!(
        troubled.faults > 0 || trouble.dags.iter().all(|dag| dag.fault.is_none()),
        "{case:?}, {trouble:?}"
    );
    quiet
}

type Case = (u64, u64, u32, Policy, Preemption, OverrunPolicy);

/// Runs a set with some trouble, in which nothing may be wrong.
fn judged(case: Case, plans: &[DagPlan], trouble: &Trouble) -> Account {
    let (_, _, cores, policy, preemption, overrun) = case;
    let machine = VirtualTime::new()
        .cores(cores)
        .policy(policy)
        .preemption(preemption)
        .clusters(&trouble.clusters)
        .contain_panics();
    let mut executed = Executed::default();
    let dags = build(plans, LENGTH, overrun, trouble, &mut executed);
    finish_create_dags_with(&dags, ConstructionPolicy::any_graph())
        .expect("a drawn set has no fault");
    let report = machine.run();
    assert_eq!(report.violations(), [], "{case:?}");
    let statistics = |dag: sched_dag::DagId| report.dag(dag).statistics();
    let (account, discrepancies) = Account::of_run(
        report.task_set(),
        &report.record(),
        statistics,
        trouble,
        &executed,
    );
    assert_eq!(discrepancies, [], "{case:?}, {trouble:?}");
    account
}

#[test]
fn every_job_is_accounted_for_at_ninety_percent() {
    for policy in [Policy::StaticPriority, Policy::Edf] {
        let mut total = Account::default();
        for number in 0..6 {
            let overrun = OverrunPolicy::Queue;
            total.add(&round(number, 90, 4, policy, Preemption::Enabled, overrun));
        }
        assert!(total.preemptions > 100, "{total:?}");
        assert_eq!(total.completed, total.jobs);
    }
}

#[test]
fn every_job_is_accounted_for_in_overload() {
    let overruns = [
        OverrunPolicy::Queue,
        OverrunPolicy::Skip,
        OverrunPolicy::Abort,
    ];
    for overrun in overruns {
        let mut total = Account::default();
        for number in 0..4 {
            for policy in [Policy::StaticPriority, Policy::Edf] {
                total.add(&round(number, 130, 4, policy, Preemption::Enabled, overrun));
                total.add(&round(
                    number,
                    130,
                    2,
                    policy,
                    Preemption::Disabled,
                    overrun,
                ));
            }
        }
        let may = |allowed: bool| if allowed { 1..=u64::MAX } else { 0..=0 };
        assert!(
            may(overrun != OverrunPolicy::Queue).contains(&total.skips),
            "{total:?}"
        );
        assert!(
            may(overrun == OverrunPolicy::Abort).contains(&total.aborts),
            "{total:?}"
        );
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
