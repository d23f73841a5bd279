//! Getting what a command needs onto the machine, by the system's own package manager.
//!
//! A command that needs QEMU installs it if it is missing; one that needs GRUB, a firmware
//! or Bochs does likewise. Which manager there is decides what is run; nothing is
//! downloaded by ourselves. Without one that we know, the person is told what to install.

use std::io;
use std::path::Path;
use std::process::{Command, Stdio};

use crate::qemu::{Loader, OVMF_FILE, PROGRAM};
use crate::system::find_program;

/// Something of the host's that a command needs.
#[derive(Debug)]
pub struct Need {
    /// What it is called, and what it is.
    name: &'static str,
    what: &'static str,
    /// What it is there by: programs on the `PATH`, and files or folders.
    parts: &'static [&'static str],
    /// For each package manager that is known to have it, the packages.
    packages: &'static [(&'static str, &'static [&'static str])],
}

/// The emulator that everything boots in, with the firmware that it brings.
pub static QEMU: Need = Need {
    name: "QEMU",
    what: "QEMU's system emulator for x86_64",
    parts: &[PROGRAM],
    packages: &[
        ("apt-get", &["qemu-system-x86"]),
        ("dnf", &["qemu-system-x86-core"]),
        ("pacman", &["qemu-system-x86"]),
        ("zypper", &["qemu-x86"]),
        ("apk", &["qemu-system-x86_64"]),
    ],
};

/// The debugger.
pub static GDB: Need = Need {
    name: "gdb",
    what: "GNU's debugger",
    parts: &["gdb"],
    packages: &[
        ("apt-get", &["gdb"]),
        ("dnf", &["gdb"]),
        ("pacman", &["gdb"]),
        ("zypper", &["gdb"]),
        ("apk", &["gdb"]),
    ],
};

/// What an ISO is made with, for BIOS and for UEFI.
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
    packages: &[(
        "apt-get",
        &["grub-pc-bin", "grub-efi-amd64-bin", "xorriso", "mtools"],
    )],
};

/// What makes a FAT stick.
pub static MTOOLS: Need = Need {
    name: "mtools",
    what: "mtools, which write FAT file systems",
    parts: &["mformat", "mmd", "mcopy"],
    packages: &[
        ("apt-get", &["mtools"]),
        ("dnf", &["mtools"]),
        ("pacman", &["mtools"]),
        ("zypper", &["mtools"]),
        ("apk", &["mtools"]),
    ],
};

/// UEFI for QEMU.
pub static OVMF: Need = Need {
    name: "OVMF",
    what: "the firmware that gives QEMU's machines UEFI",
    parts: &[OVMF_FILE],
    packages: &[("apt-get", &["ovmf"])],
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
    packages: &[("apt-get", &["bochs", "bochs-sdl", "bochsbios", "vgabios"])],
};

/// A package manager: its program, and the commands that install packages, whose names
/// follow the last one.
struct Manager {
    program: &'static str,
    commands: &'static [&'static [&'static str]],
}

const MANAGERS: &[Manager] = &[
    Manager {
        program: "apt-get",
        commands: &[
            &["apt-get", "update"],
            &["apt-get", "install", "--yes", "--no-install-recommends"],
        ],
    },
    Manager {
        program: "dnf",
        commands: &[&["dnf", "install", "--assumeyes"]],
    },
    Manager {
        program: "pacman",
        commands: &[&["pacman", "--sync", "--refresh", "--noconfirm", "--needed"]],
    },
    Manager {
        program: "zypper",
        commands: &[&["zypper", "--non-interactive", "install"]],
    },
    Manager {
        program: "apk",
        commands: &[&["apk", "add"]],
    },
];

/// Makes sure that QEMU is there, as [`ensure`] does.
///
/// # Errors
///
/// As [`ensure`].
pub fn ensure_qemu() -> Result<(), String> {
    ensure(&QEMU)
}

/// Makes sure that what a loader takes besides QEMU is there, as [`ensure`] does.
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

/// Makes sure that something is there, installing it if it is not. What the package manager
/// says goes to standard error.
///
/// # Errors
///
/// In words: the system is not known, or the installation failed, and what to
/// do by hand.
pub fn ensure(need: &Need) -> Result<(), String> {
    let Some(part) = missing(need) else {
        return Ok(());
    };
    let mut plan = plan(need, part, |name| find_program(name).is_some(), is_root())?;
    let name = need.name;
    let install = plan.pop();
    for words in plan {
        // One source of packages that cannot be reached fails the whole update,
        // and need not be the one with what is needed: the installation will tell.
        if let Err(why) = run(name, &words) {
            eprintln!("{why}");
        }
    }
    if let Some(words) = install {
        run(name, &words).map_err(|why| {
            format!("{name} could not be installed: {why}; install it by hand and start again")
        })?;
    }
    match missing(need) {
        None => Ok(()),
        Some(part) => Err(format!(
            "the installation ended well, but there is still no `{part}`; install {} by hand",
            need.what
        )),
    }
}

/// Returns the first part that is not there.
fn missing(need: &Need) -> Option<&'static str> {
    let is_there = |part: &&str| match part.starts_with('/') {
        true => Path::new(part).exists(),
        false => find_program(part).is_some(),
    };
    need.parts.iter().copied().find(|part| !is_there(part))
}

