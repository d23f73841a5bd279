//! Reference traces of message synchronizers: what comes out at which arrival.
//!
//! A case is a policy with its parameters, a list of arrivals, and what the
//! original emitted and dropped at each. [`check`] feeds the arrivals to the
//! policy of the crate `pub-sub` and compares. The records of `synchronizer.txt`:
//!
//! ```text
//! case NAME exact|approximate N QUEUE_SIZE
//! approximate W M K L_0 ..      only then: longest interval or -, the factor M / 2^K
//!                               that is 1 + age penalty, lower bounds
//! a TOPIC SEQ STAMP             an arrival; arrivals count from 0
//! s ARRIVAL SEQ_0 ..            a set, in the order in which they came out
//! r ARRIVAL TOPIC SEQ           a message that left in no set, dropped or
//!                               replaced, in any order
//! end
//! ```
//!
//! Times are in nanoseconds. An exact queue size of 0 is no limit. A `SEQ` names
//! one arrival of its topic; that it is unique is checked, but a set of messages
//! that never arrived is a difference, not an error of the file.

mod parse;
mod replay;
#[cfg(test)]
mod tests;

pub use parse::parse;
pub use replay::check;

use pub_sub::Parameters;

/// One synchronizer with its arrivals and what is expected of it.
#[derive(Debug)]
pub struct Case {
    /// The case's name.
    pub name: String,
    topics: usize,
    policy: Policy,
    arrivals: Vec<Arrival>,
    /// What is expected at each arrival.
    expected: Vec<Departures>,
}

#[derive(Debug)]
enum Policy {
    /// With this queue size.
    Exact(usize),
    Approximate(Parameters),
}

#[derive(Clone, Copy, Debug)]
struct Arrival {
    topic: usize,
    sequence: u64,
    stamp_ns: u64,
}

/// What leaves a synchronizer while one arrival is handled.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
struct Departures {
    /// For each set the sequence numbers in the order of the topics.
    sets: Vec<Vec<u64>>,
    /// Topic and sequence number of what left in no set; sorted before comparing.
    dropped: Vec<(usize, u64)>,
}
