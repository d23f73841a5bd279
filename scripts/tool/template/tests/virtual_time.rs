//! The app on the host, in virtual time: the same functions, the same
//! scheduler, and every run gives the same times.

use fass::{Policy, finish_create_dags};
use virtual_time::VirtualTime;

#[test]
fn every_job_is_in_time_and_within_its_bound() {
    let machine = VirtualTime::new().cores(2).policy(Policy::Edf);
    let commit = finish_create_dags(&app_template::build(200)).expect("the DAG is sound");
    let answer = commit.answer("app-template");
    let bound = answer.verdict.bound().expect("it is proven");
    assert!(bound <= app_template::PERIOD);

    let report = machine.run();
    assert_eq!(report.violations(), []);
    let ran = report.dag("app-template");
    let counts = ran.statistics();
    assert_eq!((counts.completed, counts.misses), (200, 0));
    for job in ran.jobs() {
        let response_time_ns = job.response_time_ns().expect("it is complete");
        assert!(u128::from(response_time_ns) <= bound.as_nanos());
    }
}
