//! Command lines, described by a table and read by one function.
//!
//! A [`Command`] lists its [`Opt`]ions; the table is the whole truth: what is
//! accepted, the range of each value, the default, and the text of `--help`
//! all come from it. An option is written `--name value` or `--name=value`,
//! a *flag* takes no value, and a *positional* is any word that is no option.
//!
//! Whatever is not in the table is refused with one line that names it, says
//! what is allowed and, where a name is near, suggests it. Nothing is guessed
//! and nothing is done before the whole line is understood.
//!
//! Words come as the system hands them over, and need not be text. The name of a file
//! may be anything; every other word must be UTF-8.

mod menu;
mod option;
mod parsed;

use std::ffi::{OsStr, OsString};
use std::fmt::Write;
use std::os::unix::ffi::OsStrExt;
use std::process::ExitCode;

use replay::shown::{quoted, visible};

pub use menu::{Choice, Menu, choices};
pub(crate) use option::options;
pub use option::{Opt, Takes};
pub use parsed::Parsed;
pub use sched_dag::nearest;

/// The exit code of a run that a person has ended before its time, as a shell has it for ctrl-C.
pub(crate) const BY_PERSON: u8 = 130;

/// A subcommand of the tool.
#[derive(Debug)]
pub struct Command {
    /// What the person types, such as `./scripts/run`.
    pub invocation: &'static str,
    /// One sentence on what it does.
    pub about: &'static str,
    /// The positional words it takes, if any, and their help. One word, or any
    /// number if the name that stands for it ends in `...`.
    pub positional: Option<(Takes, &'static str)>,
    /// The options, in the order of the help text.
    pub options: &'static [Opt],
    /// What else the help text says, after the options.
    pub notes: &'static str,
}

/// Why a command's work has come to nothing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// The person wants to be shown this help text instead.
    Help(String),
    /// The command line, or a file that it names, is at fault: exit code 2.
    Usage(String),
    /// Something else is: exit code 1.
    Failure(String),
    /// A person has ended a run before others that were to follow: exit code 130.
    ByPerson,
}

impl From<String> for Refusal {
    fn from(lines: String) -> Refusal {
        Refusal::Failure(lines)
    }
}

impl Refusal {
    /// Says to a person why nothing has come of this invocation, and returns its exit code.
    fn end(self, invocation: &str) -> ExitCode {
        let (lines, code) = match self {
            Refusal::Help(text) => {
                print!("{text}");
                return ExitCode::SUCCESS;
            }
            Refusal::Usage(lines) => (lines, 2),
            Refusal::Failure(lines) => (lines, 1),
            Refusal::ByPerson => (String::new(), BY_PERSON),
        };
        complain(invocation, &lines);
        ExitCode::from(code)
    }
}

/// Says lines under a command's name. What they repeat of files and of words must
/// not rewrite a terminal.
fn complain(invocation: &str, lines: &str) {
    let name = invocation.trim_start_matches("./scripts/");
    (lines.lines()).for_each(|line| eprintln!("{name}: {}", visible(line)));
}

impl Command {
    /// Does the work that a command line asks for, and returns the exit code. Help, and what is
    /// refused, or failed, is shown here.
    pub(crate) fn carry_out(
        &self,
        words: &[OsString],
        work: impl FnOnce(&Parsed) -> Result<ExitCode, Refusal>,
    ) -> ExitCode {
        let done = self.parse(words).and_then(|options| work(&options));
        done.unwrap_or_else(|refusal| refusal.end(self.invocation))
    }

    /// Says why the command line, or a file that it names, is refused, each line under
    /// the command's name, and returns the exit code for it.
    pub fn refuse(&self, lines: &str) -> ExitCode {
        Refusal::Usage(lines.into()).end(self.invocation)
    }

    /// Says what failed, as [`refuse`](Self::refuse), and returns the exit code for it.
    pub fn fail(&self, lines: &str) -> ExitCode {
        Refusal::Failure(lines.into()).end(self.invocation)
    }

    /// Says lines under the command's name.
    pub(crate) fn complain(&self, lines: &str) {
        complain(self.invocation, lines);
    }

    /// Returns the options of a command line that is right, for tests.
    #[cfg(test)]
    pub(crate) fn right(&self, line: &str) -> Parsed {
        let words: Vec<OsString> = line.split_whitespace().map(OsString::from).collect();
        let parsed = self.parse(&words);
        parsed.unwrap_or_else(|refusal| panic!("`{line}` gave {refusal:?}"))
    }

