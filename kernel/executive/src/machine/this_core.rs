//! Each core's own data, found through the gs segment.
//!
//! **Own-core invariant**: the gs base of a started core points to the core's [`Core`], which is
//! never freed. Other cores may look at a [`Core`] too, through [`get`]: all changing fields are
//! atomic.

use core::arch::asm;
use core::panic::Location;
use core::sync::atomic::{AtomicBool, AtomicPtr, AtomicU8, AtomicU32, AtomicU64, Ordering};

use alloc::boxed::Box;

use super::accusation::AccusationBox;
use super::context::{Context, Parked, SavedRegisters};
use super::cpu;
use super::descriptors::{self, TaskState};
use fass::platform::SetOnce;

/// The initial stacks of a core: their tops, each with a guard page below, and the core's first
/// context.
pub struct CoreStacks {
    /// The context the core runs first.
    pub first_context: Parked,
    /// The stack for interrupt handlers.
    pub handler: u64,
    /// The stacks for exceptions: ordinary, double fault, non-maskable, machine check.
    pub exceptions: [u64; 4],
}

/// A meter of how long a core's interrupts stay disabled, in ticks of the time stamp counter.
pub(super) struct CoreMeter {
    /// When the current section began, in ticks; 0 if none is in progress.
    pub(super) began: AtomicU64,
    pub(super) began_at: AtomicPtr<Location<'static>>,
    pub(super) longest: AtomicU64,
    pub(super) longest_at: AtomicPtr<Location<'static>>,
}

impl CoreMeter {
    pub(super) const fn new() -> Self {
        Self {
            began: AtomicU64::new(0),
            began_at: AtomicPtr::new(core::ptr::null_mut()),
            longest: AtomicU64::new(0),
            longest_at: AtomicPtr::new(core::ptr::null_mut()),
        }
    }
}

/// A core's part in the time slices of computing cores ([`time_slice`](super::time_slice)).
///
/// ```text
///                 1             2               4                 5
///        None ---------> Comes -------> Fresh --------> Computes --------> Waits
///        |  ^                             ^              |    ^             |  |
///        |  |             3               |              |    +----- 6 -----+  |
///        +--|-----------------------------+              |                     |
///           |               7 (from every part)          |                     |
///           +--------------------------------------------+---------------------+
/// ```
///
/// 1. `time_slice::come`: an interrupt handler has chosen a new worker for the core.
/// 2. `time_slice::join`: the new worker is about to call a function (`time_slice::enter`), or to
///    continue a suspended instance.
/// 3. `time_slice::join`: as 2, by a worker that no interrupt has chosen; or an interrupt continues
///    a suspended instance; or the instance goes on after a halt or a watch of the clock.
/// 4. `time_slice::wait`, once no core has the slice and none is urgent. This first slice is short
///    if other cores are fresh, too.
/// 5. `time_slice::pass`, at the end of an interrupt after the slice's alarm has fired.
/// 6. `time_slice::wait`, likewise, once no core is fresh and no other waiting core is next.
/// 7. `time_slice::leave` as the instance halts, watches the clock or is preempted;
///    `time_slice::rest` as the core has nothing to compute.
///
/// A core keeps its part from one instance to the next, also after a fault. A part returns to Fresh
/// only through None. If a core takes over the slice of a silent core (4, 6), both parts are
/// Computes for a while.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(super) enum TimeSlicePart {
    /// The core takes no part.
    None,
    /// An interrupt has given the core an instance, which the core is about to start.
    Comes,
    /// The core waits for its first slice.
    Fresh,
    /// The core has the slice.
    Computes,
    /// The core waits for its next slice.
    Waits,
}

/// One core's own data, on cache lines of its own.
#[repr(C, align(128))]
pub struct Core {
    this: AtomicU64,
    handler_stack: u64,
    /// The position among the cores: 0 is the boot processor.
    pub index: u32,
    apic_id: u32,
    /// The core's group, a number chosen by the layer above.
    pub group: AtomicU32,
    /// The core's place in its group, likewise.
    pub place: AtomicU32,
    exception_stacks: [u64; 4],
    task_state: AtomicPtr<TaskState>,
    /// The context running here.
    context: AtomicPtr<Context>,
    /// The context that ran here last, without further work, or null.
    spare: AtomicPtr<Context>,
    /// Another core has assigned work to this core.
    pub wake: AtomicBool,
    /// This core watches `wake`, so a wake-up needs no interrupt.
    pub(super) watches: AtomicBool,
    /// Decisions are followed at the end of the current interrupt.
    pub follows: AtomicBool,
    /// The core's [`TimeSlicePart`] in the time slices.
    part: AtomicU8,
    /// The times for this core's timer to fire, in nanoseconds on the clock, each `u64::MAX` if
    /// never.
    pub alarms: [AtomicU64; 4],
    /// Whether the timer is armed only at the end of the current interrupt.
    pub(super) arms_later: AtomicBool,
    /// The number of timer interrupts taken.
    pub timer_interrupts: AtomicU64,
    /// When this core took its last interrupt, from its timer or another core, in nanoseconds on
    /// the clock.
    pub interrupted_ns: AtomicU64,
    pub(super) accusation: AccusationBox,
    /// The time between two heartbeats of this core in nanoseconds, 0 if there are none.
    pub heartbeat_ns: AtomicU64,
    interrupts_off: CoreMeter,
    /// How far the counter has been behind another core's, in ticks.
    pub(super) behind_ticks: AtomicU64,
    /// Whether this is an efficiency core.
    pub(super) is_efficient: AtomicBool,
    /// The running instance, in two words chosen by the layer above; for reports of panics.
    pub running: [AtomicU64; 2],
}

