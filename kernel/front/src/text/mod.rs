//! All text going out: machine lines (`json`), and the path of text to the platform (`console`).

pub mod console;
pub mod json;

use core::fmt;

/// Nanoseconds, shown with about four digits and a unit: `412 ns`, `1.050 us`, `25.000 ms`, `1.500
/// s`. Honours the width of the format string.
///
/// ```no_run
/// use kernel::report::Ns;
///
/// assert_eq!(Ns(25_000_000).to_string(), "25.000 ms");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ns(pub u64);

impl fmt::Display for Ns {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ns = self.0;
        let (unit, name) = match ns {
            0..1_000 => return f.pad(&alloc::format!("{ns} ns")),
            1_000..1_000_000 => (1_000, "us"),
            1_000_000..1_000_000_000 => (1_000_000, "ms"),
            _ => (1_000_000_000, "s"),
        };
        let thousandths = (ns % unit) / (unit / 1_000);
        f.pad(&alloc::format!("{}.{thousandths:03} {name}", ns / unit))
    }
}
