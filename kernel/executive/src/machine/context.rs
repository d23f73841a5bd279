//! Contexts: computations with their own stacks, and the switch from one to another.
//!
//! A *context* is a computation with a stack. Each core runs one context. Meanwhile the processor's
//! interrupt stack 1 points to the end of the context's save area, so an interrupt saves the
//! context right there (see `interrupt.s`), and a handler may then make the core continue with
//! another context instead.
//!
//! **Context invariant**: a context's save area and stack belong to the core running the context,
//! or, while none does, to the holder of its one [`Parked`]. Two places never touch them at once.

use core::cell::UnsafeCell;
use core::fmt;
use core::ops::Range;
use core::sync::atomic::{AtomicBool, AtomicPtr, AtomicU32, AtomicU64, AtomicUsize, Ordering};

use alloc::boxed::Box;

use fass::platform::LockWords;

/// The general registers, as pushed by `interrupt.s` and the processor.
#[derive(Debug, Default)]
#[repr(C)]
#[expect(missing_docs, reason = "the processor's own names")]
pub struct SavedRegisters {
    pub r15: u64,
    pub r14: u64,
    pub r13: u64,
    pub r12: u64,
    pub r11: u64,
    pub r10: u64,
    pub r9: u64,
    pub r8: u64,
    pub rbp: u64,
    pub rdi: u64,
    pub rsi: u64,
    pub rdx: u64,
    pub rcx: u64,
    pub rbx: u64,
    pub rax: u64,
    pub vector: u64,
    pub error_code: u64,
    pub rip: u64,
    pub cs: u64,
    pub rflags: u64,
    pub rsp: u64,
    pub ss: u64,
}

impl SavedRegisters {
    const INTERRUPTS_ENABLED: u64 = 1 << 9;

    /// Reports whether interrupts were enabled when the registers were pushed.
    pub(super) const fn are_interrupts_enabled(&self) -> bool {
        self.rflags & Self::INTERRUPTS_ENABLED != 0
    }
}

impl fmt::Display for SavedRegisters {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let registers = [
            ("rax", self.rax),
            ("rbx", self.rbx),
            ("rcx", self.rcx),
            ("rdx", self.rdx),
            ("rsi", self.rsi),
            ("rdi", self.rdi),
            ("rbp", self.rbp),
            ("rsp", self.rsp),
            ("r8", self.r8),
            ("r9", self.r9),
            ("r10", self.r10),
            ("r11", self.r11),
            ("r12", self.r12),
            ("r13", self.r13),
            ("r14", self.r14),
            ("r15", self.r15),
            ("rip", self.rip),
            ("flags", self.rflags),
            ("vec", self.vector),
            ("err", self.error_code),
        ];
        for (index, (name, value)) in registers.iter().enumerate() {
            let end = if index % 4 == 3 { "\n" } else { "" };
            write!(f, "  {name:>5} {value:016x}{end}")?;
        }
        Ok(())
    }
}

/// The bytes of a save area for x87, SSE and AVX: 512 bytes in the format of `fxsave64`, a header
/// of 64 bytes listing the saved parts, and the upper halves (Intel SDM 1, 13.4).
pub(super) const VECTOR_BYTES: usize = 832;

/// The control and status words of x87 after FNINIT, and MXCSR after reset (Intel SDM 1, 8.1.5,
/// 10.2.3 and 10.5.1): every exception masked and none pending, full precision.
const CONTROL: [(usize, [u8; 8]); 2] = [
    (0, [0x7f, 0x03, 0, 0, 0, 0, 0, 0]),
    (24, [0x80, 0x1f, 0, 0, 0, 0, 0, 0]),
];

/// Vector state, then registers.
#[repr(C, align(64))]
struct SaveArea {
    vector_state: [u8; VECTOR_BYTES],
    registers: SavedRegisters,
}

const _: () = {
    // `interrupt.s` relies on each of these.
    assert!(size_of::<SavedRegisters>() == 22 * 8);
    assert!(core::mem::offset_of!(SaveArea, registers) == VECTOR_BYTES);
    assert!((VECTOR_BYTES + size_of::<SavedRegisters>()).is_multiple_of(16));
    // The area for `xsaveopt64` begins on a multiple of 64.
    assert!(VECTOR_BYTES.is_multiple_of(64));
};

