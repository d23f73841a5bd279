//! The kernel on top of Linux, for apps.
//!
//! An app's `main.rs` names `kernel`: the machine lent to the app, the options of its command line,
//! its output, the run it gets back. This crate offers the same items by the same names, and
//! `linux` does the work. So the file of an image is also a program for Linux:
//!
//! ```ignore
//! extern crate kernel_on_linux as kernel;
//!
//! #[path = "../src/main.rs"]
//! mod image;
//!
//! fn main() -> std::process::ExitCode {
//!     image::program()
//! }
//! ```
//!
//! Lines, options, reports and verdicts come from `front`, as in the kernel.
//!
//! # What is guaranteed
//!
//! - Lines, verdict and command-line options are those of the machine.
//! - An option without meaning on Linux is refused; none is ignored.
//!
//! # What is not
//!
//! - Bounds are not judged (`bound_exceeded` is printed, but does not affect the verdict), because
//!   Linux states no worst case for its own work.

#![deny(unsafe_code)]

#[doc(hidden)]
pub mod entry;
mod event;
#[allow(unsafe_code, reason = "an allocator that counts")]
mod heap;
mod linux_system;
mod program;

pub use event::Event;
#[doc(inline)]
pub use fass::shared::Lock;
pub use front::app::ending::AppError;
#[doc(inline)]
pub use front::named::{console, json, options};
pub use front::report;
pub use front::report::MemoryInUse;
pub use front::{print, println};
#[doc(hidden)]
pub use heap::Heap;
pub use linux_system::Machine;
#[doc(inline)]
pub use sched_dag::engine::Run;

/// Reports whether functions may use AVX: whether the processor has it.
pub fn has_avx() -> bool {
    #[cfg(target_arch = "x86_64")]
    return std::is_x86_feature_detected!("avx");
    #[cfg(not(target_arch = "x86_64"))]
    false
}
