//! How much of the machine's memory is in use.

use executive::machine::this_core;
use executive::memory::heap;
use executive::run::contexts;
use front::json;

use super::machine_handle::Machine;

/// What of the machine's memory is in use while nothing runs.
///
/// See [`Machine::resources`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Resources {
    /// The bytes of the heap that are in use.
    pub heap_bytes: usize,
    /// The contexts, each with a stack, that there are for instances.
    pub contexts: usize,
    /// How many of these can be taken: while nothing runs, all.
    pub contexts_free: usize,
}

impl Machine {
    /// Returns what is in use and what is free between two runs: the same after
    /// equal work, unless something leaks. During a run the stacks of running instances are not
    /// free.
    ///
    /// ```no_run
    /// fn leaks(machine: &kernel::Machine, work: impl Fn()) -> bool {
    ///     work();
    ///     let before = machine.resources();
    ///     work();
    ///     machine.resources() != before
    /// }
    /// ```
    #[must_use]
    pub fn resources(&self) -> Resources {
        let (contexts, in_stock) = contexts::count();
        let spare = this_core::all().iter().filter(|core| core.has_spare());
        Resources {
            heap_bytes: heap::usage().in_use_bytes,
            contexts,
            contexts_free: in_stock + spare.count(),
        }
    }

    /// Prints how much memory the run has needed, as a `memory` machine line.
    ///
    /// See [`Machine`].
    pub fn report_memory(&self) {
        let usage = heap::usage();
        crate::println!(
            "heap: {} KiB at its peak of {} KiB",
            usage.peak_bytes.div_ceil(1024),
            usage.capacity_bytes / 1024
        );
        json::emit("memory", |line| {
            line.number("heap_peak_bytes", usage.peak_bytes as u64)
                .number("heap_bytes", usage.capacity_bytes as u64)
                .number("allocations", usage.allocations);
        });
    }
}
