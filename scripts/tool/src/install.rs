//! Installing the programs that a command needs, by the system's own package manager.
//!
//! A command that needs QEMU installs it if it is missing; one that needs GRUB, a firmware
//! or Bochs does likewise. The package manager on this system decides the command; the tool
//! downloads nothing itself. Without a known manager the person is told what to install.

use std::io;
use std::path::Path;
use std::process::{Command, Stdio};

use crate::qemu::{Loader, OVMF_FILE, PROGRAM};
use crate::system::{self, find_program};

/// Something of the host's that a command needs.
#[derive(Debug)]
pub struct Need {
    /// Its name, and a description for messages.
    name: &'static str,
    what: &'static str,
    /// The parts by which it is recognized: programs on the `PATH`, and files or folders.
    parts: &'static [&'static str],
    /// The packages for each of `MANAGERS` in turn, with blanks between; empty if a manager is not
    /// known to have it.
    packages: [&'static str; 5],
}

const fn by_apt(packages: &str) -> [&str; 5] {
    [packages, "", "", "", ""]
}

/// The emulator that everything boots in, with the firmware that it brings.
pub static QEMU: Need = Need {
    name: "QEMU",
    what: "QEMU's system emulator for x86_64",
    parts: &[PROGRAM],
    packages: [
        "qemu-system-x86",
        "qemu-system-x86-core",
        "qemu-system-x86",
        "qemu-x86",
        "qemu-system-x86_64",
    ],
};

/// The debugger.
pub static GDB: Need = Need {
    name: "gdb",
    what: "GNU's debugger",
    parts: &["gdb"],
    packages: ["gdb"; 5],
};

/// The programs that make an ISO, for BIOS and for UEFI.
pub static GRUB: Need = Need {
    name: "GRUB",
    what: "GRUB for BIOS and for UEFI, xorriso and mtools",
    parts: &[
        "grub-mkrescue",
        "xorriso",
        "mformat",
        "/usr/lib/grub/i386-pc",
        "/usr/lib/grub/x86_64-efi",
    ],
    packages: by_apt("grub-pc-bin grub-efi-amd64-bin xorriso mtools"),
};

/// The programs that make a FAT stick.
pub static MTOOLS: Need = Need {
    name: "mtools",
    what: "mtools, which write FAT file systems",
    parts: &["mformat", "mmd", "mcopy"],
    packages: ["mtools"; 5],
};

/// UEFI for QEMU.
pub static OVMF: Need = Need {
    name: "OVMF",
    what: "the firmware that gives QEMU's machines UEFI",
    parts: &[OVMF_FILE],
    packages: by_apt("ovmf"),
};

/// The emulator that imitates a PC the most strictly.
pub static BOCHS: Need = Need {
    name: "Bochs",
    what: "the emulator Bochs with its firmware and SDL's display",
    parts: &[
        "bochs",
        "/usr/share/bochs/BIOS-bochs-latest",
        "/usr/lib/x86_64-linux-gnu/bochs/plugins/libbx_sdl2_gui.so",
    ],
    packages: by_apt("bochs bochs-sdl bochsbios vgabios"),
};

/// The package managers: the program, its words to update the list of packages, if that is a step
/// of its own, and its words to install the packages that follow.
const MANAGERS: [(&str, Option<&str>, &str); 5] = [
    (
        "apt-get",
        Some("update"),
        "install --yes --no-install-recommends",
    ),
    ("dnf", None, "install --assumeyes"),
    ("pacman", None, "--sync --refresh --noconfirm --needed"),
    ("zypper", None, "--non-interactive install"),
    ("apk", None, "add"),
];

/// Makes sure that QEMU is there, as [`ensure`] does.
///
/// # Errors
///
/// As [`ensure`].
pub fn ensure_qemu() -> Result<(), String> {
    ensure(&QEMU)
}

/// Makes sure that everything a loader needs besides QEMU is there, as [`ensure`] does.
///
/// # Errors
///
/// As [`ensure`].
pub fn ensure_loader(loader: Loader) -> Result<(), String> {
    match loader {
        Loader::Pvh => Ok(()),
        Loader::Bios => ensure(&GRUB),
        Loader::Uefi => ensure(&GRUB).and_then(|()| ensure(&OVMF)),
        Loader::Efi => ensure(&MTOOLS).and_then(|()| ensure(&OVMF)),
    }
}

