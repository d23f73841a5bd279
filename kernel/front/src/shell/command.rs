//! The commands, and the answer to anything else.

use core::fmt;

use super::Extra;

/// What a person wants.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Command<'a> {
    /// To be told the commands.
    Help,
    /// The list of DAGs.
    Dags,
    /// The counts of one DAG, or of all.
    Stats(Option<&'a str>),
    /// Events to be recorded, or not.
    Trace(bool),
    /// A DAG to rest.
    Stop(&'a str),
    /// A DAG to go on.
    Start(&'a str),
    /// The run to end.
    Shutdown,
}

/// Why a line is no command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Refusal<'a> {
    /// There is no command of this name.
    Unknown(&'a str),
    /// The command wants something else after its name.
    Wants(&'a str, &'static str),
}

/// The commands for people: how each is typed, and what it does.
pub(super) const HELP: [(&str, &str); 8] = [
    ("help", "list the commands"),
    ("dags", "list the DAGs"),
    ("stats [DAG]", "show the counts of a DAG, or of all"),
    (
        "stop DAG",
        "release no more jobs of it; those in flight finish",
    ),
    ("start DAG", "release its jobs again, from the next one due"),
    ("trace off", "forget the events so far and record no more"),
    ("trace on", "record events from now on"),
    (
        "shutdown",
        "release nothing more, wait for what is in flight, and end",
    ),
];

/// Reads a line that is not blank.
pub(super) fn parse(line: &str) -> Result<Command<'_>, Refusal<'_>> {
    let (name, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
    let rest = Some(rest.trim()).filter(|rest| !rest.is_empty());
    let alone = |command| match rest {
        None => Ok(command),
        Some(_) => Err(Refusal::Wants(name, "nothing after it")),
    };
    let dag = || {
        let what = "the name or the number of a DAG; `dags` lists them";
        rest.ok_or(Refusal::Wants(name, what))
    };
    match name {
        "help" => alone(Command::Help),
        "dags" => alone(Command::Dags),
        "stats" => Ok(Command::Stats(rest)),
        "stop" => dag().map(Command::Stop),
        "start" => dag().map(Command::Start),
        "trace" => match rest {
            Some("on") => Ok(Command::Trace(true)),
            Some("off") => Ok(Command::Trace(false)),
            _ => Err(Refusal::Wants(name, "`on` or `off`")),
        },
        "shutdown" => alone(Command::Shutdown),
        _ => Err(Refusal::Unknown(name)),
    }
}

impl<'a> Refusal<'a> {
    /// Returns what is told, where there are these commands besides.
    pub(super) fn told(self, extra: Extra) -> impl fmt::Display + 'a {
        fmt::from_fn(move |f| match self {
            Self::Unknown(name) => {
                write!(f, "`{name}` is no command; there are ")?;
                for (index, (command, _)) in HELP.iter().enumerate() {
                    let separator = if index == 0 { "" } else { ", " };
                    write!(f, "{separator}{command}")?;
                }
                let mut others = extra.iter().flatten().flat_map(|extra| extra.help());
                others.try_for_each(|(command, _)| write!(f, ", {command}"))
            }
            Self::Wants(name, what) => write!(f, "`{name}` wants {what}"),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_command_is_understood() {
        for (line, command) in [
            ("help", Command::Help),
            ("dags", Command::Dags),
            ("stats", Command::Stats(None)),
            ("stats  left eye", Command::Stats(Some("left eye"))),
            ("trace on", Command::Trace(true)),
            ("trace off", Command::Trace(false)),
            ("stop vision", Command::Stop("vision")),
            ("start 0", Command::Start("0")),
            ("shutdown", Command::Shutdown),
        ] {
            assert_eq!(parse(line), Ok(command), "{line}");
        }
    }

    #[test]
    fn each_command_of_the_help_is_one() {
        for (line, _) in HELP {
            assert!(parse(&line.replace(['[', ']'], "")).is_ok(), "{line}");
        }
    }

    #[test]
    fn what_is_no_command_is_told_the_commands() {
        let message = |line| parse(line).expect_err(line).told([None; 2]).to_string();
        assert_eq!(
            message("stpo vision"),
            "`stpo` is no command; there are help, dags, stats [DAG], stop DAG, start DAG, \
             trace off, trace on, shutdown"
        );
        assert_eq!(message("trace"), "`trace` wants `on` or `off`");
        assert_eq!(message("help me"), "`help` wants nothing after it");
        assert_eq!(
            message("stop"),
            "`stop` wants the name or the number of a DAG; `dags` lists them"
        );
    }
}
