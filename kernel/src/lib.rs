//! The unikernel: runs committed DAGs on bare x86_64 processors.
//!
//! An app is one function. It states its DAGs with `fass`, commits them, and
//! tells its [`Machine`] to run them; the kernel does the rest:
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
//! Examples in this crate's documentation are compiled and not run: it contains the
//! image's first instruction, with which no program of the host can be linked. An app's
//! own functions need no kernel and run on the host (`virtual-time`).
//!
//! The words (*run*, *context*, *step* and others) are in `docs/glossary.md`.
//!
//! # Principles
//!
//! 1. **The scheduler decides, the kernel carries out.** `sched-dag` is told
//!    what happens and when; no line here chooses an instance.
//! 2. **One lock around the scheduler**, held with interrupts off for one step
//!    of it, never across an app's function.
//! 3. **After commit nothing allocates**: from a job's release to its completion
//!    all memory is there already.
//! 4. **A core without work halts**, and is woken by the core that has some.
//! 5. **`unsafe` is in the executive's `machine`, `memory` and `devices`, and in `entry` and `start`**
//!    alone, each block with the invariant that it relies on. A driver has one such step.
//! 6. **Apps are not trusted**: what they say is verified at commit, and nothing here lets one change
//!    a core's interrupts:
//!
//! ```compile_fail,E0425
//! kernel::set_heartbeat(core::time::Duration::from_nanos(1));
//! ```
//!
//! # Rooms, from top to bottom
//!
//! `entry` and `start` bring an image up, `app` is what an app sees of the kernel. `watch` looks in
//! on a run, [`devices`] is for drivers, and [`report`] tells of it afterwards; [`options`] reads the words of the command
//! line. The part that executes jobs is below, in a crate of its own, `executive`: cores,
//! interrupts, memory, the drivers of the scheduler, and output ([`console`], [`json`]).
//! `docs/architecture.md` has the table that the tests hold this to.

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

/// Returns the number of timer interrupts that all cores have taken since boot.
///
/// ```no_run
/// let before = kernel::timer_interrupts();
/// // a run
/// kernel::println!("{} timer interrupts", kernel::timer_interrupts() - before);
/// ```
pub fn timer_interrupts() -> u64 {
    executive::interrupts::timer_interrupts()
}

/// Reports whether functions may use AVX: the processor has it, and the word `avx=off` is
/// not given.
///
/// A function that uses it bears `#[target_feature(enable = "avx")]`, and its caller has
/// asked. Any other feature, such as `avx2`, is asked of the processor
/// (`core::arch::x86_64::__cpuid`) besides; its state is AVX's.
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
