//! Linker arguments that make an app's binary a bootable image.
//!
//! An app's build script calls [`link_image`] (that of all apps here is `boot/link/image.rs`). The
//! arguments apply to the package's binaries alone, so the host tests, examples and docs of the
//! same package link as any other Rust program does.

#![forbid(unsafe_code)]

/// The arguments for the C compiler that drives the link, besides the script.
///
/// No start files and no libraries: the program brings its own entry point. Not
/// position-independent: the loader places the image where the script says. Pages of
/// 4 KiB, so that each section can have its own access rights without padding
/// the file to 2 MiB.
const ARGUMENTS: [&str; 6] = [
    "-nostartfiles",
    "-nostdlib",
    "-Wl,--build-id=none",
    "-Wl,-z,max-page-size=4096",
    "-static",
    "-no-pie",
];

/// Functions of the same instructions are kept once. Not where a debugger wants each by its name.
const FOLDED: &str = "-Wl,--icf=all";

/// Tells cargo to link the binaries of the package being built as images.
///
/// To be called from `build.rs`. `kernel::entry!` makes sure that it was, and that `Cargo.toml` is
/// right for an image; what `src/main.rs` lacks at its top is found here, where the compiler would
/// give a reason that says nothing.
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
    // So that the kernel can say it where calls take longer than they may.
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

/// Tells cargo to link with this linker script. Each package gets a copy of
/// the script in cargo's folder for it, whose place cargo keeps right if the workspace is moved.
fn link(script: &str) {
    let folder = std::env::var("OUT_DIR").expect("cargo names its folder to a build script");
    let copy = std::path::Path::new(&folder).join("script.ld");
    std::fs::write(&copy, script).expect("cargo's folder takes the linker script");
    for argument in arguments(&copy.display().to_string()) {
        println!("cargo::rustc-link-arg-bins={argument}");
    }
    // Nothing else of the package counts, and this one is there.
    println!("cargo::rerun-if-changed=Cargo.toml");
}

/// Returns the attributes that an image's file must have and this one has not.
fn missing_attributes(main: &str) -> impl Iterator<Item = &'static str> {
    let has = |attribute: &str| {
        let mut lines = main.lines().map(str::trim_start);
        lines.any(|line| line.starts_with("#![") && line.contains(attribute))
    };
    let needed = ["no_std", "no_main"];
    needed.into_iter().filter(move |attribute| !has(attribute))
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
