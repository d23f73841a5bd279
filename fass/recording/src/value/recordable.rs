//! The types whose values can be written down: the trait, and the scalars.

use alloc::string::String;
use alloc::vec::Vec;

use super::decode::{Decoder, Malformed};
use super::encode::{Encoder, Full};
use super::schema::{MOST_DEPTH, Scalar, Schema};

/// The most bytes of memory that a byte of input may become, for each level of the type's nesting.
pub const MOST_GROWTH: usize = 256;

/// A type whose values can be written down, and read again.
///
/// Implemented for what the [crate](crate#the-form-of-values) lists; an app's struct becomes one
/// by [`recordable!`](crate::recordable!). A type that is none is refused by the compiler:
///
/// ```compile_fail,E0277
/// let _ = recording::to_bytes(&std::time::Instant::now());
/// ```
///
/// ```
/// use recording::Recordable;
///
/// assert_eq!(<(u8, Option<[f32; 3]>)>::schema().to_string(), "(u8, [f32; 3]?)");
/// let value = (7, Some([1.0, 2.0, 3.0_f32]));
/// let bytes = recording::to_bytes(&value);
/// assert_eq!(bytes.len(), 1 + 1 + 12);
/// assert_eq!(<(u8, Option<[f32; 3]>)>::from_bytes(&bytes), Ok(value));
/// ```
#[diagnostic::on_unimplemented(
    message = "values of `{Self}` cannot be written down",
    label = "is not `recording::Recordable`",
    note = "define an app's struct within `recording::recordable! {{ ... }}`; for `usize` take `u64`"
)]
pub trait Recordable: Sized {
    /// The fewest bytes that a value takes.
    const LEAST_BYTES: usize;

    /// How deeply the type is nested. A type that contains itself has no depth, and does not
    /// compile.
    const DEPTH: usize;

    /// Returns what the type looks like.
    ///
    /// See [`Recordable`].
    fn schema() -> Schema;

