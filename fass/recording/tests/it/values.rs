//! Values that are written and read again, and bytes that are none.
//!
//! The program's allocator counts what this thread has allocated, for two promises: writing
//! into a buffer allocates nothing, and reading no more than its bytes allow.

#[path = "../../../../sched-dag/tests/it/counting.rs"]
mod counting;

use std::fmt::Debug;
use std::sync::Arc;

use counting::allocated;
use random::Random;
use recording::{Decoder, Encoder, MOST_DEPTH, MOST_GROWTH, Recordable, Schema, Shown, to_bytes};

recording::recordable! {
    /// One of everything.
    #[derive(Clone, Debug, PartialEq)]
    pub struct All {
        numbers: (u8, u16, u32, u64, u128, i8, i16),
        others: (i32, i64, i128, f32, f64),
        truth: bool,
        letter: char,
        name: String,
        maybe: Option<Option<f64>>,
        lists: Vec<Vec<u16>>,
        parts: Vec<Part>,
        array: [Option<u8>; 5],
        shared: Arc<[f64; 2]>,
        nothing: (),
    }

    #[derive(Clone, Debug, Default, PartialEq)]
    struct Part {
        id: u32,
        label: String,
        place: Option<Box<(f32, f32)>>,
    }
}

fn text(random: &mut Random) -> String {
    let letters = ['a', '"', '\\', '\n', 'é', '😀', '\0'];
    (0..random.index(6))
        .map(|_| random.one_of(&letters))
        .collect()
}

#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    reason = "any bits will do"
)]
fn value(random: &mut Random) -> All {
    let some = random.number();
    let list = |random: &mut Random| {
        (0..random.index(4))
            .map(|_| random.number() as u16)
            .collect()
    };
    All {
        numbers: (
            some as u8,
            some as u16,
            some as u32,
            some,
            u128::from(some) << 60,
            some as i8,
            some as i16,
        ),
        others: (
            some as i32,
            some as i64,
            -i128::from(some),
            (some as f32).sqrt(),
            1.0 / some as f64,
        ),
        truth: some & 1 == 1,
        letter: random.one_of(&['x', '\u{10ffff}']),
        name: text(random),
        maybe: random.one_of(&[None, Some(None), Some(Some(0.1))]),
        lists: (0..random.index(4)).map(|_| list(random)).collect(),
        parts: (0..random.index(3))
            .map(|_| Part {
                id: random.number() as u32,
                label: text(random),
                place: random.once_in(2).then(|| Box::new((1.0, f32::INFINITY))),
            })
            .collect(),
        array: [Some(1), None, Some(random.number() as u8), None, None],
        shared: Arc::new([0.5, f64::MIN]),
        nothing: (),
    }
}

/// Reads bytes as a value, by its type and by its schema, which must agree.
fn read<T: Recordable + Debug>(schema: &Schema, bytes: &[u8]) -> Option<T> {
    let before = allocated().1;
    let read = T::from_bytes(bytes);
    let allocated = allocated().1 - before;
    assert!(
        allocated <= MOST_DEPTH * MOST_GROWTH * bytes.len(),
        "{allocated} bytes of memory from {}",
        bytes.len()
    );
    let mut input = Decoder::new(bytes);
    let walked = schema
        .walk(&mut input, &mut |_| ())
        .and_then(|()| input.expect_end());
    match read {
        Ok(value) => {
            assert_eq!(walked, Ok(()));
            assert_eq!(to_bytes(&value), bytes, "{value:?} has other bytes");
            Some(value)
        }
        Err(malformed) => {
            assert_eq!(walked, Err(malformed));
            assert!(malformed.offset <= bytes.len());
            None
        }
    }
}

#[test]
fn values_come_back() {
    let mut random = Random::new(1);
    for _ in 0..2_000 {
        let value = value(&mut random);
        let bytes = to_bytes(&value);
        assert_eq!(read(&All::schema(), &bytes), Some(value));
        assert!(bytes.len() >= All::LEAST_BYTES);
    }
    assert_eq!(All::LEAST_BYTES, All::schema().least_bytes());
    let nan = f64::from_bits(0x7ff8_0000_0000_1234);
    let back = f64::from_bytes(&to_bytes(&nan)).map(f64::to_bits);
    assert_eq!(back, Ok(nan.to_bits()));
}

#[test]
fn hostile_bytes_are_refused_or_are_the_value_that_they_say() {
    let mut random = Random::new(2);
    let schema = All::schema();
    let (mut accepted, mut refused) = (0, 0);
    for _ in 0..20_000 {
        let mut bytes = to_bytes(&value(&mut random));
        for _ in 0..=random.index(3) {
            let place = random.index(bytes.len());
            match random.index(5) {
                0 => bytes.truncate(place.max(1)),
                1 => bytes.insert(place, random.number().to_le_bytes()[0]),
                2 => _ = bytes.remove(place),
                3 => bytes[place] = random.one_of(&[0, 1, 0x7f, 0xff]),
                _ => bytes[place] ^= 1 << random.index(8),
            }
            if bytes.is_empty() {
                bytes.push(0);
            }
        }
        match read::<All>(&schema, &bytes) {
            Some(_) => accepted += 1,
            None => refused += 1,
        }
    }
    println!("{accepted} accepted, {refused} refused");
    assert!(accepted > 1_000 && refused > 1_000);
}

