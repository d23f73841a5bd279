//! Rounds in virtual time: the sets that the machine gets, under every policy.

use std::time::Duration;

use fass::{ConstructionPolicy, OverrunPolicy, Policy, Preemption, finish_create_dags_with};
use soak::{Account, Executed, build, draw_set, largest_set};
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
    let machine = VirtualTime::new()
        .cores(cores)
        .policy(policy)
        .preemption(preemption);
    let executed = Executed::default();
    let plans = draw_set(1, round, load, cores);
    let dags = build(&plans, LENGTH, overrun, &executed);
    finish_create_dags_with(&dags, ConstructionPolicy::any_graph())
        .expect("a drawn set has no fault");
    let report = machine.run();
    let case = format!("round {round}, load {load}, {policy:?}, {preemption:?}, {overrun:?}");
    assert_eq!(report.violations(), [], "{case}");
    let statistics = |dag: sched_dag::DagId| &report.statistics[dag.index()];
    let (account, discrepancies) =
        Account::of_run(report.task_set(), &report.record(), statistics, &executed);
    assert_eq!(discrepancies, [], "{case}");
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
    let executed = Executed::default();
    let dags = build(
        &largest_set(),
        Duration::ZERO,
        OverrunPolicy::Queue,
        &executed,
    );
    finish_create_dags_with(&dags, ConstructionPolicy::any_graph())
        .expect("a drawn set has no fault");
    let report = machine.run();
    assert_eq!((report.jobs.len(), executed.instances()), (8, 96));
}