/// Makes sure that something is there, and installs it if it is not. The package manager's output
/// goes to standard error.
///
/// # Errors
///
/// In words: the system is not known, or the installation failed, with the remedy by hand.
pub fn ensure(need: &Need) -> Result<(), String> {
    let Some(part) = missing(need) else {
        return Ok(());
    };
    let (update, install) = plan(need, part, |name| find_program(name).is_some(), is_root())?;
    let name = need.name;
    // One unreachable source fails the whole update, but the needed package may come from another:
    // the installation decides.
    if let Some(Err(why)) = update.map(|line| run(name, &line)) {
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

/// Returns the first part that is missing.
fn missing(need: &Need) -> Option<&'static str> {
    let is_there = |part: &&str| match part.starts_with('/') {
        true => Path::new(part).exists(),
        false => find_program(part).is_some(),
    };
    need.parts.iter().copied().find(|part| !is_there(part))
}

/// Decides on the commands that update (if there is one) and install, from the programs that exist
/// and whether we are root.
fn plan(
    need: &Need,
    part: &str,
    exists: impl Fn(&str) -> bool,
    root: bool,
) -> Result<(Option<String>, String), String> {
    let Need { name, what, .. } = need;
    let known = MANAGERS.iter().zip(need.packages);
    let known = known.filter(|(_, packages)| !packages.is_empty());
    // The first that exists: a system mostly has one, and the order breaks ties.
    let found = known.clone().find(|((manager, ..), _)| exists(manager));
    let ((manager, update, install), packages) = found.ok_or_else(|| {
        let known: Vec<&str> = known.map(|((manager, ..), _)| *manager).collect();
        format!(
            "{name} is missing, and none of the package managers that are known to have it \
                 is here ({}); install the package that brings `{part}` ({what}) and start again",
            known.join(", ")
        )
    })?;
    if !root && !exists("sudo") {
        return Err(format!(
            "{name} is missing, and installing it takes root or `sudo`; as root, install \
             `{packages}` and start again"
        ));
    }
    let program = format!("{}{manager}", if root { "" } else { "sudo " });
    Ok((
        update.map(|words| format!("{program} {words}")),
        format!("{program} {install} {packages}"),
    ))
}

fn run(name: &str, line: &str) -> Result<(), String> {
    eprintln!("{name} is missing; running: {line}");
    let mut words = line.split(' ');
    let mut command = Command::new(words.next().unwrap_or_default());
    command.args(words);
    // Packages of Debian would ask questions, which nobody answers here.
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
    use super::{GRUB, Need, QEMU, plan};

    fn lines(need: &Need, programs: &[&str], root: bool) -> Result<String, String> {
        let exists = |name: &str| programs.contains(&name);
        let (update, install) = plan(need, need.parts[0], exists, root)?;
        let update = update.map_or(String::new(), |line| format!("{line}; "));
        Ok(update + &install)
    }

    #[test]
    fn each_manager_is_asked_without_questions_and_by_others_than_root_through_sudo() {
        let (root, qemu) = (true, &QEMU);
        let apt = "apt-get update; apt-get install --yes --no-install-recommends";
        let grub = "grub-pc-bin grub-efi-amd64-bin xorriso mtools";
        for (need, programs, root, expected) in [
            (
                qemu,
                &["apt-get"][..],
                root,
                format!("{apt} qemu-system-x86"),
            ),
            (&GRUB, &["apt-get"], root, format!("{apt} {grub}")),
            (
                qemu,
                &["dnf", "sudo"],
                !root,
                "sudo dnf install --assumeyes qemu-system-x86-core".into(),
            ),
            (
                qemu,
                &["pacman"],
                root,
                "pacman --sync --refresh --noconfirm --needed qemu-system-x86".into(),
            ),
            (
                qemu,
                &["zypper"],
                root,
                "zypper --non-interactive install qemu-x86".into(),
            ),
            (qemu, &["apk"], root, "apk add qemu-system-x86_64".into()),
        ] {
            assert_eq!(lines(need, programs, root), Ok(expected));
        }
    }

    #[test]
    fn who_cannot_install_is_told_what_to_install() {
        for (need, programs, root, parts) in [
            (
                &QEMU,
                &["dnf"][..],
                false,
                ["root or `sudo`", "`qemu-system-x86-core`"],
            ),
            (
                &QEMU,
                &["sudo"],
                true,
                ["apt-get, dnf, pacman, zypper, apk", "`qemu-system-x86_64`"],
            ),
            (
                &GRUB,
                &["dnf"],
                true,
                ["(apt-get)", "brings `grub-mkrescue`"],
            ),
        ] {
            let refusal = lines(need, programs, root).unwrap_err();
            assert!(parts.iter().all(|part| refusal.contains(part)), "{refusal}");
        }
    }
}