#[test]
fn hostile_schemas_are_refused_or_are_what_they_say() {
    let mut random = Random::new(3);
    for _ in 0..20_000 {
        let mut bytes = to_bytes(&All::schema());
        for _ in 0..=random.index(3) {
            let place = random.index(bytes.len());
            bytes[place] = random.one_of(&[0, 1, 31, 32, 33, 34, 35, 36, 0xff]);
        }
        let Ok(schema) = Schema::from_bytes(&bytes) else {
            continue;
        };
        assert_eq!(to_bytes(&schema), bytes);
        // Whatever it promises, a value is gone through in as many steps as it has bytes.
        let mut parts = 0;
        let _ = schema.walk(&mut Decoder::new(&[1; 200]), &mut |_| parts += 1);
        assert!(parts < 10_000, "{parts}");
    }
    let deep = vec![33; 1_000_000];
    assert!(Schema::from_bytes(&deep).is_err());
    // Four billion of nothing.
    for schema in ["[()]", "[(); 4000000000]", "[Empty {}]", "[[u8; 0]; 9]"] {
        assert!(Schema::parse(schema).is_err(), "{schema}");
    }
}

#[test]
fn schemas_are_read_as_they_are_shown() {
    let schema = All::schema();
    let text = schema.to_string();
    assert_eq!(Schema::parse(&text), Ok(schema.clone()), "{text}");
    assert_eq!(Schema::from_bytes(&to_bytes(&schema)), Ok(schema));
    for (text, column) in [
        ("", 1),
        ("f65", 1),
        ("A { x: }", 8),
        ("(u8 u8)", 5),
        ("[u8; 1", 7),
        ("A { : u8 }", 5),
        ("u8 u8", 4),
        ("[u8, 3]", 4),
    ] {
        assert_eq!(Schema::parse(text).unwrap_err().0, column, "{text}");
    }
    for deep in [
        "[".repeat(1_000_000),
        "u8?".to_owned() + &"?".repeat(1_000_000),
        "u8".to_owned() + &"?".repeat(16),
        "[".repeat(14) + "u8" + &"]".repeat(14) + "??",
    ] {
        assert!(Schema::parse(&deep).is_err());
    }
    let deepest = "u8".to_owned() + &"?".repeat(15);
    let schema = Schema::parse(&deepest).expect("16 levels");
    assert_eq!(Schema::from_bytes(&to_bytes(&schema)), Ok(schema));
}

#[test]
fn writing_into_a_buffer_allocates_nothing_and_tells_what_it_needs() {
    let value = value(&mut Random::new(4));
    let bytes = to_bytes(&value);
    let mut buffer = vec![0; bytes.len()];
    for room in 0..=bytes.len() {
        let before = allocated().1;
        let mut out = Encoder::new(&mut buffer[..room]);
        value.encode(&mut out);
        let finished = out.finish();
        assert_eq!(allocated().1, before);
        match finished {
            Ok(written) => assert_eq!((written, room), (bytes.len(), bytes.len())),
            Err(full) => assert_eq!(full.needed, bytes.len()),
        }
    }
    assert_eq!(buffer, bytes);
}

#[test]
fn a_value_is_shown_as_json() {
    let part = Part {
        id: 7,
        label: "a\n\"".into(),
        place: Some(Box::new((0.1, f32::NAN))),
    };
    let shown = |value: &Part| {
        let bytes = to_bytes(value);
        let schema = Part::schema();
        Shown {
            schema: &schema,
            bytes: &bytes,
        }
        .to_string()
    };
    let json = r#"{"id":7,"label":"a\u000a\"","place":[0.1,null]}"#;
    assert_eq!(shown(&part), json);
    assert_eq!(
        shown(&Part::default()),
        r#"{"id":0,"label":"","place":null}"#
    );
}

#[test]
fn in_cdr_numbers_are_aligned_lists_once_and_text_has_a_zero() {
    fn is<T: Recordable + PartialEq + Debug>(value: T, bytes: &[u8]) {
        let mut place = [0xee; 64];
        let mut out = Encoder::cdr(&mut place);
        value.encode(&mut out);
        assert_eq!(out.finish(), Ok(bytes.len()));
        assert_eq!(&place[..bytes.len()], bytes);
        let mut input = Decoder::cdr(bytes);
        assert_eq!(T::decode(&mut input), Ok(value));
        assert_eq!(input.expect_end(), Ok(()));
    }
    is(
        (7_u8, 8_u64),
        &[7, 0, 0, 0, 0, 0, 0, 0, 8, 0, 0, 0, 0, 0, 0, 0],
    );
    is((7_u8, [8_u16, 9], 1_u8), &[7, 0, 8, 0, 9, 0, 1]);
    is(
        (7_u8, Vec::<f64>::new(), 1_u8),
        &[7, 0, 0, 0, 0, 0, 0, 0, 1],
    );
    let one = [0, 0, 0, 0, 0, 0, 0xf0, 0x3f];
    is(
        (7_u8, vec![1.0_f64]),
        &[&[7, 0, 0, 0, 1, 0, 0, 0][..], &one].concat(),
    );
    is(
        (true, 7_u32, vec![1.0_f64]),
        &[&[1, 0, 0, 0, 7, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0][..], &one].concat(),
    );
    is(
        ("a".to_owned(), String::new(), 7_u8),
        &[2, 0, 0, 0, b'a', 0, 0, 0, 1, 0, 0, 0, 0, 7],
    );
    is(
        vec![vec![1_u16], vec![]],
        &[2, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0],
    );
    // Cut in the padding.
    let malformed = <(u8, u32)>::decode(&mut Decoder::cdr(&[7, 0])).unwrap_err();
    assert_eq!(
        (malformed.offset, malformed.expected),
        (2, "a u32, 4 bytes")
    );
}
