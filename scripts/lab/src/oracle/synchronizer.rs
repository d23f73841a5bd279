//! Reference traces of message synchronizers: the output at each arrival.
//!
//! A case holds a policy with its parameters, a list of arrivals, and for each arrival the sets
//! emitted and the messages dropped by the original. [`check`] feeds the arrivals to the policy of
//! the crate `pub-sub` and compares the output. The records of `synchronizer.txt`:
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
//! Times are in nanoseconds. For the exact policy, a queue size of 0 means no limit. A `SEQ` names
//! one arrival of its topic, and must be unique. A set of messages that never arrived is a
//! difference, not an error in the file.

use std::collections::{BTreeSet, HashSet};
use std::num::NonZeroUsize;

use super::FileOracle;
use pub_sub::{
    AgePenalty, ApproximateTime, ExactTime, Outlet, Parameters, Set, Stamped, Synchronizer,
};
use text::{Line, Lines, Malformed, cases, quoted};

/// The kind `synchronizer`.
pub(super) static ORACLE: FileOracle<SynchronizerCase> = FileOracle {
    invocation: "./scripts/oracle synchronizer",
    about: "Compares the sets that ExactTime and ApproximateTime emit, and what they drop, with \
            those of the publish/subscribe baseline.",
    parse,
    check,
    name: |case| &case.name,
    schedules: None,
};

/// A synchronizer with its arrivals and the expected output.
#[derive(Debug)]
pub struct SynchronizerCase {
    /// The case's name.
    pub name: String,
    topics: usize,
    queue_size: usize,
    /// `None` if the policy is exact.
    approximate: Option<Parameters>,
    arrivals: Vec<Arrival>,
}

#[derive(Clone, Debug)]
struct Arrival {
    topic: usize,
    sequence: u64,
    stamp_ns: u64,
    expected: Departures,
}

/// The messages leaving a synchronizer during an arrival.
#[derive(Clone, Debug, Default)]
struct Departures {
    /// Each set's sequence numbers, in the order of the topics.
    sets: Vec<Vec<u64>>,
    /// Topic and sequence number of each message that left without a set.
    dropped: BTreeSet<(usize, u64)>,
}

/// The largest number of topics. Storage is reserved by their number, so a number beyond any trace
/// is refused first.
const MOST_TOPICS: usize = 1024;

/// Reads all cases of a file.
///
/// # Errors
///
/// [`Malformed`] for the first record that deviates from the description above.
pub fn parse(text: &str) -> Result<Vec<SynchronizerCase>, Malformed> {
    cases(text, parse_case)
}

fn parse_case(header: &Line<'_>, lines: &mut Lines<'_>) -> Result<SynchronizerCase, Malformed> {
    let [name, policy, topics, queue_size] = header.fixed()?;
    let topics = header.number(topics)?;
    if !(1..=MOST_TOPICS).contains(&topics) {
        let reason = format!("expected 1 to {MOST_TOPICS} topics, found {topics}");
        return Err(header.malformed(reason));
    }
    let queue_size: usize = header.number(queue_size)?;
    let approximate = match policy {
        "exact" => None,
        "approximate" => {
            let queue_size = NonZeroUsize::new(queue_size).ok_or_else(|| {
                header.malformed("an approximate queue holds at least 1, found 0")
            })?;
            Some((lines.expect("approximate")?, queue_size))
        }
        other => {
            let reason = format!("expected `exact` or `approximate`, found {}", quoted(other));
            return Err(header.malformed(reason));
        }
    };
    let arrivals = parse_arrivals(lines, topics)?;
    // A queue with room for all arrivals never overflows, so no more is reserved.
    let most = NonZeroUsize::new(arrivals.len()).unwrap_or(NonZeroUsize::MIN);
    let parameters = |(line, queue_size): (Line<'_>, NonZeroUsize)| {
        let parameters = Parameters::new(topics, queue_size.min(most));
        parse_parameters(line.exactly(3 + topics)?, &line, parameters)
    };
    Ok(SynchronizerCase {
        name: name.to_owned(),
        topics,
        queue_size: queue_size.min(most.get()),
        approximate: approximate.map(parameters).transpose()?,
        arrivals,
    })
}

fn parse_parameters(
    words: &[&str],
    line: &Line<'_>,
    mut parameters: Parameters,
) -> Result<Parameters, Malformed> {
    if words[0] != "-" {
        parameters.max_interval_ns = Some(line.number(words[0])?);
    }
    let (factor, shift) = (line.number(words[1])?, line.number(words[2])?);
    parameters.age_penalty = AgePenalty::from_factor(factor, shift).ok_or_else(|| {
        line.malformed(format!(
            "the factor {factor} / 2^{shift} is out of range; expected 1 to {} / 2^(0 to {})",
            AgePenalty::MOST_FACTOR,
            AgePenalty::MOST_SHIFT
        ))
    })?;
    let bounds = words[3..].iter().map(|bound| line.number(bound));
    parameters.lower_bounds_ns = bounds.collect::<Result<_, _>>()?;
    Ok(parameters)
}

