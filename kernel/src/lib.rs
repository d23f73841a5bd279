//! The unikernel: runs committed DAGs on bare x86_64 processors.
//!
//! An app is a single function. It states its DAGs with `fass`, commits them, and tells its
//! [`Machine`] to run them; the kernel does the rest:
//!
//! ```no_run
//! use kernel::{AppError, Machine};
//!
//! fn app(machine: &Machine) -> Result<(), AppError> {
//!     machine.options().finish(&[])?;
//!     // create_dag(), register_*(), finish_create_dags() ...
//!     let run = machine.run()?;
//!     kernel::println!("{} violations", run.violations().count());
//!     Ok(())
//! }
//! // In the app's `main.rs`: kernel::entry!(app);
//! # fn main() {}
//! ```
//!
//! Examples in this crate's documentation are compiled but not run: the crate contains the image's
//! first instruction, and no program of the host can be linked with it. An app's own functions need
//! no kernel and run on the host (`virtual-time`).
//!
//! Terms (*run*, *context*, *step* and others) are defined in `docs/glossary.md`.
//!
//! # Principles
//!
//! 1. **The scheduler decides, the kernel carries out.** `sched-dag` is told about events and their
//!    times; no line here chooses an instance.
//! 2. **One lock around each cluster's scheduler**, held with interrupts off for a single step of
//!    the scheduler, never across an app's function.
//! 3. **After commit nothing allocates**: all memory needed from a job's release to its completion
//!    exists already.
//! 4. **A core without work halts**, and is woken by a core with work for it.
//! 5. **`unsafe` is confined** to the executive's `machine`, `memory`, `devices` and loans of
//!    `run`, and to `entry` and `start`. Each block names the invariant it relies on. A driver has
//!    a single such step.
//! 6. **Apps are not trusted**: their statements are verified at commit, and nothing here lets an
//!    app change a core's interrupts:
//!
//! ```compile_fail,E0425
//! kernel::set_heartbeat(core::time::Duration::from_nanos(1));
//! ```
//!
//! # Modules, from top to bottom
//!
//! `entry` and `start` bring an image up, `app` offers the kernel's services to apps. `watch`
//! observes a run, [`devices`] is for drivers, [`report`] describes a finished run, and [`options`]
//! reads the command line. Below is a crate of its own, `executive`, which executes jobs: cores,
//! interrupts, memory, the drivers of the scheduler, and output ([`console`], [`json`]). The tests
//! check this crate against the table in `docs/architecture.md`.

#![cfg_attr(not(test), no_std)]

extern crate alloc;

mod app;
pub mod devices;
#[allow(unsafe_code, reason = "the symbols that an image must define")]
#[doc(hidden)]
pub mod entry;
pub mod report;
mod start;
mod watch;

#[doc(hidden)]
pub use boot::memory_functions;

pub use crate::app::event::Event;
pub use app::bare_machine::Machine;
pub use executive::memory::heap::KernelHeap;
#[doc(inline)]
pub use fass::shared::Lock;
pub use front::app::ending::AppError;
#[doc(inline)]
pub use front::named::{console, json, options};
pub use front::report::MemoryInUse;
pub use front::{print, println};
#[doc(inline)]
pub use sched_dag::engine::Run;

/// Returns the number of timer interrupts taken by all cores since boot.
///
/// ```no_run
/// let before = kernel::timer_interrupts();
/// // a run
/// kernel::println!("{} timer interrupts", kernel::timer_interrupts() - before);
/// ```
pub fn timer_interrupts() -> u64 {
    executive::interrupts::timer_interrupts()
}

/// Reports whether functions may use AVX: the processor has AVX, and the option `avx=off` is not
/// given.
///
/// A function using AVX carries the attribute `#[target_feature(enable = "avx")]`, and its caller
/// has to ask first. For a feature using the same registers, such as `avx2` or `fma`, the caller
/// also has to ask the processor (`core::arch::x86_64::__cpuid`). AVX-512 is not enabled, whatever
/// the processor says.
///
/// ```no_run
/// # #![allow(unsafe_code)]
/// #[target_feature(enable = "avx")]
/// fn sum_by_avx(values: &[f32]) -> f32 {
///     values.iter().sum()
/// }
///
/// fn sum(values: &[f32]) -> f32 {
///     match kernel::has_avx() {
///         // SAFETY: the processor has AVX.
///         true => unsafe { sum_by_avx(values) },
///         false => values.iter().sum(),
///     }
/// }
/// ```
pub fn has_avx() -> bool {
    executive::machine::avx::is_on()
}

/// The README's app, compiled.
#[cfg(doctest)]
#[doc = include_str!("../../README.md")]
mod readme {}
