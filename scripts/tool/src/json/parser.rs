//! The recursive-descent reader behind [`parse`](super::parse).
//!
//! It walks over the bytes once. `position` is always the byte to be read
//! next, and stands on a character's first byte whenever a message is made.

use replay::repeated;
use replay::shown::quoted;

use super::{DEEPEST, JsonError, Value};

pub(super) struct Parser<'t> {
    text: &'t str,
    position: usize,
    depth: usize,
    /// The member of the outermost object whose elements' places are noted.
    watched: Option<&'t str>,
    /// Whether that member's value is being read.
    is_watched: bool,
    places: Vec<usize>,
}

impl<'t> Parser<'t> {
    pub(super) fn new(text: &'t str) -> Self {
        Parser {
            text,
            position: 0,
            depth: 0,
            watched: None,
            is_watched: false,
            places: Vec::new(),
        }
    }

    /// Reads as [`whole`](Self::whole), and notes where the elements of a member begin.
    pub(super) fn with_places(mut self, of: &'t str) -> Result<(Value, Vec<usize>), JsonError> {
        self.watched = Some(of);
        let value = self.whole()?;
        Ok((value, self.places))
    }

    /// Reads one value and makes sure that nothing follows it.
    pub(super) fn whole(&mut self) -> Result<Value, JsonError> {
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
        if self.take(b'}') {
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
            if !self.take(b':') {
                return Err(self.unexpected("`:`"));
            }
            self.is_watched = self.depth == 1 && self.watched == Some(key.as_str());
            let value = self.value()?;
            members.push((key, value));
            self.skip_blanks();
            if self.take(b'}') {
                break;
            }
            if !self.take(b',') {
                return Err(self.unexpected("`,` or `}`"));
            }
        }
        match repeated(members.iter().map(|(key, _)| key)) {
            None => Ok(Value::Object(members)),
            Some((_, second)) => {
                self.position = starts[second];
                let key = quoted(&members[second].0);
                Err(self.error(format!("key {key} stands twice in one object")))
            }
        }
    }

    fn array(&mut self) -> Result<Value, JsonError> {
        let mut elements = Vec::new();
        self.skip_blanks();
        if self.take(b']') {
            return Ok(Value::Array(elements));
        }
        let is_watched = self.is_watched && self.depth == 2;
        loop {
            self.skip_blanks();
            if is_watched {
                self.places.push(self.position);
            }
            elements.push(self.value()?);
            self.skip_blanks();
            if self.take(b']') {
                return Ok(Value::Array(elements));
            }
            if !self.take(b',') {
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

    /// Reads `uXXXX`, or a pair of them that makes one character.
    fn unicode_escape(&mut self) -> Result<char, JsonError> {
        let first = self.hexadecimal()?;
        let code = match first {
            0xd800..=0xdbff => {
                if !self.take(b'\\') || self.peek() != Some(b'u') {
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
        self.take(b'-');
        if self.take(b'0') {
            if matches!(self.peek(), Some(b'0'..=b'9')) {
                return Err(self.error("a number with a leading zero".into()));
            }
        } else {
            self.digits()?;
        }
        let mut integer = true;
        if self.take(b'.') {
            integer = false;
            self.digits()?;
        }
        if matches!(self.peek(), Some(b'e' | b'E')) {
            integer = false;
            self.position += 1;
            if !self.take(b'+') {
                self.take(b'-');
            }
            self.digits()?;
        }
        let lexeme = &self.text[start..self.position];
        let value = if integer {
            lexeme.parse().ok().map(Value::Integer)
        } else {
            let number = lexeme
                .parse()
                .ok()
                .filter(|number: &f64| number.is_finite());
            number.map(Value::Decimal)
        };
        value.ok_or_else(|| self.error(format!("number {} is out of range", quoted(lexeme))))
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

    fn take(&mut self, byte: u8) -> bool {
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
