//! What is told of a run when it is over, by the kernel's own files; the [`Run`](crate::Run) is
//! that of Linux.

#[path = "../../../src/report/counts.rs"]
pub(crate) mod counts;
#[path = "../../../src/report/distribution.rs"]
mod distribution;
#[path = "../../../src/report/time.rs"]
mod time;
#[path = "../../../src/report/times.rs"]
pub(crate) mod times;
#[path = "../../../src/report/trace.rs"]
pub(crate) mod trace;
#[path = "../../../src/report/wire.rs"]
pub(crate) mod wire;

pub use distribution::Distribution;
pub use time::Ns;
