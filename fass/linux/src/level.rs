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
//! Four neighbours, below the 50 at which Linux runs interrupt handlers that are threads. A
//! policy of sched_ext has the same four (`seats`).

use crate::seats::Seats;
use crate::sys::{self, ThreadId};

/// Where the levels end, if nobody says otherwise.
pub(crate) const USUAL_TOP: i32 = 49;

/// The levels of a run's threads, and what carries them out.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Levels {
    /// SCHED_FIFO up to this level.
    Fifo(i32),
    /// Our policy of sched_ext.
    SchedExt(Seats),
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

impl Role {
    /// Returns its place above what has no level.
    const fn rank(self) -> u8 {
        match self {
            Self::Release => 4,
            Self::Report => 3,
            Self::Run => 2,
            Self::Demoted => 1,
            Self::Abandoned => 0,
        }
    }
}

impl Levels {
    /// Takes the four levels of SCHED_FIFO up to `top`, if this program may.
    ///
    /// # Errors
    ///
    /// The kernel's reason, if it does not let us.
    pub(crate) fn of_fifo(top: i32) -> std::io::Result<Self> {
        let probe = move || {
            let me = sys::thread();
            sys::set_level(me, top)?;
            sys::set_normal(me)
        };
        let answer = std::thread::spawn(probe).join();
        answer
            .expect("the probe does not panic")
            .map(|()| Self::Fifo(top))
    }

    /// Brings a thread to its role's level.
    pub(crate) fn bring(self, thread: ThreadId, role: Role) {
        let rank = role.rank();
        // It worked before; a thread that has gone needs no level.
        let _ = match self {
            Self::Fifo(_) if rank == 0 => sys::set_normal(thread),
            Self::Fifo(top) => sys::set_level(thread, top - 4 + i32::from(rank)),
            Self::SchedExt(seats) => {
                seats.put(thread, rank);
                Ok(())
            }
        };
    }
}
