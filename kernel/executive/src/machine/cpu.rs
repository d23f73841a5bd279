//! The processor's own instructions: interrupt flag, halt, registers, identity.
//!
//! Each function is one instruction (or a few inseparable ones) with a safe signature where no use
//! of the function can break memory safety.

use core::arch::asm;
use core::arch::x86_64::__cpuid;

/// Reports whether the interrupt flag is set.
pub(super) fn is_interrupt_flag_set() -> bool {
    let flags: u64;
    // SAFETY: reads the flags through the stack, which changes no memory that Rust knows of.
    unsafe { asm!("pushfq", "pop {}", out(reg) flags) };
    flags & (1 << 9) != 0
}

/// Clears the interrupt flag. [`interrupt_flag`](super::interrupt_flag) also does so, and measures
/// how long interrupts stay disabled.
pub(super) fn clear_interrupt_flag() {
    // SAFETY: clearing the interrupt flag delays interrupts and changes no memory.
    unsafe { asm!("cli") };
}

/// Sets the interrupt flag.
pub(super) fn set_interrupt_flag() {
    // SAFETY: handlers keep all registers of what they interrupt and touch only
    // data behind locks or atomics, so an interrupt may come anywhere.
    unsafe { asm!("sti") };
}

/// Sets the interrupt flag and halts until an interrupt has been handled. As `sti` takes effect
/// only after the next instruction, no interrupt can slip in between.
pub(super) fn set_interrupt_flag_and_halt() {
    // SAFETY: as for `set_interrupt_flag`; halting changes no state.
    unsafe { asm!("sti", "hlt") };
}

/// Touches the stack below everything the following code will use: a stack too short for that code
/// overflows here and not there.
pub(super) fn probe_stack() {
    // SAFETY: reads a byte below the stack, which is the stack's own or its guard page's.
    unsafe { asm!("test byte ptr [rsp - {}], 0", const STACK_FOR_A_SECTION, options(nostack)) };
}

/// More bytes of the stack than any section with interrupts disabled uses; less than a page.
const STACK_FOR_A_SECTION: usize = 2048;

/// Interrupts the running code, at its own request to be ended.
pub fn ask_for_end() {
    // SAFETY: as for any interrupt: its handler keeps all registers, or never returns.
    unsafe { asm!("int {}", const super::vector::END) };
}

/// Fails by a page fault.
pub fn access_nothing() {
    // SAFETY: reads nothing, for the first page is mapped nowhere.
    unsafe { asm!("test byte ptr [8], 0", options(nostack, readonly)) };
}

/// Continues on another stack, for good.
///
/// # Safety
///
/// `top` is the upper end of a mapped stack used by nobody else, a multiple of 16.
pub unsafe fn continue_on_stack<T>(top: u64, argument: &T, function: extern "C" fn(&T) -> !) -> ! {
    // SAFETY: the caller vouches for the stack. The old one is never returned
    // to, so what the argument borrows from it stays as it is. `call` aligns
    // the stack as a function expects it.
    unsafe {
        asm!(
            "mov rsp, {top}", "xor ebp, ebp", "call {function}", "ud2",
            top = in(reg) top,
            function = in(reg) function,
            in("rdi") core::ptr::from_ref(argument),
            options(noreturn),
        )
    }
}

/// Stops this processor for good.
pub fn halt_forever() -> ! {
    loop {
        // SAFETY: with interrupts disabled nothing runs here again, so no
        // invariant of interrupted code can be observed.
        unsafe { asm!("cli", "hlt") };
    }
}

/// Tells the processor that the caller waits in a loop.
///
/// Under QEMU's instruction counting this also passes the turn to the next processor, so a waiting
/// loop without the call would starve the others.
pub fn relax() {
    core::hint::spin_loop();
}

/// Reads the time stamp counter, in ticks.
pub fn time_stamp() -> u64 {
    // SAFETY: RDTSC only writes two registers; every 64-bit processor has it.
    unsafe { core::arch::x86_64::_rdtsc() }
}

/// Reads the time stamp counter, in ticks, after all earlier reads from memory.
pub fn time_stamp_after_reads() -> u64 {
    // SAFETY: LFENCE only orders; every 64-bit processor has it.
    unsafe { core::arch::x86_64::_mm_lfence() };
    time_stamp()
}

