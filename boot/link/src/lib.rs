//! Linker arguments that make an app's binary a bootable image.
//!
//! An app's `build.rs` calls [`link_image`]. The arguments apply to the
//! package's binaries alone, so the host tests, examples and docs of the same
//! package link as any other Rust program does.

#![forbid(unsafe_code)]

/// The arguments for the C compiler that drives the link, besides the script.
///
/// No start files and no libraries: the image brings its own entry point. Not
/// position-independent: the loader places it where the script says. Pages of
/// 4 KiB, so that each section can have its own access rights without padding
/// the file to 2 MiB.
const ARGUMENTS: [&str; 6] = [
    "-nostartfiles",
    "-nostdlib",
    "-static",
    "-no-pie",
    "-Wl,--build-id=none",
    "-Wl,-z,max-page-size=4096",
];

/// The linker script, which lies with the boot code that its symbols serve.
const SCRIPT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../entry/src/image.ld");

/// Tells cargo to link the binaries of the package being built as images.
///
/// To be called from `build.rs`.
pub fn link_image() {
    for argument in ARGUMENTS {
        println!("cargo::rustc-link-arg-bins={argument}");
    }
    println!("cargo::rustc-link-arg-bins=-Wl,-T,{SCRIPT}");
    println!("cargo::rerun-if-changed={SCRIPT}");
}
