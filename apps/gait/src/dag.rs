//! The DAG.

use alloc::vec;
use core::time::Duration;

use fass::{Dag, SubtaskAttributes, create_dag};
use recording::{Mismatch, Recording};

use crate::filter::{Quaternion, START, after, conjugate, product};
use crate::{DAG, PERIOD, Sample, Sensor, TOPIC, Walk};

/// Each WCET: several times what was observed on two cores in mode `deterministic`.
const WCET: Duration = Duration::from_micros(50);

/// Takes what one sensor measured.
type Take = fn(&Sample) -> &Sensor;

/// Builds the DAG, which runs the jobs of a recording up to its last sample, and the place of its
/// results.
///
/// # Errors
///
/// The recording has no samples of ours.
pub fn build(recording: &Recording<'static>) -> Result<(Dag, Walk), Mismatch> {
    let mut samples = recording.values::<Sample>(DAG, TOPIC)?;
    let jobs = samples.clone().last().map_or(0, |(job, _)| job + 1);
    let count = samples.clone().count();
    let walk = Walk::new(count);
    let dag = create_dag();
    dag.name(DAG).jobs(jobs).demand_proof();
    (dag.record::<Sample>(TOPIC))
        .record::<Quaternion>("upper")
        .record::<Quaternion>("lower");
    let taking = |name| SubtaskAttributes::named(name).wcet(WCET);
    let read = move || {
        let (_, sample) = samples.next().expect("there is a job for each sample");
        (sample,)
    };
    dag.register_periodic_subtask(read, vec![TOPIC], PERIOD, taking("read"));

    let legs: [(_, Take); 2] = [
        ("upper", |sample| &sample.upper),
        ("lower", |sample| &sample.lower),
    ];
    for (leg, sensor) in legs {
        let orientation = dag.state(leg, START);
        orientation.record();
        let filter = move |orientation: &mut Quaternion, (sample,): (Sample,)| {
            *orientation = after(*orientation, sensor(&sample));
            (*orientation,)
        };
        dag.using(orientation.update())
            .subtask(filter)
            .reads(&[TOPIC])
            .writes(&[leg])
            .register(taking(leg));
    }

    let (results, mut row) = (walk.clone(), 0);
    let knee = move |(upper, lower): (Quaternion, Quaternion)| {
        results.store(row, [upper, lower, product(conjugate(upper), lower)]);
        row += 1;
    };
    dag.register_sink_subtask(knee, ["upper", "lower"], PERIOD, taking("knee"));
    Ok((dag, walk))
}
