//! Walks through a value by its schema, without its type, and writes JSON, for people and programs.
//!
//! A struct becomes an object, anything else with parts an array. An option without a value, and a
//! number that is infinite or NaN, becomes `null`, since JSON has no word for these.

use alloc::string::String;
use alloc::vec::Vec;
use core::fmt::{self, Write};

use super::bytes::{Decoder, Malformed};
use super::recordable::{Recordable, to_bytes};
use super::schema::{Field, Scalar, Schema, of_scalars};

/// A part of a value, in the order of its bytes.
///
/// ```
/// use recording::{Decoder, Part, Recordable};
///
/// let bytes = recording::to_bytes(&[7_u8, 8]);
/// let mut parts = Vec::new();
/// let walked = <[u8; 2]>::schema().walk(&mut Decoder::new(&bytes), &mut |part| {
///     parts.push(format!("{part:?}"));
/// });
/// assert_eq!(walked, Ok(()));
/// assert_eq!(parts, ["Open(None)", "Unsigned(7)", "Unsigned(8)", "Close(None)"]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Part<'p> {
    /// The elements of a list, array or tuple follow, or the fields of the struct of this name.
    Open(Option<&'p str>),
    /// The next part is the value of the field of this name.
    Field(&'p str),
    /// The end of the elements or fields.
    Close(Option<&'p str>),
    /// An option without a value. An option with a value is just that value.
    Nothing,
    /// A truth value.
    Bool(bool),
    /// A character.
    Char(char),
    /// Text.
    Text(&'p str),
    /// A number without sign.
    Unsigned(u128),
    /// A number with sign.
    Signed(i128),
    /// A number of single precision.
    Single(f32),
    /// A number of double precision.
    Double(f64),
}

macro_rules! part_from {
    ($($Part:ident: $($type:ty)+;)+) => {
        $($(impl From<$type> for Part<'_> {
            fn from(value: $type) -> Self {
                Self::$Part(value.into())
            }
        })+)+
    };
}

part_from!(
    Bool: bool;
    Char: char;
    Unsigned: u8 u16 u32 u64 u128;
    Signed: i8 i16 i32 i64 i128;
    Single: f32;
    Double: f64;
);

impl<'p> From<&'p str> for Part<'p> {
    fn from(value: &'p str) -> Self {
        Self::Text(value)
    }
}

impl From<usize> for Part<'_> {
    fn from(value: usize) -> Self {
        Self::Unsigned(value as u128)
    }
}

impl Schema {
    /// Walks through a value of this type, part by part.
    ///
    /// # Errors
    ///
    /// The bytes are not such a value; `see` got earlier parts.
    ///
    /// See [`Part`].
    pub fn walk(
        &self,
        input: &mut Decoder<'_>,
        see: &mut dyn FnMut(Part<'_>),
    ) -> Result<(), Malformed> {
        match self {
            Self::Scalar(scalar) => {
                see(scalar.read(input)?);
                return Ok(());
            }
            Self::Option(inner) => {
                if bool::decode(input)? {
                    return inner.walk(input, see);
                }
                see(Part::Nothing);
                return Ok(());
            }
            Self::List(element) => {
                let count = input.count(element.least_bytes())?;
                see(Part::Open(None));
                for _ in 0..count {
                    element.walk(input, see)?;
                }
            }
            Self::Array(element, count) => {
                see(Part::Open(None));
                for _ in 0..*count {
                    element.walk(input, see)?;
                }
            }
            Self::Tuple(elements) => {
                see(Part::Open(None));
                for element in elements {
                    element.walk(input, see)?;
                }
            }
            Self::Struct(name, fields) => {
                see(Part::Open(Some(name)));
                for Field { name, schema } in fields {
                    see(Part::Field(name));
                    schema.walk(input, see)?;
                }
                see(Part::Close(Some(name)));
                return Ok(());
            }
        }
        see(Part::Close(None));
        Ok(())
    }
}

macro_rules! read_scalars {
    ($($Scalar:ident $name:literal $bytes:literal $Type:ident $read:expr;)*) => {
        impl Scalar {
            /// Returns the bytes of a value in Rust's notation; text stands for itself. `None` if
            /// the type has no such value.
            ///
            /// ```
            /// assert_eq!(recording::Scalar::U16.parse("258"), Some(vec![2, 1]));
            /// ```
            pub fn parse(self, value: &str) -> Option<Vec<u8>> {
                match self {
                    $(Self::$Scalar => value.parse::<$Type>().ok().map(|value| to_bytes(&value))),*
                }
            }

            fn read<'b>(self, input: &mut Decoder<'b>) -> Result<Part<'b>, Malformed> {
                match self {
                    $(Self::$Scalar => $read(input).map(Part::from)),*
                }
            }
        }
    };
}

