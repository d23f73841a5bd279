//! Describes command lines by a table, and reads them all with the same function.
//!
//! A [`Command`] lists its [`Opt`]ions. This table decides everything: the accepted options, the
//! range of each value, the default, and the text of `--help`. An option is written `--name value`
//! or `--name=value`, a *flag* takes no value, and a *positional* is any word other than an option.
//!
//! A word missing from the table is refused with a single line. The line names the word, says what
//! is allowed and suggests a similar name, if there is one. The tool guesses nothing and does
//! nothing before it has understood the whole line.
//!
//! Words come as bytes of the operating system and need not be text. The name of a file may be
//! anything; every other word must be UTF-8. A fully checked command line becomes [`CommandLine`].

mod menu;

use std::collections::BTreeMap;
use std::ffi::{OsStr, OsString};
use std::fmt::{self, Write};
use std::ops::RangeInclusive;
use std::os::unix::ffi::OsStrExt;
use std::path::Path;
use std::process::ExitCode;
use std::str::{self, FromStr};

use text::{quoted, shown, visible};

use crate::files::NamedFile;

pub use menu::{MenuChoice, WordMenu, choices};
pub use sched_dag::nearest;

/// The exit code of a run ended early by a person, equal to a shell's exit code for ctrl-C.
pub(crate) const BY_PERSON: u8 = 130;

/// A subcommand of the tool.
pub struct Command {
    /// The command as a person types it, such as `./scripts/run`.
    pub invocation: &'static str,
    /// One sentence describing the command.
    pub about: &'static str,
    /// The positional words, if any are allowed, and their help: a single word, or any number of
    /// words if the placeholder ends in `...`.
    pub positional: Option<(ValueKind, &'static str)>,
    /// The options, in the order of the help text.
    pub options: &'static [Opt],
    /// Further text of the help, after the options.
    pub notes: &'static str,
}

/// Why a command did not do its work.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// The help text that the person asked for.
    Help(String),
    /// The command line, or a file named there, is at fault: exit code 2.
    Usage(String),
    /// Another failure: exit code 1.
    Failure(String),
    /// A person has ended a run before the rest of its series: exit code 130.
    ByPerson,
}

impl From<String> for Refusal {
    fn from(lines: String) -> Refusal {
        Refusal::Failure(lines)
    }
}

impl Refusal {
    /// Prints the reason under the command's name and returns its exit code.
    fn report(self, invocation: &str) -> ExitCode {
        let (lines, code) = match self {
            Refusal::Help(text) => {
                print!("{text}");
                return ExitCode::SUCCESS;
            }
            Refusal::Usage(lines) => (lines, 2),
            Refusal::Failure(lines) => (lines, 1),
            Refusal::ByPerson => (String::new(), BY_PERSON),
        };
        // The scripts have short names; the prefix would only lengthen each line.
        let name = invocation.trim_start_matches("./scripts/");
        // Text from files and command lines must not rewrite a terminal.
        (lines.lines()).for_each(|line| eprintln!("{name}: {}", visible(line)));
        ExitCode::from(code)
    }
}

impl Command {
    /// Parses a command line, runs `work` with the result, and returns the exit code. Prints help,
    /// refusals and failures.
    pub fn carry_out(
        &self,
        words: &[OsString],
        work: impl FnOnce(&CommandLine) -> Result<ExitCode, Refusal>,
    ) -> ExitCode {
        let done = self.parse(words).and_then(|options| work(&options));
        done.unwrap_or_else(|refusal| self.report(refusal))
    }

    /// Prints why the command did not do its work, with the command's name before each line.
    /// Returns the exit code.
    pub(crate) fn report(&self, refusal: Refusal) -> ExitCode {
        refusal.report(self.invocation)
    }

