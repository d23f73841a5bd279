//! Segment and interrupt descriptors: they tell the processor where each interrupt finds its code
//! and its stack (Intel SDM volume 3, 3.4, 6.14, 7.7).

use core::arch::asm;

use alloc::boxed::Box;

use super::vector::{OTHER, TIMER};
use fass::platform::SetOnce;

/// The code segment's selector.
pub(super) const CODE: u16 = 0x08;
/// The task state segment's selector.
const TASK_STATE: u16 = 0x18;

/// The stack where each kind of interrupt arrives, as IST numbers.
#[derive(Clone, Copy, Debug)]
pub(crate) enum InterruptStack {
    /// The running context's save area.
    Context = 1,
    /// Exceptions caused by code.
    Exception = 2,
    /// The double fault: the exception stack itself may be broken.
    DoubleFault = 3,
    /// The non-maskable interrupt, possible in any handler.
    NonMaskable = 4,
    /// The machine check, likewise.
    MachineCheck = 5,
}

/// The 64-bit task state segment; only the interrupt stacks matter.
#[repr(C, packed(4))]
pub(crate) struct TaskState {
    reserved_0: u32,
    privilege_stacks: [u64; 3],
    reserved_1: u64,
    /// IST 1 to 7.
    interrupt_stacks: [u64; 7],
    reserved_2: [u16; 5],
    io_map_base: u16,
}

const _: () = assert!(size_of::<TaskState>() == 104);

impl TaskState {
    /// Creates a segment with the given stack tops, in the order of [`InterruptStack`].
    pub(crate) const fn new(tops: [u64; 5]) -> Self {
        let [
            context,
            exception,
            double_fault,
            non_maskable,
            machine_check,
        ] = tops;
        Self {
            reserved_0: 0,
            privilege_stacks: [0; 3],
            reserved_1: 0,
            interrupt_stacks: [
                context,
                exception,
                double_fault,
                non_maskable,
                machine_check,
                0,
                0,
            ],
            reserved_2: [0; 5],
            io_map_base: 104,
        }
    }
}

/// Points interrupt stack 1 of a core elsewhere.
///
/// # Safety
///
/// `task_state` belongs to this core, which has interrupts disabled, and `top` is the end of the
/// save area of the context now running or about to run.
pub(super) unsafe fn set_context_stack(task_state: *mut TaskState, top: u64) {
    let offset = core::mem::offset_of!(TaskState, interrupt_stacks);
    let place = task_state.wrapping_byte_add(offset).cast::<u64>();
    // SAFETY: the place lies within the segment; the processor reads it only
    // when an interrupt comes (the caller's condition).
    unsafe { place.write_unaligned(top) };
}

/// Loads segments for this core, with `task_state` as its interrupt stacks.
///
/// `task_state` points to a segment that lives forever.
pub(super) fn load_segments(task_state: *mut TaskState) {
    let base = task_state as u64;
    let limit = size_of::<TaskState>() as u64 - 1;
    let table: &'static [u64; 5] = Box::leak(Box::new([
        0,
        0x00af_9b00_0000_ffff, // 64-bit code
        0x00cf_9300_0000_ffff, // data
        limit | (base & 0xff_ffff) << 16 | 0x89 << 40 | (base >> 24 & 0xff) << 56,
        base >> 32,
    ]));
    let pointer = TablePointer::to(table);
    // SAFETY: the table is valid and lives forever; the code segment is the
    // same as before, so execution goes on unchanged.
    unsafe { asm!("lgdt [{}]", in(reg) &pointer) };
    // SAFETY: reloads cs with the selector of a 64-bit code segment by a far
    // return to the next instruction; the data segments may be null.
    unsafe {
        asm!(
            "push {code}", "lea {scratch}, [rip + 2f]", "push {scratch}", "retfq", "2:",
            "mov ss, {null:e}",
            code = const CODE,
            scratch = out(reg) _,
            null = in(reg) 0,
        );
    };
    // SAFETY: the selector names the task state segment of the table just loaded.
    unsafe { asm!("ltr {:x}", in(reg) TASK_STATE) };
}

static INTERRUPT_TABLE: SetOnce<Box<[[u64; 2]; 256]>> = SetOnce::new();

/// Loads the interrupt table for this core. From `stubs` on, 16 bytes each, lie the stubs of the
/// exceptions, of the vectors in use, and one for all others.
pub(crate) fn load_interrupts(stubs: u64) {
    if INTERRUPT_TABLE.get().is_none() {
        let table = Box::new(core::array::from_fn(|vector| {
            let place = match u8::try_from(vector) {
                Ok(exception @ 0..32) => exception,
                Ok(used @ TIMER..OTHER) => 32 + used - TIMER,
                _ => 32 + OTHER - TIMER,
            };
            gate(stubs + 16 * u64::from(place), vector)
        }));
        INTERRUPT_TABLE.set(table);
    }
    let table = INTERRUPT_TABLE
        .get()
        .expect("it is set by the processor that boots");
    let pointer = TablePointer::to(&**table);
    // SAFETY: every gate leads to a stub that saves and restores all state.
    unsafe { asm!("lidt [{}]", in(reg) &pointer) };
}

/// Builds an interrupt gate to `address`: the code there starts with interrupts disabled (Intel SDM
/// 3, 6.14.1).
const fn gate(address: u64, vector: usize) -> [u64; 2] {
    let stack = match vector {
        2 => InterruptStack::NonMaskable,
        8 => InterruptStack::DoubleFault,
        18 => InterruptStack::MachineCheck,
        0..32 => InterruptStack::Exception,
        _ => InterruptStack::Context,
    };
    let low = address & 0xffff
        | (CODE as u64) << 16
        | (stack as u64) << 32
        | 0x8e << 40
        | (address >> 16 & 0xffff) << 48;
    [low, address >> 32]
}

/// The operand of `lgdt` and `lidt`.
#[repr(C, packed(2))]
struct TablePointer {
    limit: u16,
    base: u64,
}

impl TablePointer {
    fn to<T>(table: &'static T) -> Self {
        let limit = u16::try_from(size_of::<T>() - 1).expect("descriptor tables fit in 64 KiB");
        Self {
            limit,
            base: core::ptr::from_ref(table) as u64,
        }
    }
}
