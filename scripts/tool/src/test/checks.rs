//! Checks: properties of the whole tree, each counted as one test.
//!
//! They hold the promises that no unit test can: the image's weight, no package from
//! elsewhere, no file too long, layers in order, no crate beyond its budget of lines, nothing for the formatter, the linter
//! and the documentation to complain of, a hand-off of no more instructions than its
//! baseline, and a guest under KVM where KVM works. They judge the project's own packages.

use std::fs;
use std::path::PathBuf;

use super::libtest::Plan;
use super::tally::Tally;
use super::{budgets, layers, lint, own};
use crate::bench::hand_off;
use crate::image;
use crate::probe;
use crate::qemu::Qemu;
use crate::recordings;
use crate::system;

/// The most lines of a source file.
const MOST_LINES: usize = 400;

/// A check: its name, and what runs it.
type Check<'c> = (&'static str, &'c dyn Fn() -> Result<(), String>);

/// Runs the checks that the plan wants.
pub(super) fn run_all(plan: &Plan, tally: &mut Tally) {
    let files = own::files();
    let mut sources = files.clone();
    sources.retain(|path| path.extension().is_some_and(|ending| ending == "rs"));
    let quick: [Check<'_>; 6] = [
        ("Cargo.lock names only our own packages", &lock_is_ours),
        ("no source file has more than 400 lines", &|| {
            files_are_short(&sources)
        }),
        ("every source file opens with an essay", &|| {
            files_have_essays(&sources)
        }),
        ("layers name only layers below them", &layers::check),
        ("no crate has more lines than its budget", &|| {
            budgets::check(&files, plan.blessed.as_deref())
        }),
        ("no line escapes the budgets", &|| {
            complain(&files, budgets::escape)
        }),
    ];
    for (name, check) in quick {
        if plan.wants(name) {
            tally.add(name, check());
        }
    }
    for (name, check) in lint::CHECKS {
        match (plan.wants(name), plan.quick) {
            (false, _) => {}
            (true, true) => tally.skip(name, "left out by --quick"),
            (true, false) => tally.run(name, check),
        }
    }
    let name = "an independent reader opens MCAP files in their test";
    if plan.wants(name) {
        match recordings::independent_reader() {
            Ok(_) => tally.add(name, Ok(())),
            Err(why) => tally.skip(name, &why),
        }
    }
    if plan.quick {
        return;
    }
    let own = own::packages();
    for app in image::apps().into_iter().filter(|app| own.contains(app)) {
        let name = format!(
            "image of {app} weighs at most {} KiB",
            image::most_stripped_bytes(&app) >> 10
        );
        if plan.wants(&name) {
            tally.run(&name, || image_is_light(&app));
        }
    }
    let name = "the hand-off takes no more instructions than its baseline";
    if plan.wants(name) {
        tally.run(name, || hand_off::check(plan.blessed.as_deref()));
    }
    let name = "a guest runs under KVM";
    if plan.wants(name) {
        let image = image::build("fork-join");
        match image.and_then(|image| probe::kvm(&Qemu::default(), &image.path)) {
            Ok(()) => tally.add(name, Ok(())),
            Err(why) => tally.skip(name, &why),
        }
    }
}

/// A package of ours has no `source`: it lies in the workspace.
fn lock_is_ours() -> Result<(), String> {
    let path = system::workspace().join("Cargo.lock");
    let lock = fs::read_to_string(&path).map_err(|error| format!("Cargo.lock: {error}"))?;
    foreign(&lock)
}

fn foreign(lock: &str) -> Result<(), String> {
    let packages = lock.split("[[package]]").skip(1);
    let foreign = packages.filter(|package| package.contains("\nsource = "));
    let name = |package: &str| package.split('"').nth(1).unwrap_or("?").to_string();
    let names: Vec<String> = foreign.map(name).collect();
    if names.is_empty() {
        return Ok(());
    }
    Err(format!(
        "packages of others: {}; do without them",
        names.join(", ")
    ))
}

fn files_are_short(sources: &[PathBuf]) -> Result<(), String> {
    complain(sources, |_, text| {
        let lines = text.lines().count();
        (lines > MOST_LINES).then(|| format!("has {lines} lines, split it"))
    })
}

fn files_have_essays(sources: &[PathBuf]) -> Result<(), String> {
    complain(sources, |_, text| {
        let code = text
            .lines()
            .find(|line| !line.trim().is_empty() && !line.starts_with("#!"));
        let essay = code.is_some_and(|line| line.starts_with("//!"));
        (!essay).then(|| "does not open with `//!`".to_string())
    })
}

/// Asks for a fault of each file, by its name and its text, and gathers them on one line.
fn complain(
    sources: &[PathBuf],
    fault: impl Fn(&str, &str) -> Option<String>,
) -> Result<(), String> {
    let mut faults = Vec::new();
    for path in sources {
        let shown = own::shown(path);
        match fs::read(path) {
            Ok(text) => {
                let fault = fault(&shown, &String::from_utf8_lossy(&text));
                faults.extend(fault.map(|fault| format!("{shown} {fault}")));
            }
            Err(error) => faults.push(format!("{shown}: {error}")),
        }
    }
    if faults.is_empty() {
        return Ok(());
    }
    Err(faults.join("; "))
}

fn image_is_light(app: &str) -> Result<(), String> {
    let image = image::build(app)?;
    let bytes = image.stripped_bytes()?;
    println!("image of {app}: {bytes} bytes stripped");
    let most = image::most_stripped_bytes(app);
    if bytes <= most {
        return Ok(());
    }
    Err(format!("it weighs {bytes} bytes, {most} are allowed"))
}

#[cfg(test)]
mod tests {
    use super::foreign;

    #[test]
    fn a_package_from_a_registry_is_named() {
        let own = "version = 4\n\n[[package]]\nname = \"boot\"\nversion = \"0.1.0\"\n";
        assert_eq!(foreign(own), Ok(()));
        let with = format!("{own}\n[[package]]\nname = \"libc\"\nsource = \"registry+x\"\n");
        let fault = foreign(&with).unwrap_err();
        assert_eq!(fault, "packages of others: libc; do without them");
    }
}
