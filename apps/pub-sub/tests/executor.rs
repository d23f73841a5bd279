//! Workers on threads: what is published is handled, in order, and never twice at a
//! time within a group.

#[path = "support/threads.rs"]
mod threads;

use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;
use std::time::Duration;

use pub_sub::graph::{Call, Callbacks, Context, Graph, TopicId};

/// A source, relays that pass on what they get in the middle of their callback, and a
/// collector of all relays' topics.
enum Part {
    Source(TopicId, u64),
    Relay(TopicId),
    Collector {
        seen: Vec<Vec<u64>>,
        topics: Vec<TopicId>,
        expected: usize,
    },
}

/// How many callbacks of the collector run now, and the most that ever did.
static INSIDE: AtomicU64 = AtomicU64::new(0);
static MOST: AtomicU64 = AtomicU64::new(0);

impl Callbacks<u64> for Part {
    fn call(&mut self, call: Call<u64>, context: &dyn Context<u64>) {
        match (self, call) {
            (Part::Source(topic, next), Call::Timer { .. }) => {
                // A timer may skip periods, so the count is the source's own.
                if *next < JOBS {
                    context.publish(*topic, *next);
                    *next += 1;
                }
            }
            (Part::Relay(topic), Call::Message { message, .. }) => {
                thread::sleep(Duration::from_micros(message * 37 % 200));
                context.publish(*topic, message);
                thread::sleep(Duration::from_micros(20));
            }
            (
                Part::Collector {
                    seen,
                    topics,
                    expected,
                },
                Call::Message { topic, message },
            ) => {
                MOST.fetch_max(INSIDE.fetch_add(1, Ordering::SeqCst) + 1, Ordering::SeqCst);
                let index = topics
                    .iter()
                    .position(|own| *own == topic)
                    .expect("its own");
                seen[index].push(message);
                INSIDE.fetch_sub(1, Ordering::SeqCst);
                *expected -= 1;
                if *expected == 0 {
                    context.shut_down();
                }
            }
            _ => panic!("called for what it has not registered"),
        }
    }
}

const JOBS: u64 = 200;
const RELAYS: usize = 3;

#[test]
fn several_workers_handle_everything_once_and_in_order() {
    let mut graph = Graph::new();
    let input = graph.add_topic();
    let outputs: Vec<TopicId> = (0..RELAYS).map(|_| graph.add_topic()).collect();
    let source = graph.add_group(Part::Source(input, 0));
    graph.add_timer(source, 0, 50_000);
    for output in &outputs {
        let relay = graph.add_group(Part::Relay(*output));
        graph.subscribe(relay, input, 1000);
    }
    let collector = graph.add_group(Part::Collector {
        seen: vec![Vec::new(); RELAYS],
        topics: outputs.clone(),
        expected: RELAYS * usize::try_from(JOBS).expect("small"),
    });
    for output in &outputs {
        graph.subscribe(collector, *output, 1000);
    }
    let graph = threads::run(graph, RELAYS + 2);
    assert_eq!(graph.dropped(), 0);
    let parts: Vec<Part> = graph.into_callbacks().collect();
    assert_eq!(parts.len(), RELAYS + 2, "all were given back");
    let Some(Part::Collector { seen, .. }) = parts.last() else {
        panic!("the collector was added last");
    };
    let all: Vec<u64> = (0..JOBS).collect();
    assert!(seen.iter().all(|messages| *messages == all), "{seen:?}");
    assert_eq!(MOST.load(Ordering::SeqCst), 1);
}
