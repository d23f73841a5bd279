//! The clocks of a PC whose rates are known, by which the time stamp counter is measured.
//!
//! In the order in which they are trusted: the ACPI power management timer, the high
//! precision event timer (HPET), the local APIC's timer where it is QEMU's or KVM's, and
//! the programmable interval timer (PIT) of the first PCs, which is slow to read.

use boot::acpi::{Platform, PmTimer};

use super::{cpu, local_apic, port};

/// A clock that counts up to some number of bits, and then from 0 again.
#[derive(Clone, Copy, Debug)]
pub struct KnownClock {
    /// What the `boot` line and the word `clock=` call it.
    pub name: &'static str,
    /// The time from one count to the next, in femtoseconds.
    tick_fs: u64,
    /// The bits that count.
    pub(super) mask: u32,
    /// Whether others may be compared with it: it needs to be read twice only, at any time.
    pub(super) judges: bool,
    source: Source,
}

#[derive(Clone, Copy, Debug)]
enum Source {
    /// At this I/O port.
    PmTimer(u16),
    /// With registers at this address.
    Hpet(u64),
    LocalApic,
    Pit,
}

/// The period of the PIT's and the power management timer's common quartz, 14.31818 MHz.
const QUARTZ_FS: u64 = 69_841_279;

impl KnownClock {
    /// Returns the clocks that this machine may have, the most trusted first.
    ///
    /// # Safety
    ///
    /// `platform` is what the machine's tables say, and its registers are mapped uncached and
    /// writable at their addresses.
    pub unsafe fn all(platform: &Platform) -> [Option<Self>; 4] {
        const TCG: [u8; 12] = *b"TCGTCGTCGTCG";
        const KVM: [u8; 12] = *b"KVMKVMKVM\0\0\0";
        let is_emulated = matches!(cpu::hypervisor(), Some(TCG | KVM));
        [
            platform.pm_timer.map(Self::pm_timer),
            // SAFETY: passed on from the caller.
            platform.hpet.and_then(|base| unsafe { Self::hpet(base) }),
            is_emulated.then_some(Self {
                name: "local-apic-1ghz",
                tick_fs: 1_000_000,
                mask: u32::MAX,
                judges: false,
                source: Source::LocalApic,
            }),
            Some(Self {
                name: "pit",
                tick_fs: 12 * QUARTZ_FS,
                mask: 0xffff,
                judges: false,
                source: Source::Pit,
            }),
        ]
    }

    fn pm_timer(timer: PmTimer) -> Self {
        Self {
            name: "acpi-pm-timer",
            tick_fs: 4 * QUARTZ_FS,
            mask: u32::MAX >> (32 - timer.bits),
            judges: true,
            source: Source::PmTimer(timer.port),
        }
    }

    /// Returns the HPET at `base`, whose first register says how long its tick takes (IA-PC
    /// HPET specification 1.0a, 2.3.4).
    ///
    /// # Safety
    ///
    /// `base` is its address, mapped uncached and writable.
    unsafe fn hpet(base: u64) -> Option<Self> {
        const LONGEST_TICK_FS: u32 = 100_000_000;
        let period = (base + 4) as *const u32;
        // SAFETY: the caller vouches for the register.
        let tick_fs = unsafe { period.read_volatile() };
        (1..=LONGEST_TICK_FS).contains(&tick_fs).then_some(Self {
            name: "hpet",
            tick_fs: u64::from(tick_fs),
            mask: u32::MAX,
            judges: true,
            source: Source::Hpet(base),
        })
    }

    /// Has the clock count, if it needs to be told.
    pub(super) fn start(&self) {
        match self.source {
            // The local APIC's timer is measured, too, and counts already.
            Source::PmTimer(_) | Source::LocalApic => {}
            Source::Hpet(base) => {
                const ENABLE: u32 = 1;
                let configuration = (base + 0x10) as *mut u32;
                // SAFETY: `hpet` was told that there is one, and only this module uses it.
                let value = unsafe { configuration.read_volatile() };
                // SAFETY: likewise; its interrupts are masked in the I/O APICs.
                unsafe { configuration.write_volatile(value | ENABLE) };
            }
            Source::Pit => {
                // The gate of channel 2 on, its speaker off; then both bytes of the count,
                // over and over from the top (Intel 8254 data sheet, mode 2).
                // SAFETY: the ports are the PIT's and its gate's, which only this module uses;
                // reading that changes nothing, and where there is none, writes go nowhere.
                let gate = unsafe { port::read_u8(0x61) };
                let setup = [(0x61, gate & !2 | 1), (0x43, 0xb4), (0x42, 0), (0x42, 0)];
                for (register, value) in setup {
                    // SAFETY: as above.
                    unsafe { port::write_u8(register, value) };
                }
            }
        }
    }

    /// Returns how long so many counts take: less than 2^32 of them.
    pub(super) const fn ns(&self, ticks: u64) -> u64 {
        ticks * self.tick_fs / 1_000_000
    }

    /// Reads the clock, of which the bits of its mask count. One function for all: it is
    /// never on a hot path, and an image has little room.
    #[inline(never)]
    pub(super) fn read(&self) -> u32 {
        match self.source {
            // SAFETY: the port is the power management timer's, and reading it changes nothing.
            Source::PmTimer(port) => unsafe { port::read_u32(port) },
            // SAFETY: the register is the count of the HPET that `hpet` was told of.
            Source::Hpet(base) => unsafe { ((base + 0xf0) as *const u32).read_volatile() },
            Source::LocalApic => !local_apic::timer_count(),
            Source::Pit => {
                const LATCH_2: u8 = 0x80;
                // SAFETY: the ports are the PIT's, as in `start`.
                unsafe { port::write_u8(0x43, LATCH_2) };
                // SAFETY: likewise. The low byte comes first.
                let [low, high] = [(); 2].map(|()| unsafe { port::read_u8(0x42) });
                !u32::from(u16::from_le_bytes([low, high]))
            }
        }
    }
}
