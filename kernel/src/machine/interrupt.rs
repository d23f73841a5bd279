//! From an interrupt's vector to the function that handles it.
//!
//! The machine layer knows nothing of scheduling: whoever boots it [`install`]s
//! the functions to call. They run with interrupts disabled, on the core's
//! handler stack, and may use locks but must not wait for anything else.

use core::arch::global_asm;

use super::context::Registers;
use super::once::Once;
use super::{descriptors, fault, local_apic, this_core};

global_asm!(
    include_str!("interrupt.s"),
    handle_interrupt = sym handle_interrupt,
    handle_exception = sym handle_exception,
    handler_stack = const this_core::HANDLER_STACK_OFFSET,
);

unsafe extern "C" {
    safe static interrupt_stubs: u8;
}

/// The vectors in use.
pub(crate) mod vector {
    /// The local timer.
    pub(crate) const TIMER: u8 = 0x40;
    /// Another core has work for this one.
    pub(crate) const WAKE: u8 = 0x41;
    /// The local APIC withdrew an interrupt; needs no acknowledgement.
    pub(crate) const SPURIOUS: u8 = 0xff;
}

/// What to do at each kind of interrupt. A handler may let the core go on with
/// another context by [`this_core::exchange_context`].
#[derive(Debug)]
pub(crate) struct Handlers {
    /// The local timer has fired.
    pub(crate) timer: fn(),
    /// Another core asked for attention.
    pub(crate) wake: fn(),
    /// The code that was running cannot go on.
    pub(crate) exception: fn(&fault::Exception<'_>) -> !,
}

static HANDLERS: Once<Handlers> = Once::new();

/// Names the functions that handle interrupts. The first call counts.
pub(crate) fn install(handlers: Handlers) {
    // A second call would come from a second boot, which there is not.
    let _ = HANDLERS.set(handlers);
}

/// Loads the interrupt table for this core.
pub(crate) fn load_table() {
    descriptors::load_interrupts(core::ptr::from_ref(&interrupt_stubs) as u64);
}

/// Handles one interrupt and returns the registers to resume.
extern "C" fn handle_interrupt(registers: *mut Registers) -> *mut Registers {
    // SAFETY: `interrupt.s` passes the registers of the context that this core
    // was running, which are this core's (context invariant).
    let vector = unsafe { (*registers).vector };
    match (u8::try_from(vector), HANDLERS.get()) {
        (Ok(vector::TIMER), Some(handlers)) => {
            local_apic::acknowledge();
            (handlers.timer)();
        }
        (Ok(vector::WAKE), Some(handlers)) => {
            local_apic::acknowledge();
            (handlers.wake)();
        }
        (Ok(vector::SPURIOUS), _) => {}
        _ => local_apic::acknowledge(),
    }
    this_core::get().context().registers()
}

/// Handles one exception; none is survived yet.
extern "C" fn handle_exception(registers: *mut Registers) -> *mut Registers {
    // SAFETY: `interrupt.s` passes the registers it pushed to the exception's
    // own stack, where nobody else looks.
    let registers = unsafe { &*registers };
    fault::raise(registers, HANDLERS.get())
}
