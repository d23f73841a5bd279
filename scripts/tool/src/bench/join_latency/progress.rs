//! How far the measurement is, for the person who waits.

use std::io::{Write, stderr};
use std::time::{Duration, Instant};

use crate::protocol::read_line;
use crate::system;

/// A line on standard error: one that renews itself on a terminal.
#[derive(Debug)]
pub(super) struct Progress {
    on_terminal: bool,
    total: usize,
    /// Conditions that are complete, by measuring or by having been.
    complete: usize,
    measured: usize,
    /// The time that measuring those took.
    spent: Duration,
    name: String,
    began: Instant,
}

impl Progress {
    pub(super) fn new(total: usize) -> Progress {
        Progress {
            on_terminal: system::stderr_moves(),
            total,
            complete: 0,
            measured: 0,
            spent: Duration::ZERO,
            name: String::new(),
            began: Instant::now(),
        }
    }

    /// Begins a condition.
    pub(super) fn begin(&mut self, name: String) {
        self.name = name;
        self.began = Instant::now();
        self.draw(0.0);
    }

    /// Looks at a line of the guest.
    pub(super) fn follow(&mut self, line: &str) {
        if let Some(Ok(line)) = read_line(0, line)
            && line.kind == "progress"
            && let (Some(done), Some(total)) = (line.number_at("done"), line.number_at("total"))
        {
            self.draw(done as f64 / total.max(1) as f64);
        }
    }

    /// Ends a condition that was measured.
    pub(super) fn end(&mut self) {
        let took = self.began.elapsed();
        self.spent += took;
        self.measured += 1;
        self.complete += 1;
        self.report(&format!("{:.1} s, {}", took.as_secs_f64(), self.left(0.0)));
    }

    /// Passes over a condition that is there already.
    pub(super) fn skip(&mut self, name: String) {
        self.name = name;
        self.complete += 1;
        self.report("is there already");
    }

    /// Says something about the condition in hand.
    pub(super) fn note(&self, what: &str) {
        self.say("", what);
    }

    fn report(&self, what: &str) {
        self.say(&format!("[{} of {}] ", self.complete, self.total), what);
    }

    fn say(&self, before: &str, what: &str) {
        let wipe = if self.on_terminal { "\r\x1b[K" } else { "" };
        // That no one reads it must not end the measurement.
        let _ = writeln!(stderr(), "{wipe}{before}{}: {what}", self.name);
    }

    fn draw(&self, part: f64) {
        if self.on_terminal {
            let (now, total, name) = (self.complete + 1, self.total, &self.name);
            let (percent, left) = (part * 100.0, self.left(part));
            let _ = write!(
                stderr(),
                "\r\x1b[K[{now} of {total}] {name}: {percent:.0} %, {left}"
            );
        }
    }

    /// Says how much time is left, from what the conditions took so far.
    fn left(&self, part: f64) -> String {
        let to_do = (self.total - self.complete) as f64;
        let done = self.measured as f64 + part;
        if to_do == 0.0 {
            return "nothing left".into();
        }
        if done == 0.0 {
            return "time left unknown".into();
        }
        let in_hand = match part > 0.0 {
            true => self.began.elapsed(),
            false => Duration::ZERO,
        };
        let spent = (self.spent + in_hand).as_secs_f64();
        format!("about {:.0} s left", (spent / done * (to_do - part)).ceil())
    }
}
