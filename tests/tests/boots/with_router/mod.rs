//! Nodes of ROS 2 and a real router, in real time: judged by the arriving values, and by counts.

mod client;

use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};

use harness::peer::Router;
use harness::{Guest, Members, Said};
use ros::geometry_msgs::{Twist, Vector3};
use ros::nav_msgs::Odometry;
use ros::{Message, from_cdr, to_cdr};

/// How long anything may take: the host is busy.
const LIMIT: Duration = Duration::from_secs(120);

/// Describes a guest with a node joined to the router. A busy host may hold either back for
/// seconds, and an instance for longer than its budget.
fn joined(app: &str, port: u16) -> Guest {
    let guest = Guest::new(app).in_real_time();
    let guest = guest.network("virtio-net-pci,romfile=", "user");
    guest.word(&format!("router=udp://10.0.2.2:{port} lease_ms=10000"))
}

fn wait_for(text: &str, lines: &Receiver<String>) -> String {
    loop {
        let line = lines.recv_timeout(LIMIT).expect(text);
        if line.contains(text) {
            return line;
        }
    }
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn bytes(hex: &str) -> Vec<u8> {
    let digits = |at| u8::from_str_radix(&hex[at..at + 2], 16).expect("two digits");
    (0..hex.len() / 2).map(|at| digits(2 * at)).collect()
}

/// Drives forward, like a node of ROS 2, until the robot is beyond `x` by its odometry.
fn drive(router: &mut Router, x: f64) {
    let mut place = [0; 64];
    let linear = Vector3 {
        x: 0.5,
        ..Vector3::default()
    };
    let twist = Twist {
        linear,
        ..Twist::default()
    };
    let length = to_cdr(&twist, &mut place);
    let key = format!(
        "0/cmd_vel/geometry_msgs::msg::dds_::Twist_/RIHS01_{}",
        Twist::HASH
    );
    let attachment = [&[1, 0, 0, 0, 0, 0, 0, 0][..], &[0; 8], &[16], &[7; 16]].concat();
    let command = format!("put {key} {} {}", hex(&attachment), hex(&place[..length]));
    loop {
        router.command(&command);
        let line = heard(router, "put 0/odom/");
        let [attachment, payload] = [2, 3].map(|at| line.split(' ').nth(at).expect(&line));
        assert_eq!(attachment.len(), 66, "another ends a subscriber over there");
        let odometry: Odometry = from_cdr(&bytes(payload)).expect(&line);
        if odometry.pose.pose.position.x > x {
            router.command(&format!("decode nav_msgs/msg/Odometry {payload}"));
            assert!(heard(router, "value ").contains("Odometry"));
            return;
        }
    }
}

/// Waits for a line of the router beginning with `text`.
fn heard(router: &Router, text: &str) -> String {
    let begun = Instant::now();
    while begun.elapsed() < LIMIT {
        if let Some(line) = router.said().find(|line| line.starts_with(text)) {
            return line;
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    panic!("the router does not say `{text}`")
}

#[test]
fn a_robot_is_driven_from_ros_and_both_it_and_the_router_may_restart() {
    let mut router = Router::start(None);
    let port = router.port;
    let (outcome, ()) = joined("turtle", port).succeed_beside(|_| drive(&mut router, 0.1));
    outcome.only("session").has([("opened", 1), ("lost", 0)]);
    // It has said goodbye.
    heard(&router, "gone ");
    // It begins anew at once, whatever the lease.
    let (outcome, ()) = joined("turtle", port).succeed_beside(|lines| {
        wait_for("session opened", lines);
        drive(&mut router, 0.1);
        drop(router);
        // This one ends with the thread.
        let mut router = Router::start(Some(port));
        drive(&mut router, 0.2);
    });
    let session = outcome.only("session");
    session.has([("opened", 2), ("lost", 1), ("malformed", 0)]);
}

#[test]
fn two_machines_feed_each_other_by_a_router() {
    let router = Router::start(None);
    let pair = |words| joined("pair", router.port).word(words);
    let [left, right] = [pair("role=left jobs=600"), pair("role=right jobs=1000000")];
    let (right, (left, allocations)) = right.succeed_beside(|lines| {
        wait_for("session opened", lines);
        left.succeed_beside(|lines| wait_for("allocations while jobs ran", lines))
    });
    assert_eq!(allocations, "0 allocations while jobs ran");
    let sessions = [&left, &right].map(|outcome| outcome.only("session"));
    for session in &sessions {
        session.has([("opened", 1), ("lost", 0), ("malformed", 0), ("unknown", 0)]);
        assert!(
            session.number("puts") >= 300 && session.number("sent") >= 300,
            "{}",
            session.text
        );
    }
    // What is lost on the way nobody sends again, and nothing comes twice.
    for [from, to] in [[0, 1], [1, 0]].map(|ways| ways.map(|side| &sessions[side])) {
        assert!(to.number("puts") <= from.number("sent"));
    }
}
