//! Work keeping values in the sixteen registers of AVX for a while. The compiler would spill them;
//! here they stay, so only an interruption can change them.

use core::arch::asm;
use core::sync::atomic::{AtomicU64, Ordering};

use crate::checksum::checksum;

type Registers = [[u64; 4]; 16];

/// The number of counting steps in each call, with all registers in use: some 12 us.
const STEPS: u64 = 6_000;

/// Reports whether all registers have kept their values, which are unique to each call. Without AVX
/// there are no such registers, and nothing is lost.
pub(crate) fn are_kept() -> bool {
    static CALLS: AtomicU64 = AtomicU64::new(1);
    if !kernel::has_avx() {
        return true;
    }
    let call = CALLS.fetch_add(1, Ordering::Relaxed);
    let mut place = 0;
    let values: Registers = [[(); 4]; 16].map(|register| {
        register.map(|()| {
            place += 1;
            (call << 6 | place).wrapping_mul(0x9e37_79b9_7f4a_7c15)
        })
    });
    // SAFETY: the processor has AVX, as the kernel says.
    values == unsafe { keep(&values) }
}

/// Reports whether [`are_kept`] holds, and code without AVX computes the right result as well.
pub(crate) fn are_kept_besides_others(expected: u64) -> bool {
    are_kept() && checksum() == expected
}

/// Holds the values in registers for a while and returns the registers' contents then.
#[target_feature(enable = "avx")]
fn keep(values: &Registers) -> Registers {
    let mut kept = [[0; 4]; 16];
    // SAFETY: reads and writes as many bytes as the two have.
    unsafe {
        asm!(
            ".irp n, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15",
            r"vmovups ymm\n, [{values} + 32 * \n]",
            ".endr",
            "2: dec rcx",
            "jnz 2b",
            ".irp n, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15",
            r"vmovups [{kept} + 32 * \n], ymm\n",
            ".endr",
            "vzeroupper",
            values = in(reg) values,
            kept = in(reg) &raw mut kept,
            inout("rcx") STEPS => _,
            clobber_abi("C"),
            options(nostack),
        );
    };
    kept
}
