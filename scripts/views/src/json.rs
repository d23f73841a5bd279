//! JSON as in the machine lines: one value a line, read strictly.
//!
//! The serial protocol and cargo's messages are JSON Lines; this parser reads both. *Strict* means:
//! exactly RFC 8259, only blanks before or after the value, no key twice in one object, and no
//! nesting deeper than [`DEEPEST`]. The parser refuses a text that breaks a rule, with the column
//! of the offence, so a damaged serial line is found and never guessed at.
//!
//! Integers stay integers (`i128` holds every `u64` of nanoseconds); only a number with a fraction
//! or an exponent becomes a float. The host writes JSON by [`Object`] and [`quoted`], with members
//! in the order of the calls; guests print the machine lines.
//!
//! The reader is a recursive descent over the bytes. Its `position` is the next byte to read, and
//! is at the first byte of a character whenever an error is made.

use std::fmt::{self, Write};

use text::repeated;

/// The deepest nesting of arrays and objects allowed in a text.
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
    /// A string, with its escapes resolved.
    Text(String),
    /// An array.
    Array(Vec<Value>),
    /// An object, with its members in the order of the text.
    Object(Vec<(String, Value)>),
}

impl Value {
    /// Returns the member `name` of an object; `None` without such a member, or for any other
    /// value.
    pub fn get(&self, name: &str) -> Option<&Value> {
        let Value::Object(members) = self else {
            return None;
        };
        let member = members.iter().find(|(key, _)| key == name);
        member.map(|(_, value)| value)
    }

    /// Returns the value at a path of member names, such as
    /// `["join_latency_ns", "max"]`.
    pub fn at(&self, path: &[&str]) -> Option<&Value> {
        path.iter().try_fold(self, |value, name| value.get(name))
    }

    /// Returns the string, if the value is a string.
    pub fn as_text(&self) -> Option<&str> {
        match self {
            Value::Text(text) => Some(text),
            _ => None,
        }
    }

    /// Returns the number, if the value is an integer within `u64`.
    pub fn as_u64(&self) -> Option<u64> {
        match self {
            Value::Integer(number) => u64::try_from(*number).ok(),
            _ => None,
        }
    }

    /// Returns the elements of an array; nothing for any other value.
    pub fn elements(&self) -> &[Value] {
        match self {
            Value::Array(elements) => elements,
            _ => &[],
        }
    }
}

/// The reason why a text is no JSON value.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JsonError {
    /// The column of the offending byte, counted from 1.
    pub column: usize,
    /// The text found, and the text allowed there instead.
    pub message: String,
}

impl fmt::Display for JsonError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "column {}: {}", self.column, self.message)
    }
}

/// Reads the single value in `text`.
///
/// # Errors
///
/// The first place at which `text` departs from the rules above.
///
/// ```
/// let line = views::json::parse(r#"{"kind":"progress","done":120}"#).unwrap();
/// assert_eq!(line.get("done").and_then(|done| done.as_u64()), Some(120));
/// ```
pub fn parse(text: &str) -> Result<Value, JsonError> {
    JsonParser::new(text).whole()
}

#[derive(Default)]
struct JsonParser<'t> {
    text: &'t str,
    position: usize,
    depth: usize,
}

impl<'t> JsonParser<'t> {
    fn new(text: &'t str) -> Self {
        JsonParser {
            text,
            ..JsonParser::default()
        }
    }

    /// Reads one value and makes sure that nothing follows.
    fn whole(&mut self) -> Result<Value, JsonError> {
        let value = self.value()?;
        self.skip_blanks();
        match self.peek() {
            None => Ok(value),
            Some(_) => Err(self.unexpected("the end of the line")),
        }
    }

    fn value(&mut self) -> Result<Value, JsonError> {
        self.skip_blanks();
        match self.peek() {
            Some(b'{') => self.nested(Self::object),
            Some(b'[') => self.nested(Self::array),
            Some(b'"') => self.string().map(Value::Text),
            Some(b'-' | b'0'..=b'9') => self.number(),
            Some(b't') => self.word("true", Value::Bool(true)),
            Some(b'f') => self.word("false", Value::Bool(false)),
            Some(b'n') => self.word("null", Value::Null),
            _ => Err(self.unexpected("a value")),
        }
    }

    fn nested(
        &mut self,
        read: fn(&mut Self) -> Result<Value, JsonError>,
    ) -> Result<Value, JsonError> {
        // A recursion without a limit would overflow the stack on hostile input.
        if self.depth == DEEPEST {
            return Err(self.error(format!("nested deeper than {DEEPEST} levels")));
        }
        self.depth += 1;
        self.position += 1;
        let value = read(self);
        self.depth -= 1;
        value
    }

