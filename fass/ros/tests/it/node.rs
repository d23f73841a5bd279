//! A node's datagrams with a router that is a script: its keys, tokens and attachments against those of
//! `rmw_zenoh`, what it hears, and what becomes of messages without a session.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Duration;

use fass::platform::{Buffer, Protocol};
use fass::shared::{Received, Uses, Wire};
use fass::{SubtaskAttributes, create_dag, finish_create_dags};
use ros::geometry_msgs::Twist;
use ros::sensor_msgs::{BatteryState, Imu, LaserScan};
use ros::std_msgs::String as Text;
use ros::{Message, Node, NodeOptions, Publication, Publisher, to_cdr};
use virtual_time::VirtualTime;

use super::counting::allocated;
use super::messages::bytes;

/// As many as the router takes, which are fewer than the device does.
const MOST_BYTES: usize = 1_400;
const MS: u64 = 1_000_000;

fn options(namespace: &str) -> NodeOptions {
    let (namespace, identity) = (namespace.into(), 0x1111_1111_1111_1111);
    NodeOptions {
        namespace,
        identity,
        ..NodeOptions::default()
    }
}

fn node(namespace: &str) -> Node {
    Node::new("unikernel", options(namespace))
}

/// Lets all go that is to go at an instant.
fn sent(node: &mut Node, now_ns: u64) -> Vec<Vec<u8>> {
    let mut all = Vec::new();
    while node.send(now_ns, &mut |buffer| {
        assert!(buffer.range().start >= Buffer::HEADROOM);
        all.push(buffer.content().to_vec());
        true
    }) {}
    all
}

/// Opens a session, and returns what the node declares.
fn open(node: &mut Node) -> Vec<Vec<u8>> {
    assert_eq!(sent(node, 0), [bytes("2300")]);
    assert_eq!(
        sent(node, 100 * MS),
        [bytes("41097211111111111111110a7805")]
    );
    node.hear(
        &bytes("6109f0aa511d0ad4a01e6551dfaa5d5774804b0a780501aa"),
        100 * MS,
    );
    assert_eq!(sent(node, 100 * MS)[0][..2], [0x42, 1], "the lease");
    assert_eq!(node.up_since().value(), 0);
    node.hear(&bytes("620a00"), 101 * MS);
    assert_eq!(node.up_since().value(), 101 * MS);
    sent(node, 101 * MS)
}

fn said(data: &str) -> Text {
    let data = ros::Text::new(data);
    Text { data }
}

/// A put of the router's, in the frame of this number.
fn put(number: u8, key: &str, payload: &[u8]) -> Vec<u8> {
    let mut frame = vec![0x25, number, 0x3d, 0];
    for (before, part) in [(&[][..], key.as_bytes()), (&[1], payload)] {
        let [low, high, ..] = (part.len() << 1).to_le_bytes();
        frame.extend(before);
        frame.extend([low >> 1 | 0x80, high]);
        frame.extend(part);
    }
    frame
}

/// Runs a job of a source.
fn run<U: Uses>(uses: U, source: impl for<'a> FnMut(U::Borrowed<'a>) + Send + 'static) {
    let (machine, dag, period) = (VirtualTime::new(), create_dag(), Duration::from_millis(10));
    dag.jobs(1).period(period).relative_deadline(period);
    dag.using(uses)
        .source(source)
        .register(SubtaskAttributes::named("run"));
    finish_create_dags(&[dag]).unwrap();
    machine.run();
}

/// Publishes values, all in one job.
fn publish<T: Message>(topic: &Publication<T>, values: Vec<T>) {
    run(topic.publishing(), move |mut out: Publisher<'_, T>| {
        values.iter().for_each(|value| out.put(value));
    });
}

fn count(node: &Node, wanted: &str) -> u64 {
    let mut found = None;
    node.counts(&mut |name, count| found = found.or((name == wanted).then_some(count)));
    found.expect("it is counted")
}

