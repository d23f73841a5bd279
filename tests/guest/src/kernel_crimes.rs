//! Crimes bringing down the kernel itself, on purpose: it must end in a report.

use core::arch::asm;

use faults::crimes::{Crime, Unpunished};

/// All crimes, by name.
pub(crate) const CRIMES: [(&str, Crime); 5] = [
    ("avx", use_avx),
    ("nmi", raise_nmi),
    ("machine_check", raise_machine_check),
    ("double_fault", fault_doubly),
    ("exit_port", end_the_machine),
];

/// Uses a register of AVX, after the word `avx=off` has left AVX off.
fn use_avx() -> Unpunished {
    // SAFETY: none; the kernel has to report it (see the module).
    unsafe { asm!("vxorps ymm0, ymm0, ymm0", out("xmm0") _) };
    Unpunished
}

/// Raises a non-maskable interrupt sent by no core.
fn raise_nmi() -> Unpunished {
    // SAFETY: none; the kernel has to report it (see the module).
    unsafe { asm!("int 2") };
    Unpunished
}

/// Raises a machine check.
fn raise_machine_check() -> Unpunished {
    // SAFETY: none; the kernel has to report it (see the module).
    unsafe { asm!("int 18") };
    Unpunished
}

/// Takes away the exceptions' stack, and causes an exception: its delivery faults, too.
fn fault_doubly() -> Unpunished {
    // The task state segment's base is spread over its descriptor, at offset
    // 0x18 of the table; its IST 2 is at offset 44 (Intel SDM 3, 7.2.3, 7.7).
    // SAFETY: none; the kernel has to report it (see the module).
    unsafe {
        asm!(
            "sub rsp, 16",
            "sgdt [rsp]",
            "mov {table}, [rsp + 2]",
            "mov {base}, [{table} + 0x18 + 8]",
            "shl {base}, 32",
            "mov {part:e}, dword ptr [{table} + 0x18 + 2]",
            "and {part:e}, 0xffffff",
            "or {base}, {part}",
            "movzx {part:e}, byte ptr [{table} + 0x18 + 7]",
            "shl {part:e}, 24",
            "or {base}, {part}",
            "mov qword ptr [{base} + 44], 0",
            "ud2",
            table = out(reg) _,
            base = out(reg) _,
            part = out(reg) _,
        );
    };
    Unpunished
}

/// Ends QEMU just as the kernel ends QEMU after its verdict of success.
fn end_the_machine() -> Unpunished {
    // SAFETY: none; the host has to notice it (see the module).
    unsafe { asm!("out 0xf4, eax", in("eax") 0x10) };
    Unpunished
}

/// Disables interrupts and waits for an interrupt, again and again.
pub(crate) fn take_no_interrupts() -> Unpunished {
    // SAFETY: none; another core has to notice it (see the module).
    unsafe { asm!("cli", "2: hlt", "jmp 2b") };
    Unpunished
}
