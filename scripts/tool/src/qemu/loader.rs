//! What brings the image into the guest's memory: QEMU itself, or a firmware, with GRUB or
//! without.

use super::LEAST_MEMORY_MIB;

/// Where Debian's package `ovmf` has its firmware.
pub const OVMF_FILE: &str = "/usr/share/ovmf/OVMF.fd";

named! {
    /// What brings the image into the guest's memory.
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
