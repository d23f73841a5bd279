//! Progress of long work: the amount done and the time left, or a sign of life for work with an
//! unknown total.

use std::io::{Write, stderr};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::{Duration, Instant};

use crate::system;

/// The longest time without a line, where lines do not renew themselves.
pub const SILENCE: Duration = Duration::from_secs(5);

/// Progress on standard error: on a terminal, a single line renewed in place; otherwise a new line
/// whenever nothing was said for [`SILENCE`].
pub struct Progress {
    /// The name of the counted units, such as `files`.
    unit: &'static str,
    total: u64,
    since: Instant,
    on_terminal: bool,
    said: Instant,
}

impl Progress {
    /// Starts before the first of `total` units.
    pub fn new(total: u64, unit: &'static str) -> Progress {
        Progress {
            unit,
            total,
            since: Instant::now(),
            on_terminal: system::stderr_moves(),
            said: Instant::now(),
        }
    }

    /// Shows that `over` units are done.
    pub fn show(&mut self, over: u64) {
        let line = line(over, self.total, self.unit, self.since.elapsed());
        // An error is ignored: a closed standard error must not end the run.
        if self.on_terminal {
            let _ = write!(stderr(), "\r\x1b[K{line}");
        } else if self.said.elapsed() >= SILENCE {
            let _ = writeln!(stderr(), "{line}");
            self.said = Instant::now();
        }
    }

    /// Removes the progress line from the terminal, if there is one.
    pub fn wipe(&self) {
        if self.on_terminal {
            let _ = write!(stderr(), "\r\x1b[K");
        }
    }
}

fn line(over: u64, total: u64, unit: &str, elapsed: Duration) -> String {
    let left = total.saturating_sub(over);
    // No unit is done, so there is no rate to extrapolate from (and no divisor).
    if over == 0 {
        return format!("progress: 0 of {total} {unit}");
    }
    // The rest is assumed to take as long per unit as the finished part.
    let left_s = elapsed.as_secs().saturating_mul(left) / over;
    let left = in_words(left_s);
    format!("progress: {over} of {total} {unit}, {left} left")
}

fn in_words(seconds: u64) -> String {
    match seconds {
        0..=99 => format!("{seconds} s"),
        _ => format!("{} min", seconds.div_ceil(60)),
    }
}

/// The longest pause between two lines.
const MOST: Duration = Duration::from_secs(60);

/// Reports repeatedly on standard error that work goes on, until this value is dropped: first after
/// [`SILENCE`], then with doubling pauses.
pub struct ProgressNote {
    _over: Sender<()>,
}

impl ProgressNote {
    /// Starts the reports; `what` names the work, such as "building `drone`".
    #[must_use = "it ends when it is dropped"]
    pub fn new(what: &str) -> ProgressNote {
        let what = what.to_string();
        ProgressNote::saying(SILENCE, move |since| {
            eprintln!("{what}: {} s so far", since.as_secs());
        })
    }

    fn saying(first: Duration, say: impl Fn(Duration) + Send + 'static) -> ProgressNote {
        let (over, is_over) = channel::<()>();
        thread::spawn(move || {
            let (begun, mut pause) = (Instant::now(), first);
            // Dropping the sender disconnects the channel, which ends the wait and the loop at
            // once.
            while is_over.recv_timeout(pause) == Err(RecvTimeoutError::Timeout) {
                say(begun.elapsed());
                pause = (pause * 2).min(MOST);
            }
        });
        ProgressNote { _over: over }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_left_is_in_proportion() {
        for (over, seconds, expected) in [
            (60, 50, "progress: 60 of 120 rounds, 50 s left"),
            (30, 100, "progress: 30 of 120 rounds, 5 min left"),
            (0, 7, "progress: 0 of 120 rounds"),
        ] {
            let elapsed = Duration::from_secs(seconds);
            assert_eq!(line(over, 120, "rounds", elapsed), expected);
        }
    }

    #[test]
    fn what_lasts_is_said_until_it_ends() {
        let (sender, said) = channel();
        let lasting = ProgressNote::saying(Duration::from_millis(1), move |since| {
            let _ = sender.send(since);
        });
        let first = said.recv().expect("it lasts");
        assert!(first < said.recv().expect("it still lasts"));
        drop(lasting);
        // The thread ends, and the channel with it.
        while said.recv().is_ok() {}
    }
}
