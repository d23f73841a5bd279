//! Who keeps a run from going on: named once, before the host loses patience.
//!
//! A subtask that never returns and has no budget keeps its core, and a run may not
//! end because of it. So core 0's heartbeat looks now and then at what the cores
//! have noted for reports anyway: which instance each runs, and how many jobs have
//! ended. If neither has changed for [`STALLED_NS`] while some core runs something,
//! the run has *stalled*, and a line says who runs. The run goes on: it may be no
//! more than a long computation.
//!
//! Between two looks nothing is counted, so this costs a run nothing. It also sees
//! less: an instance that begins and ends between two looks.

use crate::machine::clock;
use crate::machine::spinlock::SpinLock;
use crate::machine::this_core;
use crate::{console, execution, json};

/// The time between two looks. Heartbeats may come more often.
const LOOK_NS: u64 = 1_000_000_000;

/// For how long nothing may change. In an emulated processor whose clock counts
/// instructions this may take a minute of the host's time.
const STALLED_NS: u64 = 2_000_000_000;

/// The most instances that are named.
const MOST_NAMED: usize = 16;

/// What was seen in this run.
#[derive(Debug)]
struct Watch {
    /// When to look again, on the clock; `u64::MAX` if there is no run.
    next_look_ns: u64,
    /// Since when nothing has changed.
    since_ns: u64,
    /// What stands for all that could.
    mark: Option<u64>,
    has_reported: bool,
}

static WATCH: SpinLock<Watch> = SpinLock::new(Watch::from(u64::MAX));

impl Watch {
    const fn from(now_ns: u64) -> Self {
        Self {
            next_look_ns: now_ns,
            since_ns: now_ns,
            mark: None,
            has_reported: false,
        }
    }

    /// Takes a look. Returns for how long nothing has changed if that is to be
    /// reported. `mark` says how far the run is, `None` if no core runs anything.
    fn look(&mut self, now_ns: u64, mark: Option<u64>) -> Option<u64> {
        if mark.is_none() || mark != self.mark {
            self.mark = mark;
            self.since_ns = now_ns;
        }
        let still_ns = now_ns.saturating_sub(self.since_ns);
        if self.has_reported || still_ns < STALLED_NS {
            return None;
        }
        self.has_reported = true;
        Some(still_ns)
    }
}

/// Begins to look, at a run that begins now.
pub(super) fn begin() {
    *WATCH.lock() = Watch::from(clock::now_ns());
}

/// Looks no longer.
pub(super) fn end() {
    *WATCH.lock() = Watch::from(u64::MAX);
}

/// Takes a look if one is due. In core 0's heartbeat.
pub(super) fn beat(now_ns: u64) {
    let Some(mut watch) = WATCH.try_lock() else {
        return;
    };
    if now_ns < watch.next_look_ns {
        return;
    }
    watch.next_look_ns = now_ns.saturating_add(LOOK_NS);
    let still_ns = watch.look(now_ns, mark());
    let has_reported = watch.has_reported;
    drop(watch);
    if let Some(still_ns) = still_ns {
        report(still_ns);
    }
    if has_reported {
        // No core may ever be idle to send it.
        console::send_what_goes_at_once();
    }
}

/// Folds what the cores run and how many jobs have ended into one number, that
/// changes whenever one of these does, but for a chance of 2^-64. `None` if no core
/// runs anything.
fn mark() -> Option<u64> {
    // FNV-1a, by words instead of bytes.
    let fold = |mark: u64, word: u64| (mark ^ word).wrapping_mul(0x100_0000_01b3);
    let mut mark = fold(0xcbf2_9ce4_8422_2325, execution::jobs_ended());
    let mut is_idle = true;
    for core in this_core::all() {
        let instance = execution::running(core);
        is_idle &= instance.is_none();
        mark = fold(mark, instance.map_or(u64::MAX, |of| of.dag.0.into()));
        mark = fold(mark, instance.map_or(u64::MAX, |of| of.subtask.0.into()));
        mark = fold(mark, instance.map_or(u64::MAX, |of| of.job));
    }
    (!is_idle).then_some(mark)
}

/// Says which instances run.
fn report(still_ns: u64) {
    let Some(task_set) = execution::task_set() else {
        return;
    };
    let running = this_core::all()
        .iter()
        .filter_map(|core| Some((core.index, execution::running(core)?)));
    for (core, instance) in running.take(MOST_NAMED) {
        let dag = task_set.dag(instance.dag);
        let subtask = dag.subtask(instance.subtask).name();
        crate::println!(
            "stalled: no job has ended for {} s; core {core} still runs subtask `{subtask}` of \
             DAG `{}`, job {}",
            still_ns / 1_000_000_000,
            dag.name(),
            instance.job
        );
        json::emit("stalled", |line| {
            line.number("dag", instance.dag.0)
                .text("dag_name", dag.name())
                .number("subtask", instance.subtask.0)
                .text("subtask_name", subtask)
                .number("job", instance.job)
                .number("cpu", core)
                .number("still_ns", still_ns);
        });
        console::send_what_goes_at_once();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Looks once a second at these marks; returns when a stall was reported.
    fn reports(marks: &[Option<u64>]) -> Vec<u64> {
        let mut watch = Watch::from(0);
        let looks = (0..).zip(marks);
        let stalled = looks.filter(|(look, mark)| watch.look(look * LOOK_NS, **mark).is_some());
        stalled.map(|(look, _)| look).collect()
    }

    #[test]
    fn what_has_not_changed_for_two_seconds_is_reported_once() {
        assert_eq!(reports(&[Some(1); 20]), [2]);
        let moves = [1, 2, 2, 3, 3, 1, 1, 1].map(Some);
        assert_eq!(reports(&moves), [7]);
        assert_eq!(reports(&moves[..7]), []);
    }

    #[test]
    fn who_waits_for_a_signal_has_not_stalled() {
        assert_eq!(reports(&[None; 20]), []);
        let marks = [Some(1), Some(1), None, None, None, Some(1), Some(1), None];
        assert_eq!(reports(&marks), []);
    }
}
