//! The unikernel: runs committed DAGs on bare x86_64 processors.
//!
//! An app is one function. It states its DAGs with `fass`, commits them, and
//! tells its [`Machine`] to run them; the kernel does the rest:
//!
//! ```no_run
//! use kernel::{Ending, Machine};
//!
//! fn app(machine: &Machine) -> Result<(), Ending> {
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
//! 5. **`unsafe` is in `machine`, `memory` and the entry** (`entry`, `start`) alone,
//!    each block with the invariant that it relies on.
//! 6. **Apps are not trusted**: what they say is verified at commit.
//!
//! # From bottom to top
//!
//! `machine` (processor, interrupts, time) and `memory` know nothing of what is
//! above. `contexts` keeps stacks, `trace` what has happened. `execution` holds the
//! scheduler, `containment` decides what a fault ends, `worker` is the loop of each core,
//! `background` what core 0 does besides. `platform` answers `fass`, [`Machine`] is what
//! an app sees, [`Run`] what it gets from a run. [`console`], [`json`], [`options`] and
//! [`report`] serve input and output.

#![cfg_attr(not(test), no_std)]

extern crate alloc;

mod background;
mod bound_verdict;
pub mod console;
mod containment;
mod contexts;
mod ending;
#[allow(unsafe_code, reason = "the symbols that an image must define")]
#[doc(hidden)]
pub mod entry;
mod event;
mod excerpt;
mod execution;
mod fault_verdict;
mod graph;
mod heartbeat;
mod interrupts;
mod journal;
pub mod json;
mod lock;
#[allow(unsafe_code, reason = "registers, ports, interrupts, page tables")]
mod machine;
mod machine_handle;
#[allow(unsafe_code, reason = "the allocator hands out raw memory")]
mod memory;
mod occupation;
pub mod options;
mod panic;
mod platform;
mod probe;
pub mod report;
mod run;
mod settings;
#[allow(unsafe_code, reason = "the way up to the first safe state")]
mod start;
mod worker;

pub use ending::Ending;
pub use event::Event;
pub use lock::Lock;
pub use machine_handle::{Machine, Resources};
pub use memory::heap::KernelHeap;
pub use run::Run;

/// Returns the number of timer interrupts that all cores have taken since boot.
///
/// ```no_run
/// let before = kernel::timer_interrupts();
/// // a run
/// kernel::println!("{} timer interrupts", kernel::timer_interrupts() - before);
/// ```
#[must_use]
pub fn timer_interrupts() -> u64 {
    interrupts::timer_interrupts()
}

/// The README's app, compiled.
#[cfg(doctest)]
#[doc = include_str!("../../README.md")]
mod readme {}
