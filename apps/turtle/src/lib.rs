//! A robot with two wheels, driven by ROS 2. The robot is simulated, the node is not.
//!
//! The node `turtle` takes velocities on the topic `cmd_vel`, and publishes `odom` and `imu`, at 20
//! Hz. The DAG `drive` has three subtasks:
//!
//! | subtask | takes | gives |
//! |---|---|---|
//! | `hear`, the source | the commands that have come, the session, the wall clock | the `wish` |
//! | `roll` | the wish | the robot's place, and its acceleration |
//! | `tell`, the sink | both | messages |
//!
//! Without a session with the router, or half a second after the last command, the wish is to stand
//! still: where nobody can stop the robot, the robot stops. The library does not use the kernel.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

use core::f64::consts::PI;
use core::time::Duration;

use fass::shared::{Packet, Received, UnixTime};
use fass::{Dag, SubtaskAttributes, create_dag};
use maths::{cos, sin};
use ros::geometry_msgs::{Quaternion, Twist};
use ros::nav_msgs::Odometry;
use ros::sensor_msgs::Imu;
use ros::std_msgs::Header;
use ros::{Node, Publisher, Text};

/// The time between two jobs.
pub const PERIOD: Duration = Duration::from_millis(50);

/// The time for which a command holds.
const HOLDS_NS: u64 = 500_000_000;

/// The distance between the wheels, in m; the highest speeds, in m/s and rad/s; and the largest
/// change of a wheel's speed in a period, in m/s.
const TRACK_M: f64 = 0.2;
const FASTEST: f64 = 0.5;
const FASTEST_TURN: f64 = 2.0;
const MOST_CHANGE: f64 = 0.1;

/// The acceleration felt at rest, in m/s^2.
const GRAVITY: f64 = 9.81;

const SECONDS: f64 = 0.05;

recording::recordable! {
    /// The velocity wanted of the robot, and the time of the job.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct Wish {
        /// Forward, in m/s.
        pub forward: f64,
        /// To the left, in rad/s.
        pub turn: f64,
        /// The Unix time in ns, or 0.
        pub stamp_ns: u64,
    }
}

/// Builds the DAG with the given number of jobs; 0: until somebody ends the run.
pub fn build(node: &mut Node, jobs: u64) -> [Dag; 1] {
    let taking = |name| SubtaskAttributes::named(name).wcet(Duration::from_millis(1));
    let commands = node.subscribe::<Twist>("cmd_vel");
    let odom = node.publish::<Odometry>("odom");
    let imu = node.publish_sensor::<Imu>("imu");
    let drive = create_dag();
    (drive.name("drive").record::<Wish>("wish")).record::<Odometry>("odom");
    if jobs > 0 {
        drive.jobs(jobs);
    }
    let (session, clock) = (node.up_since().reading(), node.clock().reading());
    let mut newest = None;
    let hear = move |(commands, since_ns, clock): (Received<'_, Twist>, u64, UnixTime)| {
        newest = commands.last().or(newest);
        (wish(newest, since_ns, clock),)
    };
    drive
        .period(PERIOD)
        .using((commands.receiving(), session, clock))
        .source(hear)
        .writes(&["wish"])
        .register(taking("hear"));
    let mut robot = Robot::default();
    drive.register_subtask(
        move |(wish,)| robot.roll(wish),
        ["wish"],
        ["odom", "imu"],
        taking("roll"),
    );
    let tell = |out: (Publisher<'_, Odometry>, Publisher<'_, Imu>), said: (Odometry, Imu)| {
        let ((mut odom, mut imu), (place, felt)) = (out, said);
        odom.put(&place);
        imu.put(&felt);
    };
    drive
        .using((odom.publishing(), imu.publishing()))
        .subtask(tell)
        .reads(&["odom", "imu"])
        .due(PERIOD)
        .register(taking("tell"));
    [drive]
}

/// Returns the wish of the newest command, if heard in this session and still fresh.
fn wish(newest: Option<Packet<Twist>>, since_ns: u64, clock: UnixTime) -> Wish {
    let now_ns = fass::now_ns();
    let holds = |packet: &Packet<Twist>| {
        let age_ns = now_ns.saturating_sub(packet.received_ns);
        since_ns > 0 && packet.received_ns >= since_ns && age_ns < HOLDS_NS
    };
    let held = newest.filter(holds).map(|packet| packet.value);
    let Twist { linear, angular } = held.unwrap_or_default();
    // A command may be any number, or none.
    let within = |wanted: f64, most: f64| match wanted.is_finite() {
        true => wanted.clamp(-most, most),
        false => 0.0,
    };
    Wish {
        forward: within(linear.x, FASTEST),
        turn: within(angular.z, FASTEST_TURN),
        stamp_ns: clock.of(now_ns).unwrap_or(0),
    }
}

/// The robot: its place, its heading, and the speeds of the left and the right wheel.
#[derive(Default)]
struct Robot {
    x: f64,
    y: f64,
    heading: f64,
    wheels: [f64; 2],
}

impl Robot {
    /// Moves for a period.
    fn roll(&mut self, wish: Wish) -> (Odometry, Imu) {
        let before = self.forward();
        for (wheel, aside) in self.wheels.iter_mut().zip([-0.5, 0.5]) {
            let wanted = wish.forward + aside * TRACK_M * wish.turn;
            *wheel += (wanted - *wheel).clamp(-MOST_CHANGE, MOST_CHANGE);
        }
        let (forward, turn) = (self.forward(), (self.wheels[1] - self.wheels[0]) / TRACK_M);
        // Along the chord of the arc.
        let along = self.heading + turn * SECONDS / 2.0;
        self.x += forward * cos(along) * SECONDS;
        self.y += forward * sin(along) * SECONDS;
        self.heading += turn * SECONDS;
        if self.heading.abs() > PI {
            self.heading -= 2.0 * PI * self.heading.signum();
        }
        let half = self.heading / 2.0;
        let mut orientation = Quaternion::default();
        (orientation.z, orientation.w) = (sin(half), cos(half));
        let mut header = Header::default();
        (header.stamp, header.frame_id) = (wish.stamp_ns.into(), Text::new("odom"));
        let mut odom = Odometry {
            header,
            child_frame_id: Text::new("base_link"),
            ..Odometry::default()
        };
        (odom.pose.pose.position.x, odom.pose.pose.position.y) = (self.x, self.y);
        odom.pose.pose.orientation = orientation;
        (odom.twist.twist.linear.x, odom.twist.twist.angular.z) = (forward, turn);
        header.frame_id = odom.child_frame_id;
        let mut imu = Imu {
            header,
            orientation,
            ..Imu::default()
        };
        imu.angular_velocity.z = turn;
        imu.linear_acceleration.x = (forward - before) / SECONDS;
        imu.linear_acceleration.y = forward * turn;
        imu.linear_acceleration.z = GRAVITY;
        (odom, imu)
    }

    fn forward(&self) -> f64 {
        (self.wheels[0] + self.wheels[1]) / 2.0
    }
}
