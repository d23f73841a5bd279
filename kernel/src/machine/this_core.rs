//! Each core's own data, found through the gs segment.
//!
//! **Own-core invariant**: the gs base of a started core points to its [`Core`],
//! which is never freed. Other cores may look at a [`Core`] too, through
//! [`get`]: everything that changes in it is atomic.

use core::arch::asm;
use core::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use alloc::boxed::Box;

use super::context::Context;
use super::descriptors::{self, TaskState};
use super::once::Once;
use super::{cpu, local_apic};

/// The tops of the stacks that a core needs, each with a guard page below.
#[derive(Debug)]
pub(crate) struct Stacks {
    /// Runs what the core does: first its start, then subtasks.
    pub(crate) work: u64,
    /// Runs interrupt handlers.
    pub(crate) handler: u64,
    /// Run exceptions: ordinary, double fault, non-maskable, machine check.
    pub(crate) exceptions: [u64; 4],
}

/// One core's own data, on cache lines of its own.
#[derive(Debug)]
#[repr(C, align(128))]
pub(crate) struct Core {
    this: AtomicU64,
    handler_stack: u64,
    /// The position among the cores: 0 is the boot processor.
    pub(crate) index: u32,
    apic_id: u8,
    stacks: Stacks,
    context: Context,
    /// Another core has assigned work to this one.
    pub(crate) wake: AtomicBool,
    /// The times at which this core's timer shall fire, each `u64::MAX` if never.
    pub(crate) alarms: [AtomicU64; 3],
    /// The number of timer interrupts taken.
    pub(crate) timer_interrupts: AtomicU64,
    /// The time between two heartbeats of this core, 0 if it has none.
    pub(crate) heartbeat_ns: AtomicU64,
    /// What runs here, in the words of whoever sets it; for reports of panics.
    pub(crate) running: [AtomicU64; 3],
}

/// Where `interrupt.s` finds the handler stack.
pub(super) const HANDLER_STACK_OFFSET: usize = core::mem::offset_of!(Core, handler_stack);

static CORES: Once<Box<[Core]>> = Once::new();

/// Creates the cores' data, the boot processor's first.
pub(crate) fn create(cores: impl Iterator<Item = (u8, Stacks)>) {
    let cores = cores.zip(0..).map(|((apic_id, stacks), index)| Core {
        this: AtomicU64::new(0),
        handler_stack: stacks.handler,
        index,
        apic_id,
        stacks,
        context: Context::new(),
        wake: AtomicBool::new(false),
        alarms: [const { AtomicU64::new(u64::MAX) }; 3],
        timer_interrupts: AtomicU64::new(0),
        heartbeat_ns: AtomicU64::new(0),
        running: [const { AtomicU64::new(u64::MAX) }; 3],
    });
    // A second call would come from a second boot, which there is not.
    let _ = CORES.set(cores.collect());
}

/// Makes the processor that executes this the core with APIC id `apic_id`:
/// segments, interrupt stacks, interrupt table and local APIC.
pub(crate) fn become_core(apic_id: u8) -> &'static Core {
    const GS_BASE: u32 = 0xc000_0101;
    let core = all()
        .iter()
        .find(|core| core.apic_id == apic_id)
        .expect("only processors that ACPI names are started");
    let exceptions = core.stacks.exceptions;
    let tops = [
        core.context.frame_end(),
        exceptions[0],
        exceptions[1],
        exceptions[2],
        exceptions[3],
    ];
    descriptors::load_segments(Box::leak(Box::new(TaskState::new(tops))));
    let address = core::ptr::from_ref(core) as u64;
    core.this.store(address, Ordering::Relaxed);
    // SAFETY: every 64-bit processor has the register; the value establishes
    // the own-core invariant.
    unsafe { cpu::write_msr(GS_BASE, address) };
    super::interrupt::load_table();
    local_apic::enable();
    core
}

/// Returns the data of the core that executes this.
///
/// The answer stays right only while the caller cannot move to another core:
/// with interrupts disabled, or in code that is not preempted.
pub(crate) fn get() -> &'static Core {
    let address: u64;
    // SAFETY: reads the first field of the core's data (own-core invariant).
    unsafe { asm!("mov {}, gs:[0]", out(reg) address, options(nostack, readonly, pure)) };
    // SAFETY: the field holds the address of the data itself, which lives
    // forever and changes only by atomics (own-core invariant).
    unsafe { &*(address as *const Core) }
}

/// Reports whether [`get`] may be called: the cores' data exists.
pub(crate) fn is_ready() -> bool {
    CORES.get().is_some()
}

/// Returns all cores, in the order of their index.
pub(crate) fn all() -> &'static [Core] {
    CORES.get().map_or(&[], |cores| cores)
}

impl Core {
    /// Makes this core look for work, by an interrupt unless it is the core that
    /// executes this.
    pub(crate) fn wake_up(&self) {
        self.wake.store(true, Ordering::Release);
        if self.index != get().index {
            local_apic::send(self.apic_id, super::interrupt::vector::WAKE);
        }
    }

    /// Returns the top of the stack that this core works on.
    pub(crate) const fn work_stack(&self) -> u64 {
        self.stacks.work
    }

    /// Returns the id that interrupts are addressed to.
    pub(crate) const fn apic_id(&self) -> u8 {
        self.apic_id
    }
}
