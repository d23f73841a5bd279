//! Names an instance that keeps a core for long, once, before the host's timeout.
//!
//! A subtask that never returns and has no budget keeps its core, whether in a loop or waiting for
//! one of the app's own locks, and the run may never end. So core 0's heartbeat looks now and then
//! at the instance each core runs, as noted for reports anyway. If a core has run the same instance
//! for [`STALLED_NS`], and for longer than its WCET if known, a line says so, even if the other
//! cores are idle. The run goes on: the instance may be no more than a long computation.
//!
//! Nothing is counted between two looks, so watching costs a run nothing. The price: an instance
//! that was preempted or has waited in between counts as running all the time.
//!
//! # Cores that watch each other: noticing a core that takes no interrupts
//!
//! Only code with `unsafe` can disable interrupts for long. Such a core can be reached by a
//! non-maskable interrupt alone, and nothing on it can go on. So core 0 watches all others in its
//! heartbeat, and core 1 watches core 0. After [`QUIET_NS`] without an interrupt, a core running
//! something is sent an interrupt. After [`SILENT_NS`] the core is accused at each look, by a
//! non-maskable interrupt. If interrupts turn out to be enabled there, the host has kept the core
//! from running, and the core goes on. If they are disabled at several looks in a row, the core
//! reports its place in the code, and ends the run.
//!
//! On a machine with a single core, nobody can notice.

use core::sync::atomic::Ordering;

use executive::machine::spinlock::SpinLock;
use executive::machine::this_core::{self, Core};
use executive::machine::{clock, non_maskable};
use executive::run::execution;
use executive::run::heartbeat::SECOND_NS;
use executive::text::console;
use front::json;
use sched_dag::Instance;

/// The time between two looks. Heartbeats may be more frequent.
pub(super) const LOOK_NS: u64 = 250_000_000;

/// The longest run of an instance without a report. In an emulated processor whose clock counts
/// instructions, this may take some ten seconds of the host's time.
const STALLED_NS: u64 = 500_000_000;

/// The most cores watched.
const MOST_CORES: usize = 64;

/// The most instances named in a run.
const MOST_NAMED: usize = 16;

/// The state of the watch in this run. Its initial value is all zeros, which takes no room in an
/// image.
struct StallWatch {
    /// Whether there is a run.
    looks: bool,
    /// The time of the next look, on the clock.
    next_look_ns: u64,
    cores: [SeenInstance; MOST_CORES],
    named: usize,
}

/// The instance seen running on a core.
#[derive(Clone, Copy, Debug)]
struct SeenInstance {
    instance: Option<Instance>,
    since_ns: u64,
    is_named: bool,
}

static WATCH: SpinLock<StallWatch> = SpinLock::new(StallWatch::NONE);

impl StallWatch {
    const NONE: Self = Self {
        looks: false,
        next_look_ns: 0,
        cores: [SeenInstance::NOTHING; MOST_CORES],
        named: 0,
    };
}

impl SeenInstance {
    const NOTHING: Self = Self {
        instance: None,
        since_ns: 0,
        is_named: false,
    };

    /// Looks at the instance `running` on the core. If the instance has to be named, returns the
    /// instance and its time on the core, which is then no less than the result of `least_ns`.
    fn look(
        &mut self,
        now_ns: u64,
        running: Option<Instance>,
        least_ns: impl Fn(Instance) -> u64,
    ) -> Option<(Instance, u64)> {
        if running != self.instance {
            *self = Self {
                instance: running,
                since_ns: now_ns,
                is_named: false,
            };
        }
        let instance = running.filter(|_| !self.is_named)?;
        let still_ns = now_ns.saturating_sub(self.since_ns);
        if still_ns < STALLED_NS || still_ns < least_ns(instance) {
            return None;
        }
        self.is_named = true;
        Some((instance, still_ns))
    }
}

/// Begins to watch a run that begins now.
pub(super) fn start() {
    *WATCH.lock() = StallWatch {
        looks: true,
        next_look_ns: clock::now_ns(),
        ..StallWatch::NONE
    };
}

/// Stops watching.
pub(super) fn stop() {
    WATCH.lock().looks = false;
}

/// Takes a look when the next look is due. Called in core 0's heartbeat.
#[inline(never)]
pub(super) fn beat(now_ns: u64) {
    let Some(mut watch) = WATCH.try_lock() else {
        return;
    };
    if !watch.looks || now_ns < watch.next_look_ns {
        return;
    }
    watch.next_look_ns = now_ns.saturating_add(LOOK_NS);
    let StallWatch { cores, named, .. } = &mut *watch;
    for (core, seen) in this_core::all().iter().zip(cores) {
        if *named == MOST_NAMED {
            break;
        }
        let running = execution::running(core);
        if let Some((instance, still_ns)) = seen.look(now_ns, running, wcet_ns) {
            *named += 1;
            report(core.index, instance, still_ns);
        }
    }
    if *named > 0 {
        // Send the line now, because no core may ever be idle to do so.
        console::send_what_goes_at_once();
    }
}

