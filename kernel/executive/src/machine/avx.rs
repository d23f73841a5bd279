//! AVX: registers of 256 bits, on processors with AVX.
//!
//! The image is compiled for every 64-bit processor, and an app's function uses AVX after asking
//! whether AVX is on. Saving the upper halves takes other instructions than saving x87 and SSE
//! alone. Both kinds are equally long, so the AVX instructions replace the others while the image
//! is still writable: no interrupt asks which kind to use, and no interrupt takes longer. The
//! processor knows whether upper halves are in use, and does not write unused ones.
//!
//! **Avx invariant**: the instructions were exchanged if and only if [`IS_ON`] is set, before any
//! core takes interrupts, and each core enables AVX before its first interrupt.

use core::arch::asm;
use core::arch::x86_64::{__cpuid, __cpuid_count};
use core::sync::atomic::{AtomicBool, Ordering};

use super::context::VECTOR_BYTES;

static IS_ON: AtomicBool = AtomicBool::new(false);

/// The length of each exchanged instruction, in bytes.
const LENGTH: usize = 9;

unsafe extern "C" {
    safe static mut save_vectors: [u8; LENGTH];
    safe static mut restore_vectors: [u8; LENGTH];
    safe static vectors_with_avx: [[u8; LENGTH]; 2];
}

/// Reports whether functions may use AVX.
pub fn is_on() -> bool {
    IS_ON.load(Ordering::Relaxed)
}

/// Turns AVX on, if this processor has AVX.
///
/// # Safety
///
/// The image is mapped writable, only this processor runs, and it has no interrupt table.
pub unsafe fn turn_on() {
    if !is_there() {
        return;
    }
    let places = [&raw mut save_vectors, &raw mut restore_vectors];
    for (place, instruction) in places.into_iter().zip(vectors_with_avx) {
        // SAFETY: the bytes are an instruction that nobody executes before the first interrupt,
        // and they are writable (the caller's conditions).
        unsafe { place.write(instruction) };
    }
    IS_ON.store(true, Ordering::Relaxed);
}

/// Reports whether the processor has AVX, and an instruction that leaves out unused state, as all
/// have except AMD's of 2011 and 2012; and whether the state fits into save areas.
fn is_there() -> bool {
    const XSAVE_AND_AVX: u32 = 1 << 26 | 1 << 28;
    const STATE: u32 = 0xd;
    const UPPER_HALVES: u32 = 2;
    if __cpuid(1).ecx & XSAVE_AND_AVX != XSAVE_AND_AVX || __cpuid(0).eax < STATE {
        return false;
    }
    let has_xsaveopt = __cpuid_count(STATE, 1).eax & 1 != 0;
    let halves = __cpuid_count(STATE, UPPER_HALVES);
    has_xsaveopt && (halves.eax + halves.ebx) as usize == VECTOR_BYTES
}

/// Enables AVX on the calling processor, if the kernel has turned AVX on. The processor takes no
/// interrupts yet.
pub(super) fn enable() {
    if !is_on() {
        return;
    }
    // SAFETY: sets the bit OSXSAVE of CR4, with which the next instruction is there.
    unsafe { asm!("mov {0}, cr4", "bts {0}, 18", "mov cr4, {0}", out(reg) _, options(nostack)) };
    // SAFETY: the processor has x87, SSE and AVX (`is_there`), and interrupts save all three
    // (avx invariant).
    unsafe { asm!("xsetbv", in("ecx") 0, in("eax") 7, in("edx") 0, options(nomem, nostack)) };
}
