//! The DAGs, and what flows between them.

use alloc::vec;
use core::time::Duration;

use common::random::Random;
use fass::{Dag, Latest, Occupation, Sample, SubtaskAttributes, create_dag, execute_for};

use crate::car::{Car, brake};
use crate::features::{Features, find, smooth};
use crate::image::{Image, Pool};
use crate::road::{Side, draw};
use crate::stereo::distance;
use crate::{Drive, FRAME, STEP, Workload};

/// The WCETs in microseconds, with room above what was observed on four cores in mode
/// `deterministic`, where all of them share one clock (`./scripts/run --app vision --cores 4`).
pub const WCETS: [(&str, u64); 10] = [
    ("expose", 100),
    ("left", 4_000),
    ("right", 4_000),
    ("smooth_left", 1_500),
    ("smooth_right", 1_500),
    ("features_left", 5_000),
    ("features_right", 5_000),
    ("fuse", 6_000),
    ("decide", 100),
    ("move", 100),
];

/// A pool's images: one for each job in flight, one that a later subtask may still read, one
/// that is being filled.
const IMAGES: usize = 4;

/// The vehicle's DAGs, and what is known of the drive when they have ended.
#[derive(Debug)]
pub struct System {
    /// In the order of the table above.
    pub dags: [Dag; 2],
    /// The figures.
    pub drive: Drive,
}

impl Workload {
    /// Builds the DAGs.
    #[must_use]
    pub fn build(self) -> System {
        let figures = Drive::default();
        let [stereo, drive] = [("stereo", FRAME), ("drive", STEP)].map(|(name, period)| {
            let dag = create_dag();
            dag.name(name).relative_deadline(period).demand_proof();
            let jobs = Duration::from_secs(self.seconds).as_nanos() / period.as_nanos();
            dag.jobs(u64::try_from(jobs).unwrap_or(u64::MAX).max(1));
            dag
        });
        let gap = drive.latest("gap");
        let seen = stereo.latest("distance");
        self.register_stereo(&stereo, &gap, &figures);
        self.register_drive(&drive, &seen, &figures);
        System {
            dags: [stereo, drive],
            drive: figures,
        }
    }

    fn register_stereo(self, dag: &Dag, gap: &Latest<f32>, figures: &Drive) {
        let expose = move |gap: Seen<'_, f32>| {
            self.spend("expose");
            (gap.map_or(Car::new().gap, |gap| *gap.value),)
        };
        dag.using(gap.sample()).register_periodic_subtask(
            expose,
            vec!["truth"],
            FRAME,
            taking("expose"),
        );
        let names = ["left", "smooth_left", "features_left"];
        let topics = ["raw left", "image left", "features left"];
        self.register_camera(dag, Side::Left, names, topics);
        let names = ["right", "smooth_right", "features_right"];
        let topics = ["raw right", "image right", "features right"];
        self.register_camera(dag, Side::Right, names, topics);

        let figures = figures.clone();
        type Seeing = (f32, Image, Features, Image, Features);
        let fuse = move |(truth, left, of_left, right, of_right): Seeing| {
            self.spend("fuse");
            let seen = distance([&left, &right], [&of_left, &of_right]);
            figures.fused(truth, seen);
            (seen,)
        };
        let inputs = vec![
            "truth",
            "image left",
            "features left",
            "image right",
            "features right",
        ];
        dag.register_subtask(fuse, inputs, vec!["distance"], taking("fuse"));
    }

    /// Registers what a camera's image goes through.
    fn register_camera(self, dag: &Dag, side: Side, names: [&'static str; 3], topics: [&str; 3]) {
        let [capturing, smoothing, finding] = names;
        let [raw, image, features] = topics;
        let mut noise = Random::new(self.seed ^ side as u64);
        let mut pool = Pool::new(IMAGES);
        let capture = move |(truth,): (f32,)| {
            self.spend(capturing);
            (pool.fill(|pixels| draw(pixels, truth, side, &mut noise)),)
        };
        dag.register_subtask(capture, vec!["truth"], vec![raw], taking(capturing));

        let mut pool = Pool::new(IMAGES);
        let soften = move |(raw,): (Image,)| {
            self.spend(smoothing);
            (pool.fill(|pixels| smooth(&raw, pixels)),)
        };
        dag.register_subtask(soften, vec![raw], vec![image], taking(smoothing));

        let search = move |(image,): (Image,)| {
            self.spend(finding);
            (find(&image),)
        };
        dag.register_subtask(search, vec![image], vec![features], taking(finding));
    }

    fn register_drive(self, dag: &Dag, distance: &Latest<Option<f32>>, figures: &Drive) {
        let car = dag.state("car", Car::new());
        let decide = move |(distance, car): (Seen<'_, Option<f32>>, &Car)| {
            self.spend("decide");
            let seen = distance.and_then(|of| Some(((*of.value)?, seconds(of.age_ns()))));
            (brake(car.speed, seen),)
        };
        dag.using((distance.sample(), car.read()))
            .register_periodic_subtask(decide, vec!["deceleration"], STEP, taking("decide"));
        let figures = figures.clone();
        let proceed = move |car: &mut Car, (deceleration,): (f32,)| {
            self.spend("move");
            car.step(deceleration, STEP.as_secs_f32());
            figures.moved(car.gap, car.speed);
            (car.gap,)
        };
        dag.using(car.update()).register_subtask(
            proceed,
            vec!["deceleration"],
            vec!["gap"],
            taking("move"),
        );
    }

    /// Takes a subtask's WCET, if that is what subtasks do.
    fn spend(self, subtask: &str) {
        if self.takes_wcet {
            execute_for(wcet(subtask), Occupation::Hold);
        }
    }
}

/// The latest value, if there has been one.
type Seen<'a, T> = Option<Sample<'a, T>>;

fn wcet(subtask: &str) -> Duration {
    let found = WCETS.iter().find(|(name, _)| *name == subtask);
    Duration::from_micros(found.expect("it is in the table").1)
}

fn taking(subtask: &str) -> SubtaskAttributes {
    SubtaskAttributes::named(subtask).wcet(wcet(subtask))
}

#[allow(clippy::cast_precision_loss, reason = "an age is well below 2^24 ms")]
fn seconds(ns: u64) -> f32 {
    ns as f32 / 1e9
}
