//! The boards that QEMU imitates for us.

use std::fmt;

/// The board that QEMU imitates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Machine {
    /// The smallest one, which boots in a tenth of a second.
    Microvm,
    /// A PC with PCI Express, HPET and all.
    Q35,
}

impl Machine {
    /// The words for [`Machine`] on command lines.
    pub const NAMES: &[&str] = &["microvm", "q35"];

    /// Returns the machine of that name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Machine> {
        let all = [Machine::Microvm, Machine::Q35];
        all.into_iter().find(|machine| machine.name() == name)
    }

    /// Returns the machine's name, which is also QEMU's.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Machine::Microvm => "microvm",
            Machine::Q35 => "q35",
        }
    }
}

impl fmt::Display for Machine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}
