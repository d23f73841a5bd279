//! Each numbered step of both policies, on traces small enough to follow by hand.
//!
//! A row is a policy with its topics and queue size, and a trace. In the trace
//! `TOPIC@STAMP` is an arrival; messages are numbered by arrival, from 0. Messages
//! that leave stand behind the arrival at which they do, in order: `{1,2}` is a set, `-0` was
//! dropped, `~0` was replaced. The age penalty is 0 unless said.
//!
//! That the two do what the originals do is for `./scripts/oracle synchronizer`, on
//! traces of those.

#[path = "../../../../../sched-dag/tests/it/counting.rs"]
mod counting;

use std::fmt::Write;
use std::num::NonZeroUsize;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::str::FromStr;

use pub_sub::{AgePenalty, ApproximateTime, ExactTime, Outlet, Parameters, Set};
use pub_sub::{Stamped, Synchronizer};

/// Steps 1 to 4.
const EXACT: &str = "\
1 the newer message of a stamp replaces the older | exact 2 5 | 0@7 0@7 ~0 1@7 {1,2}
2 a full entry goes with all smaller ones | exact 2 5 | 0@2 0@1 1@4 0@3 1@3 {3,4} -1 -0
2 a newer entry stays | exact 2 5 | 1@4 0@3 1@3 {1,2} 0@4 {3,0}
3 too many entries lose the smallest, be it new | exact 2 2 | 0@1 0@2 0@3 -0 1@1 -3
3 a queue size of 0 is no limit | exact 2 0 | 0@0 0@1 0@2 0@3 0@4 0@5 1@0 {0,6}
4 stamps of sets can go backwards | exact 2 5 | 0@9 1@9 {0,1} 0@4 1@4 {2,3}
one topic is emitted at once | exact 1 1 | 0@3 {0}";

/// Steps 5 to 15.
const APPROXIMATE: &str = "\
5 a new candidate begins at the fronts | approximate 2 5 within 3 | 0@0 0@1 1@9 -0 -1 0@8 0@9 -3 {4,2}
6 the search sees one more than the queue | approximate 2 1 | 0@0 1@10 0@30 {0,1}
7 an overflow forgets the candidate | approximate 2 1 | 0@0 1@10 1@20 -1 -0
8 of equal stamps the lowest topic is the earliest | approximate 3 5 | 0@5 1@5 2@10 0@25 {0,1,2}
8 of equal stamps the highest topic is the latest | approximate 2 1 | 1@10 1@20 -0 0@20 -2
9 a topic is lossy while it is the latest | approximate 2 1 | 1@10 1@20 -0 0@3 -2 0@21 1@40 {3,1} 0@39 0@60 {5,4}
10 the longest interval is inclusive | approximate 2 5 within 10 | 0@0 1@11 -0 0@1 0@40 {2,1}
11 better heads replace the candidate, not the pivot | approximate 2 5 | 0@0 1@10 0@19 -0 {2,1}
11 a tie keeps the candidate | approximate 2 5 | 0@0 1@10 0@20 {0,1}
11 1.25 * 7 < 10: a newer set may be better | approximate 2 5 penalty 5/2 | 0@0 1@10 0@17 -0 {2,1}
11 10 <= 1.25 * 8: the older one is preferred | approximate 2 5 penalty 5/2 | 0@0 1@10 0@18 {0,1}
12 the earliest head is passed and stays | approximate 3 5 | 0@4 1@2 2@9 0@40 1@40 {0,1,2}
13 passing the pivot emits | approximate 2 5 | 0@0 1@10 0@11 -0 {2,1}
13 a later end may still be made up for | approximate 3 5 | 0@0 1@5 2@10 0@19
13 a later end that none can make up for emits | approximate 3 5 | 0@0 1@5 2@10 0@20 {0,1,2}
14 a bound that proves nothing | approximate 2 5 bound 0=19 | 0@0 1@10
14 a bound proves the candidate best | approximate 2 5 bound 0=20 | 0@0 1@10 {0,1}
14 a virtual search fails, as if it had not been | approximate 3 5 bound 0=15 bound 1=16 | 0@0 1@3 2@10 0@12 -0 {3,1,2}
14 a virtual search succeeds | approximate 3 5 bound 0=15 bound 1=17 | 0@0 1@3 2@10 {0,1,2}
15 passed ones can be in later sets | approximate 3 5 | 0@0 1@1 2@10 0@15 1@4 1@30 {0,1,2} 2@16 {3,4,6}
15 an arrival can emit several sets | approximate 2 5 | 1@11 1@20 0@10 0@20 {2,0} {3,1}
equal stamps are emitted at once | approximate 2 1 | 0@7 1@7 {0,1}";

/// The trace again, with what really left.
struct Trace(String);

