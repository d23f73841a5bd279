//! The boards that QEMU imitates for us.

named! {
    /// The board that QEMU imitates, by QEMU's own name.
    Machine {
        /// The smallest one, which boots in a tenth of a second.
        Microvm = "microvm",
        /// A PC with PCI Express, HPET and all.
        Q35 = "q35",
    }
}
