//! Runs on real cores obey the rules, whatever else the computer does meanwhile.
//!
//! Orders and counts are asserted, never durations.

mod support;

use fass::{SubtaskAttributes, create_dag, finish_create_dags};
use linux::Run;
use support::{alone, breaches, mechanisms, ms, spin};

fn assert_lawful(run: &Run) {
    let found = breaches(run);
    assert!(found.is_empty(), "{found:?}");
}

#[test]
fn a_chain_on_one_core_wakes_nobody() {
    const LENGTH: u64 = 12;
    const JOBS: u64 = 40;
    for mechanism in mechanisms() {
        let alone = alone(1, mechanism);
        let dag = create_dag();
        dag.name("chain")
            .jobs(JOBS)
            .period(ms(2))
            .relative_deadline(ms(2));
        let named = |link| SubtaskAttributes::named(&format!("link {link}"));
        let links: Vec<_> = (0..LENGTH)
            .map(|link| dag.register_untyped_subtask(|_job| spin(10), named(link)))
            .collect();
        for pair in links.windows(2) {
            dag.precede(&pair[0], &pair[1]);
        }
        finish_create_dags(&[dag]).unwrap();
        let run = alone.machine.run().unwrap();
        assert_lawful(&run);
        let completed = run.statistics("chain").completed;
        let counts = run.counts();
        assert!(
            counts.calls <= completed,
            "one for each release: {counts:?}"
        );
        assert!(counts.hand_offs > 0, "{counts:?}");
    }
}