/// A computation with its own stack.
pub struct Context {
    save_area: UnsafeCell<SaveArea>,
    stack_top: u64,
    stack_bytes: AtomicU64,
    is_background: bool,
    /// When the context was last suspended, and its total suspension before, both in nanoseconds.
    suspended_at_ns: AtomicU64,
    suspended_ns: AtomicU64,
    /// When the execution of the context's instance reaches its budget, in nanoseconds on the
    /// clock, if not suspended again before.
    budget_end_ns: AtomicU64,
    /// Whether the context's instance has been found at fault.
    is_at_fault: AtomicBool,
    sections: SectionNote,
    /// The address awaited by the halted context; 0 if there is none.
    awaited: AtomicUsize,
}

/// A context's note of its section; see [`section`](super::section).
pub(super) struct SectionNote {
    /// The lock held or awaited by the context; null if there is none.
    pub(super) lock: AtomicPtr<LockWords>,
    /// The core where the context waits, counted from 1; 0 if the context does not wait.
    pub(super) waits_on: AtomicU32,
    /// When the present section first postponed a preemption, in nanoseconds on the clock; 0 if it
    /// has postponed none.
    pub(super) put_off_ns: AtomicU64,
}

impl SectionNote {
    const fn new() -> Self {
        Self {
            lock: AtomicPtr::new(core::ptr::null_mut()),
            waits_on: AtomicU32::new(0),
            put_off_ns: AtomicU64::new(0),
        }
    }
}

// SAFETY: everything but the save area is constant or atomic, and the save area
// has one user at a time (context invariant).
unsafe impl Sync for Context {}

impl Context {
    /// Returns the required end address of the processor's interrupt frame.
    pub(super) fn frame_end(&self) -> u64 {
        self.registers() as u64 + size_of::<SavedRegisters>() as u64
    }

    /// Returns the address where `interrupt.s` keeps this context's registers.
    pub(super) fn registers(&self) -> *mut SavedRegisters {
        self.save_area.get().wrapping_byte_add(VECTOR_BYTES).cast()
    }

    /// Returns the upper end of the context's stack.
    pub const fn stack_top(&self) -> u64 {
        self.stack_top
    }

    /// Returns the context's stack if `address` lies in the stack, or in the guard page below.
    pub(super) fn stack_at(&self, address: u64) -> Option<Range<u64>> {
        let below = self.stack_top.checked_sub(address)?;
        let stack = self.stack();
        (below <= self.stack_bytes() + super::paging::PAGE).then_some(stack)
    }

    /// Returns the context's stack.
    pub(super) fn stack(&self) -> Range<u64> {
        self.stack_top - self.stack_bytes()..self.stack_top
    }

    /// Returns the size of the context's stack, in bytes.
    pub fn stack_bytes(&self) -> u64 {
        self.stack_bytes.load(Ordering::Relaxed)
    }

    /// Notes that the stack reaches further down from now on.
    pub fn note_grown(&self, stack_bytes: u64) {
        self.stack_bytes.store(stack_bytes, Ordering::Relaxed);
    }

    /// Reports whether this is its core's background, run when nothing is assigned to the core.
    pub const fn is_background(&self) -> bool {
        self.is_background
    }

    /// Sets when the budget of the context's instance ends.
    pub fn set_budget_end(&self, end_ns: u64) {
        self.budget_end_ns.store(end_ns, Ordering::Relaxed);
    }

    /// Returns when the budget of the context's instance ends.
    pub fn budget_end_ns(&self) -> u64 {
        self.budget_end_ns.load(Ordering::Relaxed)
    }

    /// Notes a fault of the context's instance, and reports whether a fault was noted before.
    pub fn note_fault(&self) -> bool {
        self.is_at_fault.swap(true, Ordering::Relaxed)
    }

    /// Reports whether the context's instance has been found at fault.
    pub fn is_at_fault(&self) -> bool {
        self.is_at_fault.load(Ordering::Relaxed)
    }

    /// Returns the context's note of its section.
    pub(super) const fn sections(&self) -> &SectionNote {
        &self.sections
    }

    /// Notes the address awaited by the context while its core halts; 0 ends the wait.
    pub fn note_awaited(&self, address: usize) {
        self.awaited.store(address, Ordering::SeqCst);
    }

    /// Reports whether the context halts its core to await an address.
    pub fn awaits(&self, address: usize) -> bool {
        self.awaited.load(Ordering::SeqCst) == address
    }

    /// Notes that the context has waited for `ns` nanoseconds without executing.
    pub(super) fn note_waited(&self, ns: u64) {
        self.suspended_ns.fetch_add(ns, Ordering::Relaxed);
        self.set_budget_end(self.budget_end_ns().saturating_add(ns));
    }

