//! A reader for the part of YAML that generators of DAGs write.
//!
//! It reads block mappings and block sequences, nested by indentation; scalars, plain or in quotes;
//! the empty `{}` and `[]`; comments; and the marks `---` and `...` around the one document. The
//! rest of YAML (anchors, aliases, tags, block scalars, filled flow collections, tabs) is refused
//! with its line, as are repeated keys. Nothing is guessed: a scalar stays text, and a caller that
//! wants a number parses it.

use std::collections::HashSet;

use text::{Malformed, quoted};

/// The deepest nesting that is read.
const DEEPEST: usize = 32;

/// A value and its first line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Node {
    /// The line, counted from 1.
    pub line: usize,
    /// The value.
    pub value: YamlValue,
}

/// A value.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum YamlValue {
    /// Text without its quotes; empty if there is none.
    Scalar(String),
    /// A sequence.
    Sequence(Vec<Node>),
    /// A mapping, in the order of the file.
    Mapping(Vec<(String, Node)>),
}

/// Reads the one document that `text` consists of.
///
/// # Errors
///
/// The first deviation from the description above.
pub fn parse(text: &str) -> Result<Node, Malformed> {
    let mut reader = Reader {
        lines: lines(text)?,
        next: 0,
    };
    let Some(first) = reader.lines.first() else {
        return Err(malformed(1, "the file is empty; it has no YAML document"));
    };
    let indent = first.indent;
    let node = reader.block(indent, 0)?;
    match reader.peek() {
        None => Ok(node),
        Some(line) => Err(malformed(
            line.number,
            "this line's indentation fits nothing above; align it with its siblings",
        )),
    }
}

/// A line that is not blank.
#[derive(Clone, Copy, Debug)]
struct YamlLine<'t> {
    number: usize,
    indent: usize,
    text: &'t str,
}

fn malformed(line: usize, reason: impl Into<String>) -> Malformed {
    let reason = reason.into();
    Malformed { line, reason }
}

/// Returns the lines without comments, blank lines and the document's marks.
fn lines(text: &str) -> Result<Vec<YamlLine<'_>>, Malformed> {
    let mut lines: Vec<YamlLine<'_>> = Vec::new();
    let mut has_ended = false;
    for (index, text) in text.lines().enumerate() {
        let number = index + 1;
        let content = without_comment(text).trim_end();
        let indent = content.len() - content.trim_start_matches(' ').len();
        let content = &content[indent..];
        if content.is_empty() || (content == "---" && lines.is_empty()) {
            continue;
        }
        if content.starts_with('\t') {
            return Err(malformed(number, "a tab indents this line; use blanks"));
        }
        if content == "---" || has_ended {
            return Err(malformed(
                number,
                "a second document begins here; give one a file",
            ));
        }
        if content == "..." {
            has_ended = true;
            continue;
        }
        lines.push(YamlLine {
            number,
            indent,
            text: content,
        });
    }
    Ok(lines)
}

/// Cuts off a comment: a `#` at the beginning or after a blank, outside quotes.
fn without_comment(text: &str) -> &str {
    if !text.contains('#') {
        return text;
    }
    let mut quote = None;
    let mut before = ' ';
    for (at, character) in text.char_indices() {
        match quote {
            Some(open) if character == open && before != '\\' => quote = None,
            Some(_) => {}
            // In the middle of a word an apostrophe opens no quote.
            None if matches!(character, '"' | '\'') && " :-".contains(before) => {
                quote = Some(character);
            }
            None if character == '#' && before.is_whitespace() => return &text[..at],
            None => {}
        }
        before = character;
    }
    text
}

struct Reader<'t> {
    lines: Vec<YamlLine<'t>>,
    next: usize,
}

