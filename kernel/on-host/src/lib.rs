//! The kernel as an app sees it, in virtual time.
//!
//! An app's `main.rs` names `kernel`. This crate offers the same by the same names, as
//! `kernel-on-linux` does, and `virtual-time` does the work: so the file that is an image is a
//! program that schedules its DAGs in no time, without a machine. Lines, words, reports and
//! verdicts are `front`'s, as the kernel's are.
//!
//! # What is guaranteed
//!
//! - Lines, verdict and the words of the command line are those of the machine.
//! - A word that means nothing in virtual time is refused.
//! - A run has neither overheads nor latencies, so the law allows it no tolerance.
//!
//! # What is not
//!
//! - Wires, networks and consoles: there is nobody at the other end.

#![forbid(unsafe_code)]

#[doc(hidden)]
pub mod entry;
mod host_system;
#[path = "../../on-linux/src/program/mod.rs"]
mod program;

pub use front::app::ending::AppError;
#[doc(inline)]
pub use front::named::{console, json, options};
pub use front::report;
pub use front::report::MemoryInUse;
pub use front::{print, println};
pub use host_system::Machine;
#[doc(inline)]
pub use sched_dag::engine::Run;
