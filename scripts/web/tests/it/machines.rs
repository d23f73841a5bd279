//! The records of two machines, which the page reads as one.

use std::time::Duration;

use fass::finish_create_dags;
use pair::{PERIOD, Role, build};
use ros::{Node, NodeOptions};
use views::json::Value;
use virtual_time::{Link, LinkOptions, Silent, VirtualTime};

use crate::answer;

const fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

/// Returns the records of the pair, the right one of which begins 7 ms later.
fn records() -> [Vec<u8>; 2] {
    let sides = [(Role::Left, 20), (Role::Right, 19)].map(|(role, jobs)| {
        let machine = VirtualTime::new().silent(Silent::Wcet);
        let options = NodeOptions {
            identity: 1 + role as u128,
            ..NodeOptions::default()
        };
        let mut node = Node::new("side", options);
        let (dags, wires) = build(&mut node, role, ms(4), (jobs, PERIOD));
        finish_create_dags(&dags).expect("it is sound");
        (machine, wires)
    });
    let [(left, sensing), (right, acting)] = &sides;
    let options = LinkOptions {
        delay: ms(2),
        offset: ms(7),
        ..LinkOptions::default()
    };
    let mut link = Link::new([left, right], options);
    link.carry(0, &sensing[0], &acting[0]);
    link.carry(1, &acting[1], &sensing[1]);
    link.run_for(ms(400));
    [left.recording(), right.recording()]
}

#[test]
fn two_machines_have_one_axis_with_the_messages_between_them() {
    let records = records();
    let [left, right] = records.each_ref().map(Vec::len);
    let words = format!("sizes={left},{right} names=left.rec,right.rec");
    let joint = answer(&format!("open {words}"), &records.concat());
    assert_eq!(joint.text("core_names.0"), "left:core 0");
    assert_eq!(joint.text("core_names.1"), "right:core 0");
    assert!(joint.text("links.0").contains("link left:"));
    assert!(!joint.at("chains").elements().is_empty());
    // Each machine is judged alone, by its own clock.
    assert_eq!(*joint.at("is_judged"), Value::Bool(false));
    let known = |name: &str| joint.column(name).into_iter().map(Option::unwrap);
    let at = |name: &str, slice: u64| known(name).nth(usize::try_from(slice).unwrap()).unwrap();
    let hops: Vec<_> = known("hop_from").zip(known("hop_to")).collect();
    assert!(hops.len() > 20, "{hops:?}");
    for (from, to) in hops {
        // A message leaves within its writer's slice, and comes before its reader's.
        assert!(at("from", from) < at("from", to), "{from} to {to}");
    }
    let is_act = |dag: &usize| joint.text(&format!("dags.{dag}.name")) == "right:act";
    let act = (0..).find(is_act).unwrap();
    let values = answer(&format!("job {words} dag={act} job=3"), &records.concat());
    let value = values.text("values.0.text");
    assert!(value.contains("hop"), "{value}");
    // One alone is as any other, and two that have nothing to do with each other are refused.
    let alone = answer("open names=left.rec", &records[0]);
    assert_eq!(alone.number("breach_count"), 0);
    let twice = [&records[0][..], &records[0]].concat();
    let refused = answer(&format!("open sizes={left},{left}"), &twice);
    assert!(refused.head.get("faults").is_some());
}