    /// Returns the context's total suspension since its creation, in nanoseconds.
    pub fn suspended_ns(&self) -> u64 {
        self.suspended_ns.load(Ordering::Relaxed)
    }
}

/// A context that does not run. Its owner may run the context.
pub struct Parked(&'static Context);

impl Parked {
    /// Makes a context with a stack of `stack_bytes` growing down from `stack_top`, a multiple of
    /// 16. The context has no work yet.
    pub fn new(stack_top: u64, stack_bytes: u64, is_background: bool) -> Self {
        let save_area = SaveArea {
            vector_state: [0; VECTOR_BYTES],
            // The segments never change: all code has the same ones.
            registers: SavedRegisters {
                cs: u64::from(super::descriptors::CODE),
                ss: 0,
                ..SavedRegisters::default()
            },
        };
        let context = Box::leak(Box::new(Context {
            save_area: UnsafeCell::new(save_area),
            stack_top,
            stack_bytes: AtomicU64::new(stack_bytes),
            is_background,
            suspended_at_ns: AtomicU64::new(0),
            suspended_ns: AtomicU64::new(0),
            budget_end_ns: AtomicU64::new(u64::MAX),
            is_at_fault: AtomicBool::new(false),
            sections: SectionNote::new(),
            awaited: AtomicUsize::new(0),
        }));
        let mut parked = Self(context);
        parked.reset();
        parked
    }

    /// Resets all state that one function would hand on to the next: the vector state's control
    /// words, the mark of a fault, and the awaited address.
    pub(super) fn reset(&mut self) {
        self.0.is_at_fault.store(false, Ordering::Relaxed);
        self.0.note_awaited(0);
        let area: *mut u8 = self.0.save_area.get().cast();
        for (offset, value) in CONTROL {
            // SAFETY: `&mut self` is the one holder of a context that does not run (context
            // invariant), and the words lie within the vector state.
            unsafe {
                area.wrapping_byte_add(offset)
                    .cast::<[u8; 8]>()
                    .write(value)
            };
        }
    }

    /// Makes the context begin anew with `entry`, on an empty stack, when next run. Everything the
    /// context did before is forgotten.
    pub fn restart(&mut self, entry: extern "C" fn() -> !) {
        self.0.set_budget_end(u64::MAX);
        // SAFETY: `&mut self` is the one holder of a context that does not run
        // (context invariant).
        let registers = unsafe { &mut *self.0.registers() };
        let parts: *mut u64 = self.0.save_area.get().wrapping_byte_add(512).cast();
        // No upper halves of vectors are in use; others' would be saved and restored in vain.
        // SAFETY: likewise; the header begins with the parts that were saved.
        unsafe { parts.write(0) };
        // The function expects nothing in the other registers.
        registers.rbp = 0;
        registers.rip = entry as *const () as u64;
        registers.rflags = SavedRegisters::INTERRUPTS_ENABLED;
        // As after a call: a function expects the stack to be 8 off.
        registers.rsp = self.0.stack_top - 8;
    }

    /// Notes the context's suspension at `now_ns`.
    pub fn note_suspended(&self, now_ns: u64) {
        self.0.suspended_at_ns.store(now_ns, Ordering::Relaxed);
    }

    /// Notes the context's resumption at `now_ns`.
    pub fn note_resumed(&self, now_ns: u64) {
        // Saturating: `now_ns` may be an interrupt's time, from before the suspension was noted.
        let since_ns = now_ns.saturating_sub(self.0.suspended_at_ns.load(Ordering::Relaxed));
        self.0.note_waited(since_ns);
    }

    /// Returns when the budget of the context's instance ends.
    pub fn budget_end_ns(&self) -> u64 {
        self.0.budget_end_ns()
    }

    /// Returns the address where `interrupt.s` keeps the context's registers.
    pub(super) fn registers(&self) -> *mut SavedRegisters {
        self.0.registers()
    }

    /// Returns the context itself.
    pub(super) const fn context(&self) -> &Context {
        self.0
    }

    /// Reports whether this is its core's background, run when nothing is assigned to the core.
    pub const fn is_background(&self) -> bool {
        self.0.is_background()
    }

    /// Gives the context up to a core about to run the context.
    pub(super) const fn into_context(self) -> &'static Context {
        self.0
    }

    /// Takes a context that has just stopped running.
    ///
    /// # Safety
    ///
    /// The context ran on this core and has stopped, or will only run up to the caller's imminent
    /// switch; no other `Parked` of the context exists.
    pub(super) const unsafe fn from_context(context: &'static Context) -> Self {
        Self(context)
    }
}