/// Returns the WCET of an instance, 0 if unknown.
fn wcet_ns(instance: Instance) -> u64 {
    let task_set = execution::task_set();
    let wcet_ns = task_set.and_then(|task_set| {
        let dag = task_set.dag(instance.dag);
        dag.subtask(instance.subtask).wcet_ns()
    });
    wcet_ns.unwrap_or(0)
}

/// Names an instance that keeps a core.
#[cold]
#[inline(never)]
fn report(core: u32, instance: Instance, still_ns: u64) {
    let Some(task_set) = execution::task_set() else {
        return;
    };
    let dag = task_set.dag(instance.dag);
    let subtask = dag.subtask(instance.subtask).name();
    crate::println!(
        "stalled: subtask `{subtask}` of dag `{}`, job {}, has kept core {core} for {} ms, \
         and goes on",
        dag.name(),
        instance.job,
        still_ns / 1_000_000
    );
    json::report("stalled", |line| {
        line.number("dag", instance.dag.0)
            .text("dag_name", dag.name())
            .number("subtask", instance.subtask.0)
            .text("subtask_name", subtask)
            .number("job", instance.job)
            .number("cpu", core)
            .number("still_ns", still_ns);
    });
}

/// The time without an interrupt until a core is sent an interrupt. Core 0 gets its own.
const QUIET_NS: u64 = 1_500_000_000;

/// The time without an interrupt until a core is accused.
const SILENT_NS: u64 = 4_000_000_000;

const _: () = assert!(
    QUIET_NS + SECOND_NS < SILENT_NS,
    "core 1 asks core 0 before it accuses it"
);

/// The response to a core's silence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum StallResponse {
    None,
    Ask,
    Accuse,
}

/// Judges a core that took its last interrupt `silent_ns` ago.
const fn judge(silent_ns: u64) -> StallResponse {
    match silent_ns {
        SILENT_NS.. => StallResponse::Accuse,
        QUIET_NS.. => StallResponse::Ask,
        _ => StallResponse::None,
    }
}

/// Looks at the cores watched by this core. Called in a heartbeat.
pub(crate) fn look(own: &Core, now_ns: u64) {
    let cores = this_core::all();
    let watched = match own.index {
        0 => cores.get(1..),
        1 => cores.get(..1),
        _ => None,
    };
    for core in watched.unwrap_or_default() {
        // A core without work halts, and nobody has to wake it. Core 0 never rests for long.
        if core.index != 0 && execution::running(core).is_none() {
            core.interrupted_ns.store(now_ns, Ordering::Relaxed);
            continue;
        }
        let silent_ns = now_ns.saturating_sub(core.interrupted_ns.load(Ordering::Relaxed));
        match judge(silent_ns) {
            StallResponse::None => {}
            StallResponse::Ask => core.wake_up(),
            StallResponse::Accuse => non_maskable::accuse(core),
        }
    }
}

#[cfg(test)]
mod tests {
    use sched_dag::{DagId, SubtaskId};

    use super::*;

    /// Looks at a core that runs instances of these jobs; returns at which looks one
    /// was named.
    fn named(jobs: &[Option<u64>], wcet_ns: u64) -> Vec<usize> {
        let mut seen = SeenInstance::NOTHING;
        let looks = (0..).zip(jobs).filter(|&(look, &job)| {
            let running = job.map(|job| Instance {
                dag: DagId(0),
                job,
                subtask: SubtaskId(0),
            });
            seen.look(look * LOOK_NS, running, |_| wcet_ns).is_some()
        });
        looks
            .map(|(look, _)| usize::try_from(look).expect("few"))
            .collect()
    }

    #[test]
    fn what_runs_on_and_on_is_named_once() {
        assert_eq!(named(&[Some(1); 20], 0), [2]);
        let moves = [1, 2, 2, 3, 3, 1, 1, 1, 1].map(Some);
        assert_eq!(named(&moves, 0), [7]);
        assert_eq!(named(&moves[..7], 0), []);
    }

    #[test]
    fn a_core_that_waits_is_not_stalled() {
        assert_eq!(named(&[None; 20], 0), []);
        let jobs = [Some(1), Some(1), None, Some(1), Some(1), None, None, None];
        assert_eq!(named(&jobs, 0), []);
    }

    #[test]
    fn up_to_its_wcet_an_instance_may_run_without_a_word() {
        assert_eq!(named(&[Some(1); 20], 5 * LOOK_NS), [5]);
    }
}
