//! JSON as the machine lines use it: one value a line, read strictly.
//!
//! The serial protocol and cargo's messages are JSON Lines; both are read by
//! this one parser. *Strict* means: exactly RFC 8259, nothing before or after
//! the value but blanks, no key twice in one object, and no nesting deeper
//! than [`DEEPEST`]. Whatever breaks a rule is refused with the column where
//! it stands, so that a damaged serial line is found and never guessed at.
//!
//! Integers stay integers (`i128` holds every `u64` of nanoseconds); only a
//! number with a fraction or an exponent becomes a float. What the host itself
//! writes, it writes by [`Object`] and [`quoted`]; machine lines are printed by
//! the guest.

mod parser;
mod writer;

use std::fmt;

pub use writer::{Object, quoted};

/// The deepest nesting of arrays and objects that is read.
pub const DEEPEST: usize = 32;

/// A JSON value.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// `null`.
    Null,
    /// `true` or `false`.
    Bool(bool),
    /// A number without fraction and exponent.
    Integer(i128),
    /// Any other number.
    Decimal(f64),
    /// A string, its escapes resolved.
    Text(String),
    /// An array.
    Array(Vec<Value>),
    /// An object, its members in the order of the text.
    Object(Vec<(String, Value)>),
}

impl Value {
    /// Returns the member `name` of an object; `None` if there is none, or if
    /// this is not an object.
    #[must_use]
    pub fn get(&self, name: &str) -> Option<&Value> {
        let Value::Object(members) = self else {
            return None;
        };
        let member = members.iter().find(|(key, _)| key == name);
        member.map(|(_, value)| value)
    }

    /// Returns the value at a path of member names, such as
    /// `["join_latency_ns", "max"]`.
    #[must_use]
    pub fn at(&self, path: &[&str]) -> Option<&Value> {
        path.iter().try_fold(self, |value, name| value.get(name))
    }

    /// Returns the string, if this is one.
    #[must_use]
    pub fn as_text(&self) -> Option<&str> {
        match self {
            Value::Text(text) => Some(text),
            _ => None,
        }
    }

    /// Returns the number, if this is an integer within `u64`.
    #[must_use]
    pub fn as_u64(&self) -> Option<u64> {
        match self {
            Value::Integer(number) => u64::try_from(*number).ok(),
            _ => None,
        }
    }

    /// Returns the truth value, if this is one.
    #[must_use]
    pub fn as_bool(&self) -> Option<bool> {
        match self {
            Value::Bool(truth) => Some(*truth),
            _ => None,
        }
    }

    /// Returns the elements of an array; nothing if this is not an array.
    #[must_use]
    pub fn elements(&self) -> &[Value] {
        match self {
            Value::Array(elements) => elements,
            _ => &[],
        }
    }

    /// Names the type, for messages.
    #[must_use]
    pub fn type_name(&self) -> &'static str {
        match self {
            Value::Null => "null",
            Value::Bool(_) => "truth value",
            Value::Integer(_) => "integer",
            Value::Decimal(_) => "decimal number",
            Value::Text(_) => "string",
            Value::Array(_) => "array",
            Value::Object(_) => "object",
        }
    }
}

/// Why a text is no JSON value.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JsonError {
    /// The column of the offending byte, counted from 1.
    pub column: usize,
    /// What was found and what may stand there instead.
    pub message: String,
}

impl fmt::Display for JsonError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "column {}: {}", self.column, self.message)
    }
}

impl std::error::Error for JsonError {}

/// Reads the one value that `text` consists of.
///
/// # Errors
///
/// The first place at which `text` departs from the rules above.
///
/// ```
/// let line = tool::json::parse(r#"{"kind":"progress","done":120}"#).unwrap();
/// assert_eq!(line.get("done").and_then(|done| done.as_u64()), Some(120));
/// ```
pub fn parse(text: &str) -> Result<Value, JsonError> {
    parser::Parser::new(text).whole()
}

/// Reads as [`parse`], and returns also at which bytes the elements begin of the list
/// that is the member `name` of the outermost object.
///
/// # Errors
///
/// As [`parse`].
pub fn parse_with_places<'t>(
    text: &'t str,
    name: &'t str,
) -> Result<(Value, Vec<usize>), JsonError> {
    parser::Parser::new(text).with_places(name)
}

#[cfg(test)]
mod tests {
    use super::{DEEPEST, Value, parse, parse_with_places};

    fn refused(text: &str) -> (usize, String) {
        let error = parse(text).expect_err(text);
        (error.column, error.message)
    }

