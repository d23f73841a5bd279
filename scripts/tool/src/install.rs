//! Installs missing programs with `apt-get`, a target of Rust with `rustup`, and the Python
//! packages of tests with `pip`.
//!
//! A command that needs QEMU installs it if it is missing; commands that need GRUB, a firmware or
//! Bochs do likewise. The tool itself downloads nothing. Without `apt-get` a message tells the
//! person which package to install.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::qemu::{Loader, OVMF_FILE, PROGRAM};
use crate::system::{self, find_program};

/// A program or file of the host needed by a command.
pub struct HostNeed {
    /// The name, and a description for messages.
    name: &'static str,
    what: &'static str,
    /// The parts by which the tool recognizes a present program: programs on the `PATH`, and files
    /// or folders.
    parts: &'static [&'static str],
    /// The names of Debian's packages with these parts, with blanks between; empty if a person must
    /// install the program by hand.
    packages: &'static str,
}

/// The emulator for all boots, with its firmware.
pub static QEMU: HostNeed = HostNeed {
    name: "QEMU",
    what: "QEMU's system emulator for x86_64",
    parts: &[PROGRAM],
    packages: "qemu-system-x86",
};

/// The debugger.
pub static GDB: HostNeed = HostNeed {
    name: "gdb",
    what: "GNU's debugger",
    parts: &["gdb"],
    packages: "gdb",
};

/// The programs for making an ISO, for BIOS and for UEFI.
pub static GRUB: HostNeed = HostNeed {
    name: "GRUB",
    what: "GRUB for BIOS and for UEFI, xorriso and mtools",
    parts: &[
        "grub-mkrescue",
        "xorriso",
        "mformat",
        "/usr/lib/grub/i386-pc",
        "/usr/lib/grub/x86_64-efi",
    ],
    packages: "grub-pc-bin grub-efi-amd64-bin xorriso mtools",
};

/// The UEFI firmware for QEMU.
pub static OVMF: HostNeed = HostNeed {
    name: "OVMF",
    what: "the firmware that gives QEMU's machines UEFI",
    parts: &[OVMF_FILE],
    packages: "ovmf",
};

/// The strictest emulator of a PC.
pub static BOCHS: HostNeed = HostNeed {
    name: "Bochs",
    what: "the emulator Bochs with its firmware and SDL's display",
    parts: &[
        "bochs",
        "/usr/share/bochs/BIOS-bochs-latest",
        "/usr/lib/x86_64-linux-gnu/bochs/plugins/libbx_sdl2_gui.so",
    ],
    packages: "bochs bochs-sdl bochsbios vgabios",
};

/// The program for counting instructions on Linux.
pub static VALGRIND: HostNeed = HostNeed {
    name: "Valgrind",
    what: "a program that counts the instructions of others",
    parts: &["valgrind"],
    packages: "valgrind",
};

/// The runtime for testing the page's engine without a browser.
pub static NODE: HostNeed = HostNeed {
    name: "Node.js",
    what: "a runtime of JavaScript and WebAssembly",
    parts: &["node"],
    packages: "nodejs",
};

/// The prover that checks the proofs of bounds, and the compiler of the checker extracted by the
/// prover.
pub static COQ: HostNeed = HostNeed {
    name: "Coq",
    what: "a prover, with OCaml",
    parts: &["coqc", "ocamlopt"],
    packages: "coq ocaml-nox",
};

/// The browser in which tests open the page. Its package is large, so tests do not install it.
pub static CHROMIUM: HostNeed = HostNeed {
    name: "Chromium",
    what: "a browser",
    parts: &["chromium"],
    packages: "",
};

/// The reader of YAML for `scripts/convert`, in the folder of Debian's own Python.
static YAML: HostNeed = HostNeed {
    name: "PyYAML",
    what: "Python's reader of YAML",
    parts: &["python3", "/usr/lib/python3/dist-packages/yaml"],
    packages: "python3 python3-yaml",
};

/// Rust's target for the page's engine: WebAssembly with standard input and output.
pub(crate) const WASM_TARGET: &str = "wasm32-wasip1";

