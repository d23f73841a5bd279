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

/// The linker script, which lies with the boot code that its symbols serve. Each package gets a
/// copy in cargo's folder for it, whose place cargo keeps right if the workspace is moved.
const SCRIPT: &str = include_str!("../../entry/src/image.ld");

/// Tells cargo to link the binaries of the package being built as images.
///
/// To be called from `build.rs`.
///
/// # Panics
///
/// If cargo's folder for the package is not there, or takes no file.
pub fn link_image() {
    let folder = std::env::var("OUT_DIR").expect("cargo names its folder to a build script");
    let script = std::path::Path::new(&folder).join("image.ld");
    std::fs::write(&script, SCRIPT).expect("cargo's folder takes the linker script");
    for argument in arguments(&script.display().to_string()) {
        println!("cargo::rustc-link-arg-bins={argument}");
    }
    println!("cargo::rerun-if-changed=build.rs");
}

/// Returns all arguments, with the linker script at this place. It is an argument by
/// itself, for in one with others a comma would end it.
fn arguments(script: &str) -> impl Iterator<Item = &str> {
    let with_script = ["-Xlinker", "-T", "-Xlinker", script];
    ARGUMENTS.into_iter().chain(with_script)
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_script_is_an_argument_by_itself() {
        let all: Vec<&str> = super::arguments("/a,b/image.ld").collect();
        assert!(all.ends_with(&["-Xlinker", "-T", "-Xlinker", "/a,b/image.ld"]));
    }
}
