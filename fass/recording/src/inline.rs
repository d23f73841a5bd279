//! Text and lists with inline storage, up to a fixed length: copying or reading allocates nothing.
//! Their recorded form is the form of `String` and `Vec`.

use alloc::boxed::Box;
use core::fmt;
use core::ops::Deref;

use super::bytes::{Decoder, Encoder, Malformed};
use super::recordable::Recordable;
use super::schema::{Scalar, Schema};

/// Text of `N` bytes at most.
///
/// ```
/// use recording::{Recordable, Text};
///
/// let frame = Text::<8>::new("odom");
/// assert_eq!(frame.len(), 4);
/// assert_eq!(recording::to_bytes(&frame), recording::to_bytes(&String::from("odom")));
/// assert_eq!(Text::<3>::try_new("odom"), None);
/// assert!(Text::<3>::from_bytes(&recording::to_bytes(&frame)).is_err(), "never cut");
/// ```
#[derive(Clone, Copy, Default, PartialEq, Eq)]
pub struct Text<const N: usize>(List<u8, N>);

impl<const N: usize> Text<N> {
    /// Makes an inline text from a text.
    ///
    /// # Panics
    ///
    /// If the text is longer than `N` bytes.
    #[must_use]
    #[track_caller]
    pub fn new(text: &str) -> Self {
        Self::try_new(text).expect("the text is longer than its place; state a longer one")
    }

    /// Makes an inline text from a text, if that fits.
    #[must_use]
    pub fn try_new(text: &str) -> Option<Self> {
        List::try_new(text.as_bytes()).map(Self)
    }
}

impl<const N: usize> Deref for Text<N> {
    type Target = str;

    fn deref(&self) -> &str {
        // Never the default: the bytes come from a text.
        str::from_utf8(&self.0).unwrap_or_default()
    }
}

impl<const N: usize> fmt::Debug for Text<N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(&**self, f)
    }
}

impl<const N: usize> Recordable for Text<N> {
    const LEAST_BYTES: usize = 4;
    const DEPTH: usize = 1;

    fn schema() -> Schema {
        Schema::Scalar(Scalar::Text)
    }

    fn encode<const CDR: bool>(&self, out: &mut Encoder<'_, CDR>) {
        out.text(self);
    }

    fn decode<const CDR: bool>(input: &mut Decoder<'_, CDR>) -> Result<Self, Malformed> {
        let malformed = input.expected("a text that is not longer than its place");
        Self::try_new(input.text()?).ok_or(malformed)
    }
}

/// A list of `N` elements at most, usable as a slice.
///
/// ```
/// use recording::{List, Recordable};
///
/// let ranges = List::<f32, 4>::try_new(&[1.0, 2.0]).unwrap();
/// assert_eq!(ranges.iter().sum::<f32>(), 3.0);
/// assert_eq!(recording::to_bytes(&ranges), recording::to_bytes(&vec![1.0_f32, 2.0]));
/// assert_eq!(List::<f32, 1>::try_new(&[1.0, 2.0]), None);
/// assert!(List::<f32, 1>::from_bytes(&recording::to_bytes(&ranges)).is_err(), "never cut");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct List<T, const N: usize> {
    length: usize,
    /// Defaults behind the length.
    elements: [T; N],
}

impl<T: Copy + Default, const N: usize> List<T, N> {
    /// Makes a list of these elements, if they fit.
    #[must_use]
    pub fn try_new(elements: &[T]) -> Option<Self> {
        let mut list = Self::default();
        list.elements
            .get_mut(..elements.len())?
            .copy_from_slice(elements);
        list.length = elements.len();
        Some(list)
    }
}

impl<T, const N: usize> Deref for List<T, N> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        &self.elements[..self.length]
    }
}

impl<T: Copy + Default, const N: usize> Default for List<T, N> {
    fn default() -> Self {
        let elements = [T::default(); N];
        Self {
            length: 0,
            elements,
        }
    }
}

impl<T: Recordable + Copy + Default, const N: usize> Recordable for List<T, N> {
    const LEAST_BYTES: usize = 4;
    const DEPTH: usize = 1 + T::DEPTH;

    fn schema() -> Schema {
        Schema::List(Box::new(T::schema()))
    }

    fn encode<const CDR: bool>(&self, out: &mut Encoder<'_, CDR>) {
        out.count(self.length);
        T::encode_all(self, out);
    }

    fn decode<const CDR: bool>(input: &mut Decoder<'_, CDR>) -> Result<Self, Malformed> {
        const {
            assert!(
                T::LEAST_BYTES > 0,
                "a list of what takes no bytes has no length"
            )
        };
        let malformed = input.expected("no more elements than there are places for");
        let length = input.count(T::LEAST_BYTES)?;
        let mut elements = [T::default(); N];
        for place in elements.get_mut(..length).ok_or(malformed)? {
            *place = T::decode(input)?;
        }
        Ok(Self { length, elements })
    }
}
