//! A first word that chooses what the rest is for: `bench WHAT`, `oracle KIND`.

use std::ffi::{OsStr, OsString};
use std::process::ExitCode;

use replay::shown::quoted;

use super::nearest;

/// The words to choose from.
#[derive(Debug)]
pub struct Menu {
    /// What the person types before the word, such as `./scripts/bench`.
    pub invocation: &'static str,
    /// What the word stands for, such as `WHAT`.
    pub word: &'static str,
    /// One or more sentences on what the command does.
    pub about: &'static str,
    /// The words, in the order of the help text.
    pub choices: &'static [Choice],
    /// What else the help text says, after the words.
    pub notes: &'static str,
}

/// One of the words.
#[derive(Debug)]
pub struct Choice {
    /// The word.
    pub name: &'static str,
    /// A few words for the help text.
    pub about: &'static str,
    /// What it does with the words after it, and its exit code.
    pub work: fn(&[OsString]) -> ExitCode,
}

/// Makes the choices of a [`Menu`]: behind each word what the help text says of it, and what it does.
#[macro_export]
macro_rules! choices {
    ($($name:literal: $about:literal, $work:expr;)*) => {
        &[$($crate::options::Choice { name: $name, about: $about, work: $work }),*]
    };
}
pub use choices;

impl Menu {
    /// Does what a command line chooses, shows the help text, or refuses the word with
    /// exit code 2.
    #[must_use]
    pub fn run(&self, words: &[OsString]) -> ExitCode {
        let name = self.invocation.trim_start_matches("./scripts/");
        match words.split_first() {
            Some((word, _)) if word == "--help" || word == "-h" => {
                print!("{}", self.help());
                ExitCode::SUCCESS
            }
            Some((word, rest)) => match self.choose(word) {
                Ok(choice) => (choice.work)(rest),
                Err(line) => {
                    eprintln!("{name}: {line}");
                    ExitCode::from(2)
                }
            },
            None => {
                eprintln!("{name}: which {}? {}", self.word, self.remedy());
                ExitCode::from(2)
            }
        }
    }

    fn choose(&self, word: &OsStr) -> Result<&Choice, String> {
        let word = &*word.to_string_lossy();
        if let Some(choice) = self.choices.iter().find(|choice| choice.name == word) {
            return Ok(choice);
        }
        let names: Vec<&str> = self.choices.iter().map(|choice| choice.name).collect();
        let hint = nearest(word, &names)
            .map_or_else(|| self.remedy(), |near| format!("did you mean `{near}`?"));
        Err(match word.starts_with('-') {
            true => format!("unknown option {}; {}", quoted(word), self.remedy()),
            false => format!("unknown {} {}; {hint}", self.word, quoted(word)),
        })
    }

    fn remedy(&self) -> String {
        let names: Vec<&str> = self.choices.iter().map(|choice| choice.name).collect();
        format!(
            "give one of {}, and see {} --help",
            names.join(", "),
            self.invocation
        )
    }

    fn help(&self) -> String {
        let lines = self.choices.iter();
        let lines: String = lines
            .map(|choice| format!("  {:14}{}\n", choice.name, choice.about))
            .collect();
        format!(
            "{}\n\nusage: {} {} [options]; each {} explains itself by --help\n\n{lines}\n{}",
            self.about, self.invocation, self.word, self.word, self.notes
        )
    }
}

#[cfg(test)]
mod tests {
    use super::{Choice, Menu};
    use std::ffi::{OsStr, OsString};
    use std::process::ExitCode;

    static MENU: Menu = Menu {
        invocation: "./scripts/cook",
        word: "DISH",
        about: "Cooks.",
        choices: &[
            Choice {
                name: "soup",
                about: "hot",
                work: |words| ExitCode::from(u8::try_from(words.len()).unwrap()),
            },
            Choice {
                name: "salad",
                about: "cold",
                work: |_| ExitCode::SUCCESS,
            },
        ],
        notes: "Hot.\n",
    };

    #[test]
    fn a_word_gets_those_after_it() {
        let words = ["soup", "--help", "x"].map(OsString::from);
        assert_eq!(MENU.run(&words), ExitCode::from(2));
    }

    #[test]
    fn the_words_are_listed_and_an_unknown_one_is_named_with_the_nearest_or_with_all() {
        let refusal = |word| MENU.choose(OsStr::new(word)).unwrap_err();
        let all = "give one of soup, salad, and see ./scripts/cook --help";
        let steak = format!("unknown DISH `steak-tartare`; {all}");
        assert_eq!(refusal("sop"), "unknown DISH `sop`; did you mean `soup`?");
        assert_eq!(refusal("steak-tartare"), steak);
        assert_eq!(refusal("--hot"), format!("unknown option `--hot`; {all}"));
        let help = "Cooks.\n\nusage: ./scripts/cook DISH [options]; each DISH explains itself by \
                    --help\n\n  soup          hot\n  salad         cold\n\nHot.\n";
        assert_eq!(MENU.help(), help);
    }
}
