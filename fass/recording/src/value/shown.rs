//! Values as text: JSON, for people and for programs.
//!
//! A struct is an object, what else has parts is an array; an option without a value, and a
//! number that is infinite or none, is `null`, since JSON has no word for these.

use core::fmt::{self, Write};

use super::decode::{Decoder, Malformed};
use super::schema::Schema;
use super::walk::Part;

/// Writes a value, whose type is known by its schema, as JSON.
///
/// # Errors
///
/// The bytes are no value of this type. (What `out` says of its own errors is lost.)
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
        follows = !matches!(part, Part::Open(_) | Part::Field(_));
        let _ = write!(out, "{part}");
    })?;
    input.end()
}

/// A part by itself is shown as JSON.
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
            // Most numbers are short, and are faster so.
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

/// Writes a string of JSON (RFC 8259, section 7).
fn write_text(text: &str, out: &mut dyn Write) -> fmt::Result {
    out.write_char('"')?;
    for letter in text.chars() {
        match letter {
            '"' => out.write_str("\\\"")?,
            '\\' => out.write_str("\\\\")?,
            control if control < ' ' => write!(out, "\\u{:04x}", u32::from(control))?,
            other => out.write_char(other)?,
        }
    }
    out.write_char('"')
}

/// A value in a message: as JSON, or the bytes where they are none of its type.
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
        let walked = schema.walk(&mut input, &mut |_| ());
        match walked.and_then(|()| input.end()) {
            Ok(()) => write_json(schema, bytes, f).map_err(|_| fmt::Error),
            Err(_) => write!(f, "bytes {bytes:?}"),
        }
    }
}
