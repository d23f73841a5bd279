//! The end of a kernel that cannot go on: what happened, where, to whom.
//!
//! The core that panics stops all others first, so the report is not torn
//! apart and nothing runs on with broken data. A panic during the report ends
//! the run with what was said so far. Faults of subtasks do not get here:
//! `containment` ends their DAG instead.

use core::fmt::{self, Display};
use core::panic::PanicInfo;
use core::sync::atomic::{AtomicBool, Ordering};

use crate::console::write_in_emergency;
use crate::containment;
use crate::machine::context::Registers;
use crate::machine::fault::{self, Exception};
use crate::machine::interrupt::Interrupted;
use crate::machine::{cpu, exit, this_core};
use crate::{execution, json, trace};

/// The most recent events of this core that a report shows.
const EVENTS_SHOWN: usize = 16;

static PANICKING: AtomicBool = AtomicBool::new(false);

/// Ends the subtask that panics, or else the run.
pub(crate) fn panic(info: &PanicInfo<'_>) -> ! {
    containment::end_panicked(info);
    die("panic", &info.message(), &containment::place_of(info), None)
}

/// Ends the subtask that caused an exception, or else the run.
pub(crate) fn exception(exception: &Exception<'_>, interrupted: &mut Interrupted) {
    if !containment::end_faulty(exception, interrupted) {
        let registers = exception.registers;
        let place = fmt::from_fn(|f| write!(f, "{:#x}", registers.rip));
        die("exception", exception, &place, Some(registers))
    }
}

fn die(what: &str, message: &dyn Display, place: &dyn Display, registers: Option<&Registers>) -> ! {
    cpu::disable_interrupts();
    if PANICKING.swap(true, Ordering::AcqRel) {
        // Either another core reports already and is about to stop this one, or
        // this core's own report has failed.
        exit::exit(exit::Status::Failure);
    }
    let core = this_core::is_ready().then(this_core::get);
    if core.is_some() {
        fault::stop_others();
    }
    let index = core.map_or(0, |core| core.index);
    let instance = core.and_then(execution::running);
    write_in_emergency(format_args!(
        "\nkernel {what} on core {index}: {message}\n  at {place}\n"
    ));
    if let Some(instance) = instance {
        write_in_emergency(format_args!("  in {instance}\n"));
        execution::try_names(instance, |dag, subtask| {
            write_in_emergency(format_args!(
                "  that is subtask `{subtask}` of DAG `{dag}`\n"
            ));
        });
    }
    if let Some(registers) = registers {
        write_in_emergency(format_args!("{registers}"));
    }
    if core.is_some() {
        write_in_emergency(format_args!("{}", trace::latest(EVENTS_SHOWN)));
    }
    let line = json::line(what, |line| {
        line.number("cpu", index);
        if let Some(instance) = instance {
            line.number("dag", instance.dag.0)
                .number("subtask", instance.subtask.0)
                .number("job", instance.job);
        }
        line.text("place", place).text("message", message);
    });
    write_in_emergency(format_args!("{line}\n"));
    let verdict = json::line("verdict", |line| {
        line.text("status", "failure").text("reason", what);
    });
    write_in_emergency(format_args!("{verdict}\n"));
    exit::exit(exit::Status::Failure)
}
