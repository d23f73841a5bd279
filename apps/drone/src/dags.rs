//! The DAGs, and the values flowing between them.

use core::time::Duration;

use fass::shared::{Latest, Mode, ModeSwitch, Modes, Parameter};
use fass::shared::{Raiser, Sample, Signal};
use fass::{Dag, FaultLimit, Occupation, OverrunPolicy};
use fass::{SubtaskAttributes, create_dag, execute_for};
use maths::{acos, sqrt};
use random::Random;

use crate::airframe::{Airframe, Pose, RotorForce, SensorReadings, Vector, rotation};
use crate::attitude::{AttitudeEstimate, control};
use crate::camera::{Image, PositionFix, capture, detect, locate};
use crate::{FRAME, Flight, PERIOD, SECONDS, Workload};

/// The WCETs in microseconds: at least three times the times observed on four cores in mode
/// `deterministic`, where all cores share one clock (`./scripts/run --app drone --cores 4`). The
/// WCETs for images have room for a build without optimization.
pub const WCETS: [(&str, u64); 12] = [
    ("measure", 60),
    ("estimate", 60),
    ("control", 60),
    ("move", 60),
    ("capture", 1_500),
    ("detect", 500),
    ("locate", 60),
    ("drain", 60),
    ("watch", 60),
    ("decide", 240),
    ("descend", 60),
    ("alarm", 60),
];

/// The places to fly to, above the beacon's surroundings.
const WAYPOINTS: [Vector; 4] = [
    [1.0, 0.0, 3.0],
    [1.0, 1.0, 3.0],
    [-0.5, 1.0, 2.5],
    [0.0, 0.0, 3.0],
];

/// The place to wait for the first decision.
const START: Vector = [0.0, 0.0, 3.0];

/// The height of the standing airframe, in m.
const GROUND: f64 = 0.5;

/// The loss of height between two jobs of `descent`, in m.
const STEP: f64 = 0.075;

/// The battery's initial charge, as thrust times time in N s; hovering takes 11.8 a second.
const CHARGE: f64 = 130.0;

/// The drone's DAGs, and the figures of the flight when the DAGs have ended.
pub struct DroneSystem {
    /// The DAGs, in the order of the crate's table.
    pub dags: [Dag; 7],
    /// The percentage of charge below which the drone comes down.
    pub reserve: Parameter<u32>,
    /// The figures of the flight.
    pub flight: Flight,
}

impl Workload {
    /// Builds the DAGs.
    pub fn build(self) -> DroneSystem {
        let flight = Flight::default();
        let [attitude, camera, battery, mission, command, descent, safety] = [
            ("attitude", PERIOD),
            ("camera", FRAME),
            ("battery", Duration::from_millis(100)),
            ("mission", Duration::from_millis(50)),
            ("command", Duration::from_millis(200)),
            ("descent", Duration::from_millis(50)),
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
            is_low: battery.latest("is_low"),
            goal: command.latest("goal"),
            height: descent.latest("height"),
        };
        let modes = Modes::new();
        modes.mode("flight", &[&camera, &mission]);
        let landing = modes.mode("landing", &[&descent]);
        let reserve = Parameter::new("reserve", 35, 5..=95);
        self.register_attitude(&attitude, &views, &flight);
        self.register_camera(&camera, &views, &flight);
        let changed = self.register_command(&command, &views, &landing, &flight);
        self.register_battery(&battery, &views, &changed, &reserve);
        self.register_mission(&mission, &views, &changed);
        self.register_descent(&descent, &views);
        let alarm = self.register_safety(&safety, &landing, &flight);
        for dag in [&camera, &battery, &mission, &command] {
            dag.on_fault(&alarm);
        }
        DroneSystem {
            dags: [attitude, camera, battery, mission, command, descent, safety],
            reserve,
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
        dag.period(PERIOD)
            .using(airframe.read())
            .source(measure)
            .writes(&["measured"])
            .register(taking("measure"));

        let mut believed: Option<AttitudeEstimate> = None;
        let estimate = move |(measured,): (SensorReadings,)| {
            self.spend("estimate");
            let estimate = match believed {
                Some(estimate) => estimate.update(&measured),
                None => AttitudeEstimate::new(&measured),
            };
            believed = Some(estimate);
            (estimate,)
        };
        dag.register_subtask(estimate, ["measured"], ["estimate"], taking("estimate"));

        type Ahead<'a> = (Seen<'a, PositionFix>, Seen<'a, Vector>, Seen<'a, f64>);
        let control = move |(fix, goal, height): Ahead<'_>, (estimate,): (AttitudeEstimate,)| {
            self.spend("control");
            // A landing has no fix: the camera rests.
            if let Some(height) = height {
                return (control(&estimate, None, [0.0, 0.0, *height.value]),);
            }
            let fix = fix.map(|fix| (*fix.value, seconds(fix.age_ns())));
            let goal = goal.map_or(START, |goal| *goal.value);
            (control(&estimate, fix, goal),)
        };
        let uses = (
            views.fix.sample(),
            views.goal.sample(),
            views.height.sample(),
        );
        dag.using(uses)
            .subtask(control)
            .reads(&["estimate"])
            .writes(&["force"])
            .register(taking("control"));

