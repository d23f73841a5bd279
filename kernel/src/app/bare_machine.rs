//! The kernel as the platform below an app's machine.

use alloc::boxed::Box;
use core::cell::Cell;
use core::fmt;
use core::net::SocketAddrV4;
use core::panic::Location;
use core::time::Duration;

use fass::platform::{Platform, Protocol, RunConfig};
use fass::shared::{Signal, Wire};

use super::calibration;
use crate::options::CommandLine;
use crate::report::{self, Ns};
use crate::watch::background::KernelRun;
use crate::watch::background::endpoint::{self, CONNECTED, EndpointWords};
use crate::watch::background::{Background, BackgroundOptions};
use executive::machine::{self, interrupts_off, this_core};
use executive::memory::heap;
use executive::run::platform::KERNEL;
use executive::run::{contexts, edge, execution, record, worker};
use executive::text::console;
use front::app::ending::AppError;
use front::app::endpoint::word_of;
use front::app::machine::System;
use front::json;
use front::report::HeapUsage;
use sched_dag::engine::{Run, RunCounts};

/// The machine, lent to the app's function for the time of the run.
pub type Machine = front::app::machine::Machine<BareMachine>;

/// The kernel, as seen by an app's machine.
pub struct BareMachine {
    /// The options for people's view of a run, and for their commands.
    wishes: BackgroundOptions,
    /// Whether a person has ended the latest run.
    is_shut_down: Cell<bool>,
}

impl BareMachine {
    pub(crate) const fn new(wishes: BackgroundOptions) -> Self {
        Self {
            wishes,
            is_shut_down: Cell::new(false),
        }
    }
}

impl System for BareMachine {
    type Run = KernelRun;

    fn has_console(&self) -> bool {
        self.wishes.console.is_some()
    }

    fn terms(&self) -> RunConfig {
        KERNEL.terms()
    }

    fn change(&self, change: impl FnOnce(&mut RunConfig)) {
        KERNEL.change(change);
    }

    fn set_coincidence(&self, window: Duration) {
        KERNEL.set_coincidence_ns(u64::try_from(window.as_nanos()).unwrap_or(u64::MAX));
    }

    fn run(&self, epoch_ns: Option<u64>, input: Option<&Signal>) -> Result<Run, AppError> {
        /// Time for the cores to get ready between now and the first release.
        const LEAD_NS: u64 = 100_000;
        let epoch_ns = epoch_ns.unwrap_or_else(|| machine::clock::now_ns() + LEAD_NS);
        let nothing = || AppError::Failure("nothing is committed; call finish_create_dags".into());
        let total = execution::set_epoch(epoch_ns).ok_or_else(nothing)?;
        let mut outgoing = edge::get().begin_run(epoch_ns);
        let allocations_before = heap::usage().allocations;
        let locks_before = execution::lock_acquisitions();
        console::defer();
        execution::arm_all();
        let mut background = Background::begin(self.wishes, input.and_then(Signal::target), total);
        // Forget sections measured while booting and printing: only the run counts.
        let _ = interrupts_off::take_longest();
        // `|`, not `||`: each gets its turn in each round.
        worker::wait_in_background(|| record::step(&mut outgoing) | background.step());
        self.is_shut_down.set(background.end());
        let longest = interrupts_off::take_longest();
        let allocations = heap::usage().allocations - allocations_before;
        let locks = execution::lock_acquisitions().wrapping_sub(locks_before);
        let dropped = console::resume();
        if dropped > 0 {
            // The cut has most likely removed the end of a line.
            crate::println!("\n({dropped} bytes of output did not fit in the buffer)");
        }
        // Before the run is taken out, and with it the journals.
        record::end_recording(outgoing, !self.is_shut_down());
        let run = execution::take_run().ok_or_else(nothing)?;
        let run = run.with_counts(RunCounts {
            epoch_ns,
            allocations,
            lock_acquisitions: locks,
        });
        record::end_run(&run);
        report::tell_left(&run);
        CONNECTED.iter().for_each(|endpoint| endpoint.tell());
        if let Some((ticks, place)) = longest {
            report_interrupts_off(machine::clock::ticks_to_ns(ticks), place);
        }
        report::tell_stacks(&run);
        Ok(run)
    }

    fn is_shut_down(&self) -> bool {
        self.is_shut_down.get()
    }

    fn connect(
        &self,
        wire: &Wire,
        options: &CommandLine<'static>,
        module: &Cell<Option<&'static [u8]>>,
    ) -> Result<(), AppError> {
        let word = word_of(wire, options)?;
        let words = EndpointWords {
            options,
            module,
            word,
        };
        endpoint::connect(wire, &words)
    }

    fn connect_protocol(
        &self,
        protocol: Box<dyn Protocol>,
        peer: SocketAddrV4,
        options: &CommandLine<'static>,
    ) -> Result<(), AppError> {
        endpoint::connect_protocol(protocol, peer, options)
    }

    fn seed() -> u128 {
        let second = u128::from(machine::date::unix_s().unwrap_or(0));
        // The time stamp is so fine that two boots hardly ever take equally long.
        second << 64 | u128::from(machine::cpu::time_stamp())
    }

    fn unix_ns() -> Option<u64> {
        machine::date::unix_s().map(|seconds| seconds * 1_000_000_000)
    }

    fn measure_overheads(margin_percent: u32) -> Result<(), AppError> {
        calibration::charge(margin_percent)
    }

    fn contexts() -> (usize, usize) {
        let (contexts, in_stock) = contexts::count();
        let spare = this_core::all().iter().filter(|core| core.has_spare());
        (contexts, in_stock + spare.count())
    }

    fn memory() -> HeapUsage {
        heap::usage()
    }
}

fn report_interrupts_off(longest_ns: u64, place: &Location<'_>) {
    let place = fmt::from_fn(|f| write!(f, "{}:{}", place.file(), place.line()));
    crate::println!(
        "longest section without interrupts: {}, from {place}",
        Ns(longest_ns)
    );
    json::emit("interrupts_off", |line| {
        line.number("longest_ns", longest_ns).text("place", &place);
    });
}
