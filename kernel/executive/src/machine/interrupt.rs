//! Dispatches an interrupt, by its vector, to its handler.
//!
//! The machine layer knows nothing of scheduling: the start of the kernel [`install`]s the
//! functions to call. Handlers run with interrupts disabled, on the core's handler stack, and may
//! use locks but must not wait for anything else.

use core::arch::global_asm;
use core::panic::Location;

use super::abandoned::AbandonedContext;
use super::context::{Parked, SavedRegisters, VECTOR_BYTES};
use super::fault::{self, CpuException};
use super::this_core::Core;
use super::{
    cpu, descriptors, interrupt_flag, interrupts_off, local_apic, non_maskable, this_core,
    time_slice, timer, vector,
};
use fass::platform::SetOnce;

global_asm!(
    include_str!("interrupt.s"),
    handle_interrupt = sym handle_interrupt,
    handle_exception = sym handle_exception,
    handler_stack = const this_core::HANDLER_STACK_OFFSET,
    vector_bytes = const VECTOR_BYTES,
    timer = const vector::TIMER,
    other = const vector::OTHER,
);

unsafe extern "C" {
    safe static interrupt_stubs: u8;
}

/// The handlers of the layer above, called by the machine layer.
pub struct Handlers {
    /// The local timer has fired.
    pub timer: fn(&mut Interrupted),
    /// Another core asked for attention.
    pub wake: fn(&mut Interrupted),
    /// The running code asks for its own end.
    pub end: fn(&mut Interrupted),
    /// The core's heartbeat, with the time: looks in on the run.
    pub beat: fn(&Core, u64),
    /// The running code cannot continue. If the handler returns, it has exchanged the context.
    pub exception: fn(&CpuException<'_>, &mut Interrupted),
    /// The work of a restarted context; returns, with interrupts disabled, the context to continue
    /// instead.
    pub work: fn() -> Parked,
    /// Takes a context not needed by this core.
    pub release: fn(Parked),
}

/// The proof of being in a handler: the interrupted context is saved.
pub struct Interrupted(());

impl Interrupted {
    /// Returns the address of the interrupted instruction.
    pub fn instruction(&self) -> u64 {
        let registers = this_core::get().context().registers();
        // SAFETY: an `Interrupted` exists in handlers only, where the context of
        // this core is saved and does not change.
        unsafe { (*registers).rip }
    }

    /// Returns the stack pointer at that instruction.
    pub(crate) fn stack_pointer(&self) -> u64 {
        let registers = this_core::get().context().registers();
        // SAFETY: as for `instruction`.
        unsafe { (*registers).rsp }
    }

    /// Makes this core continue with `next` when the handler returns, and returns the interrupted
    /// context.
    pub fn exchange(&mut self, next: Parked) -> Parked {
        // SAFETY: an `Interrupted` exists in handlers only.
        unsafe { this_core::exchange_context(next) }
    }