    #[test]
    fn reads_every_kind_of_value() {
        let text = r#" {"a":[1,-2,0,1.5e3],"b":{},"c":"x","d":true,"e":false,"f":null,"g":[]} "#;
        let value = parse(text).unwrap();
        let numbers = value.get("a").unwrap().elements();
        let integers = [1, -2, 0].map(Value::Integer);
        assert_eq!(numbers[..3], integers);
        assert_eq!(numbers[3], Value::Decimal(1500.0));
        assert_eq!(value.get("b"), Some(&Value::Object(vec![])));
        assert_eq!(value.get("c").unwrap().as_text(), Some("x"));
        assert_eq!(value.get("d").unwrap().as_bool(), Some(true));
        assert_eq!(value.get("e").unwrap().as_bool(), Some(false));
        assert_eq!(value.get("f"), Some(&Value::Null));
        assert!(value.get("g").unwrap().elements().is_empty());
        assert_eq!(value.get("z"), None);
        let nested = parse(r#"{"join_latency_ns":{"max":12}}"#).unwrap();
        let max = nested.at(&["join_latency_ns", "max"]);
        assert_eq!(max.and_then(Value::as_u64), Some(12));
        assert_eq!(nested.at(&["join_latency_ns", "min"]), None);
    }

    #[test]
    fn keeps_every_nanosecond_of_u64() {
        let value = parse("18446744073709551615").unwrap();
        assert_eq!(value.as_u64(), Some(u64::MAX));
        assert_eq!(parse("18446744073709551616").unwrap().as_u64(), None);
        assert_eq!(parse("-1").unwrap().as_u64(), None);
    }

    #[test]
    fn resolves_escapes() {
        let value = parse(r#""a\"\\\/\b\f\n\r\t\u00e9\ud83d\ude00é""#).unwrap();
        assert_eq!(value.as_text(), Some("a\"\\/\u{8}\u{c}\n\r\té\u{1f600}é"));
    }

    /// A text that is no JSON, and the column that is named.
    const REFUSED: &str = r#"
 | 1
{ | 2
{"a":1 | 7
{"a":1,} | 8
{"a" 1} | 6
[1,] | 4
[1 2] | 4
nul | 1
1 x | 3
{} {} | 4"#;

    /// What others let pass.
    const PASSES_ELSEWHERE: &str =
        r#"01 +1 .5 1. 1e - 'a' "a "\x" "\u12" NaN "\ud800" "\ud800\u0041" "\udc00" 1e999"#;

    #[test]
    fn names_the_place_of_a_fault_and_refuses_what_others_let_pass() {
        for row in REFUSED.lines().skip(1) {
            let (text, column) = row.rsplit_once(" | ").unwrap();
            assert_eq!(refused(text).0.to_string(), column, "{text}");
        }
        PASSES_ELSEWHERE
            .split(' ')
            .for_each(|text| _ = refused(text));
        refused("\"\u{1}\"");
    }

    #[test]
    fn refuses_a_key_that_stands_twice() {
        let (column, message) = refused(r#"{"kind":"a","kind":"b"}"#);
        assert_eq!(column, 13);
        assert_eq!(message, "key `kind` stands twice in one object");
        // The first one that is too many, whatever the order of the keys.
        assert_eq!(refused(r#"{"b":1,"a":1,"b":2,"a":2}"#).0, 14);
        let long = format!("\\u001b{}", "k".repeat(5000));
        let (_, message) = refused(&format!(r#"{{"{long}":1,"{long}":2}}"#));
        assert!(
            message.len() < 100 && message.contains("\\u{1b}"),
            "{message}"
        );
    }

    #[test]
    fn tells_where_the_elements_of_a_member_begin() {
        let text = r#"{"b":[1],"a":[ [2,[3]], {"a":[4]} ,5],"c":{"a":[6]}}"#;
        let (value, places) = parse_with_places(text, "a").unwrap();
        assert_eq!(value.get("a").unwrap().elements().len(), 3);
        let begins: Vec<&str> = places.iter().map(|&at| &text[at..=at]).collect();
        assert_eq!(begins, ["[", "{", "5"]);
        assert_eq!(parse_with_places("[[1]]", "a").unwrap().1, []);
    }

    #[test]
    fn reads_an_object_of_very_many_keys() {
        // Comparing each key with each would take half a minute.
        let members: Vec<String> = (0..100_000).map(|key| format!("\"k{key}\":0")).collect();
        let text = format!("{{{}}}", members.join(","));
        assert!(
            matches!(parse(&text).unwrap(), Value::Object(members) if members.len() == 100_000)
        );
    }

    #[test]
    fn refuses_to_nest_without_bound() {
        let deep = |levels| "[".repeat(levels) + &"]".repeat(levels);
        assert!(parse(&deep(DEEPEST)).is_ok());
        let (column, message) = refused(&deep(DEEPEST + 1));
        assert_eq!(column, DEEPEST + 1);
        assert!(message.contains("32 levels"), "{message}");
    }
}
