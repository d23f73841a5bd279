//! Calls that are cut when their time is over, in the context of their caller.
//!
//! A call that can be *cut* notes its stack pointer. At the end of its time the timer's handler
//! puts that into the registers of the interrupted context, and the call returns as if its
//! function had. What has begun since is *given up*: its frames are overwritten by what the
//! caller calls next, and nothing in them is dropped. It is what C's `longjmp` does, so it takes
//! no memory and leaves none behind; and it is why the function has to be one that can be given
//! up, which its author states (`docs/decisions/0051-refinements-that-are-cut.md`).
//!
//! **Cut invariant**: a context's `cut_stack` is 0, or the stack pointer of the one `call_cuttable`
//! that has not returned there. Outside the function that it calls, interrupts are disabled, so
//! whatever a handler cuts is that function.

use core::arch::global_asm;
use core::ffi::c_void;
use core::sync::atomic::Ordering;

use super::context::{Context, Registers};
use super::this_core::{self, Core};
use super::timer::{self, Alarm};
use super::{clock, interrupt_flag, turns};

// rdi: what the function gets; rsi: the function; rdx: where the stack pointer is noted.
// What a function has to keep for its caller is kept on the stack below that (System V ABI,
// 3.2.1). The notes that end a frame keep `rbp` a chain for backtraces.
global_asm!(
    ".section .text.call_cuttable, \"ax\"",
    ".global call_cuttable",
    "call_cuttable:",
    "    push rbp",
    "    mov rbp, rsp",
    "    push rbx",
    "    push r12",
    "    push r13",
    "    push r14",
    "    push r15",
    "    push rdx",
    "    mov [rdx], rsp",
    "    call rsi",
    "    xor eax, eax",
    "    jmp 2f",
    ".global cut_goes_on",
    "cut_goes_on:",
    "    mov eax, 1",
    "2:",
    "    pop rdx",
    "    mov qword ptr [rdx], 0",
    "    pop r15",
    "    pop r14",
    "    pop r13",
    "    pop r12",
    "    pop rbx",
    "    pop rbp",
    "    ret",
    ".text",
);

/// What is called.
type Called<'a> = &'a mut dyn FnMut();

unsafe extern "C" {
    fn call_cuttable(
        called: *mut c_void,
        function: extern "C" fn(*mut c_void),
        cut_stack: *mut u64,
    ) -> bool;
    safe static cut_goes_on: u8;
}

/// Whether this image can cut; others have no instruction for it.
pub const MAY_CUT: bool = cfg!(feature = "refining");

/// Calls `f` for an instance, and cuts it when it has executed for `most_ns`. Reports whether it
/// was cut. Its time is not the budget's.
///
/// # Safety
///
/// Whatever `f` has on the stack may be given up at any instruction: nobody relies on its being
/// dropped, and nobody looks at it afterwards.
pub unsafe fn run(most_ns: u64, f: &mut dyn FnMut()) -> bool {
    interrupt_flag::disable_enabled();
    let core = this_core::get();
    let context = core.context();
    let now_ns = clock::now_ns();
    let left_ns = match context.budget_end_ns() {
        u64::MAX => u64::MAX,
        end_ns => end_ns.saturating_sub(now_ns),
    };
    limit(core, now_ns.saturating_add(most_ns));
    let mut called: Called<'_> = f;
    let place = (&raw mut called).cast();
    // SAFETY: interrupts are disabled (cut invariant), an instance has one optional part at a
    // time, and what is given up may be (the caller's condition).
    let was_cut = unsafe { call_cuttable(place, enter, context.cut_stack().as_ptr()) };
    // It may have been preempted, and be on another core.
    let core = this_core::get();
    if was_cut {
        // The hold, or the turn, was that of what was cut.
        turns::leave(core);
        timer::set(Alarm::Hold, u64::MAX);
        turns::enter();
    }
    limit(this_core::get(), clock::now_ns().saturating_add(left_ns));
    interrupt_flag::enable();
    was_cut
}

/// Has the time of what runs on this core, `core`, end then. Interrupts are disabled.
fn limit(core: &Core, end_ns: u64) {
    core.context().set_budget_end(end_ns);
    if end_ns != u64::MAX {
        timer::set_no_later(core, Alarm::Budget, end_ns);
    }
}

/// Calls what is called, with interrupts enabled meanwhile.
extern "C" fn enter(called: *mut c_void) {
    interrupt_flag::enable();
    // SAFETY: `run` passes its own variable, which nobody else uses until `call_cuttable` is back.
    let called = unsafe { &mut *called.cast::<Called<'_>>() };
    called();
    interrupt_flag::disable_enabled();
}

/// Reports whether what this context runs can be cut.
pub fn can_cut(context: &Context) -> bool {
    MAY_CUT && context.cut_stack().load(Ordering::Relaxed) != 0
}

/// Changes the registers of an interrupted context so that its call that can be cut returns.
/// Reports whether there is one.
pub(super) fn redirect(context: &Context, registers: &mut Registers) -> bool {
    if !can_cut(context) {
        return false;
    }
    // It is set anew there.
    context.set_budget_end(u64::MAX);
    registers.rip = &raw const cut_goes_on as u64;
    registers.rsp = context.cut_stack().load(Ordering::Relaxed);
    // Interrupts disabled, and the direction flag clear, as at any return.
    registers.rflags = 0;
    true
}