#[test]
fn keys_tokens_and_attachments_are_those_of_rmw_zenoh() {
    let mut node = node("/robot");
    let chatter = node.publish::<Text>("/chatter");
    let _commands = node.subscribe::<Twist>("/cmd_vel");
    let _imu = node.publish_sensor::<Imu>("/imu");
    let battery = node.publish_sensor::<BatteryState>("battery");
    let names: Vec<&str> = node.wires().map(Wire::name).collect();
    assert_eq!(names, ["chatter", "cmd_vel", "imu", "robot/battery"]);
    node.begin(1_472, || ()).unwrap();
    node.clock()
        .correct(200 * MS, 1_700_000_000_000_000_000, Duration::ZERO);
    let declared = open(&mut node).concat();
    let holds = |bytes: &[u8], text: &str| {
        bytes
            .windows(text.len())
            .any(|part| part == text.as_bytes())
    };
    let has = |text: &str| holds(&declared, text);
    publish(&chatter, vec![said("a"); 2]);
    publish(&battery, vec![BatteryState::default()]);
    let puts = sent(&mut node, 200 * MS);
    assert_eq!(puts.len(), 3);

    let mut publications = Vec::new();
    for part in include_str!("../vectors/rmw.txt").split("\n\n") {
        let field = |name: &str| {
            let line = part.lines().find_map(|line| line.strip_prefix(name))?;
            line.split_whitespace().next()
        };
        if let Some(token) = field("node token").or(field("token")) {
            // The vectors have no namespace.
            let token = token.replace("/%/%/unikernel", "/%/%robot/unikernel");
            assert!(has(&token), "{token}");
        }
        let Some((key, attachment)) = field("key").zip(field("attachment")) else {
            continue;
        };
        assert!(part.contains("MP") || has(key), "{key}");
        for (number, put) in puts.iter().filter(|put| holds(put, key)).enumerate() {
            let attachment = bytes(attachment);
            let is_time = |part: &[u8]| part == &attachment[8..17];
            let place = put.windows(9).position(is_time).expect(key) - 8;
            assert_eq!(put[place - 1], 33, "the length");
            assert_eq!(usize::from(put[place]), number + 1);
            assert_eq!(put[place + 1..][..16], attachment[1..17]);
            publications.push(put[place + 17..][..16].to_vec());
        }
    }
    // Any bytes, but the same for all messages of a publication.
    assert_eq!(publications.len(), 3);
    assert!(publications[0] == publications[1] && publications[0] != publications[2]);
}

#[test]
fn what_is_heard_is_the_topics_packet_and_nothing_is_allocated() {
    let mut node = node("");
    let commands = node.subscribe::<Twist>("cmd_vel");
    let text = node.subscribe::<Text>("text");
    let ends = node.begin(1_472, || ()).unwrap();
    let twice = node.begin(1_472, || ()).unwrap_err();
    assert!(
        twice.starts_with("topic `cmd_vel` has a device already"),
        "{twice}"
    );
    open(&mut node);
    let key = |name: &str, kind: &str, hash| format!("0/{name}/{kind}/RIHS01_{hash}");
    let twists = key("cmd_vel", "geometry_msgs::msg::dds_::Twist_", Twist::HASH);
    let texts = key("text", "std_msgs::msg::dds_::String_", Text::HASH);
    let mut twist = Twist::default();
    twist.linear.x = 0.5;
    let mut place = [0; 64];
    let length = to_cdr(&twist, &mut place);
    let wrong_hash = key("cmd_vel", "geometry_msgs::msg::dds_::Twist_", Text::HASH);
    let (a, b) = (b"\0\x01\0\0\x02\0\0\0a\0", b"\0\x01\0\0\x02\0\0\0b\0");
    let two = [
        put(5, &texts, b),
        put(6, &twists, &place[..length])[2..].to_vec(),
    ];
    let datagrams = [
        put(0, &twists, &place[..length]),
        put(1, &texts, a),
        put(2, &wrong_hash, &place[..length]),
        put(3, &twists, b"none"),
        put(4, &twists, &[0; 1_000]),
        two.concat(),
    ];
    let before = allocated().0;
    let heard = datagrams.each_ref().map(|heard| node.hear(heard, 200 * MS));
    assert_eq!(allocated().0, before);
    assert_eq!(heard, [1, 2, 0, 1, 0, 3]);
    assert!(ends[0].announce().is_none(), "no sporadic DAG receives");
    assert_eq!((count(&node, "puts"), count(&node, "unknown")), (7, 1));

    run(commands.receiving(), move |twists: Received<'_, Twist>| {
        let heard = twists.map(|packet| (packet.value, packet.received_ns));
        assert!(heard.eq([(twist, 200 * MS); 2]));
    });
    run(text.receiving(), |texts: Received<'_, Text>| {
        assert!(texts.map(|packet| packet.value).eq(["a", "b"].map(said)));
    });
    // One is no twist, and one too long.
    let counts = commands.wire().counts();
    assert_eq!((counts.packets, counts.malformed), (3, 2));
}