fn parse_arrivals(lines: &mut Lines<'_>, topics: usize) -> Result<Vec<Arrival>, Malformed> {
    let mut arrivals: Vec<Arrival> = Vec::new();
    let (mut arrived, mut left) = (HashSet::new(), HashSet::new());
    loop {
        let line = lines.next_line().ok_or_else(|| lines.ended("`end`"))?;
        let message = |topic, sequence| {
            Ok::<_, Malformed>((line.index("topic", topic, topics)?, line.number(sequence)?))
        };
        // A message that arrives or leaves twice would hide a difference.
        let once =
            |seen: &mut HashSet<_>, (topic, sequence), what| match seen.insert((topic, sequence)) {
                true => Ok(()),
                false => {
                    Err(line.malformed(format!("message {sequence} of topic {topic} {what} twice")))
                }
            };
        match line.kind {
            "a" => {
                let [topic, sequence, stamp] = line.fixed()?;
                let (topic, sequence) = message(topic, sequence)?;
                once(&mut arrived, (topic, sequence), "arrives")?;
                arrivals.push(Arrival {
                    topic,
                    sequence,
                    stamp_ns: line.number(stamp)?,
                    expected: Departures::default(),
                });
            }
            "s" => {
                let words = line.exactly(1 + topics)?;
                let arrival = line.index("arrival", words[0], arrivals.len())?;
                let sequences = words[1..].iter().map(|word| line.number(word));
                let sequences = sequences.collect::<Result<_, _>>()?;
                arrivals[arrival].expected.sets.push(sequences);
            }
            "r" => {
                let [arrival, topic, sequence] = line.fixed()?;
                let message = message(topic, sequence)?;
                let arrival = line.index("arrival", arrival, arrivals.len())?;
                once(&mut left, message, "leaves")?;
                arrivals[arrival].expected.dropped.insert(message);
            }
            "end" => {
                line.exactly(0)?;
                return Ok(arrivals);
            }
            other => {
                let reason = format!("expected `a`, `s`, `r` or `end`, found {}", quoted(other));
                return Err(line.malformed(reason));
            }
        }
    }
}

/// Feeds a case's arrivals to its policy, and compares the whole output.
///
/// # Errors
///
/// The first difference in the order of arrivals, in one line.
pub fn check(case: &SynchronizerCase) -> Result<(), String> {
    let mut synchronizer: Box<dyn Synchronizer<u64>> = match &case.approximate {
        None => Box::new(ExactTime::new(case.topics, case.queue_size)),
        Some(parameters) => Box::new(ApproximateTime::new(parameters.clone())),
    };
    for (index, arrival) in case.arrivals.iter().enumerate() {
        let (topic, message) = (arrival.topic, arrival.sequence);
        let stamp_ns = arrival.stamp_ns;
        let mut departures = Departures::default();
        synchronizer.arrive(topic, Stamped { stamp_ns, message }, &mut departures);
        compare(&arrival.expected, &departures).map_err(|difference| {
            format!("arrival {index} (topic {topic}, message {message}): {difference}")
        })?;
    }
    Ok(())
}

/// Records the leaving messages. The original does not report a message replaced by another. Since
/// the replaced message has left, too, the traces list it.
impl Outlet<u64> for Departures {
    fn emitted(&mut self, set: Set<'_, u64>) {
        self.sets.push(set.map(|stamped| stamped.message).collect());
    }

    fn dropped(&mut self, topic: usize, message: Stamped<u64>) {
        self.dropped.insert((topic, message.message));
    }

    fn replaced(&mut self, topic: usize, message: Stamped<u64>) {
        self.dropped(topic, message);
    }
}

