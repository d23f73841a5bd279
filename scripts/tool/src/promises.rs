//! What the pages promise, and which test holds them to it: `tests/promises.txt`.
//!
//! A *promise* is a sentence, or a part of one, that says what is refused, contained,
//! reported or guaranteed. The table quotes it word for word from its page and names
//! the tests that would fail if it were not kept. So a page cannot be changed without a
//! look at its tests, nor a test be dropped while a page relies on it.
//!
//! A line without indentation names a page; indented lines below it are a quotation;
//! lines that then begin with `- ` name its tests, as `PATH::NAME`. A name with spaces is
//! that of a check. The faults of `docs/errors.md` need no lines: each entry's text is a
//! promise by itself, and two tests compare all of them.

use std::fmt;
use std::fs;

use crate::fault_page;
use crate::system;

/// The table, from the workspace's root.
const TABLE: &str = "tests/promises.txt";

/// The tests that compare what is said of a fault with its entry.
const OF_FAULTS: [&str; 2] = [
    "tests/tests/commit_faults.rs::every_fault_is_found_and_said_as_documented",
    "tests/tests/boot_kernel.rs::every_commit_fault_is_printed_as_documented",
];

/// Those of the faults that need a program of their own, or no platform at all.
const OF_NO_PLATFORM: &str =
    "tests/tests/commit_without_platform.rs::a_commit_without_platform_is_refused_as_documented";

/// A sentence of a page, and the tests that hold the page to it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Promise {
    page: String,
    sentence: String,
    tests: Vec<String>,
}

impl fmt::Display for Promise {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}: {}", self.page, self.sentence)?;
        (self.tests.iter()).try_for_each(|test| writeln!(f, "    {test}"))
    }
}

/// Returns the table's promises, and one for each fault of a commit.
///
/// # Errors
///
/// In words: the table or the page of faults cannot be read.
pub fn all() -> Result<Vec<Promise>, String> {
    let mut promises = read(&text_of(TABLE)?);
    for (fault, entry) in fault_page::documented_faults()? {
        let tests = match fault.as_str() {
            "no_platform" => vec![OF_NO_PLATFORM.into()],
            _ => OF_FAULTS.map(String::from).to_vec(),
        };
        promises.push(Promise {
            page: "docs/errors.md".into(),
            sentence: entry.text,
            tests,
        });
    }
    Ok(promises)
}

fn read(table: &str) -> Vec<Promise> {
    let mut promises: Vec<Promise> = Vec::new();
    let mut page = "";
    for line in table.lines().filter(|line| !line.starts_with('#')) {
        let text = line.trim();
        if text.is_empty() {
            continue;
        } else if text == line {
            page = line;
        } else if let (Some(test), Some(promise)) = (text.strip_prefix("- "), promises.last_mut()) {
            promise.tests.push(test.into());
        } else {
            match promises.last_mut() {
                Some(promise) if promise.tests.is_empty() && promise.page == page => {
                    promise.sentence += &format!(" {text}");
                }
                _ => promises.push(Promise {
                    page: page.into(),
                    sentence: text.into(),
                    tests: Vec::new(),
                }),
            }
        }
    }
    promises
}

/// Returns a line for each promise that its page does not make, that has no test, or
/// whose test is not there.
#[must_use]
pub fn faults(promises: &[Promise]) -> Vec<String> {
    let mut faults = Vec::new();
    for promise in promises {
        let Promise {
            page,
            sentence,
            tests,
        } = promise;
        match text_of(page) {
            Ok(text) if one_line(&text).contains(&one_line(sentence)) => {}
            Ok(_) => faults.push(format!(
                "{page} does not say `{sentence}`; see if its tests still hold it, and quote \
                 what it says now in {TABLE}"
            )),
            Err(why) => faults.push(why),
        }
        if tests.is_empty() {
            faults.push(format!("`{sentence}` has no test; name one in {TABLE}"));
        }
        let absent = tests.iter().filter(|test| !is_there(test));
        faults.extend(absent.map(|test| {
            format!("there is no test `{test}` for `{sentence}`; name the one that holds it")
        }));
    }
    faults
}

fn text_of(file: &str) -> Result<String, String> {
    let path = system::workspace().join(file);
    fs::read_to_string(&path).map_err(|error| format!("`{}`: {error}", path.display()))
}

/// Leaves one blank of each white space, so that lines may be broken anywhere.
fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Whether the file has a function of that name that is marked as a test, or a check.
fn is_there(test: &str) -> bool {
    let Some((file, name)) = test.rsplit_once("::") else {
        return false;
    };
    let text = text_of(file).unwrap_or_default();
    if name.contains(' ') {
        return text.contains(&format!("\"{name}\""));
    }
    let lines: Vec<&str> = text.lines().map(str::trim).collect();
    let start = format!("fn {name}(");
    let Some(place) = lines.iter().position(|line| line.starts_with(&start)) else {
        return false;
    };
    let attributes = lines[..place].iter().rev();
    let mut attributes = attributes.take_while(|line| line.starts_with("#["));
    attributes.any(|line| *line == "#[test]")
}

#[cfg(test)]
mod tests {
    use super::{all, faults, read};

    const GOOD: &str = "\
# A remark.
README.md
  Sending never
  waits.
    - scripts/tool/src/promises.rs::every_promise_stands_on_its_page_and_has_its_tests
    - scripts/tool/src/test/lint.rs::clippy has nothing to say
  Misses are counted for each DAG and each sink.
";

    #[test]
    fn every_promise_stands_on_its_page_and_has_its_tests() {
        let promises = all().expect("the table and the page");
        assert_eq!(faults(&promises), [""; 0]);
        for page in [
            "README.md",
            "docs/architecture.md",
            "docs/caveats.md",
            "docs/dag-file.md",
            "docs/errors.md",
            "docs/guide.md",
            "docs/proving.md",
            "docs/seeing.md",
            "docs/serial-protocol.md",
        ] {
            let of_page = promises.iter().filter(|promise| promise.page == page);
            assert!(of_page.count() > 1, "{page} promises nothing");
        }
    }

    #[test]
    fn what_a_page_does_not_say_or_no_test_holds_is_named() {
        let promises = read(GOOD);
        assert_eq!(promises[0].sentence, "Sending never waits.");
        assert_eq!(promises[0].tests.len(), 2);
        let [untested] = &faults(&promises)[..] else {
            panic!("{:?}", faults(&promises));
        };
        assert!(
            untested.starts_with("`Misses are counted for each DAG and each sink.` has no test; ")
        );

        let other = faults(&read(&GOOD.replace("never", "always")));
        assert!(other[0].starts_with("README.md does not say `Sending always waits.`; "));
        for (name, lie) in [
            ("every_promise_stands", "every_promise_falls"),
            ("every_promise_stands_on_its_page_and_has_its_tests", "read"),
            ("nothing to say", "a lot to say"),
            (
                "scripts/tool/src/promises.rs",
                "scripts/tool/src/no_such_file.rs",
            ),
        ] {
            let absent = faults(&read(&GOOD.replace(name, lie)));
            assert!(absent[0].starts_with("there is no test `"), "{absent:?}");
            assert!(absent[0].contains(lie), "{absent:?}");
        }
    }
}