/// The offset where `interrupt.s` finds the handler stack.
pub(super) const HANDLER_STACK_OFFSET: usize = core::mem::offset_of!(Core, handler_stack);

static CORES: SetOnce<Box<[Core]>> = SetOnce::new();

/// Creates the cores' data, the boot processor's first.
pub fn create(cores: impl Iterator<Item = (u32, CoreStacks)>) {
    let cores = cores.zip(0..).map(|((apic_id, stacks), index)| Core {
        this: AtomicU64::new(0),
        handler_stack: stacks.handler,
        index,
        apic_id,
        group: AtomicU32::new(0),
        place: AtomicU32::new(index),
        exception_stacks: stacks.exceptions,
        task_state: AtomicPtr::new(core::ptr::null_mut()),
        context: AtomicPtr::new(
            core::ptr::from_ref(stacks.first_context.into_context()).cast_mut(),
        ),
        spare: AtomicPtr::new(core::ptr::null_mut()),
        wake: AtomicBool::new(false),
        watches: AtomicBool::new(false),
        follows: AtomicBool::new(false),
        part: AtomicU8::new(TimeSlicePart::None as u8),
        alarms: [const { AtomicU64::new(u64::MAX) }; 4],
        arms_later: AtomicBool::new(false),
        timer_interrupts: AtomicU64::new(0),
        interrupted_ns: AtomicU64::new(0),
        accusation: AccusationBox::new(),
        heartbeat_ns: AtomicU64::new(0),
        interrupts_off: CoreMeter::new(),
        behind_ticks: AtomicU64::new(0),
        is_efficient: AtomicBool::new(false),
        running: [const { AtomicU64::new(u64::MAX) }; 2],
    });
    // A second call could only come from a second boot, and the kernel boots once.
    CORES.set(cores.collect());
}

/// Makes the calling processor the core with APIC id `apic_id`: loads its segments and interrupt
/// stacks.
pub(super) fn load(apic_id: u32) -> &'static Core {
    const GS_BASE: u32 = 0xc000_0101;
    let core = all()
        .iter()
        .find(|core| core.apic_id == apic_id)
        .expect("only processors that ACPI names are started");
    // First of all: the heap looks at who allocates.
    let address = core::ptr::from_ref(core) as u64;
    core.this.store(address, Ordering::Relaxed);
    // SAFETY: every 64-bit processor has the register; the value establishes
    // the own-core invariant.
    unsafe { cpu::write_msr(GS_BASE, address) };
    let [exception, double_fault, non_maskable, machine_check] = core.exception_stacks;
    let context = core.context().frame_end();
    let tops = [
        context,
        exception,
        double_fault,
        non_maskable,
        machine_check,
    ];
    let task_state = Box::leak(Box::new(TaskState::new(tops)));
    core.task_state.store(task_state, Ordering::Relaxed);
    descriptors::load_segments(core.task_state.load(Ordering::Relaxed));
    core
}

/// Returns the data of the calling core.
///
/// The answer stays right only while the caller cannot move to another core: with interrupts
/// disabled, or in code without preemption.
pub fn get() -> &'static Core {
    let address: u64;
    // SAFETY: reads the first field of the core's data (own-core invariant).
    unsafe { asm!("mov {}, gs:[0]", out(reg) address, options(nostack, readonly, pure)) };
    // SAFETY: the field holds the address of the data itself, which lives
    // forever and changes only by atomics (own-core invariant).
    unsafe { &*(address as *const Core) }
}

/// Reports whether [`get`] may be called: the cores' data exists.
pub fn is_ready() -> bool {
    CORES.get().is_some()
}

/// Returns the first word of the calling core's running instance, as set by [`Core::note_running`].
/// Interrupts are disabled.
pub fn running() -> Option<u64> {
    let word = is_ready().then(|| get().running[0].load(Ordering::Relaxed));
    word.filter(|word| *word != u64::MAX)
}

/// Returns all cores, in the order of their index.
pub fn all() -> &'static [Core] {
    CORES.get().map_or(&[], |cores| cores)
}

