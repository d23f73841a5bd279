//! Progress lines, one for each twentieth of the jobs.

use super::patience::Patience;
use executive::run::execution;
use front::json;

/// How far a run has come.
#[derive(Debug)]
pub(super) struct Progress {
    total: u64,
    printed: u64,
    patience: Patience,
}

impl Progress {
    /// Begins with no job ended of `total`; 0: there is no end to come nearer to.
    pub(super) const fn new(total: u64) -> Self {
        Self {
            total,
            printed: 0,
            patience: Patience::new(),
        }
    }

    /// Prints how many jobs have ended, if that is a step further, and the line need
    /// not wait.
    pub(super) fn print_when_due(&mut self) {
        if self.total == 0 {
            return;
        }
        let done = execution::jobs_ended();
        let step = (self.total / 20).max(1);
        if done >= self.printed + step && self.patience.is_over() {
            self.printed = done;
            json::emit("progress", |line| {
                line.number("done", done).number("total", self.total);
            });
        }
    }
}
