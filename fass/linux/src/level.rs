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

/// What a thread is at its level for, the lower ones first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum Role {
    /// What it runs was ended: it is to delay nobody any more, in no other program either.
    Abandoned,
    /// It has lost its core.
    Demoted,
    /// It runs what its core should run.
    Run,
    /// It needs the scheduler's lock at once, whatever its core computes.
    Report,
    /// It releases jobs.
    Release,
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
        // Its place above what has no level.
        let rank = role as u8;
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
