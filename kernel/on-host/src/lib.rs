//! The kernel in virtual time, for apps.
//!
//! An app's `main.rs` names `kernel`. This crate offers the same items by the same names, as does
//! `kernel-on-linux`, and `virtual-time` does the work. So the file of an image is also a program
//! that schedules its DAGs in no time, without a machine. Lines, options, reports and verdicts come
//! from `front`, as in the kernel.
//!
//! # What is guaranteed
//!
//! - Lines, verdict and command-line options are those of the machine.
//! - An option without meaning in virtual time is refused.
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
