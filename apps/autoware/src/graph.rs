//! The six DAGs, and the subtasks' pieces of work, which take drawn times.

use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;
use core::cell::Cell;
use core::sync::atomic::{AtomicU64, Ordering};
use core::time::Duration;

use fass::shared::{Latest, Sample};
use fass::{Dag, SubtaskAttributes, create_dag, execute_for};
use random::Random;

use crate::{WCET_OF_ENDS, Workload};

/// The lidar job from which a value originates, if any: the type of all topics.
pub type Origin = Option<u64>;

/// The argument of a sampling function.
type Sampled<'a> = Option<Sample<'a, Origin>>;

/// The periods of the drivers and of the planner's timer.
const LIDAR: Duration = Duration::from_millis(100);
const MAP: Duration = Duration::from_millis(120);
const SETTINGS: Duration = Duration::from_millis(25);
const VISUALIZER: Duration = Duration::from_millis(60);

/// The built system, before its commit.
pub struct AutowareSystem {
    /// The DAGs: `lidar`, `map`, `settings`, `visualizer`, `route`, `behaviour`.
    pub dags: Vec<Dag>,
    /// For each job of `behaviour`, the lidar job whose obstacles it has acted on; `u64::MAX`:
    /// none.
    pub acted_on: Arc<[AtomicU64]>,
}

/// The recorded topics of each DAG: first the topics of its sources, sent by a replay; then topics
/// sampled by other DAGs, and results.
const RECORDED: [&[&str]; 6] = [
    &[
        "FrontLidarDriver",
        "RearLidarDriver",
        "NDTLocalizer",
        "ObjectCollisionEstimator",
        "EuclideanIntersection",
    ],
    &["PointCloudMap", "PointCloudMapLoader"],
    &["EuclideanClusterSettings"],
    &["Visualizer"],
    &[
        "Lanelet2Map",
        "Lanelet2GlobalPlanner",
        "Lanelet2MapLoader",
        "ParkingPlanner",
        "LanePlanner",
    ],
    &["BehaviorPlanner", "VehicleInterface"],
];

impl AutowareSystem {
    /// Records the topics that a replay needs, and the topics that a replay compares. Recording and
    /// replaying take a quarter of the image.
    pub fn record(&self) {
        for (dag, topics) in self.dags.iter().zip(RECORDED) {
            for topic in topics {
                dag.record::<Origin>(topic);
            }
        }
    }

    /// Returns a hash (FNV-1a, over words) that almost certainly differs if the vehicle has acted
    /// on other lidar jobs.
    pub fn digest(&self) -> u64 {
        let words = self.acted_on.iter().map(|job| job.load(Ordering::Relaxed));
        words.fold(0xcbf2_9ce4_8422_2325, |hash, word| {
            (hash ^ word).wrapping_mul(0x0000_0100_0000_01b3)
        })
    }
}

/// Builds subtasks one after the other, each with its own execution times.
struct GraphBuilder<'w> {
    workload: &'w Workload,
    subtasks: Cell<u64>,
}

impl Workload {
    /// Builds the six DAGs.
    pub fn build(&self) -> AutowareSystem {
        let build = GraphBuilder {
            workload: self,
            subtasks: Cell::new(0),
        };
        let (map, point_cloud_map) = build.map();
        let (settings, cluster_settings) =
            build.driver("settings", "EuclideanClusterSettings", SETTINGS);
        let (visualizer, goal) = build.driver("visualizer", "Visualizer", VISUALIZER);
        let (lidar, obstacles, pose) = build.lidar(&point_cloud_map, &cluster_settings);
        let (route, routes) = build.route(&goal, &pose);
        let (behaviour, acted_on) = build.behaviour(&obstacles, &pose, &routes);
        AutowareSystem {
            dags: vec![lidar, map, settings, visualizer, route, behaviour],
            acted_on,
        }
    }
}

