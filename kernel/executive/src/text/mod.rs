//! Text in and out: the serial line, and machine lines.
//!
//! `console` takes text without disturbing what is measured. Of the run, nothing is known here.

pub mod backtrace;
pub mod console;
