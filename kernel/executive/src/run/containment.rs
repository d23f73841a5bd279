//! Containment of app faults: a faulty subtask harms nobody else.
//!
//! A subtask that panics, causes an exception or exceeds its budget ends its DAG: work left half
//! done can belong to that DAG alone. If the DAG survives the fault, only the job is lost. A report
//! states the fault with DAG, subtask, job, core, cause and place, and all other DAGs continue.
//!
//! Within an interrupt the core leaves the faulty context for another one, and the faulty context
//! goes back into the stock. Until the machine is reset, the function's heap memory and the app's
//! locks held by the function stay lost.
//!
//! # The report: noted at the fault, printed by core 0's background
//!
//! Making a report's text takes some 100 us, so nobody waits for the text. The kernel first ends
//! the instance and keeps the known facts of its fault as a *note* of fixed size. Both take about
//! as long as the accompanying step of the scheduler; all the rest is left to the background, with
//! interrupts enabled. [`PLACES`] notes can wait; further faults are counted, and the journal has
//! them.
//!
//! Containment is possible because the interrupt flag tells possibly faulty code apart: apps run
//! with interrupts enabled, while kernel code that holds a lock or runs in a handler has them
//! disabled. A fault in kernel code, or outside any subtask, is the kernel's own and ends the run
//! (see `panic`).

use core::fmt::{self, Display};
use core::panic::PanicInfo;
use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;

use sched_dag::Instance;
use sched_dag::engine::FaultCost;

use super::{contexts, execution};
use crate::machine::context::Context;
use crate::machine::fault::CpuException;
use crate::machine::interrupt::Interrupted;
use crate::machine::spinlock::SpinLock;
use crate::machine::timer::{self, Alarm};
use crate::machine::{clock, cpu, interrupt_flag, this_core};
use crate::text::backtrace::{Backtrace, CodeLocation};
use fass::edge::Excerpt;
use front::json;

/// The most bytes shown of a panic's message, of its place, and of a name. Within these limits a
/// report's machine line stays together, see `console`.
const MESSAGE_BYTES: usize = 400;
const PLACE_BYTES: usize = 200;
const NAME_BYTES: usize = 60;

/// The cause of a fault by an instance that has exceeded its budget.
const OVERRUN: &str = "budget overrun";

/// The number of notes that can wait for their report.
const PLACES: usize = 8;

/// How long a finished run waits, in nanoseconds, for the end of an instance named in a note.
const LONGEST_END_NS: u64 = 100_000_000;

/// A contained fault, with the fields of its report.
struct FaultNote {
    instance: Instance,
    cause: &'static str,
    message: Excerpt<MESSAGE_BYTES>,
    place: Excerpt<PLACE_BYTES>,
    address: Option<u64>,
    core: u32,
    stack_used: u64,
    stack_bytes: u64,
    calls: Backtrace,
    /// `None` until the instance has ended.
    cost: Option<FaultCost>,
}

/// A place for a note. An empty place is all zeros in memory, so no image stores it.
#[repr(u8)]
#[expect(clippy::large_enum_variant, reason = "nothing is allocated")]
enum NotePlace {
    Empty,
    Full(FaultNote),
}

/// The waiting notes, a ring.
struct NoteQueue {
    places: [NotePlace; PLACES],
    oldest: usize,
    count: usize,
    /// How many faults found no place since the last note was taken.
    left_out: u64,
}

static WAITING: SpinLock<NoteQueue> = SpinLock::new(NoteQueue {
    places: [const { NotePlace::Empty }; PLACES],
    oldest: 0,
    count: 0,
    left_out: 0,
});

/// Whether any note waits, so that a look at an empty queue is cheap.
static HAS_WAITING: AtomicBool = AtomicBool::new(false);

/// Ends the panicking instance, if a subtask panics; otherwise returns.
pub fn end_panicked(info: &PanicInfo<'_>) {
    if !this_core::is_ready() || !interrupt_flag::are_enabled() {
        // With interrupts disabled, the panic is the kernel's own: a lock may be held.
        return;
    }
    // Instance and context are read together: between the two, a preemption could move this code to
    // another core.
    interrupt_flag::disable();
    let core = this_core::get();
    let Some(instance) = execution::running(core) else {
        interrupt_flag::enable();
        return;
    };
    let context = core.context();
    interrupt_flag::enable();
    keep_panic((instance, context), info, CodeLocation::here());
    // By an interrupt: only its handler, on another stack, can leave this context for good.
    cpu::ask_for_end();
}