    /// Reads a command line (without the program's and the command's name).
    ///
    /// # Errors
    ///
    /// The first word that the table does not allow, or the help text if that is asked for.
    pub fn parse(&self, words: &[OsString]) -> Result<Parsed, Refusal> {
        let mut parsed = Parsed::new(self.options);
        let mut words = words.iter().map(OsString::as_os_str).peekable();
        while let Some(word) = words.next() {
            if word == "--help" || word == "-h" {
                return Err(Refusal::Help(self.help()));
            }
            if !word.as_bytes().starts_with(b"-") || word == "-" {
                self.take_positional(&mut parsed, word)?;
                continue;
            }
            let (name, attached) = split(word);
            let option = self.find(name, attached)?;
            let name = option.name;
            if parsed.is_given(name) {
                let line = format!("option `--{name}` stands twice; give it once");
                return Err(Refusal::Usage(line));
            }
            let value = match (option.takes, attached) {
                (Takes::Nothing, None) => OsStr::new("yes"),
                (Takes::Nothing, Some(_)) => return Err(takes_no_value(name)),
                (_, Some(value)) => value,
                // What looks like an option is meant as one.
                (_, None) => words
                    .next_if(|next| !self.is_option(next))
                    .ok_or_else(|| Refusal::Usage(option.missing(words.peek().is_some())))?,
            };
            option.check(value).map_err(Refusal::Usage)?;
            parsed.take(name, value);
        }
        Ok(parsed)
    }

    fn take_positional(&self, parsed: &mut Parsed, word: &OsStr) -> Result<(), Refusal> {
        let shown = quoted(&word.to_string_lossy()).to_string();
        let Some((takes, _)) = self.positional else {
            return Err(Refusal::Usage(format!(
                "unknown word {shown}; options begin with `--`, see {} --help",
                self.invocation
            )));
        };
        let name = takes.name();
        if let Some(first) = parsed.files().next()
            && !name.ends_with("...")
        {
            return Err(Refusal::Usage(format!(
                "{shown}: only one {name} is allowed, and {} is one",
                quoted(&first.to_string_lossy())
            )));
        }
        if matches!(takes, Takes::Text(_)) && word.to_str().is_none() {
            return Err(Refusal::Usage(format!(
                "{shown}: a {name} must be UTF-8 text; write it so"
            )));
        }
        parsed.take_positional(word);
        Ok(())
    }

    /// Reports whether a word begins as an option does, or is the short form of one.
    fn is_option(&self, word: &OsStr) -> bool {
        let is_short = |name: &str| self.named(name).is_some();
        word.as_bytes().starts_with(b"--") || word.to_str().is_some_and(is_short)
    }

    fn named(&self, name: &str) -> Option<&'static Opt> {
        self.options
            .iter()
            .find(|option| match name.strip_prefix("--") {
                Some(long) => option.name == long,
                None => (option.short)
                    .is_some_and(|short| name.strip_prefix('-') == Some(&*short.to_string())),
            })
    }

    /// Finds the option of this name, to which this value is attached.
    fn find(&self, name: &OsStr, attached: Option<&OsStr>) -> Result<&'static Opt, Refusal> {
        let name = name.to_string_lossy();
        if attached.is_some() && (name == "--help" || name == "-h") {
            return Err(takes_no_value("help"));
        }
        self.named(&name).ok_or_else(|| {
            let names = self.options.iter().map(|option| option.name);
            let allowed = names.chain(["help"]).collect::<Vec<_>>();
            let hint = match nearest(name.trim_start_matches('-'), &allowed) {
                Some(near) => format!("did you mean `--{near}`?"),
                None => format!("allowed are --{}", allowed.join(", --")),
            };
            Refusal::Usage(format!("unknown option {}; {hint}", quoted(&name)))
        })
    }

    /// Returns the help text, ending in a newline.
    #[must_use]
    pub fn help(&self) -> String {
        let mut text = String::new();
        let positional = match self.positional {
            Some((takes, _)) => format!(" [{}]", takes.name()),
            None => String::new(),
        };
        // Writing into a `String` cannot fail.
        let _ = writeln!(text, "{}\n", self.about);
        let _ = writeln!(text, "usage: {}{positional} [options]\n", self.invocation);
        if let Some((takes, help)) = self.positional {
            add_entry(&mut text, takes.name(), help);
        }
        for option in self.options {
            add_entry(&mut text, &option.heading(), &option.sentence());
        }
        add_entry(&mut text, "-h, --help", "Show this text.");
        if !self.notes.is_empty() {
            let _ = writeln!(text, "\n{}", self.notes.trim_end());
        }
        text
    }
}

/// Adds an entry to a help text: the sentence begins at a column, and is broken to a width.
fn add_entry(text: &mut String, heading: &str, sentence: &str) {
    const COLUMN: usize = 26;
    const WIDTH: usize = 80;
    let mut line = format!("  {heading}");
    if line.len() + 2 > COLUMN {
        let _ = writeln!(text, "{line}");
        line.clear();
    }
    line = format!("{line:COLUMN$}");
    for word in sentence.split_whitespace() {
        if line.len() + word.len() > WIDTH {
            let _ = writeln!(text, "{}", line.trim_end());
            line = " ".repeat(COLUMN);
        }
        line.push_str(word);
        line.push(' ');
    }
    let _ = writeln!(text, "{}", line.trim_end());
}

fn takes_no_value(name: &str) -> Refusal {
    Refusal::Usage(format!("option `--{name}` takes no value; write it alone"))
}

/// Splits a word into the name of an option and the value attached by `=`.
fn split(word: &OsStr) -> (&OsStr, Option<&OsStr>) {
    let mut parts = word.as_bytes().splitn(2, |byte| *byte == b'=');
    let name = parts.next().unwrap_or_default();
    (OsStr::from_bytes(name), parts.next().map(OsStr::from_bytes))
}

#[cfg(test)]
mod tests;
