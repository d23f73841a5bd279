//! The DAGs, and what flows between them.

use alloc::vec;
use core::time::Duration;

use common::random::Random;
use fass::{Dag, Latest, Occupation, OverrunPolicy, Raiser, Sample, Signal, SubtaskAttributes};
use fass::{create_dag, execute_for};
use maths::{acos, sqrt};

use crate::airframe::{Airframe, Force, Measured, Pose, Vector, rotation};
use crate::attitude::{Estimate, control};
use crate::camera::{Fix, Image, capture, detect, locate};
use crate::{FRAME, Flight, PERIOD, SECONDS, Workload};

/// The WCETs in microseconds: three times and more what was observed on four cores in mode
/// `deterministic`, where all of them share one clock (`./scripts/run --app drone --cores 4`).
/// The images' have room for a build without optimization.
pub const WCETS: [(&str, u64); 11] = [
    ("measure", 60),
    ("estimate", 60),
    ("control", 60),
    ("move", 60),
    ("capture", 1_500),
    ("detect", 500),
    ("locate", 60),
    ("drain", 60),
    ("watch", 60),
    ("decide", 60),
    ("alarm", 60),
];

/// Where to fly, above the beacon's surroundings.
const WAYPOINTS: [Vector; 4] = [
    [1.0, 0.0, 3.0],
    [1.0, 1.0, 3.0],
    [-0.5, 1.0, 2.5],
    [0.0, 0.0, 3.0],
];

/// Where to wait for the first decision.
const START: Vector = [0.0, 0.0, 3.0];

/// Where to come down.
const GROUND: Vector = [0.0, 0.0, 0.5];

/// What the battery has at first, in thrust and time; to hover takes 11.8 a second.
const CHARGE: f64 = 130.0;

/// With less than this part left, the drone comes down.
const LITTLE: f64 = 0.35;

/// The drone's DAGs, and what is known of the flight when they have ended.
#[derive(Debug)]
pub struct System {
    /// In the order of the table above.
    pub dags: [Dag; 6],
    /// The figures.
    pub flight: Flight,
}

impl Workload {
    /// Builds the DAGs.
    #[must_use]
    pub fn build(self) -> System {
        let flight = Flight::default();
        let [attitude, camera, battery, mission, command, safety] = [
            ("attitude", PERIOD),
            ("camera", FRAME),
            ("battery", Duration::from_millis(100)),
            ("mission", Duration::from_millis(50)),
            ("command", Duration::from_millis(200)),
            ("safety", PERIOD),
        ]
        .map(|(name, period)| {
            let dag = create_dag();
            dag.name(name).relative_deadline(period).demand_proof();
            if !["command", "safety"].contains(&name) {
                let jobs = Duration::from_secs(self.seconds).as_nanos() / period.as_nanos();
                dag.jobs(u64::try_from(jobs).unwrap_or(u64::MAX).max(1));
            }
            dag
        });
        camera.in_flight(1).overrun(OverrunPolicy::Skip);

        let views = Views {
            estimate: attitude.latest("estimate"),
            pose: attitude.latest("pose"),
            force: attitude.latest("force"),
            fix: camera.latest("fix"),
            charge: battery.latest("charge"),
            goal: command.latest("goal"),
            is_alarmed: safety.latest("is_alarmed"),
        };
        self.register_attitude(&attitude, &views, &flight);
        self.register_camera(&camera, &views, &flight);
        let changed = self.register_command(&command, &views, &flight);
        self.register_battery(&battery, &views, &changed);
        self.register_mission(&mission, &views, &changed);
        let alarm = self.register_safety(&safety, &flight);
        for dag in [&camera, &battery, &mission, &command] {
            dag.on_fault(&alarm);
        }
        System {
            dags: [attitude, camera, battery, mission, command, safety],
            flight,
        }
    }

