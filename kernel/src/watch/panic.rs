//! The end of a kernel that cannot go on: prints what happened, where, and on which core.
//!
//! The panicking core stops all others first, so that nothing tears the report apart or runs on
//! with broken data. A panic during the report ends the run with the output so far. Faults of
//! subtasks do not get here: `containment` ends their DAG instead. A failing `drop` of a value left
//! behind by a run does get here, after the run; the report is then a single line with the DAG's
//! name.

use core::fmt::{self, Display};
use core::panic::PanicInfo;
use core::sync::atomic::{AtomicU32, Ordering};

use crate::report;
use executive::machine::context::SavedRegisters;
use executive::machine::fault::CpuException;
use executive::machine::interrupt::Interrupted;
use executive::machine::{cpu, interrupt_flag, non_maskable, power, this_core};
use executive::run::{containment, execution};
use executive::text::backtrace::CodeLocation;
use executive::text::console::{write_in_emergency, write_line_in_emergency};
use fass::edge::Excerpt;
use front::app::ending::AppExit;
use front::json;

/// The most recent events of this core shown in a report.
const EVENTS_SHOWN: usize = 16;

/// The most bytes of the message shown.
const MESSAGE_BYTES: usize = 2048;

/// The first core to report, [`FAILED`] after a failed report, or [`NOBODY`] before any.
static REPORTING: AtomicU32 = AtomicU32::new(NOBODY);
const NOBODY: u32 = u32::MAX;
/// Stands for a core after a failed report.
const FAILED: u32 = NOBODY - 1;

/// Ends the subtask that panics, or else the run.
pub(crate) fn panic(info: &PanicInfo<'_>) -> ! {
    containment::end_panicked(info);
    die("panic", &info.message(), &containment::place_of(info), None)
}

/// Ends the subtask that caused an exception, or else the run.
pub(crate) fn exception(exception: &CpuException<'_>, interrupted: &mut Interrupted) {
    if !containment::end_faulty(exception, interrupted) {
        let registers = exception.registers;
        let place = fmt::from_fn(|f| write!(f, "{:#x}", registers.rip));
        die("panic", exception, &place, Some(registers))
    }
}

/// The longest time for dropping the values left behind by a single DAG, in nanoseconds.
const LONGEST_CLEARING_NS: u64 = 5_000_000_000;

/// Ends the kernel if the `drop` of a value left behind by a run does not return. Called in core
/// 0's heartbeat.
pub(super) fn beat(now_ns: u64) {
    let took_ns = execution::look_at_clearing(|_, since_ns| now_ns.saturating_sub(since_ns));
    if took_ns > Some(LONGEST_CLEARING_NS) {
        die("stall", &"no return", &"within 5 s", None);
    }
}

#[allow(clippy::too_many_lines, reason = "the order that is safe")]
fn die(
    what: &str,
    message: &dyn Display,
    place: &dyn Display,
    registers: Option<&SavedRegisters>,
) -> ! {
    // First of all: no preemption may move the report to another core, and no handler may join in.
    interrupt_flag::disable();
    let core = this_core::is_ready().then(this_core::get);
    let index = core.map_or(0, |core| core.index);
    let mine = REPORTING.compare_exchange(NOBODY, index, Ordering::AcqRel, Ordering::Acquire);
    match mine {
        Ok(_) => {}
        // This core is reporting already: formatting its message has panicked.
        Err(reporting) if reporting == index => {
            REPORTING.store(FAILED, Ordering::Release);
            write_in_emergency(format_args!(
                "(a second {what} in the report)\n  at {place}\n"
            ));
            give_verdict(&what)
        }
        Err(FAILED) => power::exit(AppExit::Failure),
        // Another core is reporting, and is about to stop this one.
        Err(_) => cpu::halt_forever(),
    }
    // Before the cores have their data, no other core runs.
    if core.is_some() {
        non_maskable::stop_others();
    }
    let clearing = execution::look_at_clearing(|dag, _| {
        Excerpt::<MESSAGE_BYTES>::of(format_args!(
            "dag `{dag}` has left behind what cannot be dropped: {message} ({place}); mend the \
             `drop` of its values"
        ))
    });
    if let Some(reason) = clearing {
        write_in_emergency(format_args!("\n{reason}\n"));
        give_verdict(&reason);
    }
    let instance = core.and_then(execution::running);
    write_in_emergency(format_args!(
        "\nkernel {what} on core {index}\n  at {place}\n"
    ));
    // Only now: formatting may fail, and by now core and place are told.
    let message = Excerpt::<MESSAGE_BYTES>::of(message);
    write_in_emergency(format_args!("  {message}\n"));
    if let Some(instance) = instance {
        write_in_emergency(format_args!("  in {instance}\n"));
        execution::try_names(instance, |dag, subtask| {
            write_in_emergency(format_args!(
                "  that is subtask `{subtask}` of dag `{dag}`\n"
            ));
        });
    }
    if let Some(registers) = registers {
        write_in_emergency(format_args!("{registers}"));
    }
    if core.is_some() {
        write_in_emergency(format_args!("{}", report::latest::<EVENTS_SHOWN>()));
    }
    let line = json::line(what, |line| {
        line.number("cpu", index);
        if let Some(instance) = instance {
            line.number("dag", instance.dag.0)
                .number("subtask", instance.subtask.0)
                .number("job", instance.job);
        }
        line.text("place", place).text("message", &message);
    });
    write_line_in_emergency(&line);
    let spot = registers.map_or_else(CodeLocation::here, |registers| CodeLocation {
        instruction: Some(registers.rip),
        stack_pointer: registers.rsp,
    });
    let line = json::line("backtrace", |line| spot.backtrace().write(index, line));
    write_line_in_emergency(&line);
    give_verdict(&what)
}

/// Reports that the run has failed, and ends it.
fn give_verdict(what: &dyn Display) -> ! {
    let verdict = json::line("verdict", |line| {
        line.text("status", "failure").text("reason", what);
    });
    write_line_in_emergency(&verdict);
    power::exit(AppExit::Failure)
}
