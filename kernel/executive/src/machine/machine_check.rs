//! Machine checks: hardware failures reported by the processor (Intel SDM volume 3, 15).
//!
//! The processor keeps errors in *banks*, each with a few model-specific registers. An
//! uncorrectable error raises an exception; without the order to raise exceptions the processor
//! resets the machine instead, without a word.

use core::arch::asm;
use core::arch::x86_64::__cpuid;
use core::fmt;

use super::cpu;

/// The register with the number of banks, and a bit for a register that enables them all.
const CAPABILITIES: u32 = 0x179;
const HAS_CONTROL: u64 = 1 << 8;
/// The register for enabling all banks.
const CONTROL: u32 = 0x17b;
/// The registers of the first bank: what to report, the error found, and its address.
const BANK_CONTROL: u32 = 0x400;
const BANK_STATUS: u32 = 0x401;
const BANK_ADDRESS: u32 = 0x402;
/// The number of registers in a bank.
const BANK_REGISTERS: u32 = 4;

const IS_VALID: u64 = 1 << 63;
const HAS_ADDRESS: u64 = 1 << 58;

/// Returns the capabilities, and for each bank the offset to add to a register of the first bank;
/// nothing if this processor has no banks.
fn banks() -> (u64, impl Iterator<Item = u32>) {
    const EXCEPTION_AND_BANKS: u32 = 1 << 7 | 1 << 14;
    let has_banks = __cpuid(1).edx & EXCEPTION_AND_BANKS == EXCEPTION_AND_BANKS;
    // SAFETY: with these two features the processor has the register, and reading changes nothing.
    let capabilities = has_banks.then(|| unsafe { cpu::read_msr(CAPABILITIES) });
    let capabilities = capabilities.unwrap_or(0);
    let [count, ..] = capabilities.to_le_bytes();
    (
        capabilities,
        (0..u32::from(count)).map(|bank| bank * BANK_REGISTERS),
    )
}

/// Tells the calling processor to raise machine checks. The processor has an interrupt table.
pub(super) fn enable() {
    let (capabilities, banks) = banks();
    if capabilities & HAS_CONTROL != 0 {
        // SAFETY: the capability says that there is the register; all ones enable all.
        unsafe { cpu::write_msr(CONTROL, u64::MAX) };
    }
    for bank in banks {
        // SAFETY: each bank has the register; all ones have it report every error.
        unsafe { cpu::write_msr(BANK_CONTROL + bank, u64::MAX) };
        // SAFETY: each bank has the register; 0 forgets what was before.
        unsafe { cpu::write_msr(BANK_STATUS + bank, 0) };
    }
    // SAFETY: sets the bit MCE of CR4, which every 64-bit processor has: the exception has a gate.
    unsafe { asm!("mov {0}, cr4", "bts {0}, 6", "mov cr4, {0}", out(reg) _, options(nostack)) };
}

/// Writes the errors kept in the banks of this processor.
pub(super) fn write_errors(f: &mut fmt::Formatter<'_>) -> fmt::Result {
    for bank in banks().1 {
        // SAFETY: each bank has the register, and reading changes nothing.
        let status = unsafe { cpu::read_msr(BANK_STATUS + bank) };
        if status & IS_VALID != 0 {
            write!(f, ", bank {}: {status:#x}", bank / BANK_REGISTERS)?;
        }
        if status & IS_VALID != 0 && status & HAS_ADDRESS != 0 {
            // SAFETY: the status says that there is an address, and reading changes nothing.
            let address = unsafe { cpu::read_msr(BANK_ADDRESS + bank) };
            write!(f, " at {address:#x}")?;
        }
    }
    Ok(())
}
