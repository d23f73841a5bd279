//! What a type looks like: names and types, so that values can be read without the type.

use alloc::boxed::Box;
use alloc::string::String;
use alloc::vec::Vec;

/// The deepest that types may be nested.
pub const MOST_DEPTH: usize = 16;

/// The most parts of a type that may take no bytes. So a value has no more than so many parts for
/// each of its bytes, and reading it takes a time that its length bounds.
pub const MOST_WEIGHTLESS: usize = 64;

/// What is expected of a type that has more.
pub(super) const WEIGHTLESS: &str = "a type with at most 64 parts that take no bytes";

/// What is expected of a type that is nested more deeply.
pub(super) const DEEP: &str = "a type that is nested less deeply";

/// What a type looks like. It is shown, and read by [`Schema::parse`], as a type of Rust but
/// for `T?`, an `Option<T>`, `[T]`, a `Vec<T>`, and `text`, a `String`.
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
    /// So many values.
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
    /// Its name.
    pub name: String,
    /// Its type.
    pub schema: Schema,
}

macro_rules! define_scalars {
    ($($Scalar:ident $name:literal $bytes:literal)*) => {
        /// A type that is not made of others.
        ///
        /// See [`Schema`].
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[allow(missing_docs, reason = "they are named after their types")]
        pub enum Scalar {
            $($Scalar),*
        }

        impl Scalar {
            /// All of them, in the order of their numbers in recordings.
            pub(crate) const ALL: &'static [Self] = &[$(Self::$Scalar),*];

            /// Returns the name of the type.
            ///
            /// ```
            /// assert_eq!(recording::Scalar::Text.name(), "text");
            /// ```
            #[must_use]
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

define_scalars!(
    Bool "bool" 1
    Char "char" 4
    Text "text" 4
    U8 "u8" 1
    U16 "u16" 2
    U32 "u32" 4
    U64 "u64" 8
    U128 "u128" 16
    I8 "i8" 1
    I16 "i16" 2
    I32 "i32" 4
    I64 "i64" 8
    I128 "i128" 16
    F32 "f32" 4
    F64 "f64" 8
);

impl Schema {
    /// Returns the schema of a struct.
    #[doc(hidden)]
    #[must_use]
    pub fn of_struct<const N: usize>(name: &str, fields: [(&str, Schema); N]) -> Self {
        let fields = fields.map(|(name, schema)| Field {
            name: name.into(),
            schema,
        });
        Self::Struct(name.into(), Vec::from(fields))
    }

    /// Returns how deeply the type is nested.
    pub(super) fn depth(&self) -> usize {
        let deepest = |depth: usize, schema: &Self| depth.max(schema.depth());
        1 + match self {
            Self::Scalar(_) => 0,
            Self::Option(inner) | Self::List(inner) | Self::Array(inner, _) => inner.depth(),
            Self::Tuple(elements) => elements.iter().fold(0, deepest),
            Self::Struct(_, fields) => {
                let schemas = fields.iter().map(|field| &field.schema);
                schemas.fold(0, deepest)
            }
        }
    }

    /// Returns how many parts of the type take no bytes.
    pub(super) fn weightless(&self) -> usize {
        let sum = |parts: usize, schema: &Self| parts.saturating_add(schema.weightless());
        usize::from(self.least_bytes() == 0)
            + match self {
                Self::Scalar(_) => 0,
                Self::Option(inner) | Self::List(inner) | Self::Array(inner, _) => {
                    inner.weightless()
                }
                Self::Tuple(elements) => elements.iter().fold(0, sum),
                Self::Struct(_, fields) => {
                    let schemas = fields.iter().map(|field| &field.schema);
                    schemas.fold(0, sum)
                }
            }
    }

    /// Returns the fewest bytes that a value takes.
    ///
    /// ```
    /// use recording::Recordable;
    /// assert_eq!(<([u16; 3], Vec<u8>)>::schema().least_bytes(), 10);
    /// ```
    #[must_use]
    pub fn least_bytes(&self) -> usize {
        let sum = |bytes: usize, schema: &Self| bytes.saturating_add(schema.least_bytes());
        match self {
            Self::Scalar(scalar) => scalar.least_bytes(),
            Self::Option(_) => 1,
            Self::List(_) => 4,
            Self::Array(element, count) => {
                let count = usize::try_from(*count).unwrap_or(usize::MAX);
                element.least_bytes().saturating_mul(count)
            }
            Self::Tuple(elements) => elements.iter().fold(0, sum),
            Self::Struct(_, fields) => {
                let schemas = fields.iter().map(|field| &field.schema);
                schemas.fold(0, sum)
            }
        }
    }
}
