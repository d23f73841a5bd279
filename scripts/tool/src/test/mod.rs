//! The subcommand `test`: every test there is, counted.
//!
//! A *test* is a libtest test of any package (boot tests are such: they boot
//! guests), a doctest, or a *check*: one property of the whole tree with a
//! name of its own, such as "clippy has nothing to say". All of them end up
//! in one [`Tally`], whose last line is `N passed, M failed`, with
//! `, K skipped` if something could not run; the reasons stand above it.
//!
//! Nothing passes by not running: a test binary that does not compile, dies
//! without its result line, or does not end within its time is a failure.

mod budgets;
mod checks;
mod code;
mod crates;
mod disk;
mod imports;
mod layers;
mod libtest;
mod lint;
mod own;
mod table;
mod tally;

use std::ffi::OsString;
use std::fs;
use std::process::ExitCode;

use crate::image;
use crate::install;
use crate::options::Refusal;
use crate::system;
use libtest::Plan;

pub use table::TEST;
pub use tally::Tally;

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
        build_images(&plan, &mut tally);
        libtest::run_all(&plan, &mut tally);
        checks::run_all(&plan, &mut tally);
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
            None => Ok(ExitCode::from(u8::from(tally.failed() > 0))),
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
/// not have to hold for a compiler too. A failure shows in those tests.
fn build_images(plan: &Plan, tally: &mut Tally) {
    if plan.quick {
        return;
    }
    for app in image::apps() {
        let name = format!("image of {app} builds");
        if plan.wants(&name) {
            tally.run(&name, || image::build(&app).map(|_| ()));
        }
    }
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
