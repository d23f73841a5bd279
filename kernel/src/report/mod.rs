//! Figures over many samples, as reports show them.

mod distribution;
mod time;

pub use distribution::Distribution;
pub use time::Ns;
