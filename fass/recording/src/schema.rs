//! Schemas of types: names and types for reading values without the type, and the textual form of
//! schemas.

use alloc::boxed::Box;
use alloc::string::String;
use alloc::vec::Vec;
use core::fmt;

/// The deepest nesting of types.
pub const MOST_DEPTH: usize = 16;

/// The most parts of a type that take no bytes. So a value has at most so many parts for each of
/// its bytes, and the value's length bounds the time for reading it.
pub const MOST_WEIGHTLESS: usize = 64;

/// The type expected in place of a type with more such parts.
pub(super) const WEIGHTLESS: &str = "a type with at most 64 parts that take no bytes";

/// The type expected in place of a type nested more deeply than [`MOST_DEPTH`].
pub(super) const DEEP: &str = "a type that is nested less deeply";

/// The form of a type. Displayed, and parsed by [`Schema::parse`], in Rust's notation for types,
/// except `T?` for `Option<T>`, `[T]` for `Vec<T>`, and `text` for `String`.
///
/// ```
/// use recording::{Recordable, Schema};
///
/// let schema = <(String, Vec<[f64; 3]>)>::schema();
/// assert_eq!(schema.to_string(), "(text, [[f64; 3]])");
/// assert_eq!(Schema::parse("(text, [[f64; 3]])"), Ok(schema));
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Schema {
    /// A number, a truth value, a character or text.
    Scalar(Scalar),
    /// A value or none.
    Option(Box<Schema>),
    /// Any number of values.
    List(Box<Schema>),
    /// A fixed number of values.
    Array(Box<Schema>, u32),
    /// Values of different types.
    Tuple(Vec<Schema>),
    /// Values with names, and the name of the whole.
    Struct(String, Vec<Field>),
}

/// A field of a struct.
///
/// See [`Schema`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Field {
    /// The field's name.
    pub name: String,
    /// The field's type.
    pub schema: Schema,
}

/// Passes the types not composed of others to a macro: each type's name here and in a schema, its
/// least number of bytes, its Rust type, and its reader.
macro_rules! of_scalars {
    ($define:ident) => {
        $define!(
            Bool "bool" 1 bool bool::decode;
            Char "char" 4 char char::decode;
            Text "text" 4 String Decoder::text;
            U8 "u8" 1 u8 u8::decode;
            U16 "u16" 2 u16 u16::decode;
            U32 "u32" 4 u32 u32::decode;
            U64 "u64" 8 u64 u64::decode;
            U128 "u128" 16 u128 u128::decode;
            I8 "i8" 1 i8 i8::decode;
            I16 "i16" 2 i16 i16::decode;
            I32 "i32" 4 i32 i32::decode;
            I64 "i64" 8 i64 i64::decode;
            I128 "i128" 16 i128 i128::decode;
            F32 "f32" 4 f32 f32::decode;
            F64 "f64" 8 f64 f64::decode;
        );
    };
}
pub(super) use of_scalars;

macro_rules! define_scalars {
    ($($Scalar:ident $name:literal $bytes:literal $Type:ident $read:expr;)*) => {
        /// A type not composed of others.
        ///
        /// See [`Schema`].
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[allow(missing_docs, reason = "they are named after their types")]
        pub enum Scalar {
            $($Scalar),*
        }

        impl Scalar {
            /// All scalars, in the order of their numbers in recordings.
            pub(crate) const ALL: &'static [Self] = &[$(Self::$Scalar),*];

            /// Returns the name of the type.
            ///
            /// ```
            /// assert_eq!(recording::Scalar::Text.name(), "text");
            /// ```
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$Scalar => $name),*
                }
            }

            const fn least_bytes(self) -> usize {
                match self {
                    $(Self::$Scalar => $bytes),*
                }
            }
        }
    };
}

of_scalars!(define_scalars);

impl Schema {
    /// Returns the schema of a struct.
    #[doc(hidden)]
    pub fn of_struct<const N: usize>(name: &str, fields: [(&str, Schema); N]) -> Self {
        let fields = fields.map(|(name, schema)| Field {
            name: name.into(),
            schema,
        });
        Self::Struct(name.into(), Vec::from(fields))
    }

    /// Returns the types of which this type is composed; none for a scalar.
    fn parts(&self) -> impl Iterator<Item = &Self> {
        let (inner, elements, fields): (Option<&Self>, &[Self], &[Field]) = match self {
            Self::Scalar(_) => (None, &[], &[]),
            Self::Option(inner) | Self::List(inner) | Self::Array(inner, _) => {
                (Some(inner), &[], &[])
            }
            Self::Tuple(elements) => (None, elements, &[]),
            Self::Struct(_, fields) => (None, &[], fields),
        };
        let fields = fields.iter().map(|field| &field.schema);
        inner.into_iter().chain(elements).chain(fields)
    }

    /// Returns the depth of the type's nesting.
    fn depth(&self) -> usize {
        1 + self.parts().map(Self::depth).max().unwrap_or(0)
    }

    /// Returns how many parts of the type take no bytes.
    pub(super) fn weightless(&self) -> usize {
        let of_parts = self.parts().map(Self::weightless);
        of_parts.fold(usize::from(self.least_bytes() == 0), usize::saturating_add)
    }

    /// Returns the fewest bytes of a value.
    ///
    /// ```
    /// use recording::Recordable;
    /// assert_eq!(<([u16; 3], Vec<u8>)>::schema().least_bytes(), 10);
    /// ```
    pub fn least_bytes(&self) -> usize {
        match self {
            Self::Scalar(scalar) => scalar.least_bytes(),
            Self::Option(_) => 1,
            Self::List(_) => 4,
            Self::Array(element, count) => {
                let count = usize::try_from(*count).unwrap_or(usize::MAX);
                element.least_bytes().saturating_mul(count)
            }
            Self::Tuple(_) | Self::Struct(..) => {
                let of_parts = self.parts().map(Self::least_bytes);
                of_parts.fold(0, usize::saturating_add)
            }
        }
    }
}

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
    /// Parses a schema in its displayed form.
    ///
    /// # Errors
    ///
    /// The column, counted from 1, and the part expected there.
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
            // An option sign follows its type, and so deepens the type already read.
            None if schema.depth() > MOST_DEPTH => rest.refuse(DEEP),
            None if schema.weightless() > MOST_WEIGHTLESS => rest.refuse(WEIGHTLESS),
            None => Ok(schema),
            Some(_) => rest.refuse("the end"),
        }
    }
}

/// The rest of the text.
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
        // Each `?` is one more level around the type read so far.
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
        // As the reader of bytes does: every schema that can be typed can also be recorded.
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
