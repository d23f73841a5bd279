//! `--params FILE` and `--set NAME=VALUE,...`: the parameters that the guest is told.
//!
//! The guest knows the types and ranges; here only that a word can be made of it all. What
//! `--set` says comes after the file, and so prevails.

use replay::shown::{quoted, shown};

use crate::files::{self, Named};
use crate::options::{Parsed, Refusal};

/// Returns the guest's word after a blank, if one is wanted.
pub(super) fn guest_word(options: &Parsed) -> Result<String, Refusal> {
    let mut parts = Vec::new();
    if let Some(path) = options.path("params") {
        let place = files::place(path);
        let option = "params";
        let bytes = files::read_named(&Named { option, path }).map_err(Refusal::Usage)?;
        let text = String::from_utf8_lossy(&bytes);
        parts.extend(of_file(&text).map_err(|line| Refusal::Usage(format!("{place}:{line}")))?);
    }
    if let Some(text) = options.text("set") {
        for part in text.split(',') {
            let shown = shown(part);
            let why = format!("`--set {shown}`: give it as NAME=VALUE, without blanks");
            parts.push(pair(part).ok_or(Refusal::Usage(why))?);
        }
    }
    Ok(match parts.is_empty() {
        true => String::new(),
        false => format!(" set={}", parts.join(",")),
    })
}

/// Reads the lines of a file, each `NAME=VALUE`; a `#` begins a comment.
fn of_file(text: &str) -> Result<Vec<String>, String> {
    let lines = (1..).zip(text.lines()).map(|(number, line)| {
        let said = line.split('#').next().unwrap_or_default().trim();
        (number, said)
    });
    let said = lines.filter(|(_, said)| !said.is_empty());
    said.map(|(number, said)| {
        pair(said)
            .ok_or_else(|| format!("{number}: {} is not NAME=VALUE; write it so", quoted(said)))
    })
    .collect()
}

/// Returns `NAME=VALUE` without blanks around, if it is that.
fn pair(text: &str) -> Option<String> {
    let (name, value) = text.split_once('=')?;
    let parts = [name.trim(), value.trim()];
    let is_word =
        |part: &str| !part.is_empty() && !part.contains(|c: char| c.is_whitespace() || c == ',');
    let is_pair = parts.into_iter().all(is_word);
    is_pair.then(|| parts.join("="))
}

#[cfg(test)]
mod tests {
    use super::{of_file, pair};

    #[test]
    fn a_file_has_a_parameter_on_each_line_and_what_cannot_stand_in_a_word_is_none() {
        let text = "# the attitude loop\ngain = 0.5\n\nsteps=3   # few\n";
        assert_eq!(of_file(text), Ok(vec!["gain=0.5".into(), "steps=3".into()]));
        let wrong = "2: `gain 0.5` is not NAME=VALUE; write it so";
        assert_eq!(of_file("steps=3\ngain 0.5\n"), Err(wrong.into()));
        for text in "gain;=1;gain=;gain=1 2;ga in=1;gain=1,2;gain=1\n2".split(';') {
            assert_eq!(pair(text), None, "{text}");
        }
        // The value may have what the name has not.
        assert_eq!(pair("a=b=c").as_deref(), Some("a=b=c"));
    }
}
