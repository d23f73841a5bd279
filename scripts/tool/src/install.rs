//! Getting QEMU onto the machine, by the system's own package manager.
//!
//! Which manager there is decides what is run; nothing is downloaded by
//! ourselves. Without one that we know, the person is told what to install.

use std::io;
use std::process::{Command, Stdio};

use crate::qemu::PROGRAM;
use crate::system::find_program;

/// A package manager: its program, the package that brings QEMU with its
/// firmware, and the commands that install it.
struct Manager {
    program: &'static str,
    package: &'static str,
    commands: &'static [&'static [&'static str]],
}

const MANAGERS: &[Manager] = &[
    Manager {
        program: "apt-get",
        package: "qemu-system-x86",
        commands: &[
            &["apt-get", "update"],
            &["apt-get", "install", "--yes", "--no-install-recommends"],
        ],
    },
    Manager {
        program: "dnf",
        package: "qemu-system-x86-core",
        commands: &[&["dnf", "install", "--assumeyes"]],
    },
    Manager {
        program: "pacman",
        package: "qemu-system-x86",
        commands: &[&["pacman", "--sync", "--refresh", "--noconfirm", "--needed"]],
    },
    Manager {
        program: "zypper",
        package: "qemu-x86",
        commands: &[&["zypper", "--non-interactive", "install"]],
    },
    Manager {
        program: "apk",
        package: "qemu-system-x86_64",
        commands: &[&["apk", "add"]],
    },
];

/// Makes sure that QEMU is there, installing it if it is not. What the
/// package manager says goes to standard error.
///
/// # Errors
///
/// In words: the system is not known, or the installation failed, and what to
/// do by hand.
pub fn ensure_qemu() -> Result<(), String> {
    if find_program(PROGRAM).is_some() {
        return Ok(());
    }
    let mut plan = plan(|name| find_program(name).is_some(), is_root())?;
    let install = plan.pop();
    for words in plan {
        // One source of packages that cannot be reached fails the whole update,
        // and need not be the one with QEMU: the installation will tell.
        if let Err(why) = run(&words) {
            eprintln!("{why}");
        }
    }
    if let Some(words) = install {
        run(&words).map_err(|why| {
            format!("QEMU could not be installed: {why}; install it by hand and start again")
        })?;
    }
    match find_program(PROGRAM) {
        Some(_) => Ok(()),
        None => Err(format!(
            "the installation ended well, but there is still no `{PROGRAM}` on the PATH; \
             install QEMU for x86_64 by hand"
        )),
    }
}

/// Decides on the commands to run, the installation last, given which programs exist and whether we
/// are root.
fn plan(exists: impl Fn(&str) -> bool, root: bool) -> Result<Vec<Vec<String>>, String> {
    let manager = MANAGERS.iter().find(|manager| exists(manager.program));
    let manager = manager.ok_or_else(|| {
        format!(
            "QEMU is missing, and none of the package managers {} is here; install the package \
             that brings `{PROGRAM}` (QEMU's system emulator for x86_64) and start again",
            MANAGERS
                .iter()
                .map(|m| m.program)
                .collect::<Vec<_>>()
                .join(", ")
        )
    })?;
    if !root && !exists("sudo") {
        return Err(format!(
            "QEMU is missing, and installing it takes root or `sudo`; as root, install the \
             package `{}` and start again",
            manager.package
        ));
    }
    let with_privilege = |command: &&[&str]| {
        let sudo = (!root).then_some("sudo");
        let words = sudo.into_iter().chain(command.iter().copied());
        words.map(String::from).collect::<Vec<_>>()
    };
    let mut commands: Vec<_> = manager.commands.iter().map(with_privilege).collect();
    if let Some(last) = commands.last_mut() {
        last.push(manager.package.into());
    }
    Ok(commands)
}

fn run(words: &[String]) -> Result<(), String> {
    let line = words.join(" ");
    eprintln!("QEMU is missing; running: {line}");
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
    use super::plan;

    fn lines(programs: &[&str], root: bool) -> Result<Vec<String>, String> {
        let plan = plan(|name| programs.contains(&name), root)?;
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
