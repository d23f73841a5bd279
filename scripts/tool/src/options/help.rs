//! The help text, made from the table that is also what is accepted.

use super::{Command, Opt, Takes};
use std::fmt::Write;

/// The column at which the sentences of the options begin.
const TEXT_COLUMN: usize = 26;

/// The width that the sentences are broken to.
const WIDTH: usize = 80;

impl Command {
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

impl Opt {
    fn heading(&self) -> String {
        let short = match self.short {
            Some(short) => format!("-{short}, "),
            None => "    ".into(),
        };
        let value = match self.takes.name() {
            "" => "",
            value => &format!(" {value}"),
        };
        format!("{short}--{}{value}", self.name)
    }

    fn sentence(&self) -> String {
        let mut parts = Vec::new();
        match self.takes {
            Takes::Number { least, most } | Takes::Numbers { least, most } => {
                // A bound that no one can reach would only be noise.
                if most == u64::MAX {
                    parts.push(format!("from {least}"));
                } else {
                    parts.push(format!("{least} to {most}"));
                }
            }
            Takes::OneOf(words) => parts.push(words.join(" | ")),
            Takes::Nothing | Takes::Text(_) | Takes::File(_) => {}
        }
        if !self.default.is_empty() {
            parts.push(format!("default {}", self.default));
        }
        if parts.is_empty() {
            return self.help.into();
        }
        format!("{} [{}]", self.help, parts.join("; "))
    }
}

fn add_entry(text: &mut String, heading: &str, sentence: &str) {
    let mut line = format!("  {heading}");
    if line.len() + 2 > TEXT_COLUMN {
        let _ = writeln!(text, "{line}");
        line.clear();
    }
    line = format!("{line:TEXT_COLUMN$}");
    for word in sentence.split_whitespace() {
        if line.len() + word.len() > WIDTH {
            let _ = writeln!(text, "{}", line.trim_end());
            line = " ".repeat(TEXT_COLUMN);
        }
        line.push_str(word);
        line.push(' ');
    }
    let _ = writeln!(text, "{}", line.trim_end());
}
