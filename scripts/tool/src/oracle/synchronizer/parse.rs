//! Reading reference traces, strictly: whatever is not as the format says is
//! refused with its line.

use std::collections::HashSet;
use std::num::NonZeroUsize;

use pub_sub::{AgePenalty, Parameters};

use super::{Arrival, Case, Departures, Policy};
use ::replay::lines::{Line, Lines, Malformed, cases, quoted};

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