    fn register_attitude(self, dag: &Dag, views: &Views, flight: &Flight) {
        let airframe = dag.state("airframe", Airframe::new());
        let mut noise = Random::new(self.seed);
        let measure = move |airframe: &Airframe| {
            self.spend("measure");
            (airframe.measure(&mut noise),)
        };
        dag.using(airframe.read()).register_periodic_subtask(
            measure,
            vec!["measured"],
            PERIOD,
            taking("measure"),
        );

        let mut believed: Option<Estimate> = None;
        let estimate = move |(measured,): (Measured,)| {
            self.spend("estimate");
            let estimate = match believed {
                Some(estimate) => estimate.update(&measured),
                None => Estimate::new(&measured),
            };
            believed = Some(estimate);
            (estimate,)
        };
        dag.register_subtask(
            estimate,
            vec!["measured"],
            vec!["estimate"],
            taking("estimate"),
        );

        type Ahead<'a> = (Seen<'a, Fix>, Seen<'a, Vector>, Seen<'a, bool>);
        let control = move |(fix, goal, alarm): Ahead<'_>, (estimate,): (Estimate,)| {
            self.spend("control");
            if alarm.is_some() {
                return (control(&estimate, None, GROUND),);
            }
            let fix = fix.map(|fix| (*fix.value, seconds(fix.age_ns())));
            let goal = goal.map_or(START, |goal| *goal.value);
            (control(&estimate, fix, goal),)
        };
        let uses = (
            views.fix.sample(),
            views.goal.sample(),
            views.is_alarmed.sample(),
        );
        dag.using(uses).register_subtask(
            control,
            vec!["estimate"],
            vec!["force"],
            taking("control"),
        );

        let flight = flight.clone();
        let proceed = move |airframe: &mut Airframe, (force,): (Force,)| {
            self.spend("move");
            airframe.step(force, SECONDS);
            let upright = rotation(airframe.pose.angles)[2][2].min(1.0);
            flight.moved(acos(upright), airframe.pose.position[2]);
            (airframe.pose,)
        };
        dag.using(airframe.update()).register_subtask(
            proceed,
            vec!["force"],
            vec!["pose"],
            taking("move"),
        );
    }

    fn register_camera(self, dag: &Dag, views: &Views, flight: &Flight) {
        let take = move |(pose, estimate): (Seen<'_, Pose>, Seen<'_, Estimate>)| {
            self.spend("capture");
            let pose = pose.map_or(Airframe::new().pose, |pose| *pose.value);
            let estimate = estimate.map(|estimate| *estimate.value);
            (capture(&pose), (pose, estimate))
        };
        dag.using((views.pose.sample(), views.estimate.sample()))
            .register_periodic_subtask(take, vec!["image", "taken"], FRAME, taking("capture"));

        // Beyond its WCET, frames are skipped; beyond its budget the camera is at fault.
        let slow = taking("detect").budget(Duration::from_millis(100));
        let mut frame = 0;
        let find = move |(image,): (Image,)| {
            self.spend("detect");
            assert!(
                self.fault_at != Some(frame),
                "the camera fails, as was asked for"
            );
            frame += 1;
            if !self.delay.is_zero() {
                execute_for(self.delay, Occupation::Hold);
            }
            (detect(&image),)
        };
        dag.register_subtask(find, vec!["image"], vec!["beacon"], slow);

        let flight = flight.clone();
        let mut fix: Option<Fix> = None;
        let locate = move |(beacon, (truth, estimate)): (Option<(f32, f32)>, Taken)| {
            self.spend("locate");
            let seen = beacon
                .zip(estimate)
                .map(|(beacon, estimate)| locate(beacon, &estimate));
            flight.located(seen, &truth);
            if let Some(position) = seen {
                let begun = Fix {
                    position,
                    ..Fix::default()
                };
                fix = Some(fix.map_or(begun, |fix| fix.update(position, FRAME.as_secs_f64())));
            }
            (fix.unwrap_or_default(),)
        };
        dag.register_subtask(
            locate,
            vec!["beacon", "taken"],
            vec!["fix"],
            taking("locate"),
        );
    }

    fn register_command(self, dag: &Dag, views: &Views, flight: &Flight) -> Signal {
        let flight = flight.clone();
        let mut ahead = WAYPOINTS.into_iter().cycle();
        let decide = move |charge: Seen<'_, f64>| {
            self.spend("decide");
            let lands = charge.is_some_and(|charge| *charge.value < LITTLE);
            flight.decided(lands);
            let goal = if lands { None } else { ahead.next() };
            (goal.unwrap_or(GROUND),)
        };
        dag.using(views.charge.sample()).register_sporadic_subtask(
            decide,
            vec!["goal"],
            Duration::from_millis(200),
            taking("decide"),
        )
    }

    fn register_safety(self, dag: &Dag, flight: &Flight) -> Signal {
        let flight = flight.clone();
        let alarm = move || {
            self.spend("alarm");
            flight.decided(true);
            (true,)
        };
        dag.register_sporadic_subtask(alarm, vec!["is_alarmed"], PERIOD, taking("alarm"))
    }

    fn register_battery(self, dag: &Dag, views: &Views, changed: &Signal) {
        let mut left = CHARGE;
        let drain = move |(force, mut changed): (Seen<'_, Force>, Raiser<'_>)| {
            self.spend("drain");
            let was_enough = left >= LITTLE * CHARGE;
            left = (left - force.map_or(0.0, |force| force.value.thrust) * 0.1).max(0.0);
            if was_enough && left < LITTLE * CHARGE {
                changed.raise();
            }
            (left / CHARGE,)
        };
        dag.using((views.force.sample(), changed.raising()))
            .register_periodic_subtask(
                drain,
                vec!["charge"],
                Duration::from_millis(100),
                taking("drain"),
            );
    }

    fn register_mission(self, dag: &Dag, views: &Views, changed: &Signal) {
        let watch =
            move |(fix, goal, mut changed): (Seen<'_, Fix>, Seen<'_, Vector>, Raiser<'_>)| {
                self.spend("watch");
                let Some(fix) = fix else { return };
                let [x, y, height] = goal.map_or(START, |goal| *goal.value);
                let (x, y) = (x - fix.value.position[0], y - fix.value.position[1]);
                if sqrt(x * x + y * y) < 0.15 && height > GROUND[2] {
                    changed.raise();
                }
            };
        let uses = (views.fix.sample(), views.goal.sample(), changed.raising());
        dag.using(uses).register_periodic_subtask(
            watch,
            vec![],
            Duration::from_millis(50),
            taking("watch"),
        );
    }

    /// Takes a subtask's WCET, if that is what subtasks do.
    fn spend(self, subtask: &str) {
        if self.takes_wcet {
            execute_for(wcet(subtask), Occupation::Hold);
        }
    }
}

/// The values that DAGs sample of one another.
struct Views {
    estimate: Latest<Estimate>,
    pose: Latest<Pose>,
    force: Latest<Force>,
    fix: Latest<Fix>,
    charge: Latest<f64>,
    goal: Latest<Vector>,
    is_alarmed: Latest<bool>,
}

/// What an image was taken from, and what was believed then.
type Taken = (Pose, Option<Estimate>);

/// The latest value, if there has been one.
type Seen<'a, T> = Option<Sample<'a, T>>;

fn wcet(subtask: &str) -> Duration {
    let found = WCETS.iter().find(|(name, _)| *name == subtask);
    Duration::from_micros(found.expect("it is in the table").1)
}

fn taking(subtask: &str) -> SubtaskAttributes {
    SubtaskAttributes::named(subtask).wcet(wcet(subtask))
}

#[allow(clippy::cast_precision_loss, reason = "an age is well below 2^53 ns")]
fn seconds(ns: u64) -> f64 {
    ns as f64 / 1e9
}
