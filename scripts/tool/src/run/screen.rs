//! What a person (or a program) sees of a run while it goes on.
//!
//! Lines for people and machine lines go to standard output in the order of
//! the serial log, so that `grep '^{'` works there as on the log itself.
//! Progress lines become one line on standard error that renews itself if
//! that is a terminal, and otherwise a line each tenth of the way. Status lines
//! take its place on a terminal. A fault at an address gets a line of our own that
//! names the function.

use std::path::Path;

use crate::options::Parsed;
use crate::places::Places;
use crate::protocol::{MachineLine, read_line};
use crate::system;

use super::status::StatusLine;

/// The width of the bar.
const BAR: u64 = 30;

/// Where each kind of line goes.
pub(super) struct Screen {
    people: bool,
    machine: bool,
    quiet: bool,
    on_terminal: bool,
    bar_is_shown: bool,
    status: StatusLine,
    tenths_shown: u64,
    places: Places,
}

impl Screen {
    pub(super) fn new(options: &Parsed, image: &Path) -> Screen {
        Screen {
            people: !options.is_given("json"),
            machine: !options.is_given("plain")
                && (options.is_given("json") || !options.is_given("console")),
            quiet: options.is_given("quiet"),
            on_terminal: system::stderr_moves(),
            bar_is_shown: false,
            status: StatusLine::default(),
            tenths_shown: 0,
            places: Places::new(image),
        }
    }

    /// Says something of our own, unless we shall be quiet.
    pub(super) fn say(&self, line: &str) {
        if self.quiet {
            return;
        }
        if self.people {
            println!("{line}");
        } else {
            eprintln!("{line}");
        }
    }

    /// Shows one line of the serial log.
    pub(super) fn show(&mut self, line: &str) {
        // The number is for messages only, and the judge makes those.
        let read = read_line(0, line);
        if let Some(Ok(machine)) = &read {
            match machine.kind.as_str() {
                "progress" => return self.advance(machine),
                // What it says is in a file, or nobody has asked for it here.
                "record" => return,
                "status" if self.on_terminal => return self.show_status(machine),
                _ => {}
            }
        }
        let wanted = if read.is_some() {
            self.machine
        } else {
            self.people
        };
        if wanted {
            self.end();
            println!("{line}");
        }
        if let Some(place) = self.places.explain(line) {
            self.end();
            self.say(&format!("  {place}"));
        }
    }

    /// Wipes the progress line away.
    pub(super) fn end(&mut self) {
        if std::mem::take(&mut self.bar_is_shown) {
            eprint!("\r\x1b[K");
        }
    }

    fn show_status(&mut self, line: &MachineLine) {
        if let Some(text) = self.status.text(line).filter(|_| !self.quiet) {
            eprint!("\r\x1b[K{text}");
            self.bar_is_shown = true;
        }
    }

    fn advance(&mut self, line: &MachineLine) {
        let (Some(done), Some(total)) = (line.number_at("done"), line.number_at("total")) else {
            return;
        };
        if self.quiet || total == 0 {
            return;
        }
        let done = done.min(total);
        // In `u128` no product of two `u64` overflows.
        let part_of = |whole: u64| {
            let part = u128::from(done) * u128::from(whole) / u128::from(total);
            u64::try_from(part).unwrap_or(whole)
        };
        if self.on_terminal {
            let filled: String = (0..BAR)
                .map(|i| if i < part_of(BAR) { '#' } else { '.' })
                .collect();
            eprint!("\r\x1b[K[{filled}] {done} of {total} jobs");
            self.bar_is_shown = true;
        } else if part_of(10) != self.tenths_shown {
            self.tenths_shown = part_of(10);
            eprintln!("progress: {done} of {total} jobs");
        }
    }
}