        let flight = flight.clone();
        let proceed = move |airframe: &mut Airframe, (force,): (RotorForce,)| {
            self.spend("move");
            airframe.step(force, SECONDS);
            let upright = rotation(airframe.pose.angles)[2][2].min(1.0);
            flight.moved(acos(upright), airframe.pose.position[2]);
            (airframe.pose,)
        };
        dag.using(airframe.update())
            .subtask(proceed)
            .reads(&["force"])
            .writes(&["pose"])
            .register(taking("move"));
    }

    fn register_camera(self, dag: &Dag, views: &Views, flight: &Flight) {
        let take = move |(pose, estimate): (Seen<'_, Pose>, Seen<'_, AttitudeEstimate>)| {
            self.spend("capture");
            let pose = pose.map_or(Airframe::new().pose, |pose| *pose.value);
            let estimate = estimate.map(|estimate| *estimate.value);
            (capture(&pose), (pose, estimate))
        };
        dag.period(FRAME)
            .using((views.pose.sample(), views.estimate.sample()))
            .source(take)
            .writes(&["image", "taken"])
            .register(taking("capture"));

        // Beyond its WCET, frames are skipped; beyond its budget the camera is at fault.
        let slow = taking("detect").budget(Duration::from_millis(100));
        // A restart counts frames from 0, so `detect` fails again after as many.
        let make = move || {
            let mut frame = 0;
            move |(image,): (Image,)| {
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
            }
        };
        if self.survived > 0 {
            dag.survive_faults(FaultLimit::new(1, 30, self.survived));
            dag.restarting(make)
                .reads(&["image"])
                .writes(&["beacon"])
                .register(slow);
        } else {
            dag.register_subtask(make(), ["image"], ["beacon"], slow);
        }

        let flight = flight.clone();
        let mut fix: Option<PositionFix> = None;
        let locate = move |(beacon, (truth, estimate)): (Option<(f32, f32)>, Taken)| {
            self.spend("locate");
            let seen = beacon
                .zip(estimate)
                .map(|(beacon, estimate)| locate(beacon, &estimate));
            flight.located(seen, &truth);
            if let Some(position) = seen {
                let begun = PositionFix {
                    position,
                    ..PositionFix::default()
                };
                fix = Some(fix.map_or(begun, |fix| fix.update(position, FRAME.as_secs_f64())));
            }
            (fix.unwrap_or_default(),)
        };
        dag.register_subtask(locate, ["beacon", "taken"], ["fix"], taking("locate"));
    }

    fn register_command(self, dag: &Dag, views: &Views, landing: &Mode, flight: &Flight) -> Signal {
        let flight = flight.clone();
        let mut ahead = WAYPOINTS.into_iter().cycle();
        let mut goal = START;
        let decide = move |(is_low, mut landing): (Seen<'_, bool>, ModeSwitch<'_>)| {
            self.spend("decide");
            let lands = is_low.is_some_and(|is_low| *is_low.value);
            flight.decided(lands);
            if lands {
                landing.when_idle(); // after the frame in hand
            } else {
                goal = ahead.next().unwrap_or(START);
            }
            (goal,)
        };
        let uses = (views.is_low.sample(), landing.entering());
        dag.using(uses)
            .source(decide)
            .writes(&["goal"])
            .register(taking("decide"));
        dag.sporadic(Duration::from_millis(200))
    }

    fn register_descent(self, dag: &Dag, views: &Views) {
        let mut ahead = None;
        let descend = move |estimate: Seen<'_, AttitudeEstimate>| {
            self.spend("descend");
            let height = ahead.or(estimate.map(|estimate| estimate.value.height));
            let height = (height.unwrap_or(START[2]) - STEP).max(GROUND);
            ahead = Some(height);
            (height,)
        };
        dag.period(Duration::from_millis(50))
            .using(views.estimate.sample())
            .source(descend)
            .writes(&["height"])
            .register(taking("descend"));
    }

    fn register_safety(self, dag: &Dag, landing: &Mode, flight: &Flight) -> Signal {
        let flight = flight.clone();
        let alarm = move |mut landing: ModeSwitch<'_>| {
            self.spend("alarm");
            flight.decided(true);
            landing.at_once();
        };
        dag.using(landing.entering())
            .source(alarm)
            .register(taking("alarm"));
        dag.sporadic(PERIOD)
    }

    fn register_battery(
        self,
        dag: &Dag,
        views: &Views,
        changed: &Signal,
        reserve: &Parameter<u32>,
    ) {
        let (mut left, mut was_low) = (CHARGE, false);
        type Around<'a> = (Seen<'a, RotorForce>, Raiser<'a>, u32);
        let drain = move |(force, mut changed, reserve): Around<'_>| {
            self.spend("drain");
            left = (left - force.map_or(0.0, |force| force.value.thrust) * 0.1).max(0.0);
            let is_low = left * 100.0 < CHARGE * f64::from(reserve);
            if is_low && !was_low {
                fass::log!(Warn, "battery low", left = left, reserve = reserve);
                changed.raise();
            }
            was_low = is_low;
            (is_low,)
        };
        let uses = (views.force.sample(), changed.raising(), reserve.reading());
        dag.period(Duration::from_millis(100))
            .using(uses)
            .source(drain)
            .writes(&["is_low"])
            .register(taking("drain"));
    }

    fn register_mission(self, dag: &Dag, views: &Views, changed: &Signal) {
        let watch = move |(fix, goal, mut changed): (
            Seen<'_, PositionFix>,
            Seen<'_, Vector>,
            Raiser<'_>,
        )| {
            self.spend("watch");
            let Some(fix) = fix else { return };
            let [x, y, _] = goal.map_or(START, |goal| *goal.value);
            let (x, y) = (x - fix.value.position[0], y - fix.value.position[1]);
            if sqrt(x * x + y * y) < 0.15 {
                changed.raise();
            }
        };
        let uses = (views.fix.sample(), views.goal.sample(), changed.raising());
        dag.period(Duration::from_millis(50))
            .using(uses)
            .source(watch)
            .register(taking("watch"));
    }

    /// Executes for a subtask's WCET, if the workload says so.
    fn spend(self, subtask: &str) {
        if self.takes_wcet {
            execute_for(wcet(subtask), Occupation::Hold);
        }
    }
}

/// The values that DAGs sample of one another.
struct Views {
    estimate: Latest<AttitudeEstimate>,
    pose: Latest<Pose>,
    force: Latest<RotorForce>,
    fix: Latest<PositionFix>,
    is_low: Latest<bool>,
    goal: Latest<Vector>,
    height: Latest<f64>,
}

/// The true pose and the estimate at the time of an image.
type Taken = (Pose, Option<AttitudeEstimate>);

/// The latest value, if any exists yet.
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
