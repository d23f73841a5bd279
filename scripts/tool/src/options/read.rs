//! From a command line to work, or to the exit code that ends the tool: the part that
//! is the same for all commands.

use std::ffi::OsString;
use std::process::ExitCode;

use replay::shown::visible;

use super::{Command, Parsed, Request};

impl Command {
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
