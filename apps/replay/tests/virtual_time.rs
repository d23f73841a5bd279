//! The DAGs that are built of the public cases, in virtual time: the schedule
//! is the expected one, to the nanosecond.

use fass::{ConstructionPolicy, finish_create_dags_with};
use replay::{Case, Epoch, Scale, build, parse};
use virtual_time::VirtualTime;

const PUBLIC: [(&str, usize); 2] = [
    (include_str!("../../../tests/oracle/schedules.txt"), 40),
    (include_str!("../../../tests/oracle/clusters.txt"), 30),
];

#[test]
fn all_public_cases_run_as_expected() {
    for (text, count) in PUBLIC {
        let cases = parse(text).expect("the file is well formed");
        assert_eq!(cases.len(), count);
        for case in &cases {
            runs_as_expected(case, 1000);
        }
    }
}

fn runs_as_expected(case: &Case, unit_ns: u64) {
    let machine = VirtualTime::new()
        .cores(case.cores)
        .clusters(case.clusters.sizes())
        .policy(case.policy)
        .preemption(case.preemption);
    let scale = Scale {
        unit_ns,
        guard_ns: 0,
    };
    let dags = build(case, scale, &Epoch::default(), None).expect("short times");
    finish_create_dags_with(&dags, ConstructionPolicy::any_graph()).expect("any graph is right");
    let report = machine.run();
    assert_eq!(report.violations().len(), 0, "{}", case.name);
    assert_eq!(report.instances.len(), case.instances.len());
    for times in &report.instances {
        let dag = &case.dags[times.instance.dag.index()];
        let job = usize::try_from(times.instance.job).expect("few jobs");
        let expected = case.instances[dag.position(job, times.instance.subtask.index())];
        let place = format!("{} {}", case.name, times.instance);
        assert_eq!(times.start_ns, Some(expected.start_ns * unit_ns), "{place}");
        let finish_ns = Some(expected.finish_ns * unit_ns);
        assert_eq!(times.finish_ns, finish_ns, "{place}");
        let preemptions = u64::from(times.preemptions);
        assert_eq!(preemptions, expected.preemptions, "{place}");
    }
}