    /// Reads the words of a command line after the names of the program and the command.
    ///
    /// # Errors
    ///
    /// The first word not allowed by the table; or the help text, if the line asks for help.
    pub fn parse(&self, words: &[OsString]) -> Result<CommandLine, Refusal> {
        let mut parsed = CommandLine {
            options: self.options,
            given: BTreeMap::new(),
            positionals: Vec::new(),
        };
        let mut words = words.iter().map(OsString::as_os_str).peekable();
        while let Some(word) = words.next() {
            if word == "--help" || word == "-h" {
                return Err(Refusal::Help(self.help()));
            }
            // A lone `-` is a positional word: by custom it means standard input or output.
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
                (ValueKind::Nothing, None) => OsStr::new("yes"),
                (ValueKind::Nothing, Some(_)) => return Err(takes_no_value(name.as_str())),
                (_, Some(value)) => value,
                // An option is no value: the person forgot the value.
                (_, None) => words
                    .next_if(|next| !self.is_option(next))
                    .ok_or_else(|| Refusal::Usage(option.missing(words.peek().is_some())))?,
            };
            option.check(value).map_err(Refusal::Usage)?;
            parsed.given.insert(name, value.into());
        }
        Ok(parsed)
    }

    fn take_positional(&self, parsed: &mut CommandLine, word: &OsStr) -> Result<(), Refusal> {
        let shown = quoted(&word.to_string_lossy()).to_string();
        let Some((takes, _)) = self.positional else {
            return Err(Refusal::Usage(format!(
                "unknown word {shown}; options begin with `--`, see {} --help",
                self.invocation
            )));
        };
        let name = takes.name();
        // Positional words are stored as files whatever their type, so this finds the first word.
        if let Some(first) = parsed.files().next()
            && !name.ends_with("...")
        {
            return Err(Refusal::Usage(format!(
                "{shown}: only one {name} is allowed, and {} is one",
                quoted(&first.to_string_lossy())
            )));
        }
        if matches!(takes, ValueKind::Text(_)) && word.to_str().is_none() {
            return Err(Refusal::Usage(format!(
                "{shown}: a {name} must be UTF-8 text; write it so"
            )));
        }
        parsed.positionals.push(word.into());
        Ok(())
    }

    /// Reports whether a word begins like an option, or is the short form of an option.
    fn is_option(&self, word: &OsStr) -> bool {
        let is_short = |name: &str| self.named(name).is_some();
        word.as_bytes().starts_with(b"--") || word.to_str().is_some_and(is_short)
    }

    fn named(&self, name: &str) -> Option<&'static Opt> {
        self.options
            .iter()
            .find(|option| match name.strip_prefix("--") {
                Some(long) => option.name.as_str() == long,
                None => (option.short)
                    .is_some_and(|short| name.strip_prefix('-') == Some(&*short.to_string())),
            })
    }

    /// Finds the option with this name; `attached` is the value after its `=`, if any.
    fn find(&self, name: &OsStr, attached: Option<&OsStr>) -> Result<&'static Opt, Refusal> {
        // A name that is not UTF-8 cannot match an option, so the lossy form serves only the
        // message.
        let name = name.to_string_lossy();
        if attached.is_some() && (name == "--help" || name == "-h") {
            return Err(takes_no_value("help"));
        }
        self.named(&name).ok_or_else(|| {
            let names = self.options.iter().map(|option| option.name.as_str());
            let allowed = names.chain(["help"]).collect::<Vec<_>>();
            // Both are compared without dashes: `-jobs` is most often a mistyped `--jobs`.
            let hint = match nearest(name.trim_start_matches('-'), &allowed) {
                Some(near) => format!("did you mean `--{near}`?"),
                None => format!("allowed are --{}", allowed.join(", --")),
            };
            Refusal::Usage(format!("unknown option {}; {hint}", quoted(&name)))
        })
    }

    /// Returns the help text, ending in a newline.
    pub fn help(&self) -> String {
        let mut text = String::new();
        let positional = match self.positional {
            Some((takes, _)) => format!(" [{}]", takes.name()),
            None => String::new(),
        };
        // Writing into a `String` cannot fail.
        let _ = writeln!(text, "{}\n", self.about);
        let _ = writeln!(text, "usage: {}{positional} [options]\n", self.invocation);
        // The column of group names is as wide as the longest name; without groups there is no such
        // column.
        let groups = self.options.iter().map(|option| option.group.len());
        let indent = groups.max().filter(|longest| *longest > 0);
        // Two blanks separate the longest group name from the headings.
        let indent = indent.map_or(0, |longest| longest + 2);
        let mut add = |group: &str, heading: &str, sentence: &str| {
            add_entry(
                &mut text,
                &format!("  {group:indent$}{heading}"),
                26 + indent,
                sentence,
            );
        };
        if let Some((takes, help)) = self.positional {
            add("", takes.name(), help);
        }
        for option in self.options {
            add(option.group, &option.heading(), &option.sentence());
        }
        add("", "-h, --help", "Show this text.");
        if !self.notes.is_empty() {
            let _ = writeln!(text, "\n{}", self.notes.trim_end());
        }
        text
    }
}

