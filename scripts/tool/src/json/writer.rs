//! Writing JSON: objects whose members come in the order of the calls.

use std::fmt::Write;

/// An object that is being written.
#[derive(Clone, Debug, Default)]
pub struct Object(String);

impl Object {
    /// Begins an object without members.
    #[must_use]
    pub fn new() -> Object {
        Object::default()
    }

    /// Adds a member with a whole number.
    #[must_use]
    pub fn number(self, name: &str, value: impl Into<u64>) -> Object {
        let value: u64 = value.into();
        self.json(name, &value.to_string())
    }

    /// Adds a member with text.
    #[must_use]
    pub fn text(self, name: &str, value: &str) -> Object {
        self.json(name, &quoted(value))
    }

    /// Adds a member with a value that is JSON already.
    #[must_use]
    pub fn json(mut self, name: &str, value: &str) -> Object {
        let separator = if self.0.is_empty() { "" } else { "," };
        // Writing into a `String` cannot fail.
        let _ = write!(self.0, "{separator}{}:{value}", quoted(name));
        self
    }

    /// Adds a member with a list of values that are JSON already.
    #[must_use]
    pub fn list(self, name: &str, values: impl IntoIterator<Item = impl ToString>) -> Object {
        let values = values.into_iter().map(|value| value.to_string());
        self.json(name, &format!("[{}]", values.collect::<Vec<_>>().join(",")))
    }

    /// Ends the object and returns its text.
    #[must_use]
    pub fn end(self) -> String {
        format!("{{{}}}", self.0)
    }
}

/// Returns text as a JSON string (RFC 8259, section 7).
///
/// ```
/// assert_eq!(tool::json::quoted("a \"b\"\n"), r#""a \"b\"\u000a""#);
/// ```
#[must_use]
pub fn quoted(text: &str) -> String {
    let mut quoted = String::with_capacity(text.len() + 2);
    quoted.push('"');
    for character in text.chars() {
        match character {
            '"' => quoted.push_str("\\\""),
            '\\' => quoted.push_str("\\\\"),
            control if control < ' ' => {
                // Writing into a `String` cannot fail.
                let _ = write!(quoted, "\\u{:04x}", u32::from(control));
            }
            other => quoted.push(other),
        }
    }
    quoted.push('"');
    quoted
}

#[cfg(test)]
mod tests {
    use super::{Object, quoted};
    use crate::json::{Value, parse};

    #[test]
    fn what_is_written_is_read_back() {
        let inner = Object::new().text("b", "é\u{1}\"\\").end();
        let text = Object::new()
            .number("a", u64::MAX)
            .json("c", &inner)
            .json("d", "[null,true]")
            .end();
        let value = parse(&text).expect("valid JSON");
        assert_eq!(value.get("a").and_then(Value::as_u64), Some(u64::MAX));
        let text = value.at(&["c", "b"]).and_then(Value::as_text);
        assert_eq!(text, Some("é\u{1}\"\\"));
        assert_eq!(value.get("d").map(|list| list.elements().len()), Some(2));
        assert_eq!(Object::new().end(), "{}");
        assert_eq!(quoted("\n"), "\"\\u000a\"");
    }
}
