//! Choices that have names on command lines: what time means in a guest, the board that QEMU imitates
//! for it, and what brings the image into its memory: QEMU itself, or a firmware, with GRUB or
//! without.

use super::LEAST_MEMORY_MIB;

/// Where Debian's package `ovmf` has its firmware.
pub const OVMF_FILE: &str = "/usr/share/ovmf/OVMF.fd";

/// Makes an enumeration each of whose choices has a name, by which it is written and read.
macro_rules! named {
    ($(#[$about:meta])* $kind:ident {
        $($(#[$what:meta])* $choice:ident = $name:literal,)*
    }) => {
        $(#[$about])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum $kind {
            $($(#[$what])* $choice,)*
        }

        impl $kind {
            /// The names, as they stand on command lines.
            pub const NAMES: &[&str] = &[$($name),*];

            /// Returns the choice of that name.
            #[must_use]
            pub fn from_name(name: &str) -> Option<Self> {
                match name {
                    $($name => Some(Self::$choice),)*
                    _ => None,
                }
            }

            /// Returns the choice's name.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$choice => $name,)*
                }
            }
        }

        impl std::fmt::Display for $kind {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str(self.name())
            }
        }
    };
}

named! {
    /// The meaning of time in the guest.
    Mode {
        /// Real cores in real time, by the host's virtualization.
        Kvm = "kvm",
        /// One instruction is one virtual nanosecond; every run is the same.
        Deterministic = "deterministic",
        /// Emulated cores in real time, one host thread each.
        Threads = "threads",
    }
}

impl Mode {
    /// Says in one sentence what a time printed in this mode is worth.
    #[must_use]
    pub fn meaning(self) -> &'static str {
        match self {
            Mode::Kvm => "real nanoseconds on real cores, the host's noise included",
            Mode::Deterministic => {
                "one instruction is one virtual nanosecond, idle time is skipped, busy \
                 processors share one clock; these are not wall times, and are the same \
                 on every machine"
            }
            Mode::Threads => {
                "real nanoseconds of emulated processors; expect milliseconds of \
                 noise where the host has fewer cores"
            }
        }
    }

    pub(super) fn arguments(self) -> &'static [&'static str] {
        match self {
            Mode::Kvm => &["-accel", "kvm", "-cpu", "host"],
            // The sleep=off makes an idle guest jump to its next timer.
            Mode::Deterministic => &[
                "-accel",
                "tcg",
                "-icount",
                "shift=0,sleep=off",
                "-cpu",
                "max",
                "-seed",
                "1",
                "-rtc",
                "base=2000-01-01,clock=vm",
            ],
            Mode::Threads => &["-accel", "tcg,thread=multi", "-cpu", "max"],
        }
    }
}

named! {
    /// The board that QEMU imitates, by QEMU's own name.
    Machine {
        /// The smallest one, which boots in a tenth of a second.
        Microvm = "microvm",
        /// A PC with PCI Express, HPET and all.
        Q35 = "q35",
    }
}

named! {
    /// The way of the image into the guest's memory.
    Loader {
        /// QEMU's `-kernel`: the image is there at the reset.
        Pvh = "pvh",
        /// GRUB, started by QEMU's BIOS from a stick.
        Bios = "bios",
        /// GRUB, started from a stick by UEFI.
        Uefi = "uefi",
        /// An application of our own, started from a stick by UEFI.
        Efi = "efi",
    }
}

impl Loader {
    /// Reports whether it loads from a stick, by the firmware of a PC.
    #[must_use]
    pub fn needs_stick(self) -> bool {
        self != Loader::Pvh
    }

    /// Reports whether the words come by GRUB.
    #[must_use]
    pub fn is_grub(self) -> bool {
        matches!(self, Loader::Bios | Loader::Uefi)
    }

    /// Reports whether the firmware is UEFI.
    #[must_use]
    pub fn is_by_uefi(self) -> bool {
        matches!(self, Loader::Uefi | Loader::Efi)
    }

    /// Returns the least memory in MiB with which it has been seen to come to the image.
    #[must_use]
    pub fn least_memory_mib(self) -> u64 {
        match self {
            Loader::Pvh | Loader::Bios => LEAST_MEMORY_MIB,
            Loader::Uefi | Loader::Efi => 96,
        }
    }
}