/// Adds an entry to a help text: the sentence starts at `column` and wraps after 54 characters.
fn add_entry(text: &mut String, heading: &str, column: usize, sentence: &str) {
    const WIDTH: usize = 54;
    let mut line = heading.to_string();
    // A heading that is too long gets a line of its own, to keep the sentences aligned.
    if line.len() + 2 > column {
        let _ = writeln!(text, "{line}");
        line.clear();
    }
    line = format!("{line:column$}");
    for word in sentence.split_whitespace() {
        if line.len() + word.len() > column + WIDTH {
            let _ = writeln!(text, "{}", line.trim_end());
            line = " ".repeat(column);
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
    // Only the first `=` splits: a value such as `gain=0.5` may contain more.
    let mut parts = word.as_bytes().splitn(2, |byte| *byte == b'=');
    let name = parts.next().unwrap_or_default();
    (OsStr::from_bytes(name), parts.next().map(OsStr::from_bytes))
}

/// The name of an option, without its dashes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct OptionName(&'static str);

impl OptionName {
    /// Makes the name of an option, in ASCII; empty for a positional word.
    pub const fn new(name: &'static [u8]) -> OptionName {
        match str::from_utf8(name) {
            Ok(name) => OptionName(name),
            Err(_) => OptionName(""),
        }
    }

    /// Returns the name as a person types it after the dashes.
    pub const fn as_str(self) -> &'static str {
        self.0
    }
}

impl fmt::Display for OptionName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.0)
    }
}

/// Turns the name of an option's constant into the option's name: small letters, and `-` for `_`.
pub const fn typed<const LENGTH: usize>(constant: &str) -> [u8; LENGTH] {
    let mut name = [b'-'; LENGTH];
    let mut at = 0;
    while at < LENGTH {
        if constant.as_bytes()[at] != b'_' {
            name[at] = constant.as_bytes()[at].to_ascii_lowercase();
        }
        at += 1;
    }
    name
}

/// One option of a command.
#[derive(Clone, Copy, Debug)]
pub struct Opt {
    /// The long name.
    pub name: OptionName,
    /// The short form without its dash, such as `q`.
    pub short: Option<char>,
    /// The kind of value after the option.
    pub takes: ValueKind,
    /// The value of an omitted option; empty for none.
    pub default: &'static str,
    /// One sentence for the help text.
    pub help: &'static str,
    /// The name of the group started by this option in the help text; empty for none.
    pub group: &'static str,
}

