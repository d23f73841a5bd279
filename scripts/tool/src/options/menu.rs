//! Menus of words: the first word of a command line chooses the function for the rest, as in
//! `bench WHAT` and `oracle KIND`.

use std::env;
use std::ffi::OsString;
use std::process::ExitCode;

use text::quoted;

use super::{Refusal, nearest};
use crate::output;

/// A menu of words, with its texts for `--help`.
pub struct WordMenu {
    /// The command as a person types it, such as `./scripts/bench`.
    pub invocation: &'static str,
    /// The placeholder of the word in the help text, such as `WHAT`.
    pub word: &'static str,
    /// One or more sentences describing the command.
    pub about: &'static str,
    /// The words, in the order of the help text.
    pub choices: &'static [MenuChoice],
    /// Further text of the help, after the words.
    pub notes: &'static str,
}

/// A word of a menu.
#[derive(Debug)]
pub struct MenuChoice {
    /// The word.
    pub name: &'static str,
    /// A few words for the help text.
    pub about: &'static str,
    /// The function called with the words after this word; returns the exit code.
    pub work: fn(&[OsString]) -> ExitCode,
}

/// Makes the choices of a [`WordMenu`]: each word with its help text and its function. A repeated
/// word does not compile:
///
/// ```compile_fail
/// use std::process::ExitCode;
/// use tool::options::{MenuChoice, choices};
///
/// static DISHES: &[MenuChoice] = choices! {
///     "soup": "hot", |_| ExitCode::SUCCESS;
///     "soup": "cold", |_| ExitCode::SUCCESS;
/// };
/// ```
#[macro_export]
macro_rules! choices {
    ($($name:literal: $about:literal, $work:expr;)*) => {{
        #[deny(unreachable_patterns)]
        const _: fn(&str) -> bool = |word| matches!(word, $($name)|*);
        &[$($crate::options::MenuChoice { name: $name, about: $about, work: $work }),*]
    }};
}
pub use choices;

impl WordMenu {
    /// Runs the program with this menu, in the folder from which a script was called.
    pub fn carry_out(&self) -> ExitCode {
        if let Some(folder) = env::var_os("TOOL_CALLED_IN") {
            // Set by `scripts/tool/start`. If the folder is gone, we stay in the present folder.
            let _ = env::set_current_dir(folder);
        }
        let words: Vec<OsString> = env::args_os().skip(1).collect();
        output::conclude(self.invocation, self.run(&words))
    }

    /// Runs the chosen function, shows the help text, or refuses the word with exit code 2.
    pub fn run(&self, words: &[OsString]) -> ExitCode {
        match self.choose(words) {
            Ok(choice) => (choice.work)(&words[1..]),
            Err(refusal) => refusal.report(self.invocation),
        }
    }

    fn choose(&self, words: &[OsString]) -> Result<&MenuChoice, Refusal> {
        let Some(word) = words.first() else {
            let question = format!("which {}? {}", self.word, self.remedy());
            return Err(Refusal::Usage(question));
        };
        let word = &*word.to_string_lossy();
        // Before the lookup: no choice may be called `--help`.
        if word == "--help" || word == "-h" {
            return Err(Refusal::Help(self.help()));
        }
        if let Some(choice) = self.choices.iter().find(|choice| choice.name == word) {
            return Ok(choice);
        }
        let names: Vec<&str> = self.choices.iter().map(|choice| choice.name).collect();
        // No choice begins with a dash, so a similar word would only mislead.
        let (what, near) = match word.starts_with('-') {
            true => ("option", None),
            false => (self.word, nearest(word, &names)),
        };
        let hint = near.map_or_else(|| self.remedy(), |near| format!("did you mean `{near}`?"));
        let line = format!("unknown {what} {}; {hint}", quoted(word));
        Err(Refusal::Usage(line))
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
    use super::*;

    static MENU: WordMenu = WordMenu {
        invocation: "./scripts/cook",
        word: "DISH",
        about: "Cooks.",
        choices: &[
            MenuChoice {
                name: "soup",
                about: "hot",
                work: |words| ExitCode::from(u8::try_from(words.len()).unwrap()),
            },
            MenuChoice {
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
        let refusal = |word: &str| match MENU.choose(&[word.into()]) {
            Err(Refusal::Usage(line) | Refusal::Help(line)) => line,
            other => panic!("`{word}` gave {other:?}"),
        };
        let all = "give one of soup, salad, and see ./scripts/cook --help";
        let steak = format!("unknown DISH `steak-tartare`; {all}");
        assert_eq!(refusal("sop"), "unknown DISH `sop`; did you mean `soup`?");
        assert_eq!(refusal("steak-tartare"), steak);
        assert_eq!(refusal("--hot"), format!("unknown option `--hot`; {all}"));
        let help = "Cooks.\n\nusage: ./scripts/cook DISH [options]; each DISH explains itself by \
                    --help\n\n  soup          hot\n  salad         cold\n\nHot.\n";
        assert_eq!(refusal("--help"), help);
    }
}
