//! The cases of modes.

use alloc::vec;
use alloc::vec::Vec;

use fass::{Dag, Modes, SubtaskAttributes};

use super::{PERIOD, named, sound};

pub(super) fn duplicate_mode() -> Vec<Dag> {
    let (lidar, camera) = (sound("lidar", "points"), sound("camera", "frames"));
    let modes = Modes::new();
    modes.mode("flight", &[&lidar]);
    modes.mode("flight", &[&camera]);
    vec![lidar, camera]
}

pub(super) fn several_sets_of_modes() -> Vec<Dag> {
    let (lidar, camera) = (sound("lidar", "points"), sound("camera", "frames"));
    Modes::new().mode("flight", &[&lidar]);
    Modes::new().mode("landing", &[&camera]);
    vec![lidar, camera]
}

pub(super) fn mode_not_committed() -> Vec<Dag> {
    let (lidar, camera) = (sound("lidar", "points"), sound("camera", "frames"));
    Modes::new().mode("flight", &[&lidar, &camera]);
    vec![lidar] // without `camera`
}

pub(super) fn mode_starts_paused() -> Vec<Dag> {
    let lidar = sound("lidar", "points");
    lidar.starts_paused();
    Modes::new().mode("flight", &[&lidar]);
    vec![lidar]
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
