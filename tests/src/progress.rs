//! What is shown while a soak run goes on: how far it is, and the time left.

use std::io::{IsTerminal, Write, stderr};
use std::time::{Duration, Instant};

/// Progress on standard error: one line that renews itself if that is a
/// terminal, and otherwise a line each tenth of the way.
pub(super) struct Progress {
    total: u64,
    since: Instant,
    on_terminal: bool,
    tenths_shown: u64,
}

impl Progress {
    /// Starts at the first of `total` rounds.
    pub(super) fn new(total: u64) -> Progress {
        Progress {
            total,
            since: Instant::now(),
            on_terminal: stderr().is_terminal(),
            tenths_shown: 0,
        }
    }

    /// Shows that `over` rounds are over.
    pub(super) fn show(&mut self, over: u64) {
        let line = line(over, self.total, self.since.elapsed());
        let tenths = over * 10 / self.total.max(1);
        // That no one reads it must not end the run.
        if self.on_terminal {
            let _ = write!(stderr(), "\r\x1b[K{line}");
        } else if tenths != self.tenths_shown {
            let _ = writeln!(stderr(), "{line}");
        }
        self.tenths_shown = tenths;
    }

    /// Wipes the line away.
    pub(super) fn end(&self) {
        if self.on_terminal {
            let _ = write!(stderr(), "\r\x1b[K");
        }
    }
}

fn line(over: u64, total: u64, elapsed: Duration) -> String {
    let left = total.saturating_sub(over);
    // The rounds to come are taken to be as long as those that are over.
    let left_s = elapsed.as_secs().saturating_mul(left) / over.max(1);
    format!(
        "progress: {over} of {total} rounds, {} left",
        in_words(left_s)
    )
}

fn in_words(seconds: u64) -> String {
    match seconds {
        0..=99 => format!("{seconds} s"),
        _ => format!("{} min", seconds.div_ceil(60)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_left_is_in_proportion() {
        let at = |over, seconds| line(over, 120, Duration::from_secs(seconds));
        assert_eq!(at(60, 50), "progress: 60 of 120 rounds, 50 s left");
        assert_eq!(at(30, 100), "progress: 30 of 120 rounds, 5 min left");
        assert_eq!(at(120, 100), "progress: 120 of 120 rounds, 0 s left");
        assert_eq!(at(0, 7), "progress: 0 of 120 rounds, 14 min left");
    }
}
