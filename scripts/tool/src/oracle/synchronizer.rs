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

use std::collections::HashSet;
use std::num::NonZeroUsize;

use pub_sub::{
    AgePenalty, ApproximateTime, ExactTime, Outlet, Parameters, Set, Stamped, Synchronizer,
};
use replay::lines::{Line, Lines, Malformed, cases, quoted};

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

/// Reserved storage grows with the topics whatever the arrivals are, so a number
/// that no trace can need is refused before it is reserved.
const MOST_TOPICS: usize = 1024;

/// Reads all cases of a file.
///
/// # Errors
///
/// [`Malformed`] for the first record that is not as described above.
pub fn parse(text: &str) -> Result<Vec<Case>, Malformed> {
    cases(text, parse_case)
}

/// A policy before it is known how many arrivals there are.
struct Header {
    topics: usize,
    queue_size: usize,
    /// `None` if the policy is exact.
    approximate: Option<Approximate>,
}

struct Approximate {
    max_interval_ns: Option<u64>,
    age_penalty: AgePenalty,
    lower_bounds_ns: Vec<u64>,
}

fn parse_case(line: &Line<'_>, lines: &mut Lines<'_>) -> Result<Case, Malformed> {
    let &[name, ..] = line.exactly(4)? else {
        return Err(line.malformed("expected 4 words"));
    };
    let header = parse_header(line, lines)?;
    let mut trace = Trace::default();
    loop {
        let line = lines.next_line().ok_or_else(|| lines.ended("`end`"))?;
        match line.kind {
            "a" => trace.arrival(&line, header.topics)?,
            "s" => trace.set(&line, header.topics)?,
            "r" => trace.dropped(&line, header.topics)?,
            "end" => {
                line.exactly(0)?;
                break;
            }
            other => {
                let reason = format!("expected `a`, `s`, `r` or `end`, found {}", quoted(other));
                return Err(line.malformed(reason));
            }
        }
    }
    Ok(Case {
        name: name.to_owned(),
        topics: header.topics,
        policy: header.policy(trace.arrivals.len()),
        arrivals: trace.arrivals,
        expected: trace.expected,
    })
}

fn parse_header(line: &Line<'_>, lines: &mut Lines<'_>) -> Result<Header, Malformed> {
    let topics = line.number(line.words[2])?;
    if !(1..=MOST_TOPICS).contains(&topics) {
        let reason = format!("expected 1 to {MOST_TOPICS} topics, found {topics}");
        return Err(line.malformed(reason));
    }
    let queue_size = line.number(line.words[3])?;
    let approximate = match line.words[1] {
        "exact" => None,
        "approximate" if queue_size == 0 => {
            return Err(line.malformed("an approximate queue holds at least 1, found 0"));
        }
        "approximate" => Some(parse_approximate(&lines.expect("approximate")?, topics)?),
        other => {
            let reason = format!("expected `exact` or `approximate`, found {}", quoted(other));
            return Err(line.malformed(reason));
        }
    };
    Ok(Header {
        topics,
        queue_size,
        approximate,
    })
}

fn parse_approximate(line: &Line<'_>, topics: usize) -> Result<Approximate, Malformed> {
    let words = line.exactly(3 + topics)?;
    let max_interval_ns = match words[0] {
        "-" => None,
        word => Some(line.number(word)?),
    };
    let (factor, shift) = (line.number(words[1])?, line.number(words[2])?);
    let age_penalty = AgePenalty::from_factor(factor, shift).ok_or_else(|| {
        line.malformed(format!(
            "the factor {factor} / 2^{shift} is out of range; expected 1 to {} / 2^(0 to {})",
            AgePenalty::MOST_FACTOR,
            AgePenalty::MOST_SHIFT
        ))
    })?;
    let lower_bounds_ns = words[3..].iter().map(|word| line.number(word));
    Ok(Approximate {
        max_interval_ns,
        age_penalty,
        lower_bounds_ns: lower_bounds_ns.collect::<Result<_, _>>()?,
    })
}

impl Header {
    /// Makes the policy. A queue with room for all arrivals never overflows, so no
    /// more than that is reserved.
    fn policy(&self, arrivals: usize) -> Policy {
        let queue_size = self.queue_size.min(arrivals.max(1));
        match (&self.approximate, NonZeroUsize::new(queue_size)) {
            (Some(approximate), Some(queue_size)) => {
                Policy::Approximate(approximate.parameters(self.topics, queue_size))
            }
            _ => Policy::Exact(queue_size),
        }
    }
}

