//! A camera asking an accelerator about each frame, next to a control loop at 1 kHz.
//!
//! | DAG | period | subtasks |
//! |---|---|---|
//! | `control` | 1 ms | `sense`, `steer`, `act` |
//! | `camera` | 20 ms | `capture`, `detect`, `track` |
//! | `accelerator` | 500 us | `serve` |
//!
//! `detect` asks the accelerator, and waits for at most 8 ms. Its instance has no core meanwhile,
//! so `control` runs on, even on a single core. A late answer is refused, and `track` goes on with
//! the objects already known. The accelerator is simulated by its own DAG. Every 500 us this DAG
//! looks for a question, and it answers after a random time of 1 to 12 ms. So the app runs alike on
//! every platform, and a bound covers every behaviour of the accelerator. A recording contains the
//! answers, and a replay takes them from there. The library does not use the kernel.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

extern crate alloc;

use alloc::sync::Arc;
use core::sync::atomic::{AtomicU64, Ordering::Relaxed};
use core::time::Duration;

use fass::shared::{Asker, Device, DeviceDriver, Ticket, create_device};
use fass::{Dag, Occupation, SubtaskAttributes, create_dag, execute_for};
use random::Random;

/// The longest wait of `detect`.
pub const LIMIT: Duration = ms(8);

/// The time between two looks of the accelerator for a question.
const POLL: Duration = us(500);

/// The behaviour of the accelerator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Conduct {
    /// The accelerator answers after a random time, sometimes too late.
    Random,
    /// The accelerator answers twice.
    Twice,
    /// The accelerator never answers.
    Silent,
}

/// The wait of `detect`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Detection {
    /// The accelerator's answer.
    Asks,
    /// No event: a wait of zero time instead.
    Skips,
    /// A future that never completes, which is a fault.
    Hangs,
}

/// The number of waits and answers with each outcome.
#[derive(Debug, Default)]
pub struct WaitCounts {
    /// Frames answered in time.
    pub answered: AtomicU64,
    /// Frames whose wait ended at its limit.
    pub late: AtomicU64,
    /// Answers refused by the device: late or repeated.
    pub refused: AtomicU64,
}

const fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

const fn us(us: u64) -> Duration {
    Duration::from_micros(us)
}

/// Builds the DAGs. `camera` ends after `frames` jobs, and the others end with it.
pub fn build(
    frames: u64,
    seed: u64,
    conduct: Conduct,
    detection: Detection,
) -> ([Dag; 3], Arc<WaitCounts>) {
    let counts = Arc::new(WaitCounts::default());
    let (device, driver) = create_device::<u64, u64>("accelerator");
    device.record();
    let camera = build_camera(&device, detection, &counts);
    let accelerator = create_dag();
    (accelerator.name("accelerator").jobs(40 * frames)).relative_deadline(POLL);
    let mut simulated = Accelerator {
        driver,
        conduct,
        random: Random::new(seed),
        asked: None,
        counts: Arc::clone(&counts),
    };
    let serve = move || simulated.serve();
    accelerator.register_periodic_subtask(serve, [], POLL, named("serve", us(30)));
    let control = build_control();
    camera.jobs(frames);
    control.jobs(20 * frames);
    ([camera, control, accelerator], counts)
}

fn build_camera(device: &Device<u64, u64>, detection: Detection, counts: &Arc<WaitCounts>) -> Dag {
    let camera = create_dag();
    (camera.name("camera").record::<u64>("frame")).record::<Option<u64>>("objects");
    let mut frame = 0_u64;
    let capture = move || {
        frame += 1;
        execute_for(us(800), Occupation::Hold);
        (frame,)
    };
    camera.register_periodic_subtask(capture, ["frame"], ms(20), named("capture", ms(1)));
    let counted = Arc::clone(counts);
    let detect = move |accelerator: Asker<u64, u64>, (frame,): (u64,)| {
        let counts = Arc::clone(&counted);
        async move {
            execute_for(us(400), Occupation::Hold);
            let objects = match detection {
                Detection::Asks => accelerator.ask(frame).await.ok(),
                Detection::Skips => {
                    fass::sleep(Duration::ZERO).await;
                    None
                }
                Detection::Hangs => core::future::pending().await,
            };
            let count = match objects {
                Some(_) => &counts.answered,
                None => &counts.late,
            };
            count.fetch_add(1, Relaxed);
            execute_for(us(800), Occupation::Hold);
            (objects,)
        }
    };
    camera
        .using(device.asking())
        .async_subtask(detect)
        .reads(&["frame"])
        .writes(&["objects"])
        .register(named("detect", us(500)).wait(LIMIT).wcet(ms(1)));
    let mut known = 0;
    let track = move |(objects,): (Option<u64>,)| {
        known = objects.unwrap_or(known);
        execute_for(us(800), Occupation::Hold);
    };
    camera.register_sink_subtask(track, ["objects"], ms(20), named("track", ms(1)));
    camera
}

fn build_control() -> Dag {
    let control = create_dag();
    control.name("control");
    let mut step = 0_u32;
    let sense = move || {
        step = step.wrapping_add(1);
        execute_for(us(40), Occupation::Hold);
        (step,)
    };
    control.register_periodic_subtask(sense, ["state"], ms(1), named("sense", us(60)));
    let steer = |(state,): (u32,)| {
        execute_for(us(80), Occupation::Hold);
        (state / 2,)
    };
    control.register_subtask(steer, ["state"], ["command"], named("steer", us(100)));
    let act = |(_,): (u32,)| execute_for(us(20), Occupation::Hold);
    control.register_sink_subtask(act, ["command"], ms(1), named("act", us(40)));
    control
}

fn named(name: &str, wcet: Duration) -> SubtaskAttributes {
    SubtaskAttributes::named(name).wcet(wcet)
}

/// The simulated accelerator.
struct Accelerator {
    driver: DeviceDriver<u64, u64>,
    conduct: Conduct,
    random: Random,
    /// The question in hand, with the number of the accelerator's jobs until the answer.
    asked: Option<(Ticket, u64, u64)>,
    counts: Arc<WaitCounts>,
}

impl Accelerator {
    /// Accepts a question, or continues with the question in hand.
    fn serve(&mut self) {
        let Some((ticket, frame, left)) = self.asked.take() else {
            if let Some((ticket, frame)) = self.driver.question() {
                self.asked = Some((ticket, frame, self.random.within(2..=24)));
            }
            return;
        };
        if left > 1 {
            self.asked = Some((ticket, frame, left - 1));
            return;
        }
        let answers = match self.conduct {
            Conduct::Random => 1,
            Conduct::Twice => 2,
            Conduct::Silent => 0,
        };
        for _ in 0..answers {
            let refused = self.driver.answer(ticket, frame % 7).is_err();
            self.counts.refused.fetch_add(refused.into(), Relaxed);
        }
    }
}
