//! Links the binary as a bootable image: the build script of each app here.

fn main() {
    boot_link::link_image();
}