/// Builds parts of the graph. A part's topic has its writer's name, as in the original.
impl GraphBuilder<'_> {
    fn dag(&self, name: &str, period: Duration) -> Dag {
        let dag = create_dag();
        dag.name(name)
            .jobs(self.jobs(period))
            .relative_deadline(period);
        dag
    }

    /// Returns the number of jobs that a DAG has in the time of the lidars' jobs.
    fn jobs(&self, period: Duration) -> u64 {
        let jobs = u128::from(self.workload.jobs);
        let jobs = (jobs * LIDAR.as_nanos()).div_ceil(period.as_nanos());
        u64::try_from(jobs).unwrap_or(u64::MAX)
    }

    /// Returns the attributes and the work of a subtask with `pieces` of work.
    fn worker(&self, name: &str, pieces: u32) -> (SubtaskAttributes, SubtaskWork) {
        let crunch = SubtaskWork::new(
            self.workload,
            self.subtasks.replace(self.subtasks.get() + 1),
        );
        let wcet = self.workload.crunch * pieces;
        (SubtaskAttributes::named(name).wcet(wcet), crunch)
    }

    fn end_attributes(name: &str) -> SubtaskAttributes {
        SubtaskAttributes::named(name).wcet(WCET_OF_ENDS)
    }

    /// Registers a source that writes the origin of its values.
    fn source(
        dag: &Dag,
        name: &str,
        period: Duration,
        mut origin: impl FnMut() -> Origin + Send + 'static,
    ) {
        dag.register_periodic_subtask(
            move || (origin(),),
            vec![name],
            period,
            Self::end_attributes(name),
        );
    }

    /// Registers a transform: one input, one piece of work, one output.
    fn transform(&self, dag: &Dag, input: &str, name: &str) {
        let (attributes, mut crunch) = self.worker(name, 1);
        let transform = move |(origin,): (Origin,)| {
            crunch.work();
            (origin,)
        };
        dag.register_subtask(transform, vec![input], vec![name], attributes);
    }

    /// Registers a fusion of two topics of a DAG.
    fn fusion(&self, dag: &Dag, inputs: [&str; 2], name: &str) {
        let (attributes, mut crunch) = self.worker(name, 1);
        let fusion = move |(one, other): (Origin, Origin)| {
            crunch.work();
            (one.or(other),)
        };
        dag.register_subtask(fusion, inputs.to_vec(), vec![name], attributes);
    }

    /// Builds a DAG with a driver alone.
    fn driver(&self, dag_name: &str, name: &str, period: Duration) -> (Dag, Latest<Origin>) {
        let dag = self.dag(dag_name, period);
        Self::source(&dag, name, period, || None);
        let latest = dag.latest(name);
        (dag, latest)
    }

    fn map(&self) -> (Dag, Latest<Origin>) {
        let dag = self.dag("map", MAP);
        Self::source(&dag, "PointCloudMap", MAP, || None);
        self.transform(&dag, "PointCloudMap", "PointCloudMapLoader");
        let latest = dag.latest("PointCloudMapLoader");
        (dag, latest)
    }

    /// Builds `lidar`; returns the DAG, the obstacles and the pose.
    fn lidar(
        &self,
        map: &Latest<Origin>,
        settings: &Latest<Origin>,
    ) -> (Dag, Latest<Origin>, Latest<Origin>) {
        let dag = self.dag("lidar", LIDAR);
        for driver in ["FrontLidarDriver", "RearLidarDriver"] {
            let mut next = 0;
            Self::source(&dag, driver, LIDAR, move || {
                next += 1;
                Some(next - 1)
            });
        }
        self.transform(&dag, "FrontLidarDriver", "PointsTransformerFront");
        self.transform(&dag, "RearLidarDriver", "PointsTransformerRear");
        let both = ["PointsTransformerFront", "PointsTransformerRear"];
        self.fusion(&dag, both, "PointCloudFusion");
        self.transform(&dag, "PointCloudFusion", "VoxelGridDownsampler");
        self.transform(&dag, "PointCloudFusion", "RayGroundFilter");

        let (attributes, mut crunch) = self.worker("NDTLocalizer", 1);
        dag.using(map.sample())
            .subtask(move |_: Sampled<'_>, (points,): (Origin,)| {
                crunch.work();
                (points,)
            })
            .reads(&["VoxelGridDownsampler"])
            .writes(&["NDTLocalizer"])
            .register(attributes);

        // Two independent transforms in one node.
        let (attributes, mut crunch) = self.worker("EuclideanClusterDetector", 2);
        dag.using(settings.sample())
            .subtask(move |_: Sampled<'_>, (points,): (Origin,)| {
                crunch.work();
                crunch.work();
                (points, points)
            })
            .reads(&["RayGroundFilter"])
            .writes(&["EuclideanClusterDetector", "EuclideanIntersection"])
            .register(attributes);
        self.transform(&dag, "EuclideanClusterDetector", "ObjectCollisionEstimator");
        dag.register_sink_subtask(
            |(_,): (Origin,)| (),
            ["EuclideanIntersection"],
            LIDAR,
            Self::end_attributes("IntersectionOutput"),
        );
        let obstacles = dag.latest("ObjectCollisionEstimator");
        let pose = dag.latest("NDTLocalizer");
        (dag, obstacles, pose)
    }

    /// Builds `route`; returns the DAG and the outputs of its four planners.
    fn route(&self, goal: &Latest<Origin>, pose: &Latest<Origin>) -> (Dag, [Latest<Origin>; 4]) {
        let dag = self.dag("route", LIDAR);
        Self::source(&dag, "Lanelet2Map", LIDAR, || None);
        let (attributes, mut crunch) = self.worker("Lanelet2GlobalPlanner", 1);
        dag.period(LIDAR)
            .using((goal.sample(), pose.sample()))
            .source(move |(_, pose): (Sampled<'_>, Sampled<'_>)| {
                crunch.work();
                (pose.and_then(|pose| *pose.value),)
            })
            .writes(&["Lanelet2GlobalPlanner"])
            .register(attributes);
        let inputs = ["Lanelet2GlobalPlanner", "Lanelet2Map"];
        self.fusion(&dag, inputs, "Lanelet2MapLoader");
        self.transform(&dag, "Lanelet2MapLoader", "ParkingPlanner");
        self.transform(&dag, "Lanelet2MapLoader", "LanePlanner");
        let latest = [
            "Lanelet2GlobalPlanner",
            "Lanelet2MapLoader",
            "ParkingPlanner",
            "LanePlanner",
        ]
        .map(|topic| dag.latest(topic));
        (dag, latest)
    }

    /// Builds `behaviour`; returns the DAG and, for each of its jobs, the lidar job acted on.
    fn behaviour(
        &self,
        obstacles: &Latest<Origin>,
        pose: &Latest<Origin>,
        [global, loader, parking, lane]: &[Latest<Origin>; 4],
    ) -> (Dag, Arc<[AtomicU64]>) {
        let dag = self.dag("behaviour", LIDAR);
        let (attributes, mut crunch) = self.worker("BehaviorPlanner", 1);
        let uses = (
            obstacles.sample(),
            pose.sample(),
            global.sample(),
            loader.sample(),
            parking.sample(),
            lane.sample(),
        );
        dag.period(LIDAR)
            .using(uses)
            .source(
                move |(obstacles, ..): (
                    Sampled<'_>,
                    Sampled<'_>,
                    Sampled<'_>,
                    Sampled<'_>,
                    Sampled<'_>,
                    Sampled<'_>,
                )| {
                    // The sample is taken at the start, so a newer value is for the next job.
                    let origin = obstacles.and_then(|obstacles| *obstacles.value);
                    crunch.work();
                    (origin,)
                },
            )
            .writes(&["BehaviorPlanner"])
            .register(attributes);
        self.transform(&dag, "BehaviorPlanner", "MPCController");
        let inputs = ["MPCController", "BehaviorPlanner"];
        self.fusion(&dag, inputs, "VehicleInterface");
        let jobs = (0..self.jobs(LIDAR)).map(|_| AtomicU64::new(u64::MAX));
        let acted_on: Arc<[AtomicU64]> = jobs.collect();
        let mut places = 0..;
        let keep = Arc::clone(&acted_on);
        dag.register_sink_subtask(
            move |(origin,): (Origin,)| {
                let place = places.next().and_then(|job: usize| keep.get(job));
                if let (Some(place), Some(job)) = (place, origin) {
                    place.store(job, Ordering::Relaxed);
                }
            },
            ["VehicleInterface"],
            LIDAR,
            Self::end_attributes("VehicleDBWSystem"),
        );
        (dag, acted_on)
    }
}

/// The work of one subtask, job by job.
#[derive(Clone, Debug)]
struct SubtaskWork {
    workload: Workload,
    random: Random,
}

impl SubtaskWork {
    /// Makes the work of subtask number `number` of the system.
    fn new(workload: &Workload, number: u64) -> Self {
        let seed = workload.seed.wrapping_mul(0xd134_2543_de82_ef95);
        Self {
            workload: *workload,
            random: Random::new(seed.wrapping_add(number << 32)),
        }
    }

    /// Does one piece of work: executes for a time between the least part of its WCET and nearly
    /// all of its WCET. A hundredth is left for the machine's overhead.
    fn work(&mut self) {
        let least = self.workload.least_percent.min(99);
        let per_mille = least * 10 + self.random.number() % ((99 - least) * 10 + 1);
        let ns = u64::try_from(self.workload.crunch.as_nanos()).unwrap_or(u64::MAX);
        let time = Duration::from_nanos(ns / 1000 * per_mille);
        execute_for(time, self.workload.occupation);
    }
}