/// Waits until all earlier writes of this core are visible to every core, before any further
/// instruction.
pub fn finish_writes() {
    // SAFETY: the fences only order; every 64-bit processor has them.
    unsafe { asm!("mfence", "lfence", options(nostack)) };
}

/// Names a feature needed by the kernel and missing in this processor, among the features not
/// common to all 64-bit processors.
pub fn missing_feature() -> Option<&'static str> {
    const LOCAL_APIC: u32 = 1 << 9;
    const NO_EXECUTE: u32 = 1 << 20;
    if __cpuid(1).edx & LOCAL_APIC == 0 {
        return Some("local APIC");
    }
    let has_no_execute = __cpuid(0x8000_0001).edx & NO_EXECUTE != 0;
    (!has_no_execute).then_some("no-execute pages (NX, XD)")
}

/// Reports whether local APICs can be reached by model-specific registers.
pub fn has_x2apic() -> bool {
    const X2APIC: u32 = 1 << 21;
    __cpuid(1).ecx & X2APIC != 0
}

/// Reports whether the processor states one constant rate for its counter, whatever its frequency
/// and its idle state (Intel's SDM volume 3, 18.17.1).
pub fn has_invariant_counter() -> bool {
    const POWER: u32 = 0x8000_0007;
    __cpuid(0x8000_0000).eax >= POWER && __cpuid(POWER).edx & 1 << 8 != 0
}

/// Reports whether the processor states that the local APIC's timer counts in all idle states
/// (CPUID 6, ARAT). Otherwise the timer may stop where a firmware turns a halt into a deeper state
/// (C1E).
pub fn has_timer_in_halt() -> bool {
    const POWER: u32 = 6;
    __cpuid(0).eax >= POWER && __cpuid(POWER).eax & 1 << 2 != 0
}

/// Reads a model-specific register.
///
/// # Safety
///
/// The processor has the register, and reading changes nothing.
pub unsafe fn read_msr(register: u32) -> u64 {
    let (low, high): (u64, u64);
    // SAFETY: the caller vouches for the register.
    unsafe { asm!("rdmsr", in("ecx") register, out("rax") low, out("rdx") high) };
    high << 32 | low
}

/// Writes a model-specific register.
///
/// # Safety
///
/// The processor has the register, and the value is right for this register.
pub unsafe fn write_msr(register: u32, value: u64) {
    let (low, high) = (value & 0xffff_ffff, value >> 32);
    // SAFETY: the caller vouches for register and value.
    unsafe { asm!("wrmsr", in("ecx") register, in("rax") low, in("rdx") high) };
}

/// Reads the address of the access that caused the last page fault.
pub fn fault_address() -> u64 {
    let address: u64;
    // SAFETY: reading CR2 changes nothing.
    unsafe { asm!("mov {}, cr2", out(reg) address, options(nomem, nostack)) };
    address
}

/// Switches to the page table at physical address `root`.
///
/// # Safety
///
/// `root` maps the image, the current stack and all memory in use to their current places.
pub unsafe fn set_page_table(root: u64) {
    // SAFETY: the caller vouches for the table; the write flushes old entries.
    unsafe { asm!("mov cr3, {}", in(reg) root) };
}

/// Returns the processor's figures for the time stamp counter (CPUID 0x15): the denominator and the
/// numerator of its ratio to a crystal, and the crystal's rate in Hz; each 0 if left out.
pub fn counter_ratio() -> [u32; 3] {
    const LEAF: u32 = 0x15;
    if __cpuid(0).eax < LEAF {
        return [0; 3];
    }
    let leaf = __cpuid(LEAF);
    [leaf.eax, leaf.ebx, leaf.ecx]
}

/// Returns the hypervisor's signature (CPUID 0x4000_0000), if there is a hypervisor.
pub fn hypervisor() -> Option<[u8; 12]> {
    const HYPERVISOR_PRESENT: u32 = 1 << 31;
    if __cpuid(1).ecx & HYPERVISOR_PRESENT == 0 {
        return None;
    }
    let leaf = __cpuid(0x4000_0000);
    let mut signature = [0; 12];
    for (place, register) in signature
        .chunks_exact_mut(4)
        .zip([leaf.ebx, leaf.ecx, leaf.edx])
    {
        place.copy_from_slice(&register.to_le_bytes());
    }
    Some(signature)
}