impl Approximate {
    fn parameters(&self, topics: usize, queue_size: NonZeroUsize) -> Parameters {
        let mut parameters = Parameters::new(topics, queue_size).age_penalty(self.age_penalty);
        if let Some(max_interval_ns) = self.max_interval_ns {
            parameters = parameters.max_interval_ns(max_interval_ns);
        }
        let bounds_ns = self.lower_bounds_ns.iter().enumerate();
        bounds_ns.fold(parameters, |parameters, (topic, &bound_ns)| {
            parameters.lower_bound_ns(topic, bound_ns)
        })
    }
}

/// The records between a case's header and its end.
#[derive(Default)]
struct Trace {
    arrivals: Vec<Arrival>,
    expected: Vec<Departures>,
    /// Topics and sequence numbers that arrived.
    arrived: HashSet<(usize, u64)>,
    /// Topics and sequence numbers that left in no set.
    left: HashSet<(usize, u64)>,
}

impl Trace {
    fn arrival(&mut self, line: &Line<'_>, topics: usize) -> Result<(), Malformed> {
        let words = line.exactly(3)?;
        let arrival = Arrival {
            topic: topic(line, words[0], topics)?,
            sequence: line.number(words[1])?,
            stamp_ns: line.number(words[2])?,
        };
        if !self.arrived.insert((arrival.topic, arrival.sequence)) {
            return Err(line.malformed(format!(
                "message {} of topic {} arrives twice",
                arrival.sequence, arrival.topic
            )));
        }
        self.arrivals.push(arrival);
        self.expected.push(Departures::default());
        Ok(())
    }

    fn set(&mut self, line: &Line<'_>, topics: usize) -> Result<(), Malformed> {
        let words = line.exactly(1 + topics)?;
        let sequences = words[1..].iter().map(|word| line.number(word));
        let sequences = sequences.collect::<Result<_, _>>()?;
        self.departures(line, words[0])?.sets.push(sequences);
        Ok(())
    }

    fn dropped(&mut self, line: &Line<'_>, topics: usize) -> Result<(), Malformed> {
        let words = line.exactly(3)?;
        let message = (topic(line, words[1], topics)?, line.number(words[2])?);
        self.departures(line, words[0])?.dropped.push(message);
        if !self.left.insert(message) {
            let (topic, sequence) = message;
            let reason = format!("message {sequence} of topic {topic} leaves twice");
            return Err(line.malformed(reason));
        }
        Ok(())
    }

    /// Returns what is expected at the arrival that a word names.
    fn departures(&mut self, line: &Line<'_>, word: &str) -> Result<&mut Departures, Malformed> {
        let arrival: usize = line.number(word)?;
        self.expected
            .get_mut(arrival)
            .ok_or_else(|| line.malformed(format!("there is no arrival {arrival} before it")))
    }
}

fn topic(line: &Line<'_>, word: &str, topics: usize) -> Result<usize, Malformed> {
    let topic = line.number(word)?;
    if topic < topics {
        Ok(topic)
    } else {
        Err(line.malformed(format!("there is no topic {topic}")))
    }
}

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

#[cfg(test)]
mod tests {
    use super::{check, parse};

    const PUBLIC: &str = include_str!("../../../../tests/oracle/synchronizer.txt");

    /// One set of equal stamps, one stamp that is overtaken.
    const EXACT: &str = "case e exact 2 5
a 0 7 1
a 0 8 2
a 1 4 2
s 2 8 4
r 2 0 7
end
";

    /// A set that only a later message proves best, with a penalty of 0.
    const APPROXIMATE: &str = "case a approximate 2 5
approximate 100 1 0 0 0
a 0 0 0
a 1 0 10
a 0 1 19
s 2 1 0
r 2 0 0
end
";

    /// Returns each row of tables, with the case that it is about.
    fn rows<'a>(tables: &'a [(&'a str, &'a str)]) -> impl Iterator<Item = (&'a str, &'a str)> {
        (tables.iter()).flat_map(|(text, table)| table.lines().map(move |row| (*text, row)))
    }

    /// Splits a row of a table.
    fn split<const N: usize>(row: &str) -> [&str; N] {
        let cells: Vec<&str> = row.split(" | ").collect();
        cells.try_into().expect(row)
    }

    #[test]
    fn all_public_traces_agree() {
        let cases = parse(PUBLIC).unwrap();
        assert_eq!(cases.len(), 40);
        for case in &cases {
            assert_eq!(check(case), Ok(()), "{}", case.name);
        }
    }

    /// What stands in a case, what is put in its place, and the difference that makes.
    const EXACT_WRONG: &str = r"s 2 8 4 | s 2 7 4 | arrival 2 (topic 1, message 4): set 0: expected 7 4, emitted 8 4
