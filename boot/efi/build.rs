//! Links the binary in the form from which the host tool makes an application of UEFI.

fn main() {
    boot_link::link_efi();
}