/// Makes the options of a [`Command`], as the constant `OPTIONS`, and their names, as constants of
/// a module `name`; so a look-up of an unknown option does not compile. The doc comment of each
/// option is its help sentence. Then come the name, optionally a short form, `in` with the group
/// started here, a colon, the kind of value, and `or` with the default.
#[macro_export]
macro_rules! options {
    ($(
        $(#[doc = $help:literal])+
        $name:ident $($short:literal)? $(in $group:literal)?: $takes:expr $(, or $default:expr)?;
    )*) => {
        /// The names of the options.
        pub(crate) mod name {
            use $crate::options::{OptionName, typed};
            $(
                $(#[doc = $help])+
                pub(crate) const $name: OptionName = {
                    const NAME: &[u8] = &typed::<{ stringify!($name).len() }>(stringify!($name));
                    OptionName::new(NAME)
                };
            )*
        }

        pub(crate) const OPTIONS: &[$crate::options::Opt] = &[$(
            $crate::options::Opt {
                name: name::$name,
                takes: $takes,
                help: concat!($($help),+),
                $(short: Some($short),)?
                $(group: $group,)?
                $(default: $default,)?
                ..$crate::options::Opt::FLAG
            }
        ),*];
    };
}
pub use options;

/// The kind of value that an option takes.
#[derive(Clone, Copy, Debug)]
pub enum ValueKind {
    /// Nothing: the option is a flag.
    Nothing,
    /// A decimal number, from the first bound to the second, inclusive.
    Number(u64, u64),
    /// One or more such numbers, with commas between.
    Numbers(u64, u64),
    /// One of these words.
    OneOf(&'static [&'static str]),
    /// Any text; the word is its placeholder in the help text.
    Text(&'static str),
    /// The name of a file or folder, of any bytes; the word is its placeholder in the help text.
    File(&'static str),
}

impl ValueKind {
    /// Returns the placeholder of a value in the help text; empty for a flag.
    const fn name(self) -> &'static str {
        match self {
            ValueKind::Nothing => "",
            ValueKind::Number(..) => "N",
            ValueKind::Numbers(..) => "N,N,...",
            ValueKind::OneOf(_) => "WORD",
            ValueKind::Text(what) | ValueKind::File(what) => what,
        }
    }

    /// Describes the allowed values in words.
    fn allowed(self) -> String {
        match self {
            ValueKind::Nothing => "nothing".into(),
            ValueKind::Number(least, most) => format!("a number from {least} to {most}"),
            ValueKind::Numbers(least, most) => {
                format!("numbers from {least} to {most} with commas between")
            }
            ValueKind::OneOf(words) => format!("one of {}", words.join(", ")),
            ValueKind::Text(what) | ValueKind::File(what) => {
                format!("a {}", what.to_lowercase())
            }
        }
    }
}

impl Opt {
    /// A flag without a name, the base of all other options.
    pub const FLAG: Opt = Opt {
        name: OptionName(""),
        short: None,
        takes: ValueKind::Nothing,
        default: "",
        help: "",
        group: "",
    };

    /// Checks a value against the option's kind of value.
    fn check(&self, value: &OsStr) -> Result<(), String> {
        let text = value.to_str();
        let valid = match (self.takes, text) {
            (ValueKind::Nothing, _) => true,
            // A file name may be any bytes; only an empty name, from `--name=`, is a mistake.
            (ValueKind::File(_), _) => !value.is_empty(),
            // All other values are text.
            (_, None) => false,
            (ValueKind::Number(least, most), Some(text)) => is_number(text, least..=most),
            (ValueKind::Numbers(least, most), Some(text)) => {
                text.split(',').all(|text| is_number(text, least..=most))
            }
            (ValueKind::OneOf(words), Some(text)) => words.contains(&text),
            (ValueKind::Text(_), Some(text)) => !text.is_empty(),
        };
        if valid {
            return Ok(());
        }
        let mut must = format!("must be {}", self.takes.allowed());
        match (self.takes, text) {
            (_, None) => must = format!("is not UTF-8 text; {must}"),
            (ValueKind::OneOf(words), Some(text)) => {
                must += &did_you_mean(text, words);
            }
            _ => {}
        }
        let value = value.to_string_lossy();
        Err(format!("`--{} {}`: {must}", self.name, shown(&value)))
    }

    /// Describes the missing value of an option. If an option follows, the person may have meant it
    /// as the value; then the message says how to attach it.
    fn missing(&self, is_followed: bool) -> String {
        let (name, allowed) = (self.name, self.takes.allowed());
        let remedy = match (self.takes, is_followed) {
            (ValueKind::Text(_) | ValueKind::File(_), true) => {
                format!("; one that begins with `-` is written `--{name}=VALUE`")
            }
            _ => String::new(),
        };
        format!("option `--{name}` lacks its value: {allowed}{remedy}")
    }

    /// Returns the option as written in the help text.
    fn heading(&self) -> String {
        let short = self.short.map(|short| format!("-{short}, "));
        let heading = format!(
            "{:4}--{} {}",
            short.unwrap_or_default(),
            self.name,
            self.takes.name()
        );
        heading.trim_end().into()
    }

    /// Returns the option's sentence for the help text, with the allowed values and the default.
    fn sentence(&self) -> String {
        let mut parts = Vec::new();
        match self.takes {
            // `u64::MAX` means "no upper bound"; printing it would only be noise.
            ValueKind::Number(least, most) | ValueKind::Numbers(least, most) => {
                parts.push(match most {
                    u64::MAX => format!("from {least}"),
                    most => format!("{least} to {most}"),
                })
            }
            ValueKind::OneOf(words) => parts.push(words.join(" | ")),
            ValueKind::Nothing | ValueKind::Text(_) | ValueKind::File(_) => {}
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

/// Returns a semicolon and the question whether the most similar name was meant; empty if none is
/// similar.
pub(crate) fn did_you_mean(name: &str, names: &[&str]) -> String {
    nearest(name, names).map_or(String::new(), |near| format!("; did you mean `{near}`?"))
}

fn is_number(text: &str, range: RangeInclusive<u64>) -> bool {
    // `parse` alone would let `+1` pass.
    let is_plain = text.bytes().all(|byte| byte.is_ascii_digit());
    is_plain && text.parse().is_ok_and(|number| range.contains(&number))
}

/// A parsed and checked command line.
#[derive(Clone, Debug)]
pub struct CommandLine {
    options: &'static [Opt],
    given: BTreeMap<OptionName, OsString>,
    positionals: Vec<OsString>,
}

impl CommandLine {
    /// Returns whether the person gave the option (or flag).
    pub fn is_given(&self, name: OptionName) -> bool {
        self.given.contains_key(&name)
    }

    fn value(&self, name: OptionName) -> Option<&OsStr> {
        if let Some(given) = self.given.get(&name) {
            return Some(given);
        }
        let option = self.options.iter().find(|option| option.name == name)?;
        (!option.default.is_empty()).then(|| OsStr::new(option.default))
    }

    /// Returns the option's value or default; `None` if it has neither. For an option that takes a
    /// file, call [`path`](Self::path) instead.
    pub fn text(&self, name: OptionName) -> Option<&str> {
        self.value(name).and_then(OsStr::to_str)
    }

    /// Returns the file named by an option, or its default; `None` if it has neither.
    pub fn path(&self, name: OptionName) -> Option<&Path> {
        self.value(name).map(Path::new)
    }

    /// Returns the files named by these options, skipping options without a value or default.
    pub fn named(&self, options: &[OptionName]) -> Vec<NamedFile<'_>> {
        let named = options.iter().filter_map(|option| {
            let path = self.path(*option)?;
            let option = option.as_str();
            Some(NamedFile { option, path })
        });
        named.collect()
    }

    /// Returns the number given with an option, or its default; `None` if it has neither.
    pub fn number(&self, name: OptionName) -> Option<u64> {
        self.text(name).and_then(|value| value.parse().ok())
    }

    /// Returns the numbers given with an option, or its default; empty if it has neither.
    pub fn numbers<N: FromStr>(&self, name: OptionName) -> Vec<N> {
        let words = self.text(name).into_iter().flat_map(|all| all.split(','));
        words.filter_map(|word| word.parse().ok()).collect()
    }

    /// Makes sure that no comma-separated list of these options repeats a value.
    ///
    /// # Errors
    ///
    /// In words, with the option and the value.
    pub fn check_distinct(&self, options: &[OptionName]) -> Result<(), String> {
        for option in options {
            let mut before = Vec::new();
            for value in self.text(*option).iter().flat_map(|all| all.split(',')) {
                if before.contains(&value) {
                    let value = quoted(value);
                    return Err(format!("`--{option}`: {value} stands twice; give it once"));
                }
                // A list on a command line is short, so a search through it will do.
                before.push(value);
            }
        }
        Ok(())
    }

    /// Makes sure that at most one option of each pair is given.
    ///
    /// # Errors
    ///
    /// In words, with both names and the third text of the pair, such as "exclude each other".
    pub fn check_apart(&self, pairs: &[(OptionName, OptionName, &str)]) -> Result<(), String> {
        let both = |(one, other, _): &&(OptionName, OptionName, &str)| {
            self.is_given(*one) && self.is_given(*other)
        };
        match pairs.iter().find(both) {
            Some((one, other, do_what)) => {
                Err(format!("`--{one}` and `--{other}` {do_what}; give one"))
            }
            None => Ok(()),
        }
    }

    /// Makes sure that none of these options is given.
    ///
    /// # Errors
    ///
    /// The name of a given option, followed by `why`.
    pub fn check_without(&self, names: &[OptionName], why: &str) -> Result<(), String> {
        let given = self.given_of(names);
        given.map_or(Ok(()), |name| Err(format!("`--{name}` {why}")))
    }

    /// Returns the first of these options that is given.
    pub fn given_of(&self, names: &[OptionName]) -> Option<OptionName> {
        names.iter().copied().find(|name| self.is_given(*name))
    }

    /// Returns a copy of the command line with another value of an option.
    pub fn with(&self, name: OptionName, value: impl AsRef<OsStr>) -> CommandLine {
        let mut other = self.clone();
        other.given.insert(name, value.as_ref().into());
        other
    }

    /// Returns the first positional word, if one was given.
    pub fn positional(&self) -> Option<&str> {
        self.positionals.first().and_then(|word| word.to_str())
    }

    /// Returns the first positional word as a file.
    ///
    /// # Errors
    ///
    /// The `question`, if there is no such word.
    pub fn file(&self, question: &str) -> Result<NamedFile<'_>, String> {
        let path = self.files().next().ok_or(question)?;
        Ok(NamedFile { option: "", path })
    }

    /// Returns the files named by the positional words.
    pub fn files(&self) -> impl ExactSizeIterator<Item = &Path> + Clone {
        self.positionals.iter().map(Path::new)
    }
}

#[cfg(test)]
mod tests;