s 2 8 4\n |  | arrival 2 (topic 1, message 4): set 0: expected none, emitted 8 4
s 2 8 4 | s 2 8 4\ns 2 8 999 | arrival 2 (topic 1, message 4): set 1: expected 8 999, emitted none
s 2 8 4 | s 1 8 4 | arrival 1 (topic 0, message 8): set 0: expected 8 4, emitted none";
    const APPROXIMATE_WRONG: &str = r"r 2 0 0\n |  | arrival 2 (topic 0, message 1): message 0 of topic 0: dropped, but expected not to leave
r 2 0 0 | r 1 0 0 | arrival 1 (topic 1, message 0): message 0 of topic 0: expected to leave, but was not dropped
a 0 1 19 | a 0 1 20 | arrival 2 (topic 0, message 1): set 0: expected 1 0, emitted 0 0";

    #[test]
    fn the_first_difference_is_named() {
        let tables = [(EXACT, EXACT_WRONG), (APPROXIMATE, APPROXIMATE_WRONG)];
        for (text, row) in rows(&tables) {
            let row = row.replace(r"\n", "\n");
            let [from, to, difference] = split(&row);
            assert!(text.contains(from), "{from}");
            let cases = parse(&text.replacen(from, to, 1)).expect("still well formed");
            assert_eq!(check(&cases[0]), Err(difference.to_owned()));
        }
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
            assert_eq!(check(&parse(text).unwrap()[0]), Ok(()), "{text}");
        }
    }

    /// The same of what is refused: with its line and the reason.
    const EXACT_MALFORMED: &str = r"case e | kase e | 1 | expected a `case` record
exact 2 5 | exact 2 | 1 | takes 4 words, found 3
exact 2 5 | exactly 2 5 | 1 | found `exactly`
exact 2 5 | exact 0 5 | 1 | 1 to 1024 topics
exact 2 5 | exact 1025 5 | 1 | 1 to 1024 topics
exact 2 5 | exact 2 -5 | 1 | not a whole number
a 0 7 1 | a 2 7 1 | 2 | there is no topic 2
a 0 8 2 | a 0 7 2 | 3 | message 7 of topic 0 arrives twice
a 1 4 2 | a 1 4 2.5 | 4 | not a whole number
a 1 4 2 | a 1 4 | 4 | takes 3 words, found 2
a 1 4 2 | a 1 4 18446744073709551616 | 4 | too large
s 2 8 4 | s 3 8 4 | 5 | there is no arrival 3
s 2 8 4 | s 2 8 | 5 | takes 3 words, found 2
s 2 8 4 | s 2 8 x | 5 | not a whole number
s 2 8 4 | t 2 8 4 | 5 | expected `a`, `s`, `r` or `end`
r 2 0 7 | r 2 2 7 | 6 | there is no topic 2
r 2 0 7 | r 9 0 7 | 6 | there is no arrival 9
r 2 0 7 | r 2 0 7\nr 2 0 7 | 7 | leaves twice
end | end 1 | 7 | takes 0 words, found 1
end\n |  | 7 | the file ends where `end` should be";
    const APPROXIMATE_MALFORMED: &str = r"approximate 2 5 | approximate 2 0 | 1 | at least 1
approximate 2 5 | exact 2 5 | 2 | found `approximate`
100 1 0 0 0 | 100 1 0 0 | 2 | takes 5 words, found 4
100 1 0 0 0 | 1e2 1 0 0 0 | 2 | not a whole number
100 1 0 0 0 | 100 0 0 0 0 | 2 | out of range
100 1 0 0 0 | 100 1 128 0 0 | 2 | out of range
approximate 100 1 0 0 0\n |  | 2 | expected a `approximate` record";

    #[test]
    fn malformed_files_are_refused_with_their_line() {
        let tables = [
            (EXACT, EXACT_MALFORMED),
            (APPROXIMATE, APPROXIMATE_MALFORMED),
        ];
        for (text, row) in rows(&tables) {
            let row = row.replace(r"\n", "\n");
            let [from, to, line, reason] = split(&row);
            assert!(text.contains(from), "{from}");
            let malformed = parse(&text.replacen(from, to, 1)).expect_err(to);
            assert_eq!(malformed.line.to_string(), line, "{to}: {malformed}");
            assert!(malformed.reason.contains(reason), "{to}: {malformed}");
        }
        assert_eq!(parse("").expect_err("no case").line, 1);
    }
}
