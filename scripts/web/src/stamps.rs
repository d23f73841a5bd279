//! A lab: why a join must not match by stamps.
//!
//! A camera and a lidar with the same period publish frames, each with the time of its arrival at
//! the driver, as is usual. DAG `joined` has both, and an AND-join: `fuse` gets frames of one job.
//! In DAGs `camera`, `lidar` and `apart` the same subtasks publish and subscribe, and `fuse` takes
//! the frame with the nearest stamp, perhaps of another job: a lidar may take longer than half a
//! period.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::Duration;

use fass::shared::Sample;
use fass::{Dag, SubtaskAttributes, create_dag, now_ns, sleep};
use random::{nth, scale};

recording::recordable! {
    /// A frame.
    #[derive(Clone, Copy, Debug, Default)]
    pub struct Frame {
        /// The job of the frame.
        pub job: u64,
        /// The time of arrival at the driver.
        pub stamp_ns: u64,
    }
}

type Pair = (Frame, Frame);
type Latest<'a> = Option<Sample<'a, Frame>>;

/// Builds the DAGs, whose times follow from a seed, and a report on the number of mismatched pairs.
pub(crate) fn build(seed: u64) -> ([Dag; 4], impl Fn() -> String) {
    let dags = ["joined", "camera", "lidar", "apart"].map(|name| {
        let dag = create_dag();
        dag.name(name).jobs(40);
        dag.period(ms(33)).relative_deadline(ms(33));
        dag
    });
    let [joined, camera, lidar, apart] = &dags;
    for (dag, names, times) in [
        (joined, ["expose", "image", "detect", "seen"], [1, 4]),
        (camera, ["expose", "/image", "detect", "/seen"], [1, 4]),
        (joined, ["turn", "scan", "cluster", "points"], [24, 1]),
        (lidar, ["turn", "/scan", "cluster", "/points"], [24, 1]),
    ] {
        register(dag, names, times, seed);
    }
    let counts = [(); 2].map(|()| Arc::<AtomicU64>::default());
    let [join, matched] = counts.clone().map(|count| {
        move |(seen, points): Pair| {
            count.fetch_add((seen.job != points.job).into(), Relaxed);
            ((seen, points),)
        }
    });
    let join = joined.subtask(join).reads(&["seen", "points"]);
    join.writes(&["pair"]).register(taking("fuse", 1));
    // No scan has come yet, so none is near.
    let none = Frame {
        job: u64::MAX,
        stamp_ns: u64::MAX,
    };
    let mut scans = [none; 3];
    let nearest = move |(seen, points): (Latest<'_>, Latest<'_>)| {
        let [seen, points] = [seen, points].map(|it| it.map_or(scans[0], |it| *it.value));
        if scans[0].job != points.job {
            scans.rotate_right(1);
            scans[0] = points;
        }
        let distance_ns = |scan: &Frame| scan.stamp_ns.abs_diff(seen.stamp_ns);
        let nearest = scans.into_iter().min_by_key(distance_ns);
        matched((seen, nearest.unwrap_or(points)))
    };
    let seen = camera.latest::<Frame>("/seen").sample();
    let uses = (seen, lidar.latest::<Frame>("/points").sample());
    // By then, both frames of the period are there.
    let fuse = apart.offset(ms(30)).using(uses).source(nearest);
    fuse.writes(&["/pair"]).register(taking("fuse", 1));
    joined.record::<Pair>("pair");
    apart.record::<Pair>("/pair");
    let told = move || {
        let [joined, apart] = counts.each_ref().map(|count| count.load(Relaxed));
        format!(
            "`fuse` of dag `apart` matched by stamps, and took frames of different jobs in {apart} \
             of 40 jobs; the join of dag `joined` in {joined} of 40"
        )
    };
    (dags, told)
}

/// Registers a sensor with its topic, and the subtask behind the sensor with another topic. The
/// sensor takes at most `most_ms` milliseconds.
fn register(dag: &Dag, names: [&'static str; 4], [most_ms, wcet]: [u64; 2], seed: u64) {
    let [sensor, raw, branch, topic] = names;
    let mut jobs = 0..;
    let sense = move || {
        let job = jobs.next().unwrap_or(0);
        async move {
            let us = scale(nth(seed, job), 1000..=1000 * most_ms);
            sleep(Duration::from_micros(us)).await;
            let stamp_ns = now_ns();
            (Frame { job, stamp_ns },)
        }
    };
    let attributes = taking(sensor, 1).wait(ms(most_ms)).wcet(ms(1));
    dag.async_source(sense).writes(&[raw]).register(attributes);
    let (branch, topics) = (taking(branch, wcet), ([raw], [topic]));
    let pass = dag.subtask(|frame: (Frame,)| frame);
    pass.reads(&topics.0).writes(&topics.1).register(branch);
    dag.record::<Frame>(topic);
}

const fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

fn taking(name: &str, wcet: u64) -> SubtaskAttributes {
    SubtaskAttributes::named(name).wcet(ms(wcet))
}
