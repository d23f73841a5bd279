//! The kernel as an app sees it, with Linux below it.
//!
//! An app's `main.rs` names `kernel`: the machine that it is lent, the words of its command
//! line, what it prints, the run that it gets back. This crate offers the same by the same
//! names, and `linux` does the work. So the file that is an image is a program of Linux, too:
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
//! Lines, words, reports and verdicts are `front`'s, as the kernel's are.
//!
//! # What is guaranteed
//!
//! - Lines, verdict and the words of the command line are those of the machine.
//! - A word that means nothing on Linux is refused; none is ignored.
//!
//! # What is not
//!
//! - Bounds are not judged (`bound_exceeded` is said, and the verdict leaves it): Linux states
//!   no worst case for what it does itself.

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

/// Reports whether functions may use AVX: the processor has it.
pub fn has_avx() -> bool {
    #[cfg(target_arch = "x86_64")]
    return std::is_x86_feature_detected!("avx");
    #[cfg(not(target_arch = "x86_64"))]
    false
}
