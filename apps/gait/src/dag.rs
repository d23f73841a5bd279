//! The DAG, and the result of a walk: the orientations after each sample.

use alloc::sync::Arc;
use alloc::vec;
use core::sync::atomic::{AtomicU64, Ordering::Relaxed};
use core::time::Duration;

use fass::{Dag, SubtaskAttributes, create_dag};
use maths::acos;
use recording::{Mismatch, Recording};

use crate::filter::{Quaternion, START, after, conjugate, product};
use crate::{DAG, PERIOD, Sample, Sensor, TOPIC};

/// Each WCET: several times the times observed on two cores in mode `deterministic`.
const WCET: Duration = Duration::from_micros(50);

/// Selects the measurements of one sensor.
type Take = fn(&Sample) -> &Sensor;

/// Builds the DAG, which runs the jobs of a recording up to the last sample, and the place of the
/// DAG's results.
///
/// # Errors
///
/// The recording has no samples of type `Sample`.
pub fn build(recording: &Recording<'static>) -> Result<(Dag, WalkOrientations), Mismatch> {
    let mut samples = recording.values::<Sample>(DAG, TOPIC)?;
    let jobs = samples.clone().last().map_or(0, |(job, _)| job + 1);
    let count = samples.clone().count();
    let walk = WalkOrientations::new(count);
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

/// The count of numbers in a row: upper leg, lower leg, knee.
const OF_A_ROW: usize = 12;

/// The orientations after each sample. The DAG only writes orientations, so they order no subtasks.
#[derive(Clone, Debug)]
pub struct WalkOrientations(Arc<[AtomicU64]>);

impl WalkOrientations {
    /// Makes room for the rows of the given number of samples.
    pub fn new(samples: usize) -> Self {
        Self((0..samples * OF_A_ROW).map(|_| AtomicU64::new(0)).collect())
    }

    /// Stores a row; a row without room is left out.
    pub(crate) fn store(&self, row: usize, parts: [Quaternion; 3]) {
        let places = self.0.chunks_exact(OF_A_ROW).nth(row).unwrap_or_default();
        for (place, number) in places.iter().zip(parts.as_flattened()) {
            place.store(number.to_bits(), Relaxed);
        }
    }

    /// Returns the rows: w, x, y and z of the upper leg, the lower leg and the knee.
    pub fn rows(&self) -> impl ExactSizeIterator<Item = [f64; OF_A_ROW]> {
        (self.0.chunks_exact(OF_A_ROW))
            .map(|row| core::array::from_fn(|number| f64::from_bits(row[number].load(Relaxed))))
    }

    /// Returns the angles of the knee, in degrees.
    pub fn knee_degrees(&self) -> impl Iterator<Item = f64> {
        (self.rows()).map(|row| (2.0 * acos(row[8].abs().min(1.0))).to_degrees())
    }

    /// Returns a hash of all bits (FNV-1a with 64 bits, over whole words): walks with equal hashes
    /// are almost certainly equal.
    pub fn digest(&self) -> u64 {
        let words = self.0.iter().map(|word| word.load(Relaxed));
        words.fold(0xcbf2_9ce4_8422_2325, |hash, word| {
            (hash ^ word).wrapping_mul(0x0000_0100_0000_01b3)
        })
    }
}
