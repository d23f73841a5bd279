//! What no program may do, done on purpose: the processor must stop each.
//!
//! If one of these returned, the protection that it is a test of would be
//! missing; the test then fails by its ending.

use core::arch::asm;
use core::hint::black_box;

use alloc::string::ToString;
use kernel::Ending;

fn unpunished(crime: &str) -> Result<(), Ending> {
    Err(Ending::Failure(crime.to_string() + " was not stopped"))
}

/// Writes to address 8, on the page that must be absent.
pub(crate) fn write_to_null() -> Result<(), Ending> {
    write(8);
    unpunished("a write to the null page")
}

/// Writes over a function's code, on a page that must not be writable.
pub(crate) fn write_to_code() -> Result<(), Ending> {
    write(write as fn(usize) as usize);
    unpunished("a write to code")
}

fn write(address: usize) {
    // SAFETY: none; the page table has to prevent it (see the module).
    unsafe { asm!("mov byte ptr [{}], 0x90", in(reg) address) };
}

/// Executes an instruction that is defined to be undefined.
pub(crate) fn execute_undefined() -> Result<(), Ending> {
    // SAFETY: none; the processor has to refuse it (see the module).
    unsafe { asm!("ud2") };
    unpunished("an undefined instruction")
}

/// Recurses until the stack's guard page is hit.
pub(crate) fn overflow_the_stack() -> Result<(), Ending> {
    black_box(sum_down(black_box(u64::MAX)));
    unpunished("a stack overflow")
}

#[expect(unconditional_recursion, reason = "that is the crime")]
fn sum_down(number: u64) -> u64 {
    let frame = black_box([number; 64]);
    frame[0].wrapping_add(sum_down(number.wrapping_sub(1)))
}
