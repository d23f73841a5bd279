//! The only fault of a program without a platform, with its text in the page `docs/errors.md`. It
//! is the only test of its program, because an installed platform cannot be removed.

use std::panic::catch_unwind;
use std::time::Duration;

use fass::commit::CommitError;
use fass::{SubtaskAttributes, create_dag, finish_create_dags};
use harness::fault_page::{self, documented_faults};

fn no_platform() -> Result<fass::commit::Commit, CommitError> {
    // No `VirtualTime::new()` before this.
    let dag = create_dag();
    let period = Duration::from_millis(10);
    let read = SubtaskAttributes::named("read");
    dag.register_periodic_subtask(|| (1_u32,), vec!["points"], period, read);
    let store = SubtaskAttributes::named("store");
    dag.register_sink_subtask(|(_,): (u32,)| (), vec!["points"], period, store);
    finish_create_dags(&[dag])
}

#[test]
fn a_commit_without_platform_is_refused_as_documented() {
    let error = no_platform().expect_err("there is none");
    assert_eq!(error.faults()[0].code(), "no_platform");
    let documented = documented_faults();
    let text = &documented["no_platform"];
    fault_page::assert_is("no_platform", text, &error.to_string());
    for result in [
        catch_unwind(|| assert_eq!(fass::now_ns(), 0)),
        catch_unwind(|| fass::execute_for(Duration::ZERO, fass::Occupation::Spin)),
    ] {
        let payload = result.expect_err("it panics");
        let message = payload.downcast_ref::<&str>().copied().unwrap_or_default();
        assert!(message.starts_with("no platform is installed"), "{message}");
    }
}
