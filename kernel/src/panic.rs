//! The end of a kernel that cannot go on: what happened, where, to whom.
//!
//! The core that panics stops all others first, so the report is not torn
//! apart and nothing runs on with broken data. A panic during the report ends
//! the run with what was said so far.

use core::fmt::{self, Display};
use core::panic::PanicInfo;
use core::sync::atomic::{AtomicBool, Ordering};

use crate::console::write_in_emergency;
use crate::machine::fault::Exception;
use crate::machine::{cpu, exit, local_apic, this_core};
use crate::{execution, json};

static PANICKING: AtomicBool = AtomicBool::new(false);

/// Reports a panic of Rust code and ends the run.
pub(crate) fn panic(info: &PanicInfo<'_>) -> ! {
    let place = info.location();
    let place = fmt::from_fn(|f| match place {
        Some(place) => write!(f, "{}:{}:{}", place.file(), place.line(), place.column()),
        None => f.write_str("an unknown place"),
    });
    die("panic", &info.message(), &place)
}

/// Reports an exception and ends the run.
pub(crate) fn exception(exception: &Exception<'_>) -> ! {
    let registers = exception.registers;
    let message = fmt::from_fn(|f| {
        write!(f, "{}", exception.name)?;
        if let Some(address) = exception.address {
            write!(f, " at address {address:#x}")?;
        }
        write!(
            f,
            ", error code {:#x}, stack {:#x}",
            registers.error_code, registers.rsp
        )
    });
    let place = fmt::from_fn(|f| write!(f, "{:#x}", registers.rip));
    die("exception", &message, &place)
}

fn die(what: &str, message: &dyn Display, place: &dyn Display) -> ! {
    cpu::disable_interrupts();
    if PANICKING.swap(true, Ordering::AcqRel) {
        // Either another core reports already and is about to stop this one, or
        // this core's own report has failed.
        exit::exit(exit::Status::Failure);
    }
    let core = this_core::is_ready().then(this_core::get);
    if core.is_some() {
        local_apic::send_stop_to_others();
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