of_scalars!(read_scalars);

/// Writes a value as JSON, using its schema instead of its type.
///
/// # Errors
///
/// The bytes are not a value of this type. (Errors of `out` are lost.)
///
/// ```
/// use recording::Recordable;
///
/// let bytes = recording::to_bytes(&(1.5_f64, Some(true), String::from("\"")));
/// let mut json = String::new();
/// recording::write_json(&<(f64, Option<bool>, String)>::schema(), &bytes, &mut json).unwrap();
/// assert_eq!(json, r#"[1.5,true,"\""]"#);
/// ```
pub fn write_json(schema: &Schema, bytes: &[u8], out: &mut dyn Write) -> Result<(), Malformed> {
    let mut input = Decoder::new(bytes);
    // Whether a comma belongs before the next part.
    let mut follows = false;
    schema.walk(&mut input, &mut |part| {
        if follows && !matches!(part, Part::Close(_)) {
            let _ = out.write_char(',');
        }
        // No comma before the first part of a whole, or between a field's name and its value.
        follows = !matches!(part, Part::Open(_) | Part::Field(_));
        let _ = write!(out, "{part}");
    })?;
    input.expect_end()
}

/// Displays a single part as JSON.
impl fmt::Display for Part<'_> {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Part::Open(None) => out.write_char('['),
            Part::Close(None) => out.write_char(']'),
            Part::Open(Some(_)) => out.write_char('{'),
            Part::Close(Some(_)) => out.write_char('}'),
            Part::Field(name) => {
                write_text(name, out)?;
                out.write_char(':')
            }
            Part::Nothing => out.write_str("null"),
            Part::Bool(truth) => write!(out, "{truth}"),
            Part::Char(letter) => write_text(letter.encode_utf8(&mut [0; 4]), out),
            Part::Text(text) => write_text(text, out),
            // Most numbers are short, and faster in this way.
            Part::Unsigned(number) => match u64::try_from(number) {
                Ok(number) => write!(out, "{number}"),
                Err(_) => write!(out, "{number}"),
            },
            Part::Signed(number) => match i64::try_from(number) {
                Ok(number) => write!(out, "{number}"),
                Err(_) => write!(out, "{number}"),
            },
            Part::Single(number) if number.is_finite() => write!(out, "{number:?}"),
            Part::Double(number) if number.is_finite() => write!(out, "{number:?}"),
            Part::Single(_) | Part::Double(_) => out.write_str("null"),
        }
    }
}

/// Writes a JSON string (RFC 8259, section 7).
fn write_text(text: &str, out: &mut dyn Write) -> fmt::Result {
    out.write_char('"')?;
    for letter in text.chars() {
        match letter {
            '"' => out.write_str("\\\"")?,
            '\\' => out.write_str("\\\\")?,
            // JSON allows all other characters as they are, in UTF-8.
            control if control < ' ' => write!(out, "\\u{:04x}", u32::from(control))?,
            other => out.write_char(other)?,
        }
    }
    out.write_char('"')
}

/// A value in a message: as JSON, or as bytes if they do not fit the type.
///
/// ```
/// use recording::{Recordable, Shown};
///
/// let schema = <[u16; 2]>::schema();
/// let shown = |bytes| Shown { schema: &schema, bytes }.to_string();
/// assert_eq!(shown(&[1, 0, 2, 0]), "[1,2]");
/// assert_eq!(shown(&[1]), "bytes [1]");
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Shown<'s> {
    /// The type.
    pub schema: &'s Schema,
    /// The value.
    pub bytes: &'s [u8],
}

impl fmt::Display for Shown<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { schema, bytes } = *self;
        let mut input = Decoder::new(bytes);
        // Once without output: half a value in JSON would look like a whole one.
        let walked = schema.walk(&mut input, &mut |_| ());
        match walked.and_then(|()| input.expect_end()) {
            Ok(()) => write_json(schema, bytes, f).map_err(|_| fmt::Error),
            Err(_) => write!(f, "bytes {bytes:?}"),
        }
    }
}
