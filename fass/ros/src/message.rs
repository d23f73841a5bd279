//! Messages: the requirements on a message's struct, and its bytes on a wire.

use recording::{Decoder, Encoder, Recordable};

/// The representation of the body, CDR in little-endian order, and its options.
const LITTLE_ENDIAN: [u8; 4] = [0, 1, 0, 0];

/// A type of messages, defined by [`message!`](crate::message!). The type is `Copy`, and so has
/// nothing on the heap: [`Text`](crate::Text) and [`List`](crate::List) replace text and sequences.
pub trait Message: Recordable + Copy + Send + Sync + 'static {
    /// The name of the type, such as `geometry_msgs/msg/Twist`.
    const NAME: &'static str;

    /// The type's hash by REP 2011, without `RIHS01_`: 64 digits. With a wrong hash neither side
    /// hears of the other.
    const HASH: &'static str;
}

/// Defines types of messages, each with the name and the hash of its ROS 2 type.
///
/// ```
/// ros::message! {
///     /// How full a tank is.
///     pub struct Tank: "plant_msgs/msg/Tank",
///         "0000000000000000000000000000000000000000000000000000000000000000" {
///         /// In litres.
///         pub level: f32,
///         pub name: ros::Text<32>,
///     }
/// }
/// let tank = Tank { level: 0.5, name: ros::Text::new("a") };
/// let mut bytes = [0; 32];
/// let length = ros::to_cdr(&tank, &mut bytes);
/// assert_eq!(bytes[..length], [0, 1, 0, 0, 0, 0, 0, 63, 2, 0, 0, 0, b'a', 0]);
/// assert_eq!(ros::from_cdr(&bytes[..length]), Some(tank));
/// ```
///
/// A field type unknown to ROS 2 is a compiler error:
///
/// ```compile_fail,E0080
/// ros::message! {
///     struct Maybe: "plant_msgs/msg/Maybe", "" {
///         value: Option<u8>,
///     }
/// }
/// ros::from_cdr::<Maybe>(&[]);
/// ```
#[macro_export]
macro_rules! message {
    ($(
        $(#[$attribute:meta])*
        $visible:vis struct $Struct:ident: $name:expr, $hash:literal { $($fields:tt)* }
    )*) => {$(
        $crate::recordable! {
            $(#[$attribute])*
            #[derive(Clone, Copy, Debug, Default, PartialEq)]
            $visible struct $Struct { $($fields)* }
        }

        impl $crate::Message for $Struct {
            const NAME: &'static str = $name;
            const HASH: &'static str = $hash;
        }
    )*};
}

/// Writes a message in its wire format, and returns its length in bytes. If the length exceeds that
/// of `place`, the contents of `place` are of no use.
pub fn to_cdr<T: Message>(message: &T, place: &mut [u8]) -> usize {
    let (header, body) = match place.split_first_chunk_mut() {
        Some((header, body)) => (header, body),
        None => (&mut [0; 4], &mut [][..]),
    };
    *header = LITTLE_ENDIAN;
    let mut out = Encoder::cdr(body);
    message.encode(&mut out);
    let length = out.finish().unwrap_or_else(|full| full.needed);
    length.saturating_add(LITTLE_ENDIAN.len())
}

/// Reads a message; `None` if the bytes do not fit its type, or are in big-endian representation.
#[must_use]
pub fn from_cdr<T: Message>(bytes: &[u8]) -> Option<T> {
    // Options follow the representation: some give the number of padding bytes at the message's
    // end.
    let ([0, 1, _, _], body) = bytes.split_first_chunk()? else {
        return None;
    };
    let mut input = Decoder::cdr(body);
    let message = T::decode(&mut input).ok()?;
    (input.remaining() < 4).then_some(message)
}

/// Returns a length that no message of the type exceeds: each byte of memory at most doubles, where
/// a byte precedes a number of 8 bytes.
pub(crate) const fn most_bytes<T: Message>() -> usize {
    LITTLE_ENDIAN.len() + 2 * size_of::<T>() + 8
}
