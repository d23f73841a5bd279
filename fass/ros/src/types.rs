//! The types of messages included in the crate, named and documented as in ROS 2. Hashes are those
//! of the ROS 2 release Jazzy, from the package `rosbags`.
//!
//! Text and sequences have a maximum length; longer ones are malformed.

/// Defines types of a package, each with its hash.
macro_rules! package {
    ($package:ident: $($(#[$about:meta])* $Name:ident $hash:literal {
        $($field:ident: $Type:ty),* $(,)?
    })*) => {
        crate::message! {$(
            $(#[$about])*
            #[allow(missing_docs, reason = "the fields are those of ROS 2")]
            pub struct $Name: concat!(stringify!($package), "/msg/", stringify!($Name)), $hash {
                $(pub $field: $Type),*
            }
        )*}
    };
}

pub mod builtin_interfaces {
    //! Messages of `builtin_interfaces`.

    package! { builtin_interfaces:
        /// An instant of Unix time.
        Time "b106235e25a4c5ed35098aa0a61a3ee9c9b18d197f398b0e4206cea9acf9c197"
        { sec: i32, nanosec: u32 }
    }

    impl From<u64> for Time {
        /// Converts nanoseconds since 1970, up to 2038.
        fn from(unix_ns: u64) -> Self {
            let sec = i32::try_from(unix_ns / 1_000_000_000).unwrap_or(i32::MAX);
            let nanosec = (unix_ns % 1_000_000_000) as u32;
            Self { sec, nanosec }
        }
    }
}

pub mod std_msgs {
    //! Messages of `std_msgs`.

    use super::builtin_interfaces::Time;
    use crate::Text;

    package! { std_msgs:
        /// A truth value.
        Bool "feb91e995ff9ebd09c0cb3d2aed18b11077585839fb5db80193b62d74528f6c9"
        { data: bool }

        /// Nothing. In ROS 2 a struct without fields has a byte.
        Empty "20b625256f32d5dbc0d04fee44f43c41e51c70d3502f84b4a08e7a9c26a96312"
        { structure_needs_at_least_one_member: u8 }

        /// A number.
        Float64 "705ba9c3d1a09df43737eb67095534de36fd426c0587779bda2bc51fe790182a"
        { data: f64 }

        /// The time and the frame of a measurement.
        Header "f49fb3ae2cf070f793645ff749683ac6b06203e41c891e17701b1cb597ce6a01"
        { stamp: Time, frame_id: Text<64> }

        /// Text, of 256 bytes at most.
        String "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
        { data: Text<256> }

        /// A number.
        UInt32 "a5c874829b752bc5fa190024b0ad76f578cc278271e855c7d02a818b3516fb4a"
        { data: u32 }
    }
}

pub mod geometry_msgs {
    //! Messages of `geometry_msgs`. Lengths are in metres, angles in radians.

    use super::std_msgs::Header;

    package! { geometry_msgs:
        /// A vector.
        Vector3 "cc12fe83e4c02719f1ce8070bfd14aecd40f75a96696a67a2a1f37f7dbb0765d"
        { x: f64, y: f64, z: f64 }

        /// A place.
        Point "6963084842a9b04494d6b2941d11444708d892da2f4b09843b9c43f42a7f6881"
        { x: f64, y: f64, z: f64 }

        /// A rotation. Without rotation, `w` is 1.
        Quaternion "8a765f66778c8ff7c8ab94afcc590a2ed5325a1d9a076ffff38fbce36f458684"
        { x: f64, y: f64, z: f64, w: f64 }

        /// A place and a rotation.
        Pose "d501954e9476cea2996984e812054b68026ae0bfae789d9a10b23daf35cc90fa"
        { position: Point, orientation: Quaternion }

        /// A pose with its time and frame.
        PoseStamped "10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8"
        { header: Header, pose: Pose }

        /// A partly known pose.
        PoseWithCovariance "9a7c0fd234b7f45c6098745ecccd773ca1085670e64107135397aee31c02e1bb"
        { pose: Pose, covariance: [[f64; 6]; 6] }

        /// A velocity, per second.
        Twist "9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a"
        { linear: Vector3, angular: Vector3 }

        /// A partly known velocity.
        TwistWithCovariance "49f574f033f095d8b6cd1beaca5ca7925e296e84af1716d16c89d38b059c8c18"
        { twist: Twist, covariance: [[f64; 6]; 6] }
    }
}

pub mod sensor_msgs {
    //! Messages of `sensor_msgs`. A covariance of zeros is unknown.

    use super::geometry_msgs::{Quaternion, Vector3};
    use super::std_msgs::Header;
    use crate::{List, Text};

    package! { sensor_msgs:
        /// The measurement of an inertial sensor.
        Imu "7d9a00ff131080897a5ec7e26e315954b8eae3353c3f995c55faf71574000b5b" {
            header: Header,
            orientation: Quaternion, orientation_covariance: [f64; 9],
            angular_velocity: Vector3, angular_velocity_covariance: [f64; 9],
            linear_acceleration: Vector3, linear_acceleration_covariance: [f64; 9],
        }

        /// A turn of a laser, of 720 ranges at most.
        LaserScan "64c191398013af96509d518dac71d5164f9382553fce5c1f8cca5be7924bd828" {
            header: Header,
            angle_min: f32, angle_max: f32, angle_increment: f32, time_increment: f32,
            scan_time: f32, range_min: f32, range_max: f32,
            ranges: List<f32, 720>, intensities: List<f32, 720>,
        }

        /// A battery, of 32 cells at most.
        BatteryState "4bee5dfce981c98faa6828b868307a0a73f992ed0789f374ee96c8f840e69741" {
            header: Header,
            voltage: f32, temperature: f32, current: f32, charge: f32,
            capacity: f32, design_capacity: f32, percentage: f32,
            power_supply_status: u8, power_supply_health: u8, power_supply_technology: u8,
            present: bool, cell_voltage: List<f32, 32>, cell_temperature: List<f32, 32>,
            location: Text<64>, serial_number: Text<64>,
        }
    }
}

pub mod nav_msgs {
    //! Messages of `nav_msgs`.

    use super::geometry_msgs::{PoseWithCovariance, TwistWithCovariance};
    use super::std_msgs::Header;
    use crate::Text;

    package! { nav_msgs:
        /// A robot's own estimate of its pose and velocity.
        Odometry "3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0" {
            header: Header, child_frame_id: Text<64>,
            pose: PoseWithCovariance, twist: TwistWithCovariance
        }
    }
}
