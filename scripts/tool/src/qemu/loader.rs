//! What brings the image into the guest's memory: QEMU itself, or a firmware, with GRUB or
//! without.

use std::fmt;

use super::LEAST_MEMORY_MIB;

/// Where Debian's package `ovmf` has its firmware.
pub const OVMF_FILE: &str = "/usr/share/ovmf/OVMF.fd";

/// What brings the image into the guest's memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Loader {
    /// QEMU's `-kernel`: the image is there at the reset.
    Pvh,
    /// GRUB, started by QEMU's BIOS from a stick.
    Bios,
    /// GRUB, started from a stick by UEFI.
    Uefi,
    /// An application of our own, started from a stick by UEFI.
    Efi,
}

impl Loader {
    /// The words for [`Loader`] on command lines.
    pub const NAMES: &[&str] = &["pvh", "bios", "uefi", "efi"];

    /// Returns the loader of that name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Loader> {
        let all = [Loader::Pvh, Loader::Bios, Loader::Uefi, Loader::Efi];
        all.into_iter().find(|loader| loader.name() == name)
    }

    /// Returns the loader's name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Loader::Pvh => "pvh",
            Loader::Bios => "bios",
            Loader::Uefi => "uefi",
            Loader::Efi => "efi",
        }
    }

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

impl fmt::Display for Loader {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}