    /// Writes the value. Allocates nothing.
    ///
    /// See [`Encoder`].
    fn encode(&self, out: &mut Encoder<'_>);

    /// Writes values one after the other; numbers at once, for that is many times as fast.
    #[doc(hidden)]
    fn encode_all(values: &[Self], out: &mut Encoder<'_>) {
        values.iter().for_each(|value| value.encode(out));
    }

    /// Reads a value.
    ///
    /// # Errors
    ///
    /// Where the bytes are none of this type.
    ///
    /// See [`Decoder`].
    fn decode(input: &mut Decoder<'_>) -> Result<Self, Malformed>;

    /// Reads the value that these bytes are.
    ///
    /// # Errors
    ///
    /// As [`decode`](Self::decode), or something is left.
    ///
    /// See [`Recordable`].
    fn from_bytes(bytes: &[u8]) -> Result<Self, Malformed> {
        const { assert!(Self::DEPTH <= MOST_DEPTH, "the type is nested too deeply") };
        let mut input = Decoder::new(bytes);
        let value = Self::decode(&mut input)?;
        input.end().map(|()| value)
    }
}

/// Returns a value's bytes.
///
/// ```
/// assert_eq!(recording::to_bytes(&Some(258_u16)), [1, 2, 1]);
/// ```
#[must_use]
pub fn to_bytes<T: Recordable>(value: &T) -> Vec<u8> {
    let mut bytes = Vec::new();
    loop {
        let mut out = Encoder::new(&mut bytes);
        value.encode(&mut out);
        match out.finish() {
            Ok(_) => return bytes,
            // The second time there is room.
            Err(Full { needed }) => bytes.resize(needed, 0),
        }
    }
}

macro_rules! implement_number {
    ($($number:ident $scalar:ident $expected:literal)*) => {
        $(impl Recordable for $number {
            const LEAST_BYTES: usize = size_of::<Self>();
            const DEPTH: usize = 1;

            fn schema() -> Schema {
                Schema::Scalar(Scalar::$scalar)
            }

            #[inline]
            fn encode(&self, out: &mut Encoder<'_>) {
                out.put(&self.to_le_bytes());
            }

            #[inline]
            fn encode_all(values: &[Self], out: &mut Encoder<'_>) {
                /// As many as are copied at once: each block by way of a place of its own, so
                /// the compiler knows that it does not overlap where it goes.
                const BLOCK: usize = 8;
                let Some(places) = out.places(size_of_val(values)) else {
                    return;
                };
                let (blocks, rest) = values.as_chunks::<BLOCK>();
                let places = places.as_chunks_mut::<{ size_of::<$number>() }>().0;
                let (block_places, rest_places) = places.as_chunks_mut::<BLOCK>();
                for (place, block) in block_places.iter_mut().zip(blocks) {
                    *place = block.map(Self::to_le_bytes);
                }
                for (place, value) in rest_places.iter_mut().zip(rest) {
                    *place = value.to_le_bytes();
                }
            }

            fn decode(input: &mut Decoder<'_>) -> Result<Self, Malformed> {
                input.array($expected).map(Self::from_le_bytes)
            }
        })*
    };
}

implement_number!(
    u8 U8 "a u8, 1 byte"
    u16 U16 "a u16, 2 bytes"
    u32 U32 "a u32, 4 bytes"
    u64 U64 "a u64, 8 bytes"
    u128 U128 "a u128, 16 bytes"
    i8 I8 "an i8, 1 byte"
    i16 I16 "an i16, 2 bytes"
    i32 I32 "an i32, 4 bytes"
    i64 I64 "an i64, 8 bytes"
    i128 I128 "an i128, 16 bytes"
    f32 F32 "an f32, 4 bytes"
    f64 F64 "an f64, 8 bytes"
);

impl Recordable for bool {
    const LEAST_BYTES: usize = 1;
    const DEPTH: usize = 1;

    fn schema() -> Schema {
        Schema::Scalar(Scalar::Bool)
    }

    fn encode(&self, out: &mut Encoder<'_>) {
        out.put(&[u8::from(*self)]);
    }

    fn decode(input: &mut Decoder<'_>) -> Result<Self, Malformed> {
        let malformed = input.expected("a truth value, 0 or 1");
        match input.array(malformed.expected)? {
            [0] => Ok(false),
            [1] => Ok(true),
            _ => Err(malformed),
        }
    }
}

impl Recordable for char {
    const LEAST_BYTES: usize = 4;
    const DEPTH: usize = 1;

    fn schema() -> Schema {
        Schema::Scalar(Scalar::Char)
    }

    fn encode(&self, out: &mut Encoder<'_>) {
        u32::from(*self).encode(out);
    }

    fn decode(input: &mut Decoder<'_>) -> Result<Self, Malformed> {
        let malformed = input.expected("a character, 4 bytes");
        let value = u32::from_le_bytes(input.array(malformed.expected)?);
        Self::from_u32(value).ok_or(malformed)
    }
}

impl Recordable for String {
    const LEAST_BYTES: usize = 4;
    const DEPTH: usize = 1;

    fn schema() -> Schema {
        Schema::Scalar(Scalar::Text)
    }

    fn encode(&self, out: &mut Encoder<'_>) {
        out.count(self.len());
        out.put(self.as_bytes());
    }

    fn decode(input: &mut Decoder<'_>) -> Result<Self, Malformed> {
        text(input).map(Self::from)
    }
}

/// Reads text without a copy.
pub(crate) fn text<'b>(input: &mut Decoder<'b>) -> Result<&'b str, Malformed> {
    let count = input.count(1)?;
    let malformed = input.expected("UTF-8 text");
    let bytes = input.take(count, malformed.expected)?;
    core::str::from_utf8(bytes).map_err(|error| malformed.behind(error.valid_up_to()))
}
