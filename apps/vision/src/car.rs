//! The vehicle: how it moves, and when it brakes.

/// Where it shall come to rest, in metres before the obstacle.
const REST: f32 = 3.0;

/// So near to there it stops at once.
const NEAR: f32 = 0.1;

/// The deceleration that it begins to brake for, in m/s^2, and the most that it has.
const USUAL: f32 = 1.2;
const MOST: f32 = 5.0;

/// The vehicle on the road.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Car {
    /// How far the obstacle is.
    pub(crate) gap: f32,
    /// In m/s.
    pub(crate) speed: f32,
}

impl Car {
    /// Begins 10 m before the obstacle.
    pub(crate) const fn new() -> Car {
        Car {
            gap: 10.0,
            speed: 3.0,
        }
    }

    /// Goes on for so many seconds with this deceleration, in m/s^2.
    pub(crate) fn step(&mut self, deceleration: f32, seconds: f32) {
        self.gap -= self.speed * seconds;
        self.speed = (self.speed - deceleration * seconds).max(0.0);
    }
}

/// Returns the deceleration for an obstacle that was so far away so many seconds ago, or that
/// has not been seen.
pub(crate) fn brake(speed: f32, seen: Option<(f32, f32)>) -> f32 {
    let Some((distance, age)) = seen else {
        return 0.0;
    };
    let left = distance - speed * age - REST;
    if left < NEAR {
        return MOST;
    }
    let needed = speed * speed / (2.0 * left);
    match needed > USUAL {
        true => needed.min(MOST),
        false => 0.0,
    }
}
