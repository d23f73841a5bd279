//! A program that installs no platform. The only test of its program, because
//! an installed platform cannot be removed.

use core::time::Duration;
use std::panic::catch_unwind;

use fass::commit::Fault;
use fass::{SubtaskAttributes, create_dag, finish_create_dags};

#[test]
fn a_commit_without_platform_says_so_together_with_all_other_faults() {
    let dag = create_dag();
    dag.name("lonely");
    let period = Duration::from_millis(10);
    dag.register_periodic_subtask(|| (1,), vec![], period, SubtaskAttributes::named("source"));
    let error = finish_create_dags(&[dag]).expect_err("no platform");
    let codes: Vec<_> = error.faults().iter().map(Fault::code).collect();
    assert_eq!(codes[0], "no_platform");
    assert!(codes.contains(&"output_arity"), "{codes:?}");

    for result in [
        catch_unwind(|| assert_eq!(fass::now_ns(), 0)),
        catch_unwind(|| fass::execute_for(period, fass::Occupation::Spin)),
    ] {
        let payload = result.expect_err("it panics");
        let message = payload.downcast_ref::<&str>().copied().unwrap_or_default();
        assert!(message.starts_with("no platform is installed"), "{message}");
    }
}