/// Packages of PyPI for tests: a router of Zenoh, and a reader of ROS 2's messages.
const OF_PYPI: [&str; 2] = ["eclipse-zenoh==1.10.2", "rosbags==0.11.9"];

/// Installs QEMU, unless QEMU is already there.
///
/// # Errors
///
/// The errors of [`ensure`].
pub fn ensure_qemu() -> Result<(), String> {
    ensure(&QEMU)
}

/// Installs everything a loader needs besides QEMU, unless it is already there.
///
/// # Errors
///
/// The errors of [`ensure`].
pub fn ensure_loader(loader: Loader) -> Result<(), String> {
    match loader {
        Loader::Pvh => Ok(()),
        Loader::Bios => ensure(&GRUB),
        Loader::Uefi => ensure(&GRUB).and_then(|()| ensure(&OVMF)),
    }
}

/// Installs a program or file, unless it is already there. The package manager's output goes to
/// standard error.
///
/// # Errors
///
/// In words: the system is not known, or the installation failed; with the remedy by hand.
pub fn ensure(need: &HostNeed) -> Result<(), String> {
    let Some(part) = missing(need) else {
        return Ok(());
    };
    let [update, install] = plan(need, part, |name| find_program(name).is_some(), is_root())?;
    let name = need.name;
    // One unreachable source fails the whole update, but the needed package may come from another
    // source: the installation decides.
    if let Err(why) = run(name, &update) {
        eprintln!("{why}");
    }
    run(name, &install).map_err(|why| {
        format!("{name} could not be installed: {why}; install it by hand and start again")
    })?;
    match missing(need) {
        None => Ok(()),
        Some(part) => Err(format!(
            "the installation ended well, but there is still no `{part}`; install {} by hand",
            need.what
        )),
    }
}

/// Installs a reader of YAML for Python, unless Python already has such a reader.
///
/// # Errors
///
/// The errors of [`ensure`]; also, that the Python on the `PATH` still has no such reader, because
/// it is not Debian's.
pub fn ensure_yaml() -> Result<(), String> {
    let import = || system::run(Command::new("python3").args(["-c", "import yaml"]));
    if import().is_ok() {
        return Ok(());
    }
    ensure(&YAML)?;
    let remedy = "install it by `pip install pyyaml`";
    import()
        .map(drop)
        .map_err(|_| format!("the `python3` on the PATH has no PyYAML; {remedy}"))
}

/// Adds Rust's target for WebAssembly, unless the toolchain already has it.
///
/// # Errors
///
/// In words, with the remedy by hand.
pub fn ensure_wasm() -> Result<(), String> {
    let mut rustc = Command::new("rustc");
    // In the workspace, which pins a toolchain.
    rustc.current_dir(system::workspace());
    let folder = system::run(rustc.args(["--print=target-libdir", "--target", WASM_TARGET]))?;
    if Path::new(folder.trim()).is_dir() {
        return Ok(());
    }
    let what = "Rust's target for WebAssembly";
    run(what, &format!("rustup target add {WASM_TARGET}")).map_err(|why| {
        format!("{what} could not be added: {why}; add {WASM_TARGET} by hand and start again")
    })
}

/// Returns a Python with the packages needed by tests, in `target/python`. Installs missing
/// packages.
///
/// # Errors
///
/// In words: there is no Python, or the packages cannot be obtained.
pub fn python() -> Result<PathBuf, String> {
    let folder = system::workspace().join("target/python");
    let python = folder.join("bin/python");
    let install = || {
        let lock = || {
            fs::create_dir_all(&folder)?;
            let file = File::create(folder.with_extension("lock"))?;
            file.lock().map(|()| file)
        };
        // Other processes wait here until this lock is dropped.
        let _lock = lock().map_err(|why| format!("`{}`: {why}", folder.display()))?;
        if system::run(Command::new(&python).args(["-c", "import zenoh, rosbags"])).is_ok() {
            return Ok(());
        }
        system::run(Command::new("python3").args(["-m", "venv"]).arg(&folder))?;
        let mut pip = Command::new(&python);
        pip.args(["-m", "pip", "install", "--quiet", "--retries=1"]);
        system::run(pip.args(OF_PYPI)).map(drop)
    };
    let installed: Result<(), String> = install();
    let what = OF_PYPI.join(" and ");
    installed.map_err(|why| format!("no Python with {what} can be made: {why}"))?;
    Ok(python)
}

