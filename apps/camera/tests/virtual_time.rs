//! The camera in virtual time: bounds hold whatever the accelerator does.

use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;

use camera::{Conduct, Detection, build};
use fass::finish_create_dags;
use virtual_time::{Report, VirtualTime};

/// Runs it on so many cores, and returns the report with the counts: answered, late, refused.
fn ran(cores: u32, conduct: Conduct, detection: Detection) -> (Report, [u64; 3]) {
    let machine = VirtualTime::new().cores(cores).contain_panics();
    let (dags, counts) = build(50, 1, conduct, detection);
    let commit = finish_create_dags(&dags).expect("it is sound");
    let bounds: Vec<_> = (commit.answers().iter())
        .map(|answer| answer.verdict.bound())
        .collect();
    let report = machine.run();
    assert_eq!(report.violations(), []);
    for job in &report.jobs {
        let bound = bounds[job.dag.index()].expect("each has a proof");
        let response = job.response_time_ns().map(Duration::from_nanos);
        assert!(response.is_none_or(|response| response <= bound));
    }
    let counts = [&counts.answered, &counts.late, &counts.refused];
    (report, counts.map(|count| count.load(Relaxed)))
}

#[test]
fn each_frame_has_an_answer_or_a_limit_and_no_bound_is_exceeded() {
    for cores in [1, 2, 4] {
        let (report, [answered, late, refused]) = ran(cores, Conduct::Random, Detection::Asks);
        assert!(
            answered > 10 && late > 5,
            "{answered} answered, {late} late"
        );
        assert_eq!((answered + late, refused), (50, late));
        assert_eq!(report.dag("control").statistics().misses, 0);
        assert_eq!(report.dag("camera").statistics().misses, 0);
    }
}

#[test]
fn a_second_answer_is_refused_and_a_silent_device_costs_its_limit() {
    let (_, [answered, late, refused]) = ran(1, Conduct::Twice, Detection::Asks);
    assert_eq!(refused, answered + 2 * late);
    assert_eq!(ran(1, Conduct::Silent, Detection::Asks).1, [0, 50, 0]);
    assert_eq!(ran(2, Conduct::Random, Detection::Skips).1, [0, 50, 0]);
}

#[test]
fn a_future_that_never_ends_is_a_fault_of_its_dag_alone() {
    let (report, counts) = ran(2, Conduct::Random, Detection::Hangs);
    assert_eq!(counts, [0; 3]);
    assert!(report.panics[0].message.starts_with("a foreign wait"));
    assert_eq!(report.dag("camera").statistics().completed, 0);
    assert_eq!(report.dag("control").statistics().completed, 1000);
}
