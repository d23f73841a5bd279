//! Checks: properties of the whole tree, each counted as one test.
//!
//! They hold the promises that no unit test can: the image's weight, no package from
//! elsewhere, no file too long, layers in order, no crate beyond its budget of lines, nothing for the formatter, the linter
//! and the documentation to complain of, a hand-off of no more instructions than its
//! baseline, and a guest under KVM where KVM works. They judge the project's own packages.

use std::fs;

use super::own::Source;
use super::tally::{Tally, Why, none_of};
use super::{Plan, budgets, layers, own};
use crate::bench::hand_off;
use crate::image;
use crate::probe;
use crate::progress::Lasting;
use crate::qemu::Qemu;
use crate::recordings;
use crate::system;

/// The most lines of a source file.
const MOST_LINES: usize = 800;

/// Runs the checks that the plan wants.
pub(super) fn run_all(plan: &Plan, sources: &[Source], tally: &mut Tally) {
    let blessed = plan.blessed.as_deref();
    let mut run = |name: &str, check: &dyn Fn() -> Result<(), Why>| {
        if plan.wants(name) {
            tally.run(name, check);
        }
    };
    run("Cargo.lock names only our own packages", &|| {
        let lock = fs::read_to_string(system::workspace().join("Cargo.lock"));
        Ok(foreign(
            &lock.map_err(|error| format!("Cargo.lock: {error}"))?,
        )?)
    });
    run("no source file has more than 800 lines", &|| {
        Ok(complain(sources, is_long)?)
    });
    run("every source file opens with an essay", &|| {
        Ok(complain(sources, lacks_essay)?)
    });
    run("layers name only layers below them", &|| {
        Ok(layers::check(sources)?)
    });
    run("no crate has more lines than its budget", &|| {
        Ok(budgets::check(sources, blessed)?)
    });
    run("no line escapes the budgets", &|| {
        Ok(complain(sources, budgets::escape)?)
    });

    let lint = |words: &str, remedy: &str| match plan.quick {
        true => Err(Why::Skipped("left out by --quick".into())),
        false => Ok(cargo(sources, words, remedy)?),
    };
    run("rustfmt has nothing to change", &|| {
        lint("fmt --check", "run `cargo fmt`")
    });
    run("clippy has nothing to say", &|| {
        lint("clippy --quiet --all-targets -- -D warnings", "see above")
    });
    let doc = "doc --quiet --no-deps";
    run("rustdoc has nothing to say", &|| lint(doc, "see above"));
    run("rustdoc has nothing to say of private items", &|| {
        lint(&format!("{doc} --document-private-items"), "see above")
    });
    run(
        "an independent reader opens MCAP files in their test",
        &|| {
            let reader = recordings::independent_reader();
            reader.map(drop).map_err(Why::Skipped)
        },
    );
    if plan.quick {
        return;
    }
    run(
        "the hand-off takes no more instructions than its baseline",
        &|| Ok(hand_off::check(blessed)?),
    );
    run("a guest runs under KVM", &|| {
        let image = image::build("fork-join");
        let probed = image.and_then(|image| probe::kvm(&Qemu::default(), &image.path));
        probed.map_err(Why::Skipped)
    });
}

/// Runs cargo on the packages of these files; whatever it says goes to the terminal only if it fails.
fn cargo(sources: &[Source], words: &str, remedy: &str) -> Result<(), String> {
    let mut command = system::cargo();
    let mut each = words.split(' ');
    command.args(each.next());
    for package in own::packages(sources) {
        command.args(["-p", &package]);
    }
    command.args(each).env("RUSTDOCFLAGS", "-D warnings");
    let _lasting = Lasting::new(&format!("cargo {words}"));
    let output = command.output();
    let output = output.map_err(|error| format!("cannot start cargo: {error}"))?;
    if output.status.success() {
        return Ok(());
    }
    eprint!("{}", String::from_utf8_lossy(&output.stdout));
    eprint!("{}", String::from_utf8_lossy(&output.stderr));
    Err(format!("`cargo {words}` failed; {remedy}"))
}

/// Names packages of others: one of ours has no `source`, it lies in the workspace.
fn foreign(lock: &str) -> Result<(), String> {
    let packages = lock.split("[[package]]").skip(1);
    let foreign = packages.filter(|package| package.contains("\nsource = "));
    let name = |package: &str| package.split('"').nth(1).unwrap_or("?").to_string();
    let names = none_of(foreign.map(name).collect());
    names.map_err(|names| format!("packages of others: {names}; do without them"))
}

fn is_long(name: &str, text: &str) -> Option<String> {
    let lines = text.lines().count();
    let is_long = name.ends_with(".rs") && lines > MOST_LINES;
    is_long.then(|| format!("has {lines} lines, split it"))
}

fn lacks_essay(name: &str, text: &str) -> Option<String> {
    let mut lines = text.lines();
    let code = lines.find(|line| !line.trim().is_empty() && !line.starts_with("#!"));
    let has_essay = code.is_some_and(|line| line.starts_with("//!"));
    let lacks = name.ends_with(".rs") && !has_essay;
    lacks.then(|| "does not open with `//!`".to_string())
}

/// Asks for a fault of each file, by its name and its text, and gathers them on one line.
fn complain(
    sources: &[Source],
    fault: impl Fn(&str, &str) -> Option<String>,
) -> Result<(), String> {
    let faults = sources.iter().filter_map(|Source { name, text }| {
        let fault = fault(name, text)?;
        Some(format!("{name} {fault}"))
    });
    none_of(faults.collect())
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