unsafe extern "C" {
    /// Resumes the context whose registers the stack pointer points to (`interrupt.s`).
    fn resume_context() -> !;
}

/// Resumes the context with the given registers.
///
/// # Safety
///
/// The registers belong to a context that does not run and now belongs to this core; interrupts are
/// disabled.
unsafe fn resume(registers: *mut SavedRegisters) -> ! {
    // SAFETY: the caller's condition is what `interrupt.s` asks for.
    unsafe {
        asm!(
            "mov rsp, {}", "jmp {}",
            in(reg) registers,
            sym resume_context,
            options(noreturn),
        )
    }
}

/// Makes this core continue with `next` when the current interrupt's handler returns, and returns
/// the interrupted context.
///
/// # Safety
///
/// The caller is a handler of an interrupt; or of an exception, in which case the returned context
/// must not be resumed.
pub(super) unsafe fn exchange_context(next: Parked) -> Parked {
    let last = get().run_next(next);
    // SAFETY: the context runs no more: `interrupt.s` now resumes `next`.
    unsafe { Parked::from_context(last) }
}

/// Leaves the running context, for good, for `next`. The context left becomes this core's spare
/// context.
///
/// # Safety
///
/// 1. The caller runs on a context's own stack, with interrupts disabled.
/// 2. Nothing on that stack is used any more.
/// 3. This core's spare context has been taken by [`take_spare_context`].
pub(super) unsafe fn leave_context(next: Parked) -> ! {
    let core = get();
    let registers = next.registers();
    let last = core.run_next(next);
    core.spare
        .store(core::ptr::from_ref(last).cast_mut(), Ordering::Relaxed);
    // SAFETY: the registers are those of a context that does not run and that
    // this core has made its own; interrupts are disabled (condition 1).
    unsafe { resume(registers) }
}

/// Takes the context last left here, to be restarted or given away. Interrupts are disabled.
pub fn take_spare_context() -> Option<Parked> {
    let spare = get().spare.swap(core::ptr::null_mut(), Ordering::Relaxed);
    // SAFETY: a pointer that is not null comes from `leave_context`.
    let spare = unsafe { spare.as_ref() }?;
    // SAFETY: this core has left the context for another one: it executes this
    // on another stack. The swap makes sure that it is taken once.
    Some(unsafe { Parked::from_context(spare) })
}

impl Core {
    /// Returns the core's part in the time slices.
    pub(super) fn part(&self) -> TimeSlicePart {
        const COMES: u8 = TimeSlicePart::Comes as u8;
        const FRESH: u8 = TimeSlicePart::Fresh as u8;
        const COMPUTES: u8 = TimeSlicePart::Computes as u8;
        const WAITS: u8 = TimeSlicePart::Waits as u8;
        match self.part.load(Ordering::Relaxed) {
            COMES => TimeSlicePart::Comes,
            FRESH => TimeSlicePart::Fresh,
            COMPUTES => TimeSlicePart::Computes,
            WAITS => TimeSlicePart::Waits,
            _ => TimeSlicePart::None,
        }
    }

    /// Sets the core's part in the time slices.
    pub(super) fn set_part(&self, part: TimeSlicePart) {
        self.part.store(part as u8, Ordering::Relaxed);
    }

    /// Returns the context running on this core.
    pub fn context(&self) -> &'static Context {
        // SAFETY: the pointer comes from a `&'static Context` (`create`, `run_next`).
        unsafe { &*self.context.load(Ordering::Relaxed) }
    }

    /// Notes that this core runs `next` from the coming switch on, and returns the previous
    /// context.
    fn run_next(&self, next: Parked) -> &'static Context {
        let last = self.context();
        let next = next.into_context();
        self.context
            .store(core::ptr::from_ref(next).cast_mut(), Ordering::Relaxed);
        let task_state = self.task_state.load(Ordering::Relaxed);
        // SAFETY: callers run on this core with interrupts disabled, and are
        // about to switch to `next`.
        unsafe { descriptors::set_context_stack(task_state, next.frame_end()) };
        last
    }

    /// Reports whether this core keeps a spare context.
    pub fn has_spare(&self) -> bool {
        !self.spare.load(Ordering::Relaxed).is_null()
    }

    /// Notes the running instance, as two numbers.
    pub fn note_running(&self, fields: [u64; 2]) {
        for (place, field) in self.running.iter().zip(fields) {
            place.store(field, Ordering::Relaxed);
        }
    }

    /// Returns this core's meter of sections without interrupts.
    pub(super) const fn meter(&self) -> &CoreMeter {
        &self.interrupts_off
    }

    /// Reports whether this is an efficiency core.
    pub fn is_efficient(&self) -> bool {
        self.is_efficient.load(Ordering::Relaxed)
    }

    /// Returns the id for addressing interrupts to this core.
    pub const fn apic_id(&self) -> u32 {
        self.apic_id
    }
}