/// Returns the first missing part.
fn missing(need: &HostNeed) -> Option<&'static str> {
    let is_there = |part: &&str| match part.starts_with('/') {
        true => Path::new(part).exists(),
        false => find_program(part).is_some(),
    };
    need.parts.iter().copied().find(|part| !is_there(part))
}

/// Returns two commands: the first updates the list of packages, the second installs the packages.
/// `exists` tells which programs are there, and `root` whether we are root.
fn plan(
    need: &HostNeed,
    part: &str,
    exists: impl Fn(&str) -> bool,
    root: bool,
) -> Result<[String; 2], String> {
    let HostNeed {
        name,
        what,
        packages,
        ..
    } = need;
    if packages.is_empty() {
        let remedy = "install it by hand, if you want to use it";
        return Err(format!("{name} is missing; {remedy}"));
    }
    if !exists("apt-get") {
        return Err(format!(
            "{name} is missing, and `apt-get`, by which it would be installed, is not here; install \
             the package that brings `{part}` ({what}) and start again"
        ));
    }
    if !root && !exists("sudo") {
        return Err(format!(
            "{name} is missing, and installing it takes root or `sudo`; as root, install \
             `{packages}` and start again"
        ));
    }
    let program = if root { "apt-get" } else { "sudo apt-get" };
    Ok([
        format!("{program} update"),
        format!("{program} install --yes --no-install-recommends {packages}"),
    ])
}

fn run(name: &str, line: &str) -> Result<(), String> {
    eprintln!("{name} is missing; running: {line}");
    let mut words = line.split(' ');
    let mut command = Command::new(words.next().unwrap_or_default());
    command.args(words).current_dir(system::workspace());
    // Debian's packages would ask questions; nobody answers them here.
    command.env("DEBIAN_FRONTEND", "noninteractive");
    // A program may read our standard output.
    command.stdout(Stdio::from(io::stderr()));
    match command.status() {
        Ok(status) if status.success() => Ok(()),
        Ok(status) => Err(format!("`{line}` failed ({status})")),
        Err(error) => Err(format!("`{line}` did not start: {error}")),
    }
}

fn is_root() -> bool {
    // The standard library cannot tell; `id` is in every base system.
    system::run(Command::new("id").arg("-u")).is_ok_and(|id| id.trim() == "0")
}

#[cfg(test)]
mod tests {
    use super::{GRUB, HostNeed, QEMU, plan};

    fn lines(need: &HostNeed, programs: &[&str], root: bool) -> Result<String, String> {
        let exists = |name: &str| programs.contains(&name);
        plan(need, need.parts[0], exists, root).map(|lines| lines.join("; "))
    }

    #[test]
    fn apt_is_asked_without_questions_and_by_others_than_root_through_sudo() {
        let install = "install --yes --no-install-recommends";
        let qemu = format!("apt-get update; apt-get {install} qemu-system-x86");
        assert_eq!(lines(&QEMU, &["apt-get"], true), Ok(qemu));
        let grub = "grub-pc-bin grub-efi-amd64-bin xorriso mtools";
        let grub = format!("sudo apt-get update; sudo apt-get {install} {grub}");
        assert_eq!(lines(&GRUB, &["apt-get", "sudo"], false), Ok(grub));
    }

    #[test]
    fn who_cannot_install_is_told_what_to_install() {
        for (need, program, root, parts) in [
            (
                &QEMU,
                "apt-get",
                false,
                ["root or `sudo`", "`qemu-system-x86`"],
            ),
            (
                &QEMU,
                "dnf",
                true,
                ["`apt-get`", "brings `qemu-system-x86_64`"],
            ),
            (&GRUB, "dnf", true, ["`apt-get`", "brings `grub-mkrescue`"]),
        ] {
            let refusal = lines(need, &[program], root).unwrap_err();
            assert!(parts.iter().all(|part| refusal.contains(part)), "{refusal}");
        }
    }
}
