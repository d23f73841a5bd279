//! The cases of modes.

use alloc::vec;
use alloc::vec::Vec;

use fass::{Dag, Modes, SubtaskAttributes, Switch};

use super::{PERIOD, named, sound, source};

pub(super) fn empty_mode() -> Vec<Dag> {
    let lidar = sound("lidar", "points");
    let modes = Modes::new();
    modes.mode("flight", &[&lidar]);
    modes.mode("landing", &[]);
    vec![lidar]
}

pub(super) fn duplicate_mode() -> Vec<Dag> {
    let (lidar, camera) = (sound("lidar", "points"), sound("camera", "frames"));
    let modes = Modes::new();
    modes.mode("flight", &[&lidar]);
    modes.mode("flight", &[&camera]);
    vec![lidar, camera]
}

pub(super) fn mode_not_committed() -> Vec<Dag> {
    let (lidar, camera) = (sound("lidar", "points"), sound("camera", "frames"));
    Modes::new().mode("flight", &[&lidar, &camera]);
    vec![lidar] // without `camera`
}

pub(super) fn several_sets_of_modes() -> Vec<Dag> {
    let (lidar, camera) = (sound("lidar", "points"), sound("camera", "frames"));
    Modes::new().mode("flight", &[&lidar]);
    Modes::new().mode("landing", &[&camera]);
    vec![lidar, camera]
}

pub(super) fn mode_starts_paused() -> Vec<Dag> {
    let lidar = sound("lidar", "points");
    lidar.starts_paused();
    Modes::new().mode("flight", &[&lidar]);
    vec![lidar]
}

pub(super) fn mode_switched() -> Vec<Dag> {
    let lidar = sound("lidar", "points");
    Modes::new().mode("flight", &[&lidar]);
    let planner = named("planner");
    source(&planner, "look", "goal");
    let attributes = SubtaskAttributes::named("plan");
    let plan = |mut lidar: Switch<'_>, (_,): (u32,)| lidar.pause();
    planner
        .using(lidar.switching())
        .register_sink_subtask(plan, vec!["goal"], PERIOD, attributes);
    vec![lidar, planner]
}

pub(super) fn mode_without_handler() -> Vec<Dag> {
    let (lidar, camera) = (sound("lidar", "points"), sound("camera", "frames"));
    let brakes = named("brakes");
    brakes.relative_deadline(PERIOD);
    lidar.on_fault(&brakes.sporadic(PERIOD));
    brakes.register_untyped_subtask(|_job| (), SubtaskAttributes::named("hold"));
    let modes = Modes::new();
    modes.mode("flight", &[&lidar]);
    modes.mode("landing", &[&camera, &brakes]);
    vec![lidar, camera, brakes]
}
