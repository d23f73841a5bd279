//! Values that are made of others: options, lists, arrays, tuples, shared ones.

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec::Vec;

use super::decode::{Decoder, Malformed};
use super::encode::Encoder;
use super::recordable::{MOST_GROWTH, Recordable};
use super::schema::Schema;

/// Reports whether a value in the heap is not much larger than the bytes that it comes from.
const fn is_moderate<T: Recordable>() -> bool {
    size_of::<T>() <= MOST_GROWTH * T::LEAST_BYTES
}

impl<T: Recordable> Recordable for Option<T> {
    const LEAST_BYTES: usize = 1;
    const DEPTH: usize = 1 + T::DEPTH;

    fn schema() -> Schema {
        Schema::Option(Box::new(T::schema()))
    }

    fn encode(&self, out: &mut Encoder<'_>) {
        self.is_some().encode(out);
        if let Some(value) = self {
            value.encode(out);
        }
    }

    fn decode(input: &mut Decoder<'_>) -> Result<Self, Malformed> {
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

    fn encode(&self, out: &mut Encoder<'_>) {
        out.count(self.len());
        T::encode_all(self, out);
    }

    fn decode(input: &mut Decoder<'_>) -> Result<Self, Malformed> {
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
        // Not more than the count says, which the bytes that are left bound.
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
    fn encode(&self, out: &mut Encoder<'_>) {
        T::encode_all(self, out);
    }

    fn decode(input: &mut Decoder<'_>) -> Result<Self, Malformed> {
        const {
            assert!(
                T::LEAST_BYTES > 0,
                "an array of what takes no bytes has no schema; leave it out"
            );
        }
        let mut malformed = None;
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

            fn encode(&self, out: &mut Encoder<'_>) {
                T::encode(self, out);
            }

            fn decode(input: &mut Decoder<'_>) -> Result<Self, Malformed> {
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
            fn encode(&self, out: &mut Encoder<'_>) {
                let ($($item,)*) = self;
                $($item.encode(out);)*
            }

            #[allow(unused_variables, reason = "the empty tuple takes no bytes")]
            fn decode(input: &mut Decoder<'_>) -> Result<Self, Malformed> {
                Ok(($($Item::decode(input)?,)*))
            }
        }
    };
}

/// Returns how deeply that is nested which has elements of these depths.
#[must_use]
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
