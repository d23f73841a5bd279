//! Schemas as bytes, for they stand in recordings.
//!
//! They are read as values are, trusting nothing: the depth is bounded, and so are the
//! parts that take no bytes; no list or array has such elements, of which a few bytes could
//! promise any number.

use alloc::boxed::Box;
use alloc::string::String;
use alloc::vec::Vec;

use super::decode::{Decoder, Malformed};
use super::encode::Encoder;
use super::recordable::Recordable;
use super::schema::{self, DEEP, Field, MOST_DEPTH, MOST_WEIGHTLESS, Scalar, Schema};

/// The numbers of the other kinds of schema; that of a scalar is its place in `Scalar::ALL`.
const OPTION: u8 = 32;
const LIST: u8 = 33;
const ARRAY: u8 = 34;
const TUPLE: u8 = 35;
const STRUCT: u8 = 36;

const KIND: &str = "the number of a type";
const WEIGHTLESS: &str = "elements that take bytes";

impl Recordable for Schema {
    const LEAST_BYTES: usize = 1;
    const DEPTH: usize = 1;

    fn schema() -> Schema {
        // Nothing reads a schema without knowing that it is one.
        Schema::Tuple(Vec::new())
    }

    fn encode(&self, out: &mut Encoder<'_>) {
        match self {
            Self::Scalar(scalar) => {
                let place = Scalar::ALL.iter().position(|other| other == scalar);
                let number = place.and_then(|place| u8::try_from(place).ok());
                out.put(&[number.unwrap_or(u8::MAX)]);
            }
            Self::Option(inner) => {
                out.put(&[OPTION]);
                inner.encode(out);
            }
            Self::List(element) => {
                out.put(&[LIST]);
                element.encode(out);
            }
            Self::Array(element, count) => {
                out.put(&[ARRAY]);
                count.encode(out);
                element.encode(out);
            }
            Self::Tuple(elements) => {
                out.put(&[TUPLE]);
                out.count(elements.len());
                elements.iter().for_each(|element| element.encode(out));
            }
            Self::Struct(name, fields) => {
                out.put(&[STRUCT]);
                name.encode(out);
                out.count(fields.len());
                for Field { name, schema } in fields {
                    name.encode(out);
                    schema.encode(out);
                }
            }
        }
    }

    fn decode(input: &mut Decoder<'_>) -> Result<Self, Malformed> {
        let malformed = input.expected(schema::WEIGHTLESS);
        let schema = Self::decode_at(input, 0)?;
        match schema.weightless() <= MOST_WEIGHTLESS {
            true => Ok(schema),
            false => Err(malformed),
        }
    }
}

impl Schema {
    fn decode_at(input: &mut Decoder<'_>, depth: usize) -> Result<Self, Malformed> {
        let start = input.clone();
        if depth == MOST_DEPTH {
            return Err(start.expected(DEEP));
        }
        let kind = u8::decode(input)?;
        if let Some(scalar) = Scalar::ALL.get(usize::from(kind)) {
            return Ok(Self::Scalar(*scalar));
        }
        let inner = |input: &mut Decoder<'_>| Self::decode_at(input, depth + 1);
        let element = |input: &mut Decoder<'_>| {
            let malformed = input.expected(WEIGHTLESS);
            let element = inner(input)?;
            match element.least_bytes() {
                0 => Err(malformed),
                _ => Ok(Box::new(element)),
            }
        };
        Ok(match kind {
            OPTION => Self::Option(Box::new(inner(input)?)),
            LIST => Self::List(element(input)?),
            ARRAY => {
                let count = u32::decode(input)?;
                Self::Array(element(input)?, count)
            }
            TUPLE => {
                let count = input.count(1)?;
                let elements = (0..count).map(|_| inner(input));
                Self::Tuple(elements.collect::<Result<_, _>>()?)
            }
            STRUCT => {
                let name = String::decode(input)?;
                let count = input.count(1)?;
                let fields = (0..count).map(|_| {
                    Ok(Field {
                        name: String::decode(input)?,
                        schema: inner(input)?,
                    })
                });
                Self::Struct(name, fields.collect::<Result<_, _>>()?)
            }
            _ => return Err(start.expected(KIND)),
        })
    }
}