impl<'t> Reader<'t> {
    fn peek(&self) -> Option<&YamlLine<'t>> {
        self.lines.get(self.next)
    }

    /// Returns the next line if it has this indentation.
    fn sibling(&self, indent: usize) -> Option<YamlLine<'t>> {
        self.peek().filter(|line| line.indent == indent).copied()
    }

    /// Reads the collection or scalar that begins with the next line.
    fn block(&mut self, indent: usize, depth: usize) -> Result<Node, Malformed> {
        let Some(line) = self.sibling(indent) else {
            return Err(malformed(1, "there is nothing to read"));
        };
        // A recursion without a limit would overflow the stack on hostile input.
        if depth > DEEPEST {
            let reason = format!("this is nested more than {DEEPEST} levels deep");
            return Err(malformed(line.number, reason));
        }
        if is_item(line.text) {
            return self.sequence(indent, depth);
        }
        // Only now: `- a: b` is an item, although it contains a key.
        if split_key(&line)?.is_some() {
            return self.mapping(indent, depth);
        }
        self.next += 1;
        scalar(&line, line.text)
    }

    fn sequence(&mut self, indent: usize, depth: usize) -> Result<Node, Malformed> {
        let mut items = Vec::new();
        let first = self.peek().map_or(1, |line| line.number);
        while let Some(line) = self.sibling(indent).filter(|line| is_item(line.text)) {
            let rest = line.text[1..].trim_start_matches(' ');
            if rest.is_empty() {
                self.next += 1;
                items.push(self.below(&line, indent + 1, depth)?);
                continue;
            }
            // The rest after the dash is a block of its own, indented further.
            let inner = indent + line.text.len() - rest.len();
            self.lines[self.next].indent = inner;
            self.lines[self.next].text = rest;
            items.push(self.block(inner, depth + 1)?);
        }
        Ok(Node {
            line: first,
            value: YamlValue::Sequence(items),
        })
    }

    fn mapping(&mut self, indent: usize, depth: usize) -> Result<Node, Malformed> {
        let mut members: Vec<(String, Node)> = Vec::new();
        let mut known: HashSet<String> = HashSet::new();
        let first = self.peek().map_or(1, |line| line.number);
        while let Some(line) = self.sibling(indent).filter(|line| !is_item(line.text)) {
            let Some((key, rest)) = split_key(&line)? else {
                let reason = format!("{} is no `key: value`", quoted(line.text));
                return Err(malformed(line.number, reason));
            };
            if !known.insert(key.clone()) {
                let reason = format!("key {} stands here twice; give it once", quoted(&key));
                return Err(malformed(line.number, reason));
            }
            self.next += 1;
            let node = if rest.is_empty() {
                // The items of a sequence may be as far in as their key.
                let is_at_key = self.sibling(indent).is_some_and(|next| is_item(next.text));
                self.below(&line, indent + usize::from(!is_at_key), depth)?
            } else {
                scalar(&line, rest)?
            };
            members.push((key, node));
        }
        Ok(Node {
            line: first,
            value: YamlValue::Mapping(members),
        })
    }

    /// Reads the block below `line`, indented by at least `least`; without one, an empty scalar.
    fn below(
        &mut self,
        line: &YamlLine<'_>,
        least: usize,
        depth: usize,
    ) -> Result<Node, Malformed> {
        match self.peek().map(|next| next.indent) {
            Some(indent) if indent >= least => self.block(indent, depth + 1),
            _ => scalar(line, ""),
        }
    }
}

fn is_item(text: &str) -> bool {
    text == "-" || text.starts_with("- ")
}

/// Splits `key: value`; the value may be empty.
fn split_key<'t>(line: &YamlLine<'t>) -> Result<Option<(String, &'t str)>, Malformed> {
    let text = line.text;
    let end = if text.starts_with(['"', '\'']) {
        closing_quote(text).map(|end| end + 1)
    } else {
        text.find(": ")
            .or(text.ends_with(':').then(|| text.len() - 1))
    };
    let Some((key, rest)) = end.map(|end| text.split_at(end)) else {
        return Ok(None);
    };
    let Some(rest) = rest.strip_prefix(':') else {
        return Ok(None);
    };
    match scalar(line, key)?.value {
        YamlValue::Scalar(key) => Ok(Some((key, rest.trim_start()))),
        _ => Err(malformed(line.number, "a collection cannot be a key")),
    }
}

/// Returns the position of the quote that closes the one at the beginning of `text`.
fn closing_quote(text: &str) -> Option<usize> {
    let quote = text.chars().next()?;
    let mut is_escaped = false;
    text.char_indices().skip(1).find_map(|(at, character)| {
        let closes = character == quote && !is_escaped;
        // Only double quotes know escapes; in single ones a backslash is itself.
        is_escaped = quote == '"' && character == '\\' && !is_escaped;
        closes.then_some(at)
    })
}

/// Reads a value that is on one line.
fn scalar(line: &YamlLine<'_>, text: &str) -> Result<Node, Malformed> {
    let value = match text {
        "{}" => YamlValue::Mapping(Vec::new()),
        "[]" => YamlValue::Sequence(Vec::new()),
        _ => YamlValue::Scalar(plain(line.number, text)?),
    };
    Ok(Node {
        line: line.number,
        value,
    })
}

fn plain(line: usize, text: &str) -> Result<String, Malformed> {
    if !text.starts_with(['"', '\'']) {
        // These begin a part of YAML that is not read here.
        let not_read = |character| "&*!|>{}[]%@`".contains(character);
        return if text.starts_with(not_read) {
            let shown = quoted(text);
            let reason = format!("{shown}: only plain scalars, {{}} and [] are read; write it out");
            Err(malformed(line, reason))
        } else {
            Ok(text.into())
        };
    }
    let end = closing_quote(text).filter(|end| end + 1 == text.len());
    let Some(end) = end else {
        let why = "its quote does not close at the line's end";
        let reason = format!("{}: {why}", quoted(text));
        return Err(malformed(line, reason));
    };
    let inner = &text[1..end];
    if inner.contains('\\') && text.starts_with('"') {
        let remedy = "write the character";
        let reason = format!("{}: escapes are not read; {remedy}", quoted(text));
        return Err(malformed(line, reason));
    }
    Ok(inner.into())
}

#[cfg(test)]
mod tests;
