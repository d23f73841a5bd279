//! The local APIC: a core's own timer, and interrupts to other cores.
//!
//! Each core reaches its own local APIC by one of two modes (Intel SDM volume 3, chapter 11):
//! *xAPIC*, by registers in memory at the same address, with ids of 8 bits; or *x2APIC*, by
//! model-specific registers, with ids of 32. The firmware leaves a PC with many processors in the
//! latter mode.

use core::sync::atomic::{AtomicU64, Ordering};

use super::{cpu, vector};

/// The registers' address, set once before any use; 0 for model-specific registers.
static BASE: AtomicU64 = AtomicU64::new(0);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ApicRegister {
    Id = 0x20,
    TaskPriority = 0x80,
    EndOfInterrupt = 0xb0,
    SpuriousVector = 0xf0,
    /// The part of the pending interrupts with this kernel's vectors.
    Requests = 0x220,
    CommandLow = 0x300,
    CommandHigh = 0x310,
    TimerEntry = 0x320,
    Pin0Entry = 0x350,
    Pin1Entry = 0x360,
    ErrorEntry = 0x370,
    InitialCount = 0x380,
    CurrentCount = 0x390,
    DivideConfiguration = 0x3e0,
}

const MASKED: u32 = 1 << 16;

/// The register with this core's mode in its bits (SDM volume 3, 11.4.4 and 11.12.1).
const WAY: u32 = 0x1b;
const ENABLED: u64 = 1 << 11;
const X2APIC: u64 = 1 << 10;

/// Chooses the mode for all cores, and enters the mode on this core, the boot processor: x2APIC if
/// `wants_x2apic`, or if the firmware has left it on.
///
/// # Panics
///
/// If x2APIC is wanted, and the processor lacks it.
///
/// # Safety
///
/// `base` is the local APIC's address, mapped uncached and writable.
pub unsafe fn choose(base: u64, wants_x2apic: bool) {
    assert!(
        !wants_x2apic || cpu::has_x2apic(),
        "the processor has no x2APIC, which `x2apic=on` or an APIC id asks for"
    );
    // SAFETY: every 64-bit processor has the register.
    let is_left_on = unsafe { cpu::read_msr(WAY) } & X2APIC != 0;
    if !wants_x2apic && !is_left_on {
        BASE.store(base, Ordering::Release);
    }
    take_way();
}

/// Reports whether the registers are model-specific.
pub fn is_x2apic() -> bool {
    BASE.load(Ordering::Relaxed) == 0
}

/// Puts this core's local APIC into the chosen mode.
fn take_way() {
    if is_x2apic() {
        // SAFETY: as in `choose`.
        let way = unsafe { cpu::read_msr(WAY) };
        // From off, the only way leads over xAPIC (SDM volume 3, 11.12.5).
        for way in [way | ENABLED, way | ENABLED | X2APIC] {
            // SAFETY: the processor has x2APIC (`choose`).
            unsafe { cpu::write_msr(WAY, way) };
        }
    }
}

/// Returns the number of the model-specific register for `register`.
const fn specific(register: ApicRegister) -> u32 {
    0x800 + register as u32 / 16
}

fn read(register: ApicRegister) -> u32 {
    match BASE.load(Ordering::Relaxed) {
        0 => read_specific(specific(register)),
        base => read_mapped(base, register),
    }
}

fn write(register: ApicRegister, value: u32) {
    match BASE.load(Ordering::Relaxed) {
        0 => write_specific(specific(register), value),
        base => write_mapped(base, register, value),
    }
}

/// A separate function, so that the usual path through the caller saves no registers for it.
#[cold]
#[inline(never)]
#[expect(clippy::cast_possible_truncation, reason = "their upper half is 0")]
fn read_specific(register: u32) -> u32 {
    // SAFETY: in x2APIC mode these are the local APIC's registers, without side effects.
    unsafe { cpu::read_msr(register) as u32 }
}

/// A separate function, like `read_specific`.
#[cold]
#[inline(never)]
fn write_specific(register: u32, value: u32) {
    // SAFETY: as in `read_specific`; this module alone decides what is written, and no
    // value makes the local APIC touch memory.
    unsafe { cpu::write_msr(register, u64::from(value)) };
}

fn read_mapped(base: u64, register: ApicRegister) -> u32 {
    let address = (base + register as u64) as *const u32;
    // SAFETY: the register is one of the mapped local APIC's (`choose`).
    unsafe { address.read_volatile() }
}

fn write_mapped(base: u64, register: ApicRegister, value: u32) {
    let address = (base + register as u64) as *mut u32;
    // SAFETY: as in `write_specific`.
    unsafe { address.write_volatile(value) };
}

/// Returns the id of the calling core.
pub fn id() -> u32 {
    let id = read(ApicRegister::Id);
    if is_x2apic() { id } else { id >> 24 }
}

const SOFTWARE_ENABLE: u32 = 1 << 8;

/// The writes for turning a local APIC on, with only its timer unmasked. The software enable comes
/// first: until then, and after an INIT, each entry of the local vector table stays masked, even if
/// written (Intel SDM volume 3, 11.4.7.2).
const TURN_ON: [(ApicRegister, u32); 7] = [
    (
        ApicRegister::SpuriousVector,
        SOFTWARE_ENABLE | vector::SPURIOUS as u32,
    ),
    (ApicRegister::TaskPriority, 0),
    (ApicRegister::Pin0Entry, MASKED),
    (ApicRegister::Pin1Entry, MASKED),
    (ApicRegister::ErrorEntry, MASKED),
    (ApicRegister::DivideConfiguration, 0b1011), // by 1
    (ApicRegister::TimerEntry, vector::TIMER as u32),
];

