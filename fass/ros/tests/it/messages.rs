//! Messages against the bytes and the values that the package `rosbags` has for them, both ways.
//!
//! `MESSAGES=n` and `SEED=n` have wrong bytes n times for each value, and others.

use std::env;

use random::Random;
use ros::builtin_interfaces::Time;
use ros::geometry_msgs::{
    Point, Pose, PoseStamped, PoseWithCovariance, Quaternion, Twist, TwistWithCovariance, Vector3,
};
use ros::nav_msgs::Odometry;
use ros::sensor_msgs::{BatteryState, Imu, LaserScan};
use ros::std_msgs::{Bool, Empty, Float64, Header, String, UInt32};
use ros::{Message, from_cdr, to_cdr};

pub(crate) fn bytes(hex: &str) -> Vec<u8> {
    let digits = hex.as_bytes().chunks(2);
    let byte = |two| u8::from_str_radix(str::from_utf8(two).unwrap(), 16).unwrap();
    digits.map(byte).collect()
}

/// The lines of vectors, each as its columns.
fn vectors() -> impl Iterator<Item = [&'static str; 7]> {
    let lines = include_str!("../vectors/cdr.txt").lines();
    let lines = lines.filter(|line| !line.starts_with('#'));
    lines.map(|line| {
        line.split(" | ")
            .collect::<Vec<_>>()
            .try_into()
            .expect(line)
    })
}

/// Returns how many lines there are of a type, which is as they say.
fn check<T: Message + PartialEq>() -> usize {
    let of_type = vectors().filter(|line| line[0] == T::NAME);
    let check = |[name, _, hash, about, length, hex, json]: [&str; 7]| {
        assert_eq!(hash.strip_prefix("RIHS01_"), Some(T::HASH), "{name}");
        let bytes = bytes(hex);
        let value = from_cdr::<T>(&bytes).unwrap_or_else(|| panic!("{name} {about}"));
        let shown = recording::Shown {
            schema: &T::schema(),
            bytes: &recording::to_bytes(&value),
        };
        assert_eq!(shown.to_string(), json, "{name}");
        let mut place = [0xee; 8192];
        let written = to_cdr(&value, &mut place);
        assert_eq!(
            (&place[..written], written.to_string()),
            (&bytes[..], length.into()),
            "{name}"
        );
        // Others are refused, and places that are too short told.
        for room in 0..bytes.len() {
            assert_eq!(to_cdr(&value, &mut vec![0; room]), bytes.len());
            assert!(
                from_cdr::<T>(&bytes[..room]).is_none(),
                "{name} cut at {room}"
            );
        }
        assert!(
            from_cdr(&[&bytes[..], &[0; 3]].concat()) == Some(value),
            "{name} padded"
        );
        assert!(
            from_cdr::<T>(&[&bytes[..], &[0; 4]].concat()).is_none(),
            "{name} and more"
        );
        assert!(
            from_cdr::<T>(&[&[0, 0], &bytes[2..]].concat()).is_none(),
            "{name} big-endian"
        );
        hear_mutants::<T>(&bytes);
    };
    of_type.map(check).count()
}

/// Wrong bytes are no value, or one that has the same bytes each time.
fn hear_mutants<T: Message>(bytes: &[u8]) {
    let number = |name, usual| env::var(name).map_or(usual, |text| text.parse().unwrap());
    let mut random = Random::new(number("SEED", 1) + bytes.len() as u64);
    let (mut first, mut second) = ([0; 8192], [0; 8192]);
    for _ in 0..number("MESSAGES", 300) {
        let mut mutant = bytes.to_vec();
        for _ in 0..=random.index(3) {
            let place = random.index(mutant.len());
            mutant[place] = random.one_of(&[0, 1, 2, 8, 0x40, 0x7f, 0xff]);
        }
        mutant.truncate(mutant.len() - usize::from(random.chance(10)));
        let Some(read) = from_cdr::<T>(&mutant) else {
            continue;
        };
        // Not those of the mutant, whose padding may be anything.
        let length = to_cdr(&read, &mut first);
        let again = from_cdr::<T>(&first[..length]).expect("it was written");
        assert_eq!(to_cdr(&again, &mut second), length);
        assert_eq!(second[..length], first[..length]);
    }
}

#[test]
fn all_types_have_the_bytes_and_hashes_of_ros_2() {
    let geometry = [
        check::<Vector3>(),
        check::<Point>(),
        check::<Quaternion>(),
        check::<Pose>(),
        check::<PoseStamped>(),
        check::<PoseWithCovariance>(),
        check::<Twist>(),
        check::<TwistWithCovariance>(),
    ];
    assert_eq!(geometry, [1; 8]);
    let others = [
        check::<Time>(),
        check::<Header>(),
        check::<Bool>(),
        check::<Empty>(),
    ];
    assert_eq!(others, [1; 4]);
    let numbers = (check::<Float64>(), check::<UInt32>(), check::<String>());
    assert_eq!(numbers, (1, 1, 2));
    let sensors = (
        check::<Imu>(),
        check::<LaserScan>(),
        check::<BatteryState>(),
    );
    assert_eq!((sensors, check::<Odometry>()), ((3, 2, 2), 2));
    assert_eq!(vectors().count(), 25);
}

#[test]
fn what_is_longer_than_its_place_is_malformed_and_padding_is_not_looked_at() {
    let hello = bytes("000100000600000068656c6c6f00");
    let mut long = [&[0, 1, 0, 0, 2, 1, 0, 0][..], &[b'a'; 257], &[0]].concat();
    assert_eq!(from_cdr::<String>(&long), None, "257 of 256 bytes");
    (long[4], long[264]) = (1, 0);
    assert!(from_cdr::<String>(&long).is_some_and(|text| text.data.len() == 256));
    for (place, byte) in [(13, b'!'), (4, 0), (8, 0xff), (7, 0xff)] {
        let mut wrong = hello.clone();
        wrong[place] = byte;
        assert_eq!(from_cdr::<String>(&wrong), None, "byte {place}: {byte}");
    }
    let mut scan = bytes(vectors().find(|line| line[0] == LaserScan::NAME).unwrap()[5]);
    let expected = from_cdr::<LaserScan>(&scan);
    scan[18..20].fill(0xee); // between the frame and the first number
    assert_eq!(from_cdr::<LaserScan>(&scan), expected);
}
