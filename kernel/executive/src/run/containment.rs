//! Faults of apps, kept from harming anyone else.
//!
//! A subtask that panics, causes an exception or exceeds its budget ends its DAG:
//! what it may have left half done can belong to that DAG alone. If that DAG survives
//! the fault, it costs the job only. The fault is reported with DAG, subtask, job,
//! core, cause and place, and all other DAGs go on.
//!
//! The core leaves the context that it happened in for another one, within an interrupt, and
//! the context goes back into the stock. Until the machine is reset a fault keeps all that the
//! function owned on the heap, and the app's locks that it held.
//!
//! That is possible because code that may be at fault is told apart by the
//! interrupt flag: apps run with interrupts enabled, while code that holds a
//! lock of the kernel's, or handles an interrupt, has them disabled. A fault there, or
//! outside any subtask, is the kernel's and ends the run (see `panic`).

use core::fmt::{self, Display};
use core::panic::PanicInfo;
use core::time::Duration;

use sched_dag::Instance;
use sched_dag::engine::FaultCost;

use super::{contexts, execution};
use crate::machine::fault::CpuException;
use crate::machine::interrupt::Interrupted;
use crate::machine::timer::{self, Alarm};
use crate::machine::{cpu, interrupt_flag, this_core};
use crate::text::backtrace::CodeLocation;
use fass::edge::Excerpt;
use front::json;

/// How much of a panic's message is shown, and of a name, in bytes. With these a
/// report's machine line stays together, see `console`.
const MESSAGE_BYTES: usize = 400;
const NAME_BYTES: usize = 60;

/// A contained fault, as its report states it.
struct ContainedFault<'a> {
    cause: &'a str,
    message: &'a dyn Display,
    place: &'a dyn Display,
    address: Option<u64>,
    spot: CodeLocation,
}

/// Ends the instance that panics, if it is a subtask's; else returns.
pub fn end_panicked(info: &PanicInfo<'_>) {
    if !this_core::is_ready() || !interrupt_flag::are_enabled() {
        return;
    }
    interrupt_flag::disable();
    let core = this_core::get();
    let context = core.context();
    let Some(instance) = execution::running(core) else {
        interrupt_flag::enable();
        return;
    };
    interrupt_flag::enable();
    // The message is made into text before any lock is taken, as that is the
    // app's code once more. A panic in it comes here a second time. There may be no
    // memory left, so none is taken from here on.
    let message: Excerpt<MESSAGE_BYTES> = match context.note_fault() {
        false => Excerpt::of(info.message()),
        true => Excerpt::of("it panicked again while its message was made"),
    };
    report(
        instance,
        &ContainedFault {
            cause: "panic",
            message: &message,
            place: &place_of(info),
            address: None,
            spot: CodeLocation::here(),
        },
    );
    cpu::ask_for_end();
}

/// Ends this core's instance, which has asked for that after it was found at fault.
pub fn end_at_fault(interrupted: &mut Interrupted) {
    let core = this_core::get();
    if core.context().is_at_fault() && execution::running(core).is_some() {
        end_interrupted(interrupted);
    }
}

/// Ends the instance that caused an exception, if it is a subtask's, and reports
/// whether it was.
pub fn end_faulty(exception: &CpuException<'_>, interrupted: &mut Interrupted) -> bool {
    if !exception.is_of_interruptible_code() || !this_core::is_ready() {
        return false;
    }
    let core = this_core::get();
    let Some(instance) = execution::running(core) else {
        return false;
    };
    let rip = exception.registers.rip;
    report(
        instance,
        &ContainedFault {
            cause: exception.name,
            message: exception,
            place: &fmt::from_fn(|f| write!(f, "{rip:#x}")),
            address: exception.address,
            spot: CodeLocation {
                instruction: Some(rip),
                stack_pointer: exception.registers.rsp,
            },
        },
    );
    end_interrupted(interrupted);
    true
}

/// Ends this core's instance if its budget is used up.
pub fn end_overrun(interrupted: &mut Interrupted, now_ns: u64) {
    let core = this_core::get();
    let context = core.context();
    let Some(instance) = execution::running(core) else {
        return;
    };
    // The alarm may have been set for an instance before this one.
    if context.budget_end_ns() > now_ns {
        timer::set(Alarm::Budget, context.budget_end_ns());
        return;
    }
    let budget = Duration::from_nanos(execution::budget_ns(instance));
    let rip = interrupted.instruction();
    report(
        instance,
        &ContainedFault {
            cause: "budget overrun",
            message: &format_args!("executed for more than its budget of {budget:?}"),
            place: &fmt::from_fn(|f| write!(f, "{rip:#x}")),
            address: None,
            spot: CodeLocation {
                instruction: Some(rip),
                stack_pointer: interrupted.stack_pointer(),
            },
        },
    );
    end_interrupted(interrupted);
}

/// Ends this core's instance, whose context a handler has interrupted.
fn end_interrupted(interrupted: &mut Interrupted) {
    let abandoned = interrupted.abandon(contexts::new_worker());
    execution::fail(&abandoned);
    contexts::give_back(abandoned.recover());
}

/// Returns where a panic was raised, as `file:line:column`.
pub fn place_of(info: &PanicInfo<'_>) -> impl Display {
    let place = info.location();
    fmt::from_fn(move |f| match place {
        Some(place) => write!(f, "{}:{}:{}", place.file(), place.line(), place.column()),
        None => f.write_str("an unknown place"),
    })
}

fn report(instance: Instance, fault: &ContainedFault<'_>) {
    let ContainedFault {
        cause,
        message,
        place,
        address,
        spot,
    } = fault;
    let core = this_core::get().index;
    // No lock is held by code that has interrupts enabled.
    let known = execution::cost_of_fault(instance);
    let names = known.as_ref().map(|(_, model)| {
        let dag = model.dag(instance.dag);
        (dag.name(), dag.subtask(instance.subtask).name())
    });
    let (dag, subtask) = names.unwrap_or_default();
    let dag = Excerpt::<NAME_BYTES>::of(dag);
    let subtask = Excerpt::<NAME_BYTES>::of(subtask);
    let cost = known.as_ref().map_or(FaultCost::Dag, |(cost, _)| *cost);
    let consequence = cost.consequence();
    front::println!(
        "fault: {cause} in subtask `{subtask}` of dag `{dag}`, job {}, on core {core}: {message}; \
         at {place}; {consequence}",
        instance.job
    );
    let context = this_core::get().context();
    let used = context.stack_top().saturating_sub(spot.stack_pointer);
    json::report("fault", |line| {
        line.text("cause", cause)
            .number("dag", instance.dag.0)
            .text("dag_name", &dag)
            .number("subtask", instance.subtask.0)
            .text("subtask_name", &subtask)
            .number("job", instance.job)
            .text("cost", cost.word())
            .number("cpu", core)
            .text("place", place)
            .text("message", message)
            .number("stack_used_bytes", used)
            .number("stack_bytes", context.stack_bytes());
        if let Some(address) = address {
            line.text("address", format_args!("{address:#x}"));
        }
    });
    json::report("backtrace", |line| spot.write(core, line));
}