#[test]
fn what_is_put_without_a_session_or_too_long_is_lost_and_counted() {
    let mut node = node("");
    let text = node.publish::<Text>("text");
    let [scan, wide] = ["scan", "wide"].map(|name| node.publish::<LaserScan>(name));
    node.begin(1_472, || ()).unwrap();
    let wires: Vec<Wire> = node.wires().cloned().collect();
    assert!(!wires[0].link().value());
    publish(&text, vec![said("a"); 5]);
    open(&mut node);
    assert_eq!((count(&node, "unsent"), count(&node, "sent")), (5, 0));
    assert!(wires[0].link().value());

    // As long as a datagram, and longer by a range.
    let ranges = |count: usize| LaserScan {
        ranges: ros::List::try_new(&vec![1.0; count]).unwrap(),
        ..LaserScan::default()
    };
    let length = |count: usize| to_cdr(&ranges(count), &mut [0; 8192]);
    let key = "0/scan/sensor_msgs::msg::dds_::LaserScan_/RIHS01_".len() + 64;
    let is_short = |count: &usize| length(*count) + key + 48 <= MOST_BYTES;
    let fits = (0..720).rev().find(is_short).unwrap();
    publish(&scan, vec![ranges(fits)]);
    publish(&wide, vec![ranges(fits + 1)]);
    assert_eq!(wires[2].counts().unsent_bytes, length(fits + 1) as u64);
    // A datagram that has not gone is handed over again, as it is.
    let mut tried = Vec::new();
    assert!(!node.send(300 * MS, &mut |buffer| {
        tried.push(buffer.content().to_vec());
        false
    }));
    assert_eq!(sent(&mut node, 301 * MS), tried);
    assert!((MOST_BYTES - 12..=MOST_BYTES).contains(&tried[0].len()));
    assert_eq!(count(&node, "unsent"), 5);

    node.set_link(false);
    assert!(node.up_since().value() == 0 && !wires[0].link().value());
    assert_eq!(["opened", "lost"].map(|name| count(&node, name)), [1, 1]);
    node.close();
    assert_eq!(sent(&mut node, 400 * MS), [bytes("2300")], "goodbye");
    assert_eq!(sent(&mut node, 9_000 * MS), [[0_u8; 0]; 0]);
    node.set_link(true); // the next run
    assert_eq!(sent(&mut node, 9_000 * MS), [bytes("2300")]);
}

#[test]
fn names_that_ros_2_refuses_and_topics_taken_twice_are_told() {
    type Fault = (fn(&mut Node), &'static str);
    fn fill(node: &mut Node) {
        (0..64).for_each(|topic| drop(node.publish::<Twist>(&format!("t{topic}"))));
    }
    let faults: [Fault; 6] = [
        (
            |_| {
                let lease = Duration::ZERO;
                drop(Node::new(
                    "n",
                    NodeOptions {
                        lease,
                        ..options("")
                    },
                ));
            },
            "node `n` cannot have NodeOptions {",
        ),
        (
            |_| drop(Node::new("a/b", options(""))),
            "node `a/b` cannot have NodeOptions {",
        ),
        (
            |_| drop(node("2nd")),
            "node `unikernel` cannot have NodeOptions { namespace: \"2nd\"",
        ),
        (
            |node| drop(node.subscribe::<Twist>("cmd_vel")),
            "node `unikernel` has topic `cmd_vel` already",
        ),
        (
            |node| drop(node.publish::<Twist>("2nd")),
            "topic `2nd` of node `unikernel` has a name that",
        ),
        (
            fill,
            "node `unikernel` has topic `t63` already, or 64 topics; use the one",
        ),
    ];
    for (fault, expected) in faults {
        let mut node = node("");
        node.subscribe::<Twist>("/cmd_vel");
        let panic = catch_unwind(AssertUnwindSafe(|| fault(&mut node))).unwrap_err();
        let told: String = *panic.downcast().unwrap();
        assert!(told.starts_with(expected), "{told}");
    }
    node("").publish::<Twist>("cmd_vel"); // next to a subscription
}
