//! Exceptions: the processor's reports about code that cannot go on.

use core::fmt;

use super::context::SavedRegisters;
use super::{cpu, machine_check, this_core};

/// The vector of the non-maskable interrupt: another core's message
/// ([`non_maskable`](super::non_maskable)), or a failure of the board.
pub(super) const NON_MASKABLE: u64 = 2;
const DOUBLE_FAULT: u64 = 8;
const PAGE_FAULT: u64 = 14;
const MACHINE_CHECK: u64 = 18;

/// An exception, in words and numbers.
pub struct CpuException<'a> {
    /// Its name, such as `page fault`.
    pub name: &'static str,
    /// The registers at the faulting instruction.
    pub registers: &'a SavedRegisters,
    /// The accessed address, for a page fault.
    pub address: Option<u64>,
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

impl fmt::Display for CpuException<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)?;
        if let Some(address) = self.address {
            write!(f, " at address {address:#x}")?;
        }
        if self.is_stack_overflow() {
            f.write_str(", a stack overflow")?;
            let stack = this_core::get().context().stack_at(self.registers.rsp);
            if let Some(stack) = stack {
                let kib = (stack.end - stack.start) / 1024;
                write!(f, " (the stack has {kib} KiB)")?;
            }
        }
        if self.registers.vector == MACHINE_CHECK {
            machine_check::write_errors(f)?;
        }
        let SavedRegisters {
            error_code, rsp, ..
        } = self.registers;
        write!(f, ", error code {error_code:#x}, stack {rsp:#x}")
    }
}

impl<'a> CpuException<'a> {
    /// Names the exception whose stub has pushed `registers`.
    pub(super) fn new(registers: &'a SavedRegisters) -> Self {
        let vector = registers.vector;
        let name = usize::try_from(vector)
            .ok()
            .and_then(|vector| NAMES.get(vector));
        Self {
            name: name.unwrap_or(&"reserved exception"),
            registers,
            address: (vector == PAGE_FAULT).then(cpu::fault_address),
        }
    }
}

impl CpuException<'_> {
    /// Reports whether the access hit the page below the stack: an absent page within one page of
    /// the stack pointer, as compiled code touches each page on its way down.
    fn is_stack_overflow(&self) -> bool {
        const PRESENT: u64 = 1;
        const PAGE: u64 = 4096;
        let registers = self.registers;
        let is_near = |address: u64| address.abs_diff(registers.rsp) <= PAGE;
        registers.error_code & PRESENT == 0 && self.address.is_some_and(is_near)
    }

    /// Reports whether the running code is at fault, rather than the machine or the kernel: that
    /// code had interrupts enabled, unlike every holder of a lock and every handler.
    pub fn is_of_interruptible_code(&self) -> bool {
        let is_contained = !matches!(
            self.registers.vector,
            NON_MASKABLE | DOUBLE_FAULT | MACHINE_CHECK
        );
        is_contained && self.registers.are_interrupts_enabled()
    }
}
