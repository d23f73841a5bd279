//! Schemas as people write them.

use alloc::boxed::Box;
use alloc::string::String;
use alloc::vec::Vec;
use core::fmt;

use super::schema::{DEEP, Field, MOST_DEPTH, MOST_WEIGHTLESS, Scalar, Schema, WEIGHTLESS};

impl fmt::Display for Schema {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Scalar(scalar) => f.write_str(scalar.name()),
            Self::Option(inner) => write!(f, "{inner}?"),
            Self::List(element) => write!(f, "[{element}]"),
            Self::Array(element, count) => write!(f, "[{element}; {count}]"),
            Self::Tuple(elements) => {
                f.write_str("(")?;
                for (number, element) in elements.iter().enumerate() {
                    write!(f, "{}{element}", if number > 0 { ", " } else { "" })?;
                }
                f.write_str(if elements.len() == 1 { ",)" } else { ")" })
            }
            Self::Struct(name, fields) => {
                write!(f, "{name} {{")?;
                for (number, Field { name, schema }) in fields.iter().enumerate() {
                    let separator = if number > 0 { ", " } else { " " };
                    write!(f, "{separator}{name}: {schema}")?;
                }
                f.write_str(" }")
            }
        }
    }
}

impl Schema {
    /// Reads a schema in the form in which it is shown.
    ///
    /// # Errors
    ///
    /// The column, counted from 1, and what was expected there.
    ///
    /// ```
    /// use recording::Schema;
    ///
    /// let text = "Seen { at: (u64,), colours: [u8; 3]? }";
    /// assert_eq!(Schema::parse(text).unwrap().to_string(), text);
    /// assert_eq!(Schema::parse("[u8; x]"), Err((6, "a number, `]`")));
    /// ```
    pub fn parse(text: &str) -> Result<Self, (usize, &'static str)> {
        let mut rest = Rest { text, whole: text };
        let schema = rest.schema(0)?;
        match rest.peek() {
            // An option follows its type, and so has made deeper what was read.
            None if schema.depth() > MOST_DEPTH => rest.refuse(DEEP),
            None if schema.weightless() > MOST_WEIGHTLESS => rest.refuse(WEIGHTLESS),
            None => Ok(schema),
            Some(_) => rest.refuse("the end"),
        }
    }
}

/// What is left of the text.
struct Rest<'t> {
    text: &'t str,
    whole: &'t str,
}

type Refused = (usize, &'static str);

impl<'t> Rest<'t> {
    fn refuse<T>(&self, expected: &'static str) -> Result<T, Refused> {
        let before = &self.whole[..self.whole.len() - self.text.len()];
        Err((1 + before.chars().count(), expected))
    }

    fn peek(&mut self) -> Option<char> {
        self.text = self.text.trim_start();
        self.text.chars().next()
    }

    fn takes(&mut self, mark: char) -> bool {
        let is_next = self.peek() == Some(mark);
        if is_next {
            self.text = &self.text[mark.len_utf8()..];
        }
        is_next
    }

    fn expect(&mut self, mark: char, expected: &'static str) -> Result<(), Refused> {
        match self.takes(mark) {
            true => Ok(()),
            false => self.refuse(expected),
        }
    }

    fn word(&mut self, expected: &'static str) -> Result<&'t str, Refused> {
        self.peek();
        let is_of_word = |letter: char| letter.is_alphanumeric() || letter == '_';
        let end = self.text.find(|letter| !is_of_word(letter));
        let (word, rest) = self.text.split_at(end.unwrap_or(self.text.len()));
        if word.is_empty() {
            return self.refuse(expected);
        }
        self.text = rest;
        Ok(word)
    }

    fn schema(&mut self, depth: usize) -> Result<Schema, Refused> {
        if depth == MOST_DEPTH {
            return self.refuse(DEEP);
        }
        let mut schema = match self.peek() {
            Some('[') => self.sequence(depth)?,
            Some('(') => self.tuple(depth)?,
            _ => self.named(depth)?,
        };
        for depth in depth.. {
            if !self.takes('?') {
                break;
            }
            if depth == MOST_DEPTH {
                return self.refuse(DEEP);
            }
            schema = Schema::Option(Box::new(schema));
        }
        Ok(schema)
    }

    fn sequence(&mut self, depth: usize) -> Result<Schema, Refused> {
        self.expect('[', "`[`")?;
        let element = Box::new(self.schema(depth + 1)?);
        if element.least_bytes() == 0 {
            return self.refuse("elements that take bytes");
        }
        let expected = "a number, `]`";
        if !self.takes(';') {
            self.expect(']', "`;` or `]`")?;
            return Ok(Schema::List(element));
        }
        self.peek();
        let number = self.refuse(expected);
        let count = self.word(expected)?.parse().or(number)?;
        self.expect(']', "`]`")?;
        Ok(Schema::Array(element, count))
    }

    fn tuple(&mut self, depth: usize) -> Result<Schema, Refused> {
        self.expect('(', "`(`")?;
        let mut elements = Vec::new();
        while !self.takes(')') {
            elements.push(self.schema(depth + 1)?);
            if !self.takes(',') {
                self.expect(')', "`,` or `)`")?;
                break;
            }
        }
        Ok(Schema::Tuple(elements))
    }

    fn named(&mut self, depth: usize) -> Result<Schema, Refused> {
        self.peek();
        let unknown = self.refuse("a type, such as `f64`, `[u8; 3]` or `Name { field: u8 }`");
        let Ok(name) = self.word("") else {
            return unknown;
        };
        if !self.takes('{') {
            let scalar = Scalar::ALL.iter().find(|scalar| scalar.name() == name);
            return scalar.map_or(unknown, |scalar| Ok(Schema::Scalar(*scalar)));
        }
        let mut fields = Vec::new();
        while !self.takes('}') {
            let name = String::from(self.word("a field's name, or `}`")?);
            self.expect(':', "`:`")?;
            let schema = self.schema(depth + 1)?;
            fields.push(Field { name, schema });
            if !self.takes(',') {
                self.expect('}', "`,` or `}`")?;
                break;
            }
        }
        Ok(Schema::Struct(name.into(), fields))
    }
}