impl Outlet<u64> for Trace {
    fn emitted(&mut self, set: Set<'_, u64>) {
        let messages = set.map(|stamped| stamped.message.to_string());
        self.put(&format!("{{{}}}", messages.collect::<Vec<_>>().join(",")));
    }

    fn dropped(&mut self, _topic: usize, message: Stamped<u64>) {
        self.put(&format!("-{}", message.message));
    }

    fn replaced(&mut self, _topic: usize, message: Stamped<u64>) {
        self.put(&format!("~{}", message.message));
    }
}

impl Trace {
    fn put(&mut self, word: &str) {
        let blank = if self.0.is_empty() { "" } else { " " };
        write!(self.0, "{blank}{word}").expect("a string takes all");
    }
}

fn number<T: FromStr>(word: &str) -> T {
    word.parse().ok().expect(word)
}

/// Makes the synchronizer of a row.
fn synchronizer(words: &str) -> Box<dyn Synchronizer<u64>> {
    let words: Vec<&str> = words.split(' ').collect();
    let (topics, queue_size) = (number(words[1]), number(words[2]));
    if words[0] == "exact" {
        return Box::new(ExactTime::new(topics, queue_size));
    }
    let no_penalty = AgePenalty::from_factor(1, 0).expect("in range");
    let queue_size = NonZeroUsize::new(queue_size).expect("in range");
    let mut parameters = Parameters::new(topics, queue_size);
    parameters.age_penalty = no_penalty;
    for option in words[3..].chunks(2) {
        let pair = |separator| option[1].split_once(separator).expect(option[1]);
        match option[0] {
            "within" => parameters.max_interval_ns = Some(number(option[1])),
            "bound" => {
                let (topic, bound_ns) = pair('=');
                parameters.lower_bounds_ns[number::<usize>(topic)] = number(bound_ns);
            }
            _ => {
                let (factor, shift) = pair('/');
                let penalty = AgePenalty::from_factor(number(factor), number(shift));
                parameters.age_penalty = penalty.expect("in range");
            }
        }
    }
    Box::new(ApproximateTime::new(parameters))
}

/// Feeds the arrivals of a trace.
fn fed(synchronizer: &mut dyn Synchronizer<u64>, trace: &str) -> String {
    let mut written = Trace(String::new());
    let arrivals = trace.split(' ').filter(|word| word.contains('@'));
    for (message, word) in (0..).zip(arrivals) {
        written.put(word);
        let (topic, stamp_ns) = word.split_once('@').expect("it has one");
        let stamp_ns = number(stamp_ns);
        synchronizer.arrive(number(topic), Stamped { stamp_ns, message }, &mut written);
    }
    written.0
}

#[test]
fn each_step_is_taken() {
    for row in EXACT.lines().chain(APPROXIMATE.lines()) {
        let cells: Vec<&str> = row.split(" | ").collect();
        let found = fed(&mut *synchronizer(cells[1]), cells[2]);
        assert_eq!(found, cells[2], "{row}");
    }
}

#[test]
fn the_largest_stamps_and_bounds_are_no_trouble() {
    let (most, last) = (u64::MAX, u64::MAX - 1);
    let policy = format!(
        "approximate 2 2 penalty {}/0 bound 0={most}",
        AgePenalty::MOST_FACTOR
    );
    let trace = format!("0@{last} 1@{most} {{0,1}} 0@0 1@0 {{2,3}}");
    assert_eq!(fed(&mut *synchronizer(&policy), &trace), trace);
}

#[test]
fn an_unknown_topic_is_refused() {
    for policy in ["exact 2 1", "approximate 2 1"] {
        let mut synchronizer = synchronizer(policy);
        let arrival = || fed(&mut *synchronizer, "2@0");
        let panic = catch_unwind(AssertUnwindSafe(arrival));
        let said = panic.expect_err(policy).downcast::<String>().expect("text");
        assert!(said.starts_with("there is no topic 2"), "{said}");
    }
}

/// Counts what leaves.
struct Counted(usize);

impl Outlet<u64> for Counted {
    fn emitted(&mut self, set: Set<'_, u64>) {
        self.0 += set.len();
    }

    fn dropped(&mut self, _topic: usize, _message: Stamped<u64>) {
        self.0 += 1;
    }
}

#[test]
fn nothing_is_allocated_after_construction() {
    for policy in ["exact 3 4", "approximate 3 4 within 30"] {
        let mut synchronizer = synchronizer(policy);
        let mut counted = Counted(0);
        let (before, ..) = counting::allocated();
        for message in 0..999 {
            let stamp_ns = message * message % 17;
            let topic = usize::try_from(message % 3).expect("below 3");
            synchronizer.arrive(topic, Stamped { stamp_ns, message }, &mut counted);
        }
        let (after, ..) = counting::allocated();
        assert_eq!(after, before, "{policy}");
        assert!(counted.0 > 800, "{policy}: {}", counted.0);
    }
}