fn compare(expected: &Departures, departures: &Departures) -> Result<(), String> {
    // Up to the longer list: a missing set and a set too many are both differences.
    for index in 0..expected.sets.len().max(departures.sets.len()) {
        let [expected, emitted] = [expected, departures].map(|of| {
            let set = of.sets.get(index);
            let words = set.map(|set| set.iter().map(u64::to_string).collect::<Vec<_>>());
            words.map_or("none".to_owned(), |words| words.join(" "))
        });
        // By position: the order in which sets come out is part of the policy.
        if expected != emitted {
            return Err(format!(
                "set {index}: expected {expected}, emitted {emitted}"
            ));
        }
    }
    for (these, others, what) in [
        (
            expected,
            departures,
            "expected to leave, but was not dropped",
        ),
        (departures, expected, "dropped, but expected not to leave"),
    ] {
        if let Some((topic, sequence)) = these.dropped.difference(&others.dropped).next() {
            return Err(format!("message {sequence} of topic {topic}: {what}"));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::{ORACLE, parse};
    use crate::oracle::judged::{assert_agree, assert_differs};
    use crate::tests::assert_malformed;

    const PUBLIC: &str = include_str!("../../../../tests/oracle/synchronizer.txt");

    /// A set of equal stamps, and an overtaken stamp.
    const EXACT: &str = "case e exact 2 5
a 0 7 1
a 0 8 2
a 1 4 2
s 2 8 4
r 2 0 7
end
";

    /// A set proven best only by a later message, with a penalty of 0.
    const APPROXIMATE: &str = "case a approximate 2 5
approximate 100 1 0 0 0
a 0 0 0
a 1 0 10
a 0 1 19
s 2 1 0
r 2 0 0
end
";

    #[test]
    fn all_public_traces_agree() {
        assert_agree(&ORACLE, PUBLIC, 40);
    }

    /// A part of a case, its replacement, and the resulting difference.
    const EXACT_WRONG: &str = r"s 2 8 4 | s 2 7 4 | arrival 2 (topic 1, message 4): set 0: expected 7 4, emitted 8 4
s 2 8 4\n |  | arrival 2 (topic 1, message 4): set 0: expected none, emitted 8 4
s 2 8 4 | s 2 8 4\ns 2 8 999 | arrival 2 (topic 1, message 4): set 1: expected 8 999, emitted none
s 2 8 4 | s 1 8 4 | arrival 1 (topic 0, message 8): set 0: expected 8 4, emitted none";
    const APPROXIMATE_WRONG: &str = r"r 2 0 0\n |  | arrival 2 (topic 0, message 1): message 0 of topic 0: dropped, but expected not to leave
r 2 0 0 | r 1 0 0 | arrival 1 (topic 1, message 0): message 0 of topic 0: expected to leave, but was not dropped
a 0 1 19 | a 0 1 20 | arrival 2 (topic 0, message 1): set 0: expected 1 0, emitted 0 0";

    #[test]
    fn the_first_difference_is_named() {
        assert_differs(&ORACLE, EXACT, EXACT_WRONG);
        assert_differs(&ORACLE, APPROXIMATE, APPROXIMATE_WRONG);
    }

    #[test]
    fn neither_the_order_of_what_leaves_nor_a_size_of_queues_matters() {
        let in_any_order = "case e exact 2 5\na 0 0 1\na 0 1 1\na 0 2 2\na 0 3 3\na 1 0 3\n\
                            s 4 3 0\nr 4 0 2\nr 1 0 0\nr 4 0 1\nend\n";
        let without_limit = EXACT.replacen("exact 2 5", "exact 2 0", 1);
        // A queue costs no more than the arrivals.
        let largest = format!("2 {}", usize::MAX);
        let [exact, approximate] =
            [EXACT, APPROXIMATE].map(|text| text.replacen("2 5", &largest, 1));
        for text in [in_any_order, &without_limit, &exact, &approximate] {
            assert_agree(&ORACLE, text, 1);
        }
    }

    /// The same for refusals: with the line and the reason. The tests of bounds cover faults common
    /// to the lines of all files.
    const EXACT_MALFORMED: &str = r"exact 2 5 | exactly 2 5 | 1 | found `exactly`
exact 2 5 | exact 0 5 | 1 | 1 to 1024 topics
exact 2 5 | exact 1025 5 | 1 | 1 to 1024 topics
a 0 7 1 | a 2 7 1 | 2 | there is no topic 2
a 0 8 2 | a 0 7 2 | 3 | message 7 of topic 0 arrives twice
s 2 8 4 | s 3 8 4 | 5 | there is no arrival 3
s 2 8 4 | t 2 8 4 | 5 | expected `a`, `s`, `r` or `end`
r 2 0 7 | r 2 2 7 | 6 | there is no topic 2
r 2 0 7 | r 9 0 7 | 6 | there is no arrival 9
r 2 0 7 | r 2 0 7\nr 2 0 7 | 7 | leaves twice
end\n |  | 7 | the file ends where `end` should be";
    const APPROXIMATE_MALFORMED: &str = r"approximate 2 5 | approximate 2 0 | 1 | at least 1
approximate 2 5 | exact 2 5 | 2 | found `approximate`
100 1 0 0 0 | 100 1 0 0 | 2 | takes 5 words, found 4
100 1 0 0 0 | 100 0 0 0 0 | 2 | out of range
100 1 0 0 0 | 100 1 128 0 0 | 2 | out of range
approximate 100 1 0 0 0\n |  | 2 | expected a `approximate` record";

    #[test]
    fn malformed_files_are_refused_with_their_line() {
        assert_malformed(parse, EXACT, EXACT_MALFORMED);
        assert_malformed(parse, APPROXIMATE, APPROXIMATE_MALFORMED);
        assert_eq!(parse("").expect_err("no case").line, 1);
    }
}
