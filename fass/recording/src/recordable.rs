//! The types whose values can be written down: the trait, scalars, an app's structs, and composed
//! types: options, lists, arrays, tuples, shared values.
//!
//! Schemas are recordable, too, as they are parts of recordings. They are read like values, without
//! any trust: the depth is bounded, and so are the parts taking no bytes. The elements of lists and
//! arrays always take bytes; otherwise a few bytes could promise any number of elements.

use alloc::boxed::Box;
use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec::Vec;

use super::bytes::{Decoder, Encoder, Full, Malformed, require};
use super::schema;
use super::schema::{DEEP, Field, MOST_DEPTH, MOST_WEIGHTLESS, Scalar, Schema};

/// The most bytes of memory resulting from a byte of input, for each level of the type's nesting.
pub const MOST_GROWTH: usize = 256;

/// A type whose values can be written down, and read again.
///
/// Implemented for the types listed in the [crate](crate#the-form-of-values). An app's struct
/// becomes recordable by [`recordable!`](crate::recordable!). The compiler refuses other types:
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
    /// The fewest bytes of a value.
    const LEAST_BYTES: usize;

    /// The depth of the type's nesting. A type containing itself has no depth, and does not
    /// compile.
    const DEPTH: usize;

    /// Returns the form of the type.
    ///
    /// See [`Recordable`].
    fn schema() -> Schema;

    /// Writes the value. Allocates nothing.
    ///
    /// See [`Encoder`].
    fn encode<const CDR: bool>(&self, out: &mut Encoder<'_, CDR>);

    /// Writes values one after the other; numbers all at once, many times as fast.
    #[doc(hidden)]
    fn encode_all<const CDR: bool>(values: &[Self], out: &mut Encoder<'_, CDR>) {
        values.iter().for_each(|value| value.encode(out));
    }

    /// Reads a value.
    ///
    /// # Errors
    ///
    /// The place at which the bytes do not fit the type.
    ///
    /// See [`Decoder`].
    fn decode<const CDR: bool>(input: &mut Decoder<'_, CDR>) -> Result<Self, Malformed>;

    /// Reads the value made of exactly these bytes.
    ///
    /// # Errors
    ///
    /// As [`decode`](Self::decode), or if bytes are left.
    ///
    /// See [`Recordable`].
    fn from_bytes(bytes: &[u8]) -> Result<Self, Malformed> {
        // At compile time: no value of such a type could be read by its schema.
        const { assert!(Self::DEPTH <= MOST_DEPTH, "the type is nested too deeply") };
        let mut input = Decoder::new(bytes);
        let value = Self::decode(&mut input)?;
        input.expect_end().map(|()| value)
    }
}

/// Returns a value's bytes.
///
/// ```
/// assert_eq!(recording::to_bytes(&Some(258_u16)), [1, 2, 1]);
/// ```
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
            fn encode<const CDR: bool>(&self, out: &mut Encoder<'_, CDR>) {
                const { require(!CDR || Self::LEAST_BYTES <= 8) }
                out.align(size_of::<Self>());
                out.put(&self.to_le_bytes());
            }

            #[inline]
            fn encode_all<const CDR: bool>(values: &[Self], out: &mut Encoder<'_, CDR>) {
                /// The number of values copied at once. Each block goes through a place of its own,
                /// so the compiler knows that source and target do not overlap.
                const BLOCK: usize = 8;
                if !values.is_empty() {
                    out.align(size_of::<Self>());
                }
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

            fn decode<const CDR: bool>(input: &mut Decoder<'_, CDR>) -> Result<Self, Malformed> {
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

    fn encode<const CDR: bool>(&self, out: &mut Encoder<'_, CDR>) {
        out.put(&[u8::from(*self)]);
    }

    fn decode<const CDR: bool>(input: &mut Decoder<'_, CDR>) -> Result<Self, Malformed> {
        let malformed = input.expected("a truth value, 0 or 1");
        // Other bytes are refused, not taken for true: each of the two values has one form.
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

    fn encode<const CDR: bool>(&self, out: &mut Encoder<'_, CDR>) {
        const { require(!CDR) }
        u32::from(*self).encode(out);
    }

    fn decode<const CDR: bool>(input: &mut Decoder<'_, CDR>) -> Result<Self, Malformed> {
        const { require(!CDR) }
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

    fn encode<const CDR: bool>(&self, out: &mut Encoder<'_, CDR>) {
        out.text(self);
    }

    fn decode<const CDR: bool>(input: &mut Decoder<'_, CDR>) -> Result<Self, Malformed> {
        input.text().map(Self::from)
    }
}

/// Defines structs whose values can be written down: a struct is written field by field.
///
/// Takes structs with named fields and without parameters, in their usual notation; the fields'
/// types have to be [`Recordable`].
///
/// ```
/// use recording::Recordable;
///
/// recording::recordable! {
///     /// What a sensor has seen.
///     #[derive(Clone, Debug, PartialEq)]
///     pub struct Seen {
///         /// In metres.
///         pub distance: f64,
///         pub colours: [u8; 3],
///     }
/// }
/// let schema = Seen::schema();
/// assert_eq!(schema.to_string(), "Seen { distance: f64, colours: [u8; 3] }");
/// let seen = Seen { distance: 1.0, colours: [1, 2, 3] };
/// assert_eq!(Seen::from_bytes(&recording::to_bytes(&seen)), Ok(seen));
/// ```
#[macro_export]
macro_rules! recordable {
    ($(
        $(#[$attribute:meta])*
        $visible:vis struct $Struct:ident {
            $($(#[$of_field:meta])* $field_visible:vis $field:ident: $Type:ty),* $(,)?
        }
    )*) => {
        $(
            $(#[$attribute])*
            $visible struct $Struct {
                $($(#[$of_field])* $field_visible $field: $Type),*
            }

            impl $crate::Recordable for $Struct {
                const LEAST_BYTES: usize = 0 $(+ <$Type as $crate::Recordable>::LEAST_BYTES)*;
                const DEPTH: usize =
                    $crate::deepest(&[$(<$Type as $crate::Recordable>::DEPTH),*]);

                fn schema() -> $crate::Schema {
                    $crate::Schema::of_struct(
                        stringify!($Struct),
                        [$((stringify!($field), <$Type as $crate::Recordable>::schema())),*],
                    )
                }

                fn encode<const CDR: bool>(&self, out: &mut $crate::Encoder<'_, CDR>) {
                    $($crate::Recordable::encode(&self.$field, out);)*
                }

                fn decode<const CDR: bool>(input: &mut $crate::Decoder<'_, CDR>) -> Result<Self, $crate::Malformed> {
                    Ok(Self { $($field: $crate::Recordable::decode(input)?),* })
                }
            }
        )*
    };
}

/// Reports whether a value on the heap is not much larger than its recorded bytes.
const fn is_moderate<T: Recordable>() -> bool {
    size_of::<T>() <= MOST_GROWTH * T::LEAST_BYTES
}

impl<T: Recordable> Recordable for Option<T> {
    const LEAST_BYTES: usize = 1;
    const DEPTH: usize = 1 + T::DEPTH;

    fn schema() -> Schema {
        Schema::Option(Box::new(T::schema()))
    }

    fn encode<const CDR: bool>(&self, out: &mut Encoder<'_, CDR>) {
        const { require(!CDR) }
        self.is_some().encode(out);
        if let Some(value) = self {
            value.encode(out);
        }
    }

    fn decode<const CDR: bool>(input: &mut Decoder<'_, CDR>) -> Result<Self, Malformed> {
        const { require(!CDR) }
        match bool::decode(input)? {
            true => T::decode(input).map(Some),
            false => Ok(None),
        }
    }
}

impl<T: Recordable> Recordable for Vec<T> {
    const LEAST_BYTES: usize = 4;
    const DEPTH: usize = 1 + T::DEPTH;

    fn schema() -> Schema {
        Schema::List(Box::new(T::schema()))
    }

    fn encode<const CDR: bool>(&self, out: &mut Encoder<'_, CDR>) {
        out.count(self.len());
        T::encode_all(self, out);
    }

    fn decode<const CDR: bool>(input: &mut Decoder<'_, CDR>) -> Result<Self, Malformed> {
        const {
            assert!(
                T::LEAST_BYTES > 0,
                "a list of what takes no bytes has no length; record a count"
            );
            assert!(
                is_moderate::<T>(),
                "few bytes would become much memory; box what is optional"
            );
        }
        let count = input.count(T::LEAST_BYTES)?;
        // Not more than the count, bounded by the bytes left.
        let mut values = Self::with_capacity(count);
        for _ in 0..count {
            values.push(T::decode(input)?);
        }
        Ok(values)
    }
}

impl<T: Recordable, const N: usize> Recordable for [T; N] {
    const LEAST_BYTES: usize = N * T::LEAST_BYTES;
    const DEPTH: usize = 1 + T::DEPTH;

    fn schema() -> Schema {
        Schema::Array(Box::new(T::schema()), u32::try_from(N).unwrap_or(u32::MAX))
    }

    #[inline]
    fn encode<const CDR: bool>(&self, out: &mut Encoder<'_, CDR>) {
        T::encode_all(self, out);
    }

    fn decode<const CDR: bool>(input: &mut Decoder<'_, CDR>) -> Result<Self, Malformed> {
        const {
            assert!(
                T::LEAST_BYTES > 0,
                "an array of what takes no bytes has no schema; leave it out"
            );
        }
        let mut malformed = None;
        // `map` cannot stop early, so after an error the other elements are not read.
        let values = [(); N].map(|()| match malformed {
            None => T::decode(input)
                .map_err(|error| malformed = Some(error))
                .ok(),
            Some(_) => None,
        });
        match malformed {
            Some(malformed) => Err(malformed),
            None => Ok(values.map(|value| value.expect("nothing was malformed"))),
        }
    }
}

macro_rules! implement_pointer {
    ($($Pointer:ident)*) => {
        $(impl<T: Recordable> Recordable for $Pointer<T> {
            const LEAST_BYTES: usize = T::LEAST_BYTES;
            const DEPTH: usize = 1 + T::DEPTH;

            fn schema() -> Schema {
                T::schema()
            }

            fn encode<const CDR: bool>(&self, out: &mut Encoder<'_, CDR>) {
                T::encode(self, out);
            }

            fn decode<const CDR: bool>(input: &mut Decoder<'_, CDR>) -> Result<Self, Malformed> {
                const {
                    assert!(is_moderate::<T>(), "few bytes would become much memory; box what is optional");
                }
                T::decode(input).map(Self::new)
            }
        })*
    };
}

implement_pointer!(Arc Box);

macro_rules! implement_tuple {
    ($($Item:ident $item:ident)*) => {
        impl<$($Item: Recordable),*> Recordable for ($($Item,)*) {
            const LEAST_BYTES: usize = 0 $(+ $Item::LEAST_BYTES)*;
            const DEPTH: usize = deepest(&[$($Item::DEPTH),*]);

            fn schema() -> Schema {
                Schema::Tuple(Vec::from([$($Item::schema()),*]))
            }

            #[allow(unused_variables, reason = "the empty tuple takes no bytes")]
            fn encode<const CDR: bool>(&self, out: &mut Encoder<'_, CDR>) {
                let ($($item,)*) = self;
                $($item.encode(out);)*
            }

            #[allow(unused_variables, reason = "the empty tuple takes no bytes")]
            fn decode<const CDR: bool>(input: &mut Decoder<'_, CDR>) -> Result<Self, Malformed> {
                Ok(($($Item::decode(input)?,)*))
            }
        }
    };
}

/// Returns the depth of a type with elements of these depths.
pub const fn deepest(elements: &[usize]) -> usize {
    let (mut deepest, mut index) = (0, 0);
    while index < elements.len() {
        if elements[index] > deepest {
            deepest = elements[index];
        }
        index += 1;
    }
    1 + deepest
}

implement_tuple!();
implement_tuple!(A a);
implement_tuple!(A a B b);
implement_tuple!(A a B b C c);
implement_tuple!(A a B b C c D d);
implement_tuple!(A a B b C c D d E e);
implement_tuple!(A a B b C c D d E e F f);
implement_tuple!(A a B b C c D d E e F f G g);
implement_tuple!(A a B b C c D d E e F f G g H h);

/// The numbers of the other kinds of schema; a scalar's number is its place in `Scalar::ALL`.
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

    fn encode<const CDR: bool>(&self, out: &mut Encoder<'_, CDR>) {
        match self {
            Self::Scalar(scalar) => {
                out.put(&[*scalar as u8]);
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

    fn decode<const CDR: bool>(input: &mut Decoder<'_, CDR>) -> Result<Self, Malformed> {
        let malformed = input.expected(schema::WEIGHTLESS);
        let schema = Self::decode_at(input, 0)?;
        match schema.weightless() <= MOST_WEIGHTLESS {
            true => Ok(schema),
            false => Err(malformed),
        }
    }
}

impl Schema {
    fn decode_at<const CDR: bool>(
        input: &mut Decoder<'_, CDR>,
        depth: usize,
    ) -> Result<Self, Malformed> {
        let start = input.clone();
        // Before anything is read: each level is a call, and the stack is finite.
        if depth == MOST_DEPTH {
            return Err(start.expected(DEEP));
        }
        let kind = u8::decode(input)?;
        if let Some(scalar) = Scalar::ALL.get(usize::from(kind)) {
            return Ok(Self::Scalar(*scalar));
        }
        let inner = |input: &mut Decoder<'_, CDR>| Self::decode_at(input, depth + 1);
        let element = |input: &mut Decoder<'_, CDR>| {
            let malformed = input.expected(WEIGHTLESS);
            let element = inner(input)?;
            match element.least_bytes() {
                // A list of such elements would have any number of elements in no bytes.
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
                // Each element's schema takes a byte at least.
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