/// Keeps the note of a panic. A separate function, because the calls are read from the stack
/// pointer of the caller, whose frame is small.
#[inline(never)]
fn keep_panic(
    (instance, context): (Instance, &Context),
    info: &PanicInfo<'_>,
    location: CodeLocation,
) {
    // The message becomes text before any lock is taken, as its formatting is the app's code once
    // more. A panic there comes here a second time. There may be no memory left, so nothing is
    // allocated from here on.
    let message = match context.note_fault() {
        false => Excerpt::of(info.message()),
        true => Excerpt::of("it panicked again while its message was made"),
    };
    let place = Excerpt::of(place_of(info));
    interrupt_flag::disable();
    let note = FaultNote::new(instance, "panic", message, None, location);
    keep(FaultNote { place, ..note });
    interrupt_flag::enable();
}

/// Ends this core's instance at its own request, if it was found at fault before.
pub fn end_at_fault(interrupted: &mut Interrupted) {
    let core = this_core::get();
    if core.context().is_at_fault()
        && let Some(instance) = execution::running(core)
    {
        end_interrupted(instance, interrupted);
    }
}

/// Ends the instance that caused an exception, if a subtask did, and reports whether that was the
/// case.
pub fn end_faulty(exception: &CpuException<'_>, interrupted: &mut Interrupted) -> bool {
    if !exception.is_of_interruptible_code() || !this_core::is_ready() {
        return false;
    }
    let core = this_core::get();
    let Some(instance) = execution::running(core) else {
        return false;
    };
    let rip = exception.registers.rip;
    let location = CodeLocation {
        instruction: Some(rip),
        stack_pointer: exception.registers.rsp,
    };
    let (name, message) = (exception.name, Excerpt::of(exception));
    let note = FaultNote::new(instance, name, message, exception.address, location);
    keep(note);
    end_interrupted(instance, interrupted);
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
    let location = CodeLocation {
        instruction: Some(interrupted.instruction()),
        stack_pointer: interrupted.stack_pointer(),
    };
    let message = Excerpt::of("");
    keep(FaultNote::new(instance, OVERRUN, message, None, location));
    end_interrupted(instance, interrupted);
}

/// Ends this core's instance after a handler interrupted its context. The note exists already,
/// because this may be the end of the run, and the run awaits its notes; the remaining facts are
/// added now.
fn end_interrupted(instance: Instance, interrupted: &mut Interrupted) {
    let abandoned = interrupted.abandon(contexts::new_worker());
    let (cost, budget_ns) = execution::fail(&abandoned).unwrap_or((FaultCost::Dag, u64::MAX));
    // Given back only after `fail` has recovered the runner: another core may reuse the stack at
    // once.
    contexts::give_back(abandoned.recover());
    WAITING
        .lock_uninterrupted()
        .settle(instance, cost, budget_ns);
}

/// Returns the place of a panic, as `file:line:column`.
pub fn place_of(info: &PanicInfo<'_>) -> impl Display {
    let place = info.location();
    fmt::from_fn(move |f| match place {
        Some(place) => write!(f, "{}:{}:{}", place.file(), place.line(), place.column()),
        None => f.write_str("an unknown place"),
    })
}

/// Queues a note for its report, or counts the fault if the queue is full.
fn keep(note: FaultNote) {
    let mut waiting = WAITING.lock();
    if waiting.count == PLACES {
        waiting.left_out += 1;
        return;
    }
    let free = (waiting.oldest + waiting.count) % PLACES;
    waiting.places[free] = NotePlace::Full(note);
    waiting.count += 1;
    HAS_WAITING.store(true, Ordering::Relaxed);
}

/// Prints the report of the oldest contained fault, and reports whether there was one. Allocates
/// nothing.
pub fn tell_fault() -> bool {
    // A hint only: the lock orders the notes, and a note missed now is seen at the next look.
    if !HAS_WAITING.load(Ordering::Relaxed) {
        return false;
    }
    let (note, left_out) = WAITING.lock().take();
    // Printed with the lock free, since the next fault's handler waits for it.
    if let Some(note) = &note {
        note.tell();
    }
    if left_out > 0 {
        front::println!("fault: {left_out} more came too fast to be told of; the journal has them");
    }
    note.is_some()
}

