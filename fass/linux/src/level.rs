//! The levels of SCHED_FIFO that the program's threads are at, and which thread is at which.
//!
//! | level | threads |
//! |---|---|
//! | top | the release thread |
//! | top - 1 | a worker that reports an end, if it was demoted |
//! | top - 2 | workers that run what the scheduler wants |
//! | top - 3 | demoted workers: what they run was preempted |
//! | none | abandoned workers: what they run has exceeded its budget |
//!
//! Four neighbours, below the 50 at which Linux runs interrupt handlers that are threads.

use crate::sys::{self, ThreadId};

/// Where the levels end, if nobody says otherwise.
pub(crate) const USUAL_TOP: i32 = 49;

/// The levels of a run's threads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Levels {
    top: i32,
}

/// What a thread is at its level for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Role {
    /// It releases jobs.
    Release,
    /// It needs the scheduler's lock at once, whatever its core computes.
    Report,
    /// It runs what its core should run.
    Run,
    /// It has lost its core.
    Demoted,
    /// What it runs was ended: it is to delay nobody any more, in no other program either.
    Abandoned,
}

impl Levels {
    /// Takes the four levels up to `top`, if this program may.
    ///
    /// # Errors
    ///
    /// The kernel's reason, if it does not let us.
    pub(crate) fn take(top: i32) -> std::io::Result<Self> {
        let probe = move || {
            let me = sys::thread();
            sys::set_level(me, top)?;
            sys::set_normal(me)
        };
        let answer = std::thread::spawn(probe).join();
        answer
            .expect("the probe does not panic")
            .map(|()| Self { top })
    }

    /// Brings a thread to its role's level.
    pub(crate) fn bring(self, thread: ThreadId, role: Role) {
        let below = match role {
            Role::Release => 0,
            Role::Report => 1,
            Role::Run => 2,
            Role::Demoted => 3,
            Role::Abandoned => {
                let _ = sys::set_normal(thread);
                return;
            }
        };
        // It worked before; a thread that has gone needs no level.
        let _ = sys::set_level(thread, self.top - below);
    }
}
