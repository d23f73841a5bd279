//! Signals that release sporadic DAGs, in virtual time.

mod support;

use support::run;

use fass::create_dag;
use support::sharing::{ms, named};
use virtual_time::VirtualTime;

#[test]
fn a_subtask_cannot_raise_a_signal_behind_the_models_back() {
    let machine = VirtualTime::new().contain_panics();
    let answers = create_dag();
    answers.relative_deadline(ms(5));
    let event = answers.sporadic(ms(15));
    answers.source(|| ()).register(named("answer"));
    let asks = create_dag();
    asks.jobs(1).relative_deadline(ms(10));
    asks.register_periodic_subtask(move || event.raise(), vec![], ms(10), named("ask"));
    let report = run(&machine, &[answers, asks]);
    assert!(
        report.panics[0]
            .message
            .contains("dag.using(signal.raising())")
    );
}
