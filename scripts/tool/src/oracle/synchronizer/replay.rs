//! Feeding a case's arrivals to the real policy, and comparing.

use pub_sub::{ApproximateTime, ExactTime, Outlet, Set, Stamped, Synchronizer};

use super::{Arrival, Case, Departures, Policy};

/// Feeds a case and compares everything that it expects.
///
/// # Errors
///
/// The first difference in the order of arrivals, in one line.
pub fn check(case: &Case) -> Result<(), String> {
    let mut synchronizer: Box<dyn Synchronizer<u64>> = match &case.policy {
        Policy::Exact(queue_size) => Box::new(ExactTime::new(case.topics, *queue_size)),
        Policy::Approximate(parameters) => Box::new(ApproximateTime::new(parameters.clone())),
    };
    for (index, (arrival, expected)) in case.arrivals.iter().zip(&case.expected).enumerate() {
        let mut departures = Departures::default();
        let message = Stamped {
            stamp_ns: arrival.stamp_ns,
            message: arrival.sequence,
        };
        synchronizer.arrive(arrival.topic, message, &mut departures);
        compare(expected, departures)
            .map_err(|difference| format!("{}: {difference}", place(index, arrival)))?;
    }
    Ok(())
}

/// A policy's own account of what leaves. The original gives no notice of a message
/// that another replaces, but it has left, and so the traces list it.
impl Outlet<u64> for Departures {
    fn emitted(&mut self, set: Set<'_, u64>) {
        self.sets.push(set.map(|stamped| stamped.message).collect());
    }

    fn dropped(&mut self, topic: usize, message: Stamped<u64>) {
        self.dropped.push((topic, message.message));
    }

    fn replaced(&mut self, topic: usize, message: Stamped<u64>) {
        self.dropped(topic, message);
    }
}

fn place(index: usize, arrival: &Arrival) -> String {
    format!(
        "arrival {index} (topic {}, message {})",
        arrival.topic, arrival.sequence
    )
}

fn compare(expected: &Departures, mut departures: Departures) -> Result<(), String> {
    let sets = expected.sets.len().max(departures.sets.len());
    for index in 0..sets {
        let (expected, emitted) = (expected.sets.get(index), departures.sets.get(index));
        if expected != emitted {
            return Err(format!(
                "set {index}: expected {}, emitted {}",
                words(expected),
                words(emitted)
            ));
        }
    }
    let mut wanted = expected.dropped.clone();
    wanted.sort_unstable();
    departures.dropped.sort_unstable();
    if let Some((topic, sequence)) = difference(&wanted, &departures.dropped) {
        return Err(format!(
            "message {sequence} of topic {topic}: expected to leave, but was not dropped"
        ));
    }
    if let Some((topic, sequence)) = difference(&departures.dropped, &wanted) {
        return Err(format!(
            "message {sequence} of topic {topic}: dropped, but expected not to leave"
        ));
    }
    Ok(())
}

fn words(set: Option<&Vec<u64>>) -> String {
    let Some(set) = set else {
        return "none".to_owned();
    };
    let words: Vec<String> = set.iter().map(u64::to_string).collect();
    words.join(" ")
}

/// Returns the first message of one list that is not in the other.
fn difference(messages: &[(usize, u64)], others: &[(usize, u64)]) -> Option<(usize, u64)> {
    let missing = |message: &&(usize, u64)| !others.contains(message);
    messages.iter().find(missing).copied()
}
