//! Goldens: texts in the tree that must equal the output of its programs.
//!
//! A *golden* is the text of a fault in its page, an output or code shown by a page, a baseline, or
//! the table of budgets. A test compares the golden with the present output. Under
//! `./scripts/test --bless` the test rewrites a differing golden in the file and passes; a person
//! then reads the change in `git diff`. The command ends with a list of the rewritten files.
//! Nothing else in a file changes. If the file does not contain the golden letter by letter,
//! rewriting is impossible and the test still fails.

use std::env;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::Path;
use std::sync::Mutex;

use tool::system::workspace;

/// The environment variable telling test programs of `--bless`: the path of the list of rewritten
/// files.
pub const BLESSED: &str = "TOOL_BLESSED";

/// A golden: a text in a file, to be compared with a program's output.
#[derive(Clone, Copy, Debug)]
pub struct GoldenText<'t> {
    /// The file's path from the workspace's root.
    pub file: &'t str,
    /// The nearest text above the golden occurring only once in the file, such as a heading.
    pub below: &'t str,
    /// The golden.
    pub text: &'t str,
}

/// Compares a golden, given by file, place and text, with a program's present output, `said`.
///
/// # Panics
///
/// Panics if the two differ and the golden is not rewritten.
#[track_caller]
pub fn assert_is(file: &str, below: &str, text: &str, said: &str) {
    let list = env::var_os(BLESSED);
    let golden = GoldenText { file, below, text };
    if let Err(why) = golden.compare(said, list.as_deref().map(Path::new)) {
        panic!("{why}");
    }
}

impl GoldenText<'_> {
    /// Compares the golden with a program's present output. A differing golden is rewritten if
    /// there is a `list` of rewritten files.
    ///
    /// # Errors
    ///
    /// In words: the two differ, and the golden was not rewritten.
    pub fn compare(&self, said: &str, list: Option<&Path>) -> Result<(), String> {
        let GoldenText { file, below, text } = self;
        if *text == said {
            return Ok(());
        }
        let remedy = match list.map(|list| self.rewrite(said, list)) {
            Some(Ok(())) => return Ok(()),
            Some(Err(error)) => format!("it cannot be rewritten: {error}"),
            None => "if that is meant, rewrite it by `./scripts/test --bless FILTER`".into(),
        };
        let [below, text, said] = [below, text, said].map(str::trim_end);
        Err(format!(
            "{file}, below \"{}\":\n{text}\nNow it is:\n{said}\n{remedy}",
            below.trim()
        ))
    }

    fn rewrite(&self, said: &str, list: &Path) -> io::Result<()> {
        // The tests of a program are threads, and some share a file.
        static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());
        let _one = ONE_AT_A_TIME.lock();
        let file = workspace().join(self.file);
        let page = fs::read_to_string(&file)?;
        let place = page.find(self.below).and_then(|start| {
            // Only below the heading: the same text may also occur elsewhere.
            let start = start + self.below.len();
            Some(start + page[start..].find(self.text)?)
        });
        let place = place.ok_or_else(|| io::Error::other("it does not stand there"))?;
        let rest = &page[place + self.text.len()..];
        fs::write(&file, [&page[..place], said, rest].concat())?;
        // Appended, since several test programs share the list.
        let mut list = File::options().create(true).append(true).open(list)?;
        writeln!(list, "{}", self.file)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_differs_fails_and_is_rewritten_in_its_place_when_blessed() {
        let folder = std::env::temp_dir().join(format!("golden-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let (page, list) = (folder.join("page.md"), folder.join("list"));
        let before = "# a\nsaid\n# b\nsaid\nmore\n";
        fs::write(&page, before).unwrap();
        let is_now = |text: &str| assert_eq!(fs::read_to_string(&page).unwrap(), text);
        let file = page.to_str().unwrap();
        let golden = |below, text| GoldenText { file, below, text };
        let of_b = golden("# b", "said\n");

        assert_eq!(of_b.compare("said\n", None), Ok(()));
        let why = of_b.compare("altered\n", None).unwrap_err();
        let words = ", below \"# b\":\nsaid\nNow it is:\naltered\nif that is meant, rewrite it by";
        assert!(why.contains(words), "{why}");
        is_now(before);
        assert_eq!(of_b.compare("altered\n", Some(&list)), Ok(()));
        // Both words are there, but not one below the other.
        for unknown in [golden("# c", "said"), golden("more", "said")] {
            let why = unknown.compare("altered", Some(&list)).unwrap_err();
            assert!(why.ends_with("rewritten: it does not stand there"), "{why}");
        }
        is_now("# a\nsaid\n# b\naltered\nmore\n");
        assert_eq!(fs::read_to_string(&list).unwrap(), format!("{file}\n"));
        fs::remove_dir_all(folder).unwrap();
    }
}