    /// Makes this core continue with `next` when the handler returns; nothing ever continues the
    /// interrupted context.
    pub fn abandon(&mut self, next: Parked) -> AbandonedContext {
        AbandonedContext::new(self.exchange(next))
    }
}

static HANDLERS: SetOnce<Handlers> = SetOnce::new();

/// The handler for devices' messages, called with the line's number. Separate from the others, so
/// that an image without drivers has no such handler.
static DEVICES: SetOnce<fn(u8, &mut Interrupted)> = SetOnce::new();

/// Names the handler for devices' messages. The first call counts.
pub fn install_devices(handler: fn(u8, &mut Interrupted)) {
    // Each driver names the same handler.
    DEVICES.set(handler);
}

/// Names the functions that handle interrupts. The first call counts.
pub fn install(handlers: Handlers) {
    // A second call could only come from a second boot, and the kernel boots once.
    HANDLERS.set(handlers);
}

/// Loads the interrupt table for this core.
pub fn load_table() {
    descriptors::load_interrupts(core::ptr::from_ref(&interrupt_stubs) as u64);
}

/// Handles one interrupt and returns the registers to resume.
extern "C" fn handle_interrupt(registers: *mut SavedRegisters) -> *mut SavedRegisters {
    interrupts_off::note_disabled(Location::caller());
    time_slice::begin_urgent();
    // SAFETY: `interrupt.s` passes the registers of the context that this core
    // was running, which are this core's (context invariant).
    let vector = unsafe { (*registers).vector };
    match (u8::try_from(vector), HANDLERS.get()) {
        (Ok(vector::TIMER), Some(handlers)) => {
            timer::settle();
            local_apic::acknowledge();
            (handlers.timer)(&mut Interrupted(()));
        }
        (Ok(vector::WAKE), Some(handlers)) => {
            local_apic::acknowledge();
            (handlers.wake)(&mut Interrupted(()));
        }
        // Raised by an instruction (`cpu::ask_for_end`), so the local APIC expects no
        // acknowledgement.
        (Ok(vector::END), Some(handlers)) => (handlers.end)(&mut Interrupted(())),
        // Never in service, so an acknowledgement would end another interrupt (Intel SDM 3, 11.9).
        (Ok(vector::SPURIOUS), _) => {}
        (Ok(line @ vector::DEVICE..vector::OTHER), _) => {
            local_apic::acknowledge();
            if let Some(handler) = DEVICES.get() {
                handler(line - vector::DEVICE, &mut Interrupted(()));
            }
        }
        _ => local_apic::acknowledge(),
    }
    interrupts_off::note_enabled();
    time_slice::end_interrupt();
    this_core::get().context().registers()
}

/// The number of answers in a row with disabled interrupts after which an accused core counts as
/// having disabled them for good. On a busy host, a line to the serial port may outlast several
/// answers: the line is written with interrupts disabled, and a core runs there for some
/// milliseconds between answers.
const LAST_ANSWER: u32 = 8;

/// Handles one exception and returns the registers to resume, or null for the registers of the
/// interrupted code.
extern "C" fn handle_exception(registers: *mut SavedRegisters) -> *mut SavedRegisters {
    // SAFETY: `interrupt.s` passes the registers it pushed to the exception's
    // own stack, where nobody else looks.
    let pushed = unsafe { &*registers };
    let is_message = pushed.vector == fault::NON_MASKABLE;
    let is_stopped = is_message && non_maskable::is_stopping();
    let Some(handlers) = HANDLERS.get().filter(|_| !is_stopped) else {
        cpu::halt_forever();
    };
    let mut exception = CpuException::new(pushed);
    let answers = if is_message {
        non_maskable::answer()
    } else {
        0
    };
    if answers > 0 {
        if pushed.are_interrupts_enabled() || answers < LAST_ANSWER {
            // The host has not let this core run. The core takes its interrupts now, or soon.
            return core::ptr::null_mut();
        }
        exception.name = "interrupts disabled for seconds";
    }
    (handlers.exception)(&exception, &mut Interrupted(()));
    this_core::get().context().registers()
}

/// Makes the kernel look in on the run. Called in a heartbeat of this core.
pub fn look_in(core: &Core, now_ns: u64) {
    if let Some(handlers) = HANDLERS.get() {
        (handlers.beat)(core, now_ns);
    }
}

/// Begins a core's first context.
pub fn begin_work() -> ! {
    work()
}

/// The start of every restarted context.
pub extern "C" fn work() -> ! {
    let handlers = HANDLERS
        .get()
        .expect("handlers are installed before any context begins");
    let next = (handlers.work)();
    // Disabled already by the contract of `Handlers::work`; `leave_context` must be sure of it.
    interrupt_flag::disable();
    if let Some(spare) = this_core::take_spare_context() {
        (handlers.release)(spare);
    }
    // SAFETY: 1. This function begins a context, and interrupts are disabled.
    // 2. `work` has returned, so nothing of it is left on the stack.
    // 3. The spare context was taken just now.
    unsafe { this_core::leave_context(next) }
}