/// Turns on the local APIC of this core, with only its timer unmasked.
pub fn enable() {
    take_way();
    for (register, value) in TURN_ON {
        write(register, value);
    }
}

/// Reports whether an interrupt waits for this core to enable interrupts.
pub fn is_interrupt_pending() -> bool {
    // Each such register has the bits of 32 vectors.
    const LINES: u32 = (1 << vector::DEVICES) - 1;
    const OURS: u32 =
        1 << (vector::TIMER % 32) | 1 << (vector::WAKE % 32) | LINES << (vector::DEVICE % 32);
    read(ApicRegister::Requests) & OURS != 0
}

/// Ends the current interrupt.
pub fn acknowledge() {
    write(ApicRegister::EndOfInterrupt, 0);
}

/// Starts this core's one-shot timer, to fire after `count` ticks; 0 means never.
pub fn start_timer(count: u32) {
    write(ApicRegister::InitialCount, count);
}

/// Returns the remaining ticks of the running timer.
pub fn timer_count() -> u32 {
    read(ApicRegister::CurrentCount)
}

/// Sends interrupt `vector` to the core with id `apic_id`.
pub fn send(apic_id: u32, vector: u8) {
    command(apic_id, u32::from(vector));
}

/// Sends the INIT interrupt: the processor waits for its startup interrupt.
pub fn send_init(apic_id: u32) {
    const INIT_ASSERT: u32 = 0b101 << 8 | 1 << 14;
    command(apic_id, INIT_ASSERT);
}

/// Sends the startup interrupt: the processor starts at page `vector`.
pub fn send_startup(apic_id: u32, vector: u8) {
    const STARTUP: u32 = 0b110 << 8 | 1 << 14;
    command(apic_id, STARTUP | u32::from(vector));
}

/// Sends the non-maskable interrupt to all cores but this one.
pub fn send_stop_to_others() {
    const NON_MASKABLE_ALL_BUT_SELF: u32 = 0b100 << 8 | 1 << 14 | 0b11 << 18;
    command(0, NON_MASKABLE_ALL_BUT_SELF);
}

/// Sends the non-maskable interrupt to the core with id `apic_id`.
pub fn send_non_maskable(apic_id: u32) {
    const NON_MASKABLE: u32 = 0b100 << 8 | 1 << 14;
    command(apic_id, NON_MASKABLE);
}

/// Writes an interrupt command. No handler's command may come between the two halves, so interrupts
/// are disabled meanwhile. One function for all commands: an image has little room.
#[inline(never)]
fn command(apic_id: u32, low: u32) {
    const PENDING: u32 = 1 << 12;
    let base = BASE.load(Ordering::Relaxed);
    if base == 0 {
        return command_at_once(apic_id, low);
    }
    let was_set = cpu::is_interrupt_flag_set();
    cpu::clear_interrupt_flag();
    // Delivery takes microseconds at most; the hardware bounds the wait.
    while read_mapped(base, ApicRegister::CommandLow) & PENDING != 0 {
        cpu::relax();
    }
    // The destination first: writing the low half sends the interrupt.
    write_mapped(base, ApicRegister::CommandHigh, apic_id << 24);
    write_mapped(base, ApicRegister::CommandLow, low);
    if was_set {
        cpu::set_interrupt_flag();
    }
}

/// Writes an interrupt command in x2APIC mode, by a single write. First makes all earlier writes of
/// this core visible to the other core (SDM volume 3, 11.12.3).
#[cold]
#[inline(never)]
fn command_at_once(apic_id: u32, low: u32) {
    cpu::finish_writes();
    let command = u64::from(apic_id) << 32 | u64::from(low);
    // SAFETY: as in `write_specific`.
    unsafe { cpu::write_msr(specific(ApicRegister::CommandLow), command) };
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A local APIC after INIT, as far as its local vector table goes.
    struct ApicModel {
        is_enabled: bool,
        /// The timer, the two pins, the error.
        entries: [(ApicRegister, u32); 4],
    }

    impl ApicModel {
        fn after_init() -> Self {
            let entries = [
                ApicRegister::TimerEntry,
                ApicRegister::Pin0Entry,
                ApicRegister::Pin1Entry,
                ApicRegister::ErrorEntry,
            ];
            Self {
                is_enabled: false,
                entries: entries.map(|register| (register, MASKED)),
            }
        }

        /// Takes a write as the manual says (Intel SDM volume 3, 11.4.7.2).
        fn write(&mut self, register: ApicRegister, value: u32) {
            if register == ApicRegister::SpuriousVector {
                self.is_enabled = value & SOFTWARE_ENABLE != 0;
            }
            let entry = self.entries.iter_mut().find(|(of, _)| *of == register);
            if let Some((_, kept)) = entry {
                let forced = if self.is_enabled { 0 } else { MASKED };
                *kept = value | forced;
            }
        }
    }

    #[test]
    fn the_timer_alone_is_unmasked_when_a_processor_comes_from_init() {
        let mut model = ApicModel::after_init();
        for (register, value) in TURN_ON {
            model.write(register, value);
        }
        assert!(model.is_enabled);
        let unmasked = model.entries.iter().filter(|(_, kept)| kept & MASKED == 0);
        let unmasked: Vec<_> = unmasked.collect();
        assert_eq!(
            unmasked,
            [&(ApicRegister::TimerEntry, u32::from(vector::TIMER))]
        );
    }
}
