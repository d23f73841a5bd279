//! The subcommand `test`: every test there is, counted.
//!
//! A *test* is a libtest test of any package (boot tests are such: they boot
//! guests), a doctest, or a *check*: one property of the whole tree with a
//! name of its own, such as "clippy has nothing to say". All of them end up
//! in one tally, whose last line is `N passed, M failed`, with
//! `, K skipped` if something could not run; the reasons stand above it.
//!
//! Nothing passes by not running: a test binary that does not compile, dies
//! without its result line, or does not end within its time is a failure.

mod budgets;
mod checks;
mod disk;
mod layers;
mod libtest;
mod own;
mod tally;

use std::ffi::OsString;
use std::fs;
use std::path::PathBuf;
use std::process::ExitCode;

use crate::image;
use crate::install;
use crate::options::{Command, Refusal, Takes, options};
use crate::system;
use own::Source;
use tally::Tally;

/// The table of `test`.
pub static TEST: Command = Command {
    invocation: "./scripts/test",
    about: "Runs every test, on the host and in QEMU, and counts them.",
    positional: Some((
        Takes::Text("FILTER"),
        "Run only tests and checks whose name contains this.",
    )),
    options: options! {
        /// Only what runs on the host: no guests, no images, no lints.
        "quick": Takes::Nothing;
        /// Rewrite what a change makes wrong: fault texts and outputs in pages, baselines.
        "bless": Takes::Nothing;
        /// Show every test by name, not only those that fail.
        "verbose" 'v': Takes::Nothing;
    },
    notes: "\
The last line is `N passed, M failed`, or `N passed, M failed, K skipped` with
the reasons above it. Each part says when it ends how many seconds it took.

With --bless the files that were rewritten stand there, too; `git diff` shows what
has changed in them. What cannot be rewritten still fails.

exit codes: 0 nothing failed; 1 something failed; 2 a refused command line, or
a FILTER by which nothing has run
",
};

/// The tests that shall run.
struct Plan {
    /// A part of the names of the tests wanted; `None`: all.
    filter: Option<String>,
    /// Leave out guests, images and lints.
    quick: bool,
    /// Show every test by name.
    verbose: bool,
    /// Whether guests can be booted, or why not.
    boots: Result<(), String>,
    /// The list of rewritten files, if what differs is to be rewritten.
    blessed: Option<PathBuf>,
}

impl Plan {
    fn wants(&self, name: &str) -> bool {
        let filter = self.filter.as_deref();
        filter.is_none_or(|filter| name.contains(filter))
    }
}

/// Runs the subcommand with the words after its name.
#[must_use]
pub fn test(words: &[OsString]) -> ExitCode {
    TEST.carry_out(words, |options| {
        disk::check()?;
        let list = options.is_given("bless");
        let list = list.then(|| system::new_log("blessed"));
        let plan = Plan {
            filter: options.positional().map(String::from),
            quick: options.is_given("quick"),
            verbose: options.is_given("verbose"),
            boots: install::ensure_qemu(),
            blessed: list.transpose()?,
        };
        let mut tally = Tally::default();
        let sources = own::sources();
        build_images(&plan, &sources, &mut tally);
        libtest::run_all(&plan, &mut tally);
        checks::run_all(&plan, &sources, &mut tally);
        if let Some(list) = &plan.blessed {
            // There is none if nothing was rewritten.
            tally.bless(&fs::read_to_string(list).unwrap_or_default());
            let _ = fs::remove_file(list);
        }

        // A filter without a match ends in the complaint alone: `0 passed, 0 failed`
        // would look like success.
        if !tally.is_empty() {
            print!("{tally}");
        }
        match complaint(plan.filter.as_deref(), &tally) {
            Some(line) => Err(Refusal::Usage(line)),
            None => Ok(ExitCode::from(u8::from(tally.has_failed()))),
        }
    })
}

/// Says what is wrong with a filter by which nothing has run.
fn complaint(filter: Option<&str>, tally: &Tally) -> Option<String> {
    let filter = filter.filter(|_| !tally.has_run())?;
    if tally.is_empty() {
        return Some(format!(
            "no test or check has `{filter}` in its name; give a part of a name, as \
             `./scripts/test --verbose` shows them"
        ));
    }
    Some(format!(
        "all that has `{filter}` in its name was skipped, for the reasons above"
    ))
}

/// Builds the images before the tests that boot them, so that their limits do
/// not have to hold for a compiler too. One of the project's own must be light.
fn build_images(plan: &Plan, sources: &[Source], tally: &mut Tally) {
    if plan.quick {
        return;
    }
    let own = own::packages(sources);
    for app in image::apps() {
        let most = own.contains(&app).then(|| image::most_stripped_bytes(&app));
        let name = match most {
            Some(most) => format!("image of {app} weighs at most {} KiB", most >> 10),
            None => format!("image of {app} builds"),
        };
        if plan.wants(&name) {
            tally.run(&name, || Ok(build_image(&app, most.unwrap_or(u64::MAX))?));
        }
    }
}

fn build_image(app: &str, most: u64) -> Result<(), String> {
    let bytes = image::build(app)?.stripped_bytes()?;
    println!("image of {app}: {bytes} bytes stripped");
    if bytes <= most {
        return Ok(());
    }
    Err(format!("it weighs {bytes} bytes, {most} are allowed"))
}

#[cfg(test)]
mod tests {
    use super::{Tally, complaint};

    #[test]
    fn a_filter_by_which_nothing_has_run_is_named() {
        let mut tally = Tally::default();
        let line = complaint(Some("frob"), &tally).unwrap();
        assert!(line.starts_with("no test or check has `frob` in its name; "));
        tally.skip("boot_x", "left out by --quick");
        let line = complaint(Some("boot"), &tally).unwrap();
        assert!(line.starts_with("all that has `boot` in its name was skipped, "));
        assert_eq!(complaint(None, &tally), None);
        tally.fail("a", "b");
        assert_eq!(complaint(Some("boot"), &tally), None);
    }
}
