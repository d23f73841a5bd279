//! Cores that watch each other: a core that takes no interrupts is noticed.
//!
//! Only code with `unsafe` can disable interrupts for long. Such a core can be reached by
//! a non-maskable interrupt alone, and nothing on it can go on. So core 0 looks at all
//! others in its heartbeat, and core 1 at core 0. A core that has taken no interrupt for
//! [`QUIET_NS`] while it runs something is sent one; if it has taken none for
//! [`SILENT_NS`], it is accused at each look, by a non-maskable interrupt. If interrupts turn
//! out to be enabled there, it was the host that did not let it run, and it goes on. If they
//! are disabled at two looks in a row, it reports where it is, and ends the run.
//!
//! A machine of one core has nobody to notice.

use core::sync::atomic::Ordering;

use executive::machine::non_maskable;
use executive::machine::this_core::{self, Core};
use executive::run::execution;
use executive::run::heartbeat::SECOND_NS;

/// After this time without an interrupt a core is sent one. Core 0 gets its own.
const QUIET_NS: u64 = 1_500_000_000;

/// After this time without an interrupt a core is accused.
const SILENT_NS: u64 = 4_000_000_000;

const _: () = assert!(
    QUIET_NS + SECOND_NS < SILENT_NS,
    "core 1 asks core 0 before it accuses it"
);

/// What is to be done about a core.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Doubt {
    None,
    Ask,
    Accuse,
}

/// Judges a core that took its last interrupt so long ago.
const fn judge(silent_ns: u64) -> Doubt {
    match silent_ns {
        SILENT_NS.. => Doubt::Accuse,
        QUIET_NS.. => Doubt::Ask,
        _ => Doubt::None,
    }
}

/// Looks at the cores that are this core's to watch. In a heartbeat.
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
            Doubt::None => {}
            Doubt::Ask => core.wake_up(),
            Doubt::Accuse => non_maskable::accuse(core),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_core_is_asked_before_it_is_accused() {
        assert_eq!(judge(0), Doubt::None);
        assert_eq!(judge(QUIET_NS - 1), Doubt::None);
        assert_eq!(judge(QUIET_NS), Doubt::Ask);
        assert_eq!(judge(SILENT_NS - 1), Doubt::Ask);
        assert_eq!(judge(SILENT_NS), Doubt::Accuse);
    }
}
