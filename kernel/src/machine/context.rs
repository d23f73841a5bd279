//! Where an interrupted computation is kept.
//!
//! A *context* is a computation with a stack of its own. While it runs, the
//! processor's interrupt stack 1 points to the end of its register area, so an
//! interrupt saves it right there (see `interrupt.s`).

/// The general registers as `interrupt.s` and the processor push them.
#[derive(Debug, Default)]
#[repr(C)]
pub(crate) struct Registers {
    pub(crate) r15: u64,
    pub(crate) r14: u64,
    pub(crate) r13: u64,
    pub(crate) r12: u64,
    pub(crate) r11: u64,
    pub(crate) r10: u64,
    pub(crate) r9: u64,
    pub(crate) r8: u64,
    pub(crate) rbp: u64,
    pub(crate) rdi: u64,
    pub(crate) rsi: u64,
    pub(crate) rdx: u64,
    pub(crate) rcx: u64,
    pub(crate) rbx: u64,
    pub(crate) rax: u64,
    pub(crate) vector: u64,
    pub(crate) error_code: u64,
    pub(crate) rip: u64,
    pub(crate) cs: u64,
    pub(crate) rflags: u64,
    pub(crate) rsp: u64,
    pub(crate) ss: u64,
}

/// A context's save area: vector state (x87 and SSE), then registers.
#[derive(Debug)]
#[repr(C, align(64))]
pub(crate) struct Context {
    vector_state: [u8; 512],
    registers: Registers,
}

const _: () = {
    // `interrupt.s` relies on each of these.
    assert!(size_of::<Registers>() == 22 * 8);
    assert!(core::mem::offset_of!(Context, registers) == 512);
    assert!((512 + size_of::<Registers>()).is_multiple_of(16));
};

impl Context {
    /// Creates an empty save area.
    pub(crate) fn new() -> Self {
        Self {
            vector_state: [0; 512],
            registers: Registers::default(),
        }
    }

    /// Returns the address where the processor's interrupt frame has to end.
    pub(crate) fn frame_end(&self) -> u64 {
        core::ptr::from_ref(&self.registers) as u64 + size_of::<Registers>() as u64
    }
}
