//! Going through a value by its schema, without its type.

use super::decode::{Decoder, Malformed};
use super::recordable::{Recordable, text};
use super::schema::{Field, Scalar, Schema};

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
    /// They were the last ones.
    Close(Option<&'p str>),
    /// An option without a value. One with a value is that value.
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
    Text: &'static str;
    Unsigned: u8 u16 u32 u64 u128;
    Signed: i8 i16 i32 i64 i128;
    Single: f32;
    Double: f64;
);

impl From<usize> for Part<'_> {
    fn from(value: usize) -> Self {
        Self::Unsigned(value as u128)
    }
}

impl Schema {
    /// Goes through a value of this type, part by part.
    ///
    /// # Errors
    ///
    /// The bytes are none; the parts before were seen.
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

impl Scalar {
    fn read<'b>(self, input: &mut Decoder<'b>) -> Result<Part<'b>, Malformed> {
        Ok(match self {
            Self::Bool => Part::Bool(bool::decode(input)?),
            Self::Char => Part::Char(char::decode(input)?),
            Self::Text => Part::Text(text(input)?),
            Self::U8 => Part::Unsigned(u8::decode(input)?.into()),
            Self::U16 => Part::Unsigned(u16::decode(input)?.into()),
            Self::U32 => Part::Unsigned(u32::decode(input)?.into()),
            Self::U64 => Part::Unsigned(u64::decode(input)?.into()),
            Self::U128 => Part::Unsigned(u128::decode(input)?),
            Self::I8 => Part::Signed(i8::decode(input)?.into()),
            Self::I16 => Part::Signed(i16::decode(input)?.into()),
            Self::I32 => Part::Signed(i32::decode(input)?.into()),
            Self::I64 => Part::Signed(i64::decode(input)?.into()),
            Self::I128 => Part::Signed(i128::decode(input)?),
            Self::F32 => Part::Single(f32::decode(input)?),
            Self::F64 => Part::Double(f64::decode(input)?),
        })
    }
}
