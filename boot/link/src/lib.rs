//! Linker arguments that make an app's binary a bootable image.
//!
//! An app's build script calls [`link_image`] (all apps here use `boot/link/image.rs`). The
//! arguments apply to the package's binaries alone, so the host tests, examples and docs of the
//! same package link like any other Rust program.

#![forbid(unsafe_code)]

/// The arguments for the C compiler that drives the link, in addition to the script.
///
/// No start files and no libraries: the program brings its own entry point. Not
/// position-independent: the loader places the image at the script's addresses. Pages of 4 KiB, so
/// that each section can have its own access rights without padding the file to 2 MiB.
const ARGUMENTS: [&str; 6] = [
    "-nostartfiles",
    "-nostdlib",
    "-Wl,--build-id=none",
    "-Wl,-z,max-page-size=4096",
    "-static",
    "-no-pie",
];

/// Keeps functions with the same instructions only once. Not in builds for a debugger, which wants
/// each by its name.
const FOLDED: &str = "-Wl,--icf=all";

/// Tells cargo to link the binaries of the package being built as images.
///
/// Call from `build.rs`. `kernel::entry!` makes sure of this call, and checks `Cargo.toml` for the
/// settings of an image. Attributes missing at the top of `src/main.rs` are reported here, because
/// the compiler's own message would not explain the reason.
///
/// # Panics
///
/// If cargo's folder for the package is not there, or takes no file.
pub fn link_image() {
    // The script lies with the boot code that its symbols serve.
    link(include_str!("../../entry/src/image.ld"));
    if std::env::var("PROFILE").is_ok_and(|profile| profile == "release") {
        println!("cargo::rustc-link-arg-bins={FOLDED}");
    }
    println!("cargo::rustc-check-cfg=cfg(linked_as_image)");
    println!("cargo::rustc-cfg=linked_as_image");
    // The kernel names missing optimization as a cause when calls take longer than they may.
    println!("cargo::rustc-check-cfg=cfg(unoptimized)");
    if std::env::var("OPT_LEVEL").is_ok_and(|level| level == "0") {
        println!("cargo::rustc-cfg=unoptimized");
    }
    if let Ok(main) = std::fs::read_to_string("src/main.rs") {
        println!("cargo::rerun-if-changed=src/main.rs");
        for attribute in missing_attributes(&main) {
            println!(
                "cargo::error=src/main.rs is an image's and lacks `#![{attribute}]`; write it \
                 above all items"
            );
        }
    }
}

/// Tells cargo to link with this linker script. Each package gets a copy of the script in cargo's
/// folder for the package; cargo keeps the folder's path right if the workspace is moved.
fn link(script: &str) {
    let folder = std::env::var("OUT_DIR").expect("cargo names its folder to a build script");
    let copy = std::path::Path::new(&folder).join("script.ld");
    std::fs::write(&copy, script).expect("cargo's folder takes the linker script");
    for argument in arguments(&copy.display().to_string()) {
        println!("cargo::rustc-link-arg-bins={argument}");
    }
    // No file of the package counts for the script; cargo is told of one that always exists.
    println!("cargo::rerun-if-changed=Cargo.toml");
}

/// Returns the attributes required in an image's file but missing in this file.
fn missing_attributes(main: &str) -> impl Iterator<Item = &'static str> {
    let has = |attribute: &str| {
        let mut lines = main.lines().map(str::trim_start);
        lines.any(|line| line.starts_with("#![") && line.contains(attribute))
    };
    let needed = ["no_std", "no_main"];
    needed.into_iter().filter(move |attribute| !has(attribute))
}

/// Returns all arguments, with the linker script at this place. The script is an argument by
/// itself, because inside a combined argument a comma in its path would end it.
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

    #[test]
    fn an_attribute_counts_where_it_is_one() {
        let missing = |main| super::missing_attributes(main).collect::<Vec<_>>();
        assert_eq!(
            missing("#![no_std]\n#![cfg_attr(not(test), no_main)]\n").len(),
            0
        );
        assert_eq!(missing("//! `#![no_std]`\n#![no_main]\n"), ["no_std"]);
        assert_eq!(missing("fn main() {}\n"), ["no_std", "no_main"]);
    }
}
