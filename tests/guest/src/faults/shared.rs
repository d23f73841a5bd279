//! The cases of what subtasks share: states, latest values, signals.

use alloc::vec;
use alloc::vec::Vec;

use fass::{Dag, Latest, Parameter, Sample, SubtaskAttributes, Unique, create_dag};

use super::{FAULT_LIMIT, PERIOD, joining_sink, named, planning, sound, source, storing};

pub(super) fn activations_differ() -> Vec<Dag> {
    let dag = sound("lidar", "points");
    dag.sporadic(PERIOD);
    vec![dag]
}

pub(super) fn duplicate_state() -> Vec<Dag> {
    let dag = sound("lidar", "points");
    for _ in 0..2 {
        let _ = dag.state("map", 0_u32);
    }
    vec![dag]
}

pub(super) fn unused_state() -> Vec<Dag> {
    let dag = sound("lidar", "points");
    let _ = dag.state("map", 0_u32);
    vec![dag]
}

pub(super) fn state_never_updated() -> Vec<Dag> {
    let dag = named("lidar");
    source(&dag, "read", "points");
    let map = dag.state("map", 0_u32);
    storing(&dag, map.read(), |_| ());
    vec![dag]
}

pub(super) fn state_used_twice() -> Vec<Dag> {
    let dag = named("lidar");
    source(&dag, "read", "points");
    let map = dag.state("map", 0_u32);
    storing(&dag, (map.update(), map.read()), |(_, _)| ());
    vec![dag]
}

pub(super) fn state_without_reset() -> Vec<Dag> {
    let dag = named("lidar");
    dag.survive_faults(FAULT_LIMIT);
    source(&dag, "read", "points");
    let map = dag.state("map", 0_u32);
    let attributes = SubtaskAttributes::named("store");
    let store = || |map: &mut u32, (points,): (u32,)| *map += points;
    dag.using(map.update())
        .restarting(store)
        .reads(&["points"])
        .due(PERIOD)
        .register(attributes);
    vec![dag]
}

pub(super) fn replaced_in_vain() -> Vec<Dag> {
    let dag = named("lidar");
    source(&dag, "read", "points");
    let attributes = SubtaskAttributes::named("store");
    dag.restarting(|| |(_,): (u32,)| ())
        .reads(&["points"])
        .due(PERIOD)
        .register(attributes);
    vec![dag]
}

pub(super) fn nothing_replaceable() -> Vec<Dag> {
    let dag = sound("lidar", "points");
    dag.survive_faults(FAULT_LIMIT);
    vec![dag]
}

pub(super) fn state_over_jobs() -> Vec<Dag> {
    let dag = named("lidar");
    dag.in_flight(2);
    let map = dag.state("map", 0_u32);
    let read = |map: &mut u32| (*map,);
    let attributes = SubtaskAttributes::named("read");
    dag.period(PERIOD)
        .using(map.update())
        .source(read)
        .writes(&["points"])
        .register(attributes);
    storing(&dag, map.read(), |_| ());
    vec![dag]
}

pub(super) fn latest_unwritten() -> Vec<Dag> {
    let lidar = sound("lidar", "points");
    let pose = lidar.latest::<u32>("pose");
    let planner = planner(&pose);
    vec![lidar, planner]
}

pub(super) fn latest_unread() -> Vec<Dag> {
    let lidar = sound("lidar", "points");
    let _ = lidar.latest::<u32>("points");
    vec![lidar]
}

pub(super) fn latest_type_mismatch() -> Vec<Dag> {
    let lidar = sound("lidar", "points");
    let points = lidar.latest::<f64>("points");
    let planner = named("planner");
    planning(&planner, points.sample(), |_| ());
    vec![lidar, planner]
}

pub(super) fn latest_of_moved() -> Vec<Dag> {
    let lidar = named("lidar");
    lidar.relative_deadline(PERIOD);
    let attributes = SubtaskAttributes::named("read");
    let read = || (Unique::new(1_u32),);
    lidar.register_periodic_subtask(read, vec!["points"], PERIOD, attributes);
    let points = lidar.latest::<Unique<u32>>("points");
    let planner = named("planner");
    planning(&planner, (points.sample(), points.sample()), |(_, _)| ());
    vec![lidar, planner]
}

pub(super) fn latest_not_committed() -> Vec<Dag> {
    let lidar = sound("lidar", "points");
    let points = lidar.latest::<u32>("points");
    vec![planner(&points)] // without `lidar`
}

pub(super) fn signal_not_committed() -> Vec<Dag> {
    let dag = named("lidar");
    source(&dag, "read", "points");
    let alarm = create_dag().sporadic(PERIOD);
    storing(&dag, alarm.raising(), |mut alarm| alarm.raise());
    vec![dag]
}

pub(super) fn switched_not_committed() -> Vec<Dag> {
    let dag = named("lidar");
    source(&dag, "read", "points");
    let camera = sound("camera", "frames");
    storing(&dag, camera.switching(), |mut camera| camera.pause());
    vec![dag] // without `camera`
}

pub(super) fn taken_by_no_source() -> Vec<Dag> {
    let dag = named("lidar");
    source(&dag, "read", "points");
    let nearest = Parameter::new("nearest", 0.5, 0.0..=2.0);
    storing(&dag, nearest.reading(), |_nearest| ());
    vec![dag]
}

pub(super) fn taken_twice() -> Vec<Dag> {
    let dag = named("lidar");
    let nearest = Parameter::new("nearest", 0.5, 0.0..=2.0);
    for (name, topic) in [("left", "left points"), ("right", "right points")] {
        let attributes = SubtaskAttributes::named(name);
        let read = |_nearest: f64| (1_u32,);
        dag.period(PERIOD)
            .using(nearest.reading())
            .source(read)
            .writes(&[topic])
            .register(attributes);
    }
    joining_sink(&dag, "store", ["left points", "right points"]);
    vec![dag]
}

pub(super) fn source_partly_recorded() -> Vec<Dag> {
    let dag = named("lidar");
    dag.record::<u32>("points");
    let read = SubtaskAttributes::named("read");
    dag.register_periodic_subtask(|| (1_u32, 2_u32), vec!["points", "heat"], PERIOD, read);
    joining_sink(&dag, "store", ["points", "heat"]);
    vec![dag]
}

pub(super) fn sample_not_recorded() -> Vec<Dag> {
    let lidar = sound("lidar", "points");
    let points = lidar.latest::<u32>("points");
    let planner = named("planner");
    planner.record::<u32>("ticks");
    source(&planner, "tick", "ticks");
    let attributes = SubtaskAttributes::named("plan");
    let plan = |_: Option<Sample<'_, u32>>, (_,): (u32,)| ();
    planner
        .using(points.sample())
        .subtask(plan)
        .reads(&["ticks"])
        .due(PERIOD)
        .register(attributes);
    vec![lidar, planner]
}

/// A DAG of one subtask, which samples.
fn planner(latest: &Latest<u32>) -> Dag {
    let planner = named("planner");
    planning(&planner, latest.sample(), |_| ());
    planner
}
