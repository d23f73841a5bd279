//! From a command line to work, and to the exit code that ends the tool: the part that
//! is the same for all commands.

use std::ffi::OsString;
use std::process::ExitCode;

use replay::shown::visible;

use super::{Command, Parsed, Request};

/// The exit code of a run that a person has ended before its time, as a shell has it for ctrl-C.
pub(crate) const BY_PERSON: u8 = 130;

/// Why a command's work has come to nothing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Refusal {
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

impl Command {
    /// Does the work that a command line asks for, and returns the exit code. What is refused,
    /// or failed, is said here.
    pub(crate) fn carry_out(
        &self,
        words: &[OsString],
        work: impl FnOnce(&Parsed) -> Result<ExitCode, Refusal>,
    ) -> ExitCode {
        match self.read(words).map(|options| work(&options)) {
            Err(code) | Ok(Ok(code)) => code,
            Ok(Err(Refusal::Usage(lines))) => self.refuse(&lines),
            Ok(Err(Refusal::Failure(lines))) => self.fail(&lines),
            Ok(Err(Refusal::ByPerson)) => ExitCode::from(BY_PERSON),
        }
    }

    /// Returns the options that a command line gives. Help, and what is wrong with the
    /// command line, are shown here.
    ///
    /// # Errors
    ///
    /// The exit code with which the tool ends: 0 after the help text, 2 after a complaint.
    pub fn read(&self, words: &[OsString]) -> Result<Parsed, ExitCode> {
        match self.parse(words) {
            Ok(Request::Work(options)) => Ok(options),
            Ok(Request::Help(text)) => {
                print!("{text}");
                Err(ExitCode::SUCCESS)
            }
            Err(error) => Err(self.refuse(&error.0)),
        }
    }

    /// Says why the command line, or a file that it names, is refused, each line under
    /// the command's name, and returns the exit code for it.
    pub fn refuse(&self, lines: &str) -> ExitCode {
        self.complain(lines);
        ExitCode::from(2)
    }

    /// Says what failed, as [`refuse`](Self::refuse), and returns the exit code for it.
    pub fn fail(&self, lines: &str) -> ExitCode {
        self.complain(lines);
        ExitCode::FAILURE
    }

    /// Returns the options of a command line that is right, for tests.
    #[cfg(test)]
    pub(crate) fn right(&self, line: &str) -> Parsed {
        let words: Vec<OsString> = line.split_whitespace().map(OsString::from).collect();
        match self.parse(&words) {
            Ok(Request::Work(options)) => options,
            other => panic!("`{line}` gave {other:?}"),
        }
    }

    /// Says lines under the command's name. What they repeat of files and of words must
    /// not rewrite a terminal.
    pub(crate) fn complain(&self, lines: &str) {
        let name = self.invocation.trim_start_matches("./scripts/");
        (lines.lines()).for_each(|line| eprintln!("{name}: {}", visible(line)));
    }
}