    fn object(&mut self) -> Result<Value, JsonError> {
        let mut members: Vec<(String, Value)> = Vec::new();
        let mut starts = Vec::new();
        self.skip_blanks();
        if self.skip(b'}') {
            return Ok(Value::Object(members));
        }
        loop {
            self.skip_blanks();
            starts.push(self.position);
            if self.peek() != Some(b'"') {
                return Err(self.unexpected("a key in double quotes"));
            }
            let key = self.string()?;
            self.skip_blanks();
            if !self.skip(b':') {
                return Err(self.unexpected("`:`"));
            }
            let value = self.value()?;
            members.push((key, value));
            self.skip_blanks();
            if self.skip(b'}') {
                break;
            }
            if !self.skip(b',') {
                return Err(self.unexpected("`,` or `}`"));
            }
        }
        match repeated(members.iter().map(|(key, _)| key)) {
            None => Ok(Value::Object(members)),
            Some((_, second)) => {
                // The column of the second key, where the object went wrong.
                self.position = starts[second];
                let key = text::quoted(&members[second].0);
                Err(self.error(format!("key {key} stands twice in one object")))
            }
        }
    }

    fn array(&mut self) -> Result<Value, JsonError> {
        let mut elements = Vec::new();
        self.skip_blanks();
        if self.skip(b']') {
            return Ok(Value::Array(elements));
        }
        loop {
            self.skip_blanks();
            elements.push(self.value()?);
            self.skip_blanks();
            if self.skip(b']') {
                return Ok(Value::Array(elements));
            }
            if !self.skip(b',') {
                return Err(self.unexpected("`,` or `]`"));
            }
        }
    }

    fn string(&mut self) -> Result<String, JsonError> {
        self.position += 1;
        let mut string = String::new();
        loop {
            let Some(next) = self.text[self.position..].chars().next() else {
                return Err(self.unexpected("the closing `\"`"));
            };
            match next {
                '"' => {
                    self.position += 1;
                    return Ok(string);
                }
                '\\' => string.push(self.escape()?),
                '\0'..='\u{1f}' => return Err(self.unexpected("an escape such as `\\n`")),
                _ => {
                    self.position += next.len_utf8();
                    string.push(next);
                }
            }
        }
    }

    fn escape(&mut self) -> Result<char, JsonError> {
        self.position += 1;
        let resolved = match self.peek() {
            Some(b'"') => '"',
            Some(b'\\') => '\\',
            Some(b'/') => '/',
            Some(b'b') => '\u{8}',
            Some(b'f') => '\u{c}',
            Some(b'n') => '\n',
            Some(b'r') => '\r',
            Some(b't') => '\t',
            Some(b'u') => return self.unicode_escape(),
            _ => return Err(self.unexpected("one of `\"\\/bfnrtu`")),
        };
        self.position += 1;
        Ok(resolved)
    }

    /// Reads `uXXXX`, or a pair of such escapes for a single character.
    fn unicode_escape(&mut self) -> Result<char, JsonError> {
        let first = self.hexadecimal()?;
        let code = match first {
            0xd800..=0xdbff => {
                // A high surrogate stands for half a character; the other half must follow (RFC
                // 8259, section 7).
                if !self.skip(b'\\') || self.peek() != Some(b'u') {
                    return Err(self.error("half a surrogate pair".into()));
                }
                let second = self.hexadecimal()?;
                if !(0xdc00..=0xdfff).contains(&second) {
                    return Err(self.error("half a surrogate pair".into()));
                }
                0x1_0000 + ((first - 0xd800) << 10) + (second - 0xdc00)
            }
            _ => first,
        };
        // A lone low surrogate is the only code that fails here.
        char::from_u32(code).ok_or_else(|| self.error("half a surrogate pair".into()))
    }

    fn hexadecimal(&mut self) -> Result<u32, JsonError> {
        let digits = self.text.get(self.position + 1..self.position + 5);
        let valid = digits.filter(|digits| digits.bytes().all(|b| b.is_ascii_hexdigit()));
        let code = valid.and_then(|digits| u32::from_str_radix(digits, 16).ok());
        let code = code.ok_or_else(|| self.error("`\\u` without four hex digits".into()))?;
        self.position += 5;
        Ok(code)
    }

    fn number(&mut self) -> Result<Value, JsonError> {
        let start = self.position;
        self.skip(b'-');
        if self.skip(b'0') {
            // RFC 8259 allows no leading zeros (section 6).
            if matches!(self.peek(), Some(b'0'..=b'9')) {
                return Err(self.error("a number with a leading zero".into()));
            }
        } else {
            self.digits()?;
        }
        let mut integer = true;
        if self.skip(b'.') {
            integer = false;
            self.digits()?;
        }
        if matches!(self.peek(), Some(b'e' | b'E')) {
            integer = false;
            self.position += 1;
            if !self.skip(b'+') {
                self.skip(b'-');
            }
            self.digits()?;
        }
        let lexeme = &self.text[start..self.position];
        let value = if integer {
            lexeme.parse().ok().map(Value::Integer)
        } else {
            // A float that overflows to infinity is refused: JSON has no such number.
            let number = lexeme
                .parse()
                .ok()
                .filter(|number: &f64| number.is_finite());
            number.map(Value::Decimal)
        };
        value.ok_or_else(|| self.error(format!("number {} is out of range", text::quoted(lexeme))))
    }

