//! The robot in virtual time: its way for some commands, and when the wheels stop.

use std::time::Duration;

use fass::finish_create_dags;
use fass::shared::Wire;
use ros::geometry_msgs::Twist;
use ros::nav_msgs::Odometry;
use ros::sensor_msgs::Imu;
use ros::{Message, Node, NodeOptions, from_cdr, to_cdr};
use turtle::build;
use virtual_time::{Silent, VirtualTime};

/// The robot with a session, and the wires of its topics: commands, odometry, and what it feels.
fn turtle(machine: VirtualTime, jobs: u64) -> (Node, VirtualTime, [Wire; 3]) {
    let options = NodeOptions {
        identity: 1,
        ..NodeOptions::default()
    };
    let mut node = Node::new("turtle", options);
    let dags = build(&mut node, jobs);
    let wires: Vec<Wire> = node.wires().cloned().collect();
    let machine = machine.silent(Silent::Wcet);
    let machine = machine.connect(&wires[1]).connect(&wires[2]);
    let commit = finish_create_dags(&dags).expect("it is sound");
    assert!(commit.answers()[0].verdict.bound().is_some());
    node.up_since().set(1).expect("any number");
    (node, machine, wires.try_into().expect("three topics"))
}

/// Commands a velocity from `start_ms` on, ten times a second, for a time.
fn command(machine: &VirtualTime, to: &Wire, (start_ms, for_ms): (u64, u64), velocity: (f64, f64)) {
    let mut twist = Twist::default();
    (twist.linear.x, twist.angular.z) = velocity;
    let mut bytes = [0; 64];
    let length = to_cdr(&twist, &mut bytes);
    for at in (start_ms..start_ms + for_ms).step_by(100) {
        machine.arrive_at(to, Duration::from_millis(at), &bytes[..length]);
    }
}

fn said<T: Message>(machine: &VirtualTime, wire: &Wire) -> Vec<T> {
    let packets = machine.sent_packets(wire);
    let message = |(bytes, _): &(Vec<u8>, _)| from_cdr(bytes).expect("a message");
    packets.iter().map(message).collect()
}

#[test]
fn it_drives_a_square_and_a_replay_sends_the_same_bytes() {
    let (_node, machine, [commands, odom, imu]) = turtle(VirtualTime::new(), 260);
    // A quarter turn takes 32 periods.
    let turn = std::f64::consts::FRAC_PI_2 / 1.6;
    for start in [0_u64, 3_250, 6_500, 9_750] {
        let command = |from, for_ms, velocity| {
            command(&machine, &commands, (start + from, for_ms), velocity);
        };
        command(10, 1_000, (0.5, 0.0));
        command(1_010, 500, (0.0, 0.0));
        command(1_510, 1_600, (0.0, turn));
        command(3_110, 100, (0.0, 0.0));
    }
    assert_eq!(machine.run().violations(), []);
    let path = said::<Odometry>(&machine, &odom);
    let place = |odom: &Odometry| (odom.pose.pose.position.x, odom.pose.pose.position.y);
    let is_at = |(x, y): (f64, f64), side: f64| (x - side).abs() + (y - side).abs() < 1e-9;
    let furthest = |one: (f64, f64), other| (one.0.max(place(other).0), one.1.max(place(other).1));
    assert!(is_at(path.iter().fold((0.0, 0.0), furthest), 0.5));
    assert!(is_at(place(&path[259]), 0.0));
    let felt = said::<Imu>(&machine, &imu);
    let turned: f64 = felt.iter().map(|imu| imu.angular_velocity.z * 0.05).sum();
    let pushed: f64 = felt.iter().map(|imu| imu.linear_acceleration.x).sum();
    assert!((turned - std::f64::consts::TAU).abs() < 1e-9 && pushed.abs() < 1e-9);

    let again = VirtualTime::new().replay(&machine.recording());
    let (_node, again, [_, odom_again, imu_again]) = turtle(again.expect("a recording"), 260);
    assert_eq!(again.run().divergence, None);
    assert_eq!(machine.sent(&odom), again.sent(&odom_again));
    assert_eq!(machine.sent(&imu), again.sent(&imu_again));
}

#[test]
fn it_stops_where_no_command_comes_and_where_the_session_is_lost() {
    let (node, machine, [commands, odom, _]) = turtle(VirtualTime::new(), 60);
    let ms = Duration::from_millis;
    // More than it can, and no number.
    command(&machine, &commands, (10, 100), (9.0, f64::NAN));
    machine.arrive_at(&commands, ms(20), b"\0\x01\0\0too short");
    command(&machine, &commands, (1_010, 2_000), (0.5, 0.0));
    machine.run_for(ms(1_500));
    node.up_since().set(0).expect("any number");
    machine.run_for(ms(500));
    node.up_since().set(2_000_000_000).expect("any number");
    machine.run();
    let odom = said::<Odometry>(&machine, &odom);
    let speeds: Vec<f64> = odom.iter().map(|odom| odom.twist.twist.linear.x).collect();
    // From the job after the command, at most 0.5 m/s; still 0.5 s later, and six periods to stop.
    assert_eq!(
        (speeds[0], speeds[5], speeds[10], speeds[16]),
        (0.0, 0.5, 0.5, 0.0)
    );
    let moves = |speeds: &[f64]| speeds.iter().filter(|speed| **speed > 1e-9).count();
    assert_eq!(
        (
            moves(&speeds[20..30]),
            moves(&speeds[35..40]),
            moves(&speeds[41..])
        ),
        (9, 0, 19)
    );
    assert_eq!(commands.counts().malformed, 1);
}
