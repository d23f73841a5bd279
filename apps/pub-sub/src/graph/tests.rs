//! The rules of a graph, step by step.

use super::{Call, Graph, GroupId, Next, TopicId};

/// Callbacks that are only a name.
type Names = Graph<u32, &'static str>;

/// Takes what is ready, as (name, what it is called for).
fn take(graph: &mut Names, now_ns: u64) -> Option<(GroupId, &'static str, Call<u32>)> {
    match graph.take(now_ns) {
        Next::Call(group, name, call) => Some((group, name, call)),
        Next::WaitUntil(_) | Next::End => None,
    }
}

fn message(topic: TopicId, message: u32) -> Call<u32> {
    Call::Message { topic, message }
}

#[test]
fn timers_come_before_subscriptions_and_both_in_order() {
    let mut graph = Names::new();
    let topic = graph.add_topic();
    let groups = ["a", "b", "c"].map(|name| graph.add_group(name));
    graph.subscribe(groups[2], topic, 3);
    graph.subscribe(groups[0], topic, 3);
    graph.add_timer(groups[1], 10, 5);
    graph.publish(topic, 7);
    let names = core::iter::from_fn(|| take(&mut graph, 10)).map(|(_, name, _)| name);
    assert_eq!(names.collect::<Vec<_>>(), ["b", "c", "a"]);
}

#[test]
fn callbacks_of_a_group_exclude_each_other() {
    let mut graph = Names::new();
    let topics = [graph.add_topic(), graph.add_topic()];
    let group = graph.add_group("both");
    for topic in topics {
        graph.subscribe(group, topic, 2);
    }
    graph.publish(topics[1], 1);
    graph.publish(topics[0], 2);
    let (_, name, call) = take(&mut graph, 0).unwrap();
    assert_eq!(call, message(topics[0], 2));
    assert!(matches!(graph.take(0), Next::WaitUntil(u64::MAX)));
    assert!(graph.give_back(group, name, 0), "another one waits");
    let (_, name, call) = take(&mut graph, 0).unwrap();
    assert_eq!(call, message(topics[1], 1));
    assert!(!graph.give_back(group, name, 0));
}

#[test]
fn a_full_queue_drops_its_oldest_message() {
    let mut graph = Names::new();
    let topic = graph.add_topic();
    let group = graph.add_group("slow");
    graph.subscribe(group, topic, 2);
    for number in 1..=5 {
        graph.publish(topic, number);
    }
    assert_eq!(graph.dropped(), 3);
    for number in [4, 5] {
        let (_, name, call) = take(&mut graph, 0).unwrap();
        assert_eq!(call, message(topic, number));
        graph.give_back(group, name, 0);
    }
    assert_eq!(take(&mut graph, 0), None);
}

#[test]
fn a_timer_keeps_its_grid_and_skips_what_it_missed() {
    let mut graph = Names::new();
    let group = graph.add_group("timer");
    graph.add_timer(group, 100, 10);
    assert!(matches!(graph.take(99), Next::WaitUntil(100)));
    // Served late by less than a period, exactly one, and more.
    for (now_ns, due_ns) in [(103, 100), (120, 110), (165, 120), (170, 170)] {
        let (_, name, call) = take(&mut graph, now_ns).unwrap();
        assert_eq!(call, Call::Timer { due_ns }, "at {now_ns}");
        graph.give_back(group, name, now_ns);
    }
}

#[test]
fn a_worker_learns_of_a_timer_whose_group_is_busy() {
    let mut graph = Names::new();
    let group = graph.add_group("timer");
    graph.add_timer(group, 0, 10);
    let (_, name, _) = take(&mut graph, 0).unwrap();
    assert!(matches!(graph.take(5), Next::WaitUntil(10)));
    assert!(matches!(graph.take(10), Next::WaitUntil(u64::MAX)));
    assert!(graph.give_back(group, name, 10), "it is due by now");
}

#[test]
fn nothing_is_taken_after_the_shutdown() {
    let mut graph = Names::new();
    let group = graph.add_group("timer");
    graph.add_timer(group, 0, 10);
    graph.shut_down();
    assert!(matches!(graph.take(0), Next::End));
    assert_eq!(graph.into_callbacks().collect::<Vec<_>>(), ["timer"]);
}