    fn digits(&mut self) -> Result<(), JsonError> {
        let rest = &self.text.as_bytes()[self.position..];
        let count = rest.iter().take_while(|byte| byte.is_ascii_digit()).count();
        if count == 0 {
            return Err(self.unexpected("a digit"));
        }
        self.position += count;
        Ok(())
    }

    fn word(&mut self, word: &str, value: Value) -> Result<Value, JsonError> {
        if !self.text[self.position..].starts_with(word) {
            return Err(self.unexpected("a value"));
        }
        self.position += word.len();
        Ok(value)
    }

    fn skip_blanks(&mut self) {
        while matches!(self.peek(), Some(b' ' | b'\t' | b'\r' | b'\n')) {
            self.position += 1;
        }
    }

    fn skip(&mut self, byte: u8) -> bool {
        let found = self.peek() == Some(byte);
        self.position += usize::from(found);
        found
    }

    fn peek(&self) -> Option<u8> {
        self.text.as_bytes().get(self.position).copied()
    }

    fn unexpected(&self, wanted: &str) -> JsonError {
        match self
            .text
            .get(self.position..)
            .and_then(|rest| rest.chars().next())
        {
            Some(found) => self.error(format!("found {found:?} where {wanted} must stand")),
            None => self.error(format!("the line ends where {wanted} must stand")),
        }
    }

    fn error(&self, message: String) -> JsonError {
        JsonError {
            column: self.position + 1,
            message,
        }
    }
}

/// An object being written.
#[derive(Clone, Debug, Default)]
#[must_use]
pub struct Object(String);

impl Object {
    /// Makes an object without members.
    pub fn new() -> Object {
        Object::default()
    }

    /// Adds a member with a whole number.
    pub fn number(self, name: &str, value: impl Into<u64>) -> Object {
        let value: u64 = value.into();
        self.json(name, &value.to_string())
    }

    /// Adds a member with text.
    pub fn text(self, name: &str, value: &str) -> Object {
        self.json(name, &quoted(value))
    }

    /// Adds a member with a value already in JSON.
    pub fn json(mut self, name: &str, value: &str) -> Object {
        let separator = if self.0.is_empty() { "" } else { "," };
        // Writing into a `String` cannot fail.
        let _ = write!(self.0, "{separator}{}:{value}", quoted(name));
        self
    }

    /// Adds a member with a list of values already in JSON.
    pub fn list(self, name: &str, values: impl IntoIterator<Item = impl ToString>) -> Object {
        let values = values.into_iter().map(|value| value.to_string());
        self.json(name, &format!("[{}]", values.collect::<Vec<_>>().join(",")))
    }

    /// Ends the object and returns its text.
    pub fn into_text(self) -> String {
        format!("{{{}}}", self.0)
    }
}

/// Returns text as a JSON string (RFC 8259, section 7).
///
/// ```
/// assert_eq!(views::json::quoted("a \"b\"\n"), r#""a \"b\"\u000a""#);
/// ```
pub fn quoted(text: &str) -> String {
    recording::Part::Text(text).to_string()
}

#[cfg(test)]
mod tests {
    use super::{DEEPEST, Object, Value, parse, quoted};

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
        assert_eq!(value.get("d"), Some(&Value::Bool(true)));
        assert_eq!(value.get("e"), Some(&Value::Bool(false)));
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

    /// Texts that lenient readers accept.
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
        // The first member too many, in any order of the keys.
        assert_eq!(refused(r#"{"b":1,"a":1,"b":2,"a":2}"#).0, 14);
        let long = format!("\\u001b{}", "k".repeat(5000));
        let (_, message) = refused(&format!(r#"{{"{long}":1,"{long}":2}}"#));
        let is_told = message.len() < 100 && message.contains("\\u{1b}");
        assert!(is_told, "{message}");
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

    #[test]
    fn what_is_written_is_read_back() {
        let inner = Object::new().text("b", "é\u{1}\"\\").into_text();
        let text = Object::new().number("a", u64::MAX).json("c", &inner);
        let text = text.json("d", "[null,true]").into_text();
        let value = parse(&text).expect("valid JSON");
        assert_eq!(value.get("a").and_then(Value::as_u64), Some(u64::MAX));
        let text = value.at(&["c", "b"]).and_then(Value::as_text);
        assert_eq!(text, Some("é\u{1}\"\\"));
        assert_eq!(value.get("d").map(|list| list.elements().len()), Some(2));
        assert_eq!(Object::new().into_text(), "{}");
        assert_eq!(quoted("\n"), "\"\\u000a\"");
    }
}