/// Decides on the commands to run, the installation last, given what is missing, which
/// programs exist and whether we are root.
fn plan(
    need: &Need,
    part: &str,
    exists: impl Fn(&str) -> bool,
    root: bool,
) -> Result<Vec<Vec<String>>, String> {
    let Need { name, what, .. } = need;
    let mut known = need.packages.iter();
    let (manager, packages) = known.find(|(manager, _)| exists(manager)).ok_or_else(|| {
        let known: Vec<&str> = need.packages.iter().map(|(manager, _)| *manager).collect();
        format!(
            "{name} is missing, and none of the package managers that are known to have it \
                 is here ({}); install the package that brings `{part}` ({what}) and start again",
            known.join(", ")
        )
    })?;
    if !root && !exists("sudo") {
        return Err(format!(
            "{name} is missing, and installing it takes root or `sudo`; as root, install \
             `{}` and start again",
            packages.join(" ")
        ));
    }
    let with_privilege = |command: &&[&str]| {
        let sudo = (!root).then_some("sudo");
        let words = sudo.into_iter().chain(command.iter().copied());
        words.map(String::from).collect::<Vec<_>>()
    };
    let all = MANAGERS.iter().filter(|known| known.program == *manager);
    let commands = all.flat_map(|manager| manager.commands);
    let mut commands: Vec<_> = commands.map(with_privilege).collect();
    if let Some(last) = commands.last_mut() {
        last.extend(packages.iter().map(|package| package.to_string()));
    }
    Ok(commands)
}

fn run(name: &str, words: &[String]) -> Result<(), String> {
    let line = words.join(" ");
    eprintln!("{name} is missing; running: {line}");
    let mut command = Command::new(&words[0]);
    command.args(&words[1..]);
    command.env("DEBIAN_FRONTEND", "noninteractive");
    // Our standard output may be read by a machine.
    command.stdout(Stdio::from(io::stderr()));
    match command.status() {
        Ok(status) if status.success() => Ok(()),
        Ok(status) => Err(format!("`{line}` failed ({status})")),
        Err(error) => Err(format!("`{line}` did not start: {error}")),
    }
}

fn is_root() -> bool {
    // The standard library does not tell; `id` is in every system's base.
    let id = Command::new("id").arg("-u").output();
    id.is_ok_and(|output| output.stdout.trim_ascii() == b"0")
}

#[cfg(test)]
mod tests {
    use super::{BOCHS, GDB, GRUB, MANAGERS, MTOOLS, Need, OVMF, QEMU, plan};

    fn lines(programs: &[&str], root: bool) -> Result<Vec<String>, String> {
        lines_of(&QEMU, programs, root)
    }

    fn lines_of(need: &Need, programs: &[&str], root: bool) -> Result<Vec<String>, String> {
        let plan = plan(need, need.parts[0], |name| programs.contains(&name), root)?;
        Ok(plan.iter().map(|words| words.join(" ")).collect())
    }

    #[test]
    fn debian_is_asked_without_questions_and_recommendations() {
        assert_eq!(
            lines(&["apt-get"], true).unwrap(),
            [
                "apt-get update",
                "apt-get install --yes --no-install-recommends qemu-system-x86"
            ]
        );
    }

    #[test]
    fn others_than_root_go_through_sudo() {
        assert_eq!(
            lines(&["dnf", "sudo"], false).unwrap(),
            ["sudo dnf install --assumeyes qemu-system-x86-core"]
        );
        let refusal = lines(&["dnf"], false).unwrap_err();
        assert!(refusal.contains("root or `sudo`"), "{refusal}");
        assert!(refusal.contains("`qemu-system-x86-core`"), "{refusal}");
    }

    #[test]
    fn an_unknown_system_is_told_what_to_install() {
        let refusal = lines(&["sudo"], true).unwrap_err();
        assert!(
            refusal.contains("apt-get, dnf, pacman, zypper, apk"),
            "{refusal}"
        );
        assert!(refusal.contains("`qemu-system-x86_64`"), "{refusal}");
    }

    #[test]
    fn what_is_needed_is_installed_in_one_go() {
        let lines = lines_of(&GRUB, &["apt-get", "sudo"], false).unwrap();
        assert_eq!(
            lines[1],
            "sudo apt-get install --yes --no-install-recommends grub-pc-bin grub-efi-amd64-bin \
             xorriso mtools"
        );
        let refusal = lines_of(&GRUB, &["dnf"], true).unwrap_err();
        assert!(refusal.contains("brings `grub-mkrescue`"), "{refusal}");
    }

    #[test]
    fn packages_are_of_managers_that_we_can_run() {
        for (manager, packages) in [&QEMU, &GDB, &GRUB, &MTOOLS, &OVMF, &BOCHS]
            .into_iter()
            .flat_map(|n| n.packages)
        {
            assert!(MANAGERS.iter().any(|known| known.program == *manager));
            assert!(!packages.is_empty(), "{manager}");
        }
    }

    #[test]
    fn every_manager_ends_with_its_package() {
        for (manager, package) in [
            ("apt-get", "qemu-system-x86"),
            ("dnf", "qemu-system-x86-core"),
            ("pacman", "qemu-system-x86"),
            ("zypper", "qemu-x86"),
            ("apk", "qemu-system-x86_64"),
        ] {
            let last = lines(&[manager], true).unwrap().pop().unwrap();
            assert!(
                last.starts_with(manager) && last.ends_with(package),
                "{last}"
            );
        }
    }
}
