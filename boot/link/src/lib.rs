//! Linker arguments of a bootable image.