/// Drops the note of the oldest contained fault, and reports whether there was one.
pub fn forget_fault() -> bool {
    HAS_WAITING.load(Ordering::Relaxed) && WAITING.lock().take().0.is_some()
}

/// Takes all faults of a finished run, each by [`tell_fault`] or [`forget_fault`], because the
/// names are about to be forgotten. The last faulty instance may still be ending on another core; a
/// note whose instance never ends is dropped.
pub fn take_last_faults(take: fn() -> bool) {
    let until_ns = clock::now_ns() + LONGEST_END_NS;
    while HAS_WAITING.load(Ordering::Relaxed) {
        if take() {
            continue;
        }
        if clock::now_ns() > until_ns {
            WAITING.lock().clear();
        }
        cpu::relax();
    }
}

impl NoteQueue {
    fn clear(&mut self) {
        self.count = 0;
        HAS_WAITING.store(false, Ordering::Relaxed);
    }

    /// Adds the cost of an instance's latest fault, and the exceeded budget.
    fn settle(&mut self, instance: Instance, cost: FaultCost, budget_ns: u64) {
        for place in &mut self.places {
            if let NotePlace::Full(note) = place
                && (note.instance, note.cost) == (instance, None)
            {
                note.cost = Some(cost);
                if note.cause == OVERRUN {
                    let budget = Duration::from_nanos(budget_ns);
                    let says = format_args!("executed for more than its budget of {budget:?}");
                    note.message = Excerpt::of(says);
                }
            }
        }
    }

    /// Takes the oldest note, once its instance has ended, and how many faults found no place.
    fn take(&mut self) -> (Option<FaultNote>, u64) {
        let place = &mut self.places[self.oldest];
        // A note without its cost holds up those behind it: reports come in the order of the
        // faults.
        let taken = match place {
            NotePlace::Full(FaultNote { cost: Some(_), .. }) => {
                core::mem::replace(place, NotePlace::Empty)
            }
            _ => NotePlace::Empty,
        };
        let NotePlace::Full(note) = taken else {
            return (None, 0);
        };
        self.oldest = (self.oldest + 1) % PLACES;
        self.count -= 1;
        HAS_WAITING.store(self.count > 0, Ordering::Relaxed);
        (Some(note), core::mem::take(&mut self.left_out))
    }
}

impl FaultNote {
    /// Notes the known facts about a fault of this core's instance, at an instruction. Interrupts
    /// are disabled.
    fn new(
        instance: Instance,
        cause: &'static str,
        message: Excerpt<MESSAGE_BYTES>,
        address: Option<u64>,
        location: CodeLocation,
    ) -> Self {
        let core = this_core::get();
        let context = core.context();
        Self {
            instance,
            cause,
            message,
            place: Excerpt::of(fmt::from_fn(|f| match location.instruction {
                Some(instruction) => write!(f, "{instruction:#x}"),
                None => Ok(()),
            })),
            address,
            core: core.index,
            // A faulty function may leave any stack pointer, also one above its stack.
            stack_used: context.stack_top().saturating_sub(location.stack_pointer),
            stack_bytes: context.stack_bytes(),
            calls: location.backtrace(),
            cost: None,
        }
    }

    fn tell(&self) {
        let (instance, core) = (self.instance, self.core);
        let model = execution::task_set();
        let names = model.as_ref().map(|model| {
            let dag = model.dag(instance.dag);
            [dag.name(), dag.subtask(instance.subtask).name()]
        });
        let [dag, subtask] = names.unwrap_or_default().map(Excerpt::<NAME_BYTES>::of);
        let of = (instance, [&dag as _, &subtask as _]);
        let cause = (self.cause, &self.message as _);
        let cost = self.cost.unwrap_or(FaultCost::Dag);
        front::report::fault(of, cause, (core, &self.place), cost, |line| {
            line.number("stack_used_bytes", self.stack_used)
                .number("stack_bytes", self.stack_bytes);
            if let Some(address) = self.address {
                line.text("address", format_args!("{address:#x}"));
            }
        });
        json::report("backtrace", |line| self.calls.write(core, line));
    }
}
