//! Progress lines, one for each twentieth of the jobs.

use crate::machine::clock;
use crate::{execution, json};

/// The time that a line takes, with much room.
const TIME_TO_PRINT_NS: u64 = 1_000_000;

/// How far a run has come.
#[derive(Debug)]
pub(super) struct Progress {
    total: u64,
    printed: u64,
}

impl Progress {
    /// Begins with no job ended of `total`; 0: there is no end to come nearer to.
    pub(super) const fn new(total: u64) -> Self {
        Self { total, printed: 0 }
    }

    /// Prints how many jobs have ended, if that is a step further and the next
    /// event leaves time for it.
    pub(super) fn print_when_due(&mut self) {
        if self.total == 0 {
            return;
        }
        let done = execution::jobs_ended();
        let step = (self.total / 20).max(1);
        if done >= self.printed + step && is_quiet() {
            self.printed = done;
            json::emit("progress", |line| {
                line.number("done", done).number("total", self.total);
            });
        }
    }
}

/// Reports whether the scheduler leaves time for a line.
pub(super) fn is_quiet() -> bool {
    execution::next_event_ns() > clock::now_ns() + TIME_TO_PRINT_NS
}
