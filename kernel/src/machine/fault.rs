//! Exceptions: what the processor says about code that cannot go on.

use core::fmt;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use super::context::Registers;
use super::interrupt::{Handlers, Interrupted};
use super::this_core::{self, Core};
use super::{cpu, local_apic};

/// The non-maskable interrupt: another core stops this one, or the board has
/// something terrible to say.
const NON_MASKABLE: u64 = 2;
const DOUBLE_FAULT: u64 = 8;
/// The interrupt flag, in the flags.
const INTERRUPTS_ENABLED: u64 = 1 << 9;
const PAGE_FAULT: u64 = 14;
const MACHINE_CHECK: u64 = 18;

/// An exception, in words and numbers.
#[derive(Debug)]
pub(crate) struct Exception<'a> {
    /// What happened, such as `page fault`.
    pub(crate) name: &'static str,
    /// The registers at the faulting instruction.
    pub(crate) registers: &'a Registers,
    /// The address that was accessed, for a page fault.
    pub(crate) address: Option<u64>,
}

/// The names of Intel SDM volume 3, table 6-1, by vector.
const NAMES: [&str; 22] = [
    "division error",
    "debug exception",
    "non-maskable interrupt",
    "breakpoint",
    "overflow",
    "bound range exceeded",
    "invalid opcode",
    "device not available",
    "double fault",
    "coprocessor segment overrun",
    "invalid task state segment",
    "segment not present",
    "stack segment fault",
    "general protection fault",
    "page fault",
    "reserved exception",
    "x87 floating-point error",
    "alignment check",
    "machine check",
    "vector floating-point error",
    "virtualization exception",
    "control protection exception",
];

/// Whether non-maskable interrupts are this kernel's own signal to stop.
static STOPPING: AtomicBool = AtomicBool::new(false);

/// The core that has to say why it takes no interrupts: its index, or `NOBODY`.
static ACCUSED: AtomicU32 = AtomicU32::new(NOBODY);
const NOBODY: u32 = u32::MAX;

/// Makes a core say why it takes no interrupts, and end the run; or go on, if it does.
pub(crate) fn accuse(core: &Core) {
    ACCUSED.store(core.index, Ordering::Release);
    local_apic::send_non_maskable(core.apic_id());
}

/// Reports whether this is an accusation of this core, and withdraws it.
fn is_accusation(vector: u64) -> bool {
    let (taken, failed) = (Ordering::AcqRel, Ordering::Relaxed);
    vector == NON_MASKABLE
        && this_core::is_ready()
        && (ACCUSED.compare_exchange(this_core::get().index, NOBODY, taken, failed)).is_ok()
}

/// Stops all other cores, for good.
pub(crate) fn stop_others() {
    STOPPING.store(true, Ordering::Release);
    local_apic::send_stop_to_others();
}

/// Passes an exception to its handler, or stops the core if it is the signal to
/// stop or nobody handles exceptions yet. Reports whether the code that was interrupted
/// is to go on.
pub(super) fn raise(
    registers: &Registers,
    handlers: Option<&Handlers>,
    interrupted: &mut Interrupted,
) -> bool {
    let vector = registers.vector;
    let is_stopped = vector == NON_MASKABLE && STOPPING.load(Ordering::Acquire);
    let Some(handlers) = handlers.filter(|_| !is_stopped) else {
        cpu::halt_forever();
    };
    let is_accused = is_accusation(vector);
    if is_accused && registers.rflags & INTERRUPTS_ENABLED != 0 {
        // The host has not let this core run. It takes its interrupts now.
        return true;
    }
    let name = match is_accused {
        true => Some(&"interrupts disabled for seconds"),
        false => usize::try_from(vector)
            .ok()
            .and_then(|vector| NAMES.get(vector)),
    };
    let exception = Exception {
        name: name.unwrap_or(&"reserved exception"),
        registers,
        address: (vector == PAGE_FAULT).then(cpu::fault_address),
    };
    (handlers.exception)(&exception, interrupted);
    false
}

impl fmt::Display for Exception<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)?;
        if let Some(address) = self.address {
            write!(f, " at address {address:#x}")?;
        }
        if self.is_stack_overflow() {
            f.write_str(", a stack overflow")?;
            let bytes = this_core::get()
                .context()
                .stack_bytes_at(self.registers.rsp);
            if let Some(bytes) = bytes {
                write!(f, " (the stack has {} KiB)", bytes / 1024)?;
            }
        }
        let Registers {
            error_code, rsp, ..
        } = self.registers;
        write!(f, ", error code {error_code:#x}, stack {rsp:#x}")
    }
}

impl Exception<'_> {
    /// Reports whether the page below the stack was hit: an absent page within one
    /// page of the stack pointer, as compiled code touches each page on its way down.
    fn is_stack_overflow(&self) -> bool {
        const PRESENT: u64 = 1;
        const PAGE: u64 = 4096;
        let registers = self.registers;
        let is_near = |address: u64| address.abs_diff(registers.rsp) <= PAGE;
        registers.error_code & PRESENT == 0 && self.address.is_some_and(is_near)
    }

    /// Reports whether it is the fault of the code that ran, rather than of the
    /// machine or the kernel: that code had interrupts enabled, as no holder of
    /// a lock and no handler has.
    pub(crate) fn is_of_interruptible_code(&self) -> bool {
        let is_contained = !matches!(
            self.registers.vector,
            NON_MASKABLE | DOUBLE_FAULT | MACHINE_CHECK
        );
        is_contained && self.registers.rflags & INTERRUPTS_ENABLED != 0
    }
}
