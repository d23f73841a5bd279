//! Text in and out: the serial line, and machine lines.
//!
//! `console` takes text without disturbing measurements. This module knows nothing of the run.

pub mod backtrace;
pub mod console;
