//! The text of each fault: fact, offender, remedy, in one line.
//!
//! Times stand in it as a `Duration` prints them, in the unit that a person reads and
//! with every digit: `20ms`, `6.000001ms`.

use alloc::string::String;
use core::fmt::{self, Display};
use core::time::Duration;

use super::fault::{Direction, Fault, Time};
use crate::MAX_ARITY;
use crate::spec::STACK_BYTES;

/// How many subtasks a message lists before it only counts the rest.
const LISTED: usize = 8;

impl Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoDags => {
                f.write_str("the commit has no dag; create one and register its subtasks")
            }
            Self::NoCores => {
                f.write_str("the commit is for 0 cores; give the scheduler at least 1")
            }
            Self::TooManyDags { count } => {
                write!(
                    f,
                    "the commit has {count} DAGs, more than {}; merge some",
                    u32::MAX
                )
            }
            Self::NoSubtasks { dag } => {
                write!(f, "{dag} has no subtask; register one or drop the DAG")
            }
            Self::TooManySubtasks { dag, count } => {
                write!(
                    f,
                    "{dag} has {count} subtasks, more than {}; split it",
                    u32::MAX
                )
            }
            Self::TooManyInstances {
                dag,
                in_flight,
                instances,
                limit,
            } => write!(
                f,
                "the jobs in flight need {instances} instances, more than the limit of {limit}, and {dag} \
                 with {in_flight} jobs in flight needs most; lower its in_flight or raise the instance limit"
            ),
            Self::DuplicateSubtask { dag, first, second } => write!(
                f,
                "{dag} has two subtasks named `{}` (registered as number {} and {}); rename one",
                first.name, first.id.0, second.id.0
            ),
            Self::Cycle { .. } | Self::SelfEdge { .. } | Self::EdgeOutOfRange { .. } => {
                self.fmt_edge(f)
            }
            Self::ClusterWithoutCores { .. }
            | Self::ClustersBeyondCores { .. }
            | Self::NoCluster { .. }
            | Self::UnknownCluster { .. } => self.fmt_cluster(f),
            Self::NotConnected {
                dag,
                parts,
                one,
                other,
            } => write!(
                f,
                "{dag} falls into {parts} parts: no edge leads from the part of {one} to the part of {other}; \
                 connect them or make them dags of their own"
            ),
            Self::NoSource { dag } => write!(
                f,
                "{dag} has no source: every subtask has an input; register a periodic subtask"
            ),
            Self::SeveralSources { dag, sources } => write!(
                f,
                "{dag} has {} sources: {}; keep one, or choose a construction policy with several",
                sources.len(),
                list(sources)
            ),
            Self::NoSink { dag } => write!(
                f,
                "{dag} has no sink: every subtask has a successor; register a sink subtask"
            ),
            Self::SeveralSinks { dag, sinks } => write!(
                f,
                "{dag} has {} sinks: {}; keep one, or choose a construction policy with several",
                sinks.len(),
                list(sinks)
            ),
            Self::MissingPeriod { dag } => {
                write!(
                    f,
                    "{dag} has no period; register its source as a periodic subtask"
                )
            }
            Self::ZeroPeriod { dag } => write!(f, "{dag} has a period of 0; give it at least 1 ns"),
            Self::MissingDeadline { dag } => write!(
                f,
                "{dag} has no relative deadline; register its sink as a sink subtask with one"
            ),
            Self::ZeroDeadline { dag } => {
                write!(
                    f,
                    "{dag} has a relative deadline of 0; give it at least 1 ns"
                )
            }
            Self::ZeroSinkDeadline { dag, sink } => write!(
                f,
                "{sink} of {dag} has a relative deadline of 0; give it at least 1 ns"
            ),
            Self::SinkDeadlineBeyondDag {
                dag,
                sink,
                relative_deadline_ns,
                of_dag_ns,
            } => write!(
                f,
                "{sink} of {dag} has a relative deadline of {:?}, longer than its DAG's of {:?}; shorten \
                 it, or extend the DAG's",
                Duration::from_nanos(*relative_deadline_ns),
                Duration::from_nanos(*of_dag_ns)
            ),
            Self::DeadlineOfNoSink {
                dag,
                subtask,
                successor,
            } => write!(
                f,
                "{subtask} of {dag} has a relative deadline and is no sink, for {successor} follows it; \
                 give the deadline to a sink"
            ),
            Self::WcetExceedsDeadline {
                dag,
                subtask,
                wcet_ns,
                relative_deadline_ns,
            } => write!(
                f,
                "{subtask} of {dag} has a WCET of {:?}, longer than the relative deadline of {:?}; \
                 shorten it or extend the deadline",
                Duration::from_nanos(*wcet_ns),
                Duration::from_nanos(*relative_deadline_ns)
            ),
            Self::StackOutOfRange {
                dag,
                subtask,
                bytes,
            } => write!(
                f,
                "{subtask} of {dag} states a stack of {bytes} bytes; give it {} to {}, or leave it out",
                STACK_BYTES.start(),
                STACK_BYTES.end()
            ),
            Self::ZeroJobs { dag } => {
                write!(
                    f,
                    "{dag} has a limit of 0 jobs; give at least 1, or no limit"
                )
            }
            Self::ZeroInFlight { dag } => {
                write!(
                    f,
                    "{dag} has room for 0 jobs in flight; give at least 1, or leave it out"
                )
            }
            Self::ZeroFaults { dag } => write!(
                f,
                "{dag} survives 0 faults; let it survive at least 1, or end it by a fault"
            ),
            Self::ZeroWindow { dag } => write!(
                f,
                "{dag} survives faults within a window of 0 jobs; give the window at least 1"
            ),
            Self::TimeOverflow { dag, time } => write!(
                f,
                "{} of {dag} exceeds {} ns, the last time there is; {}",
                time.noun(),
                u64::MAX,
                time.remedy()
            ),
            Self::PrioritiesPartlyGiven { dag, without } => write!(
                f,
                "{dag} has subtasks with and {} without priority: {}; give each a priority, or none",
                without.len(),
                list(without)
            ),
            Self::PrioritiesExhausted { dag } => write!(
                f,
                "the priorities of {dag}, which follow those given to other dags, exceed {}; \
                 give smaller numbers there",
                u32::MAX
            ),
            _ => self.fmt_topic(f),
        }
    }
}

impl Fault {
    fn fmt_edge(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Cycle { dag, hops } => {
                write!(f, "{dag} has a cycle: ")?;
                for hop in hops {
                    write!(f, "{hop} -> ")?;
                }
                if let Some(first) = hops.first() {
                    write!(f, "{first}")?;
                }
                f.write_str("; remove one of these edges")
            }
            Self::SelfEdge {
                dag,
                subtask,
                topic: Some(topic),
            } => write!(
                f,
                "{subtask} of {dag} reads topic `{topic}`, which it writes itself; keep the value in the \
                 subtask's own state"
            ),
            Self::SelfEdge {
                dag,
                subtask,
                topic: None,
            } => {
                write!(f, "{subtask} of {dag} precedes itself; remove the edge")
            }
            Self::EdgeOutOfRange {
                dag,
                edge: (from, to),
                subtasks,
            } => write!(
                f,
                "{dag} has an edge from {from} to {to}, but its {subtasks} subtasks are counted from 0; \
                 correct the edge or register the subtask"
            ),
            _ => f.write_str(self.code()),
        }
    }

    fn fmt_topic(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::UnreadTopic {
                dag,
                topic,
                writer,
                meant,
            } => write!(
                f,
                "{writer} of {dag} writes topic `{topic}`, which no subtask reads; {}register a reader or drop \
                 the output",
                question(meant.as_ref())
            ),
            Self::UnwrittenTopic {
                dag,
                topic,
                reader,
                meant,
            } => write!(
                f,
                "{reader} of {dag} reads topic `{topic}`, which no subtask writes; {}register a writer or drop \
                 the input",
                question(meant.as_ref())
            ),
            Self::TypeMismatch {
                dag,
                topic,
                writer,
                written,
                reader,
                read,
            } => write!(
                f,
                "topic `{topic}` of {dag} is written as `{written}` by {writer} and read as `{read}` by \
                 {reader}; make both the same type"
            ),
            Self::SeveralWriters {
                dag,
                topic,
                writers,
            } => write!(
                f,
                "topic `{topic}` of {dag} has {} writers: {}; give each a topic of its own",
                writers.len(),
                list(writers)
            ),
            Self::SeveralReaders {
                dag,
                topic,
                type_name,
                readers,
            } => write!(
                f,
                "topic `{topic}` of {dag} carries `{type_name}`, which can only be moved, and has {} readers: \
                 {}; keep one reader or send a type that can be shared",
                readers.len(),
                list(readers)
            ),
            Self::TopicInSeveralDags { topic, dags } => {
                write!(
                    f,
                    "topic `{topic}` is used by {} DAGs: {}",
                    dags.len(),
                    list(dags)
                )?;
                f.write_str("; a topic stays inside one dag, so rename it in the others")
            }
            Self::DuplicateTopic {
                dag,
                subtask,
                topic,
                direction,
            } => write!(
                f,
                "{subtask} of {dag} {} topic `{topic}` twice; drop one of the {}",
                direction.verb(),
                direction.noun()
            ),
            Self::ArityTooLarge {
                dag,
                subtask,
                direction,
                arity,
            } => write!(
                f,
                "{subtask} of {dag} has {arity} {}, more than {MAX_ARITY}; bundle some into one message",
                direction.noun()
            ),
            _ => self.fmt_shared(f),
        }
    }
}

/// Returns what stands before the remedy: whether another topic was meant.
pub(super) fn question(meant: Option<&String>) -> impl Display {
    fmt::from_fn(move |f| match meant {
        Some(topic) => write!(f, "did you mean `{topic}`? If not, "),
        None => Ok(()),
    })
}

/// Returns the labels with commas between them, at most [`LISTED`].
pub(super) fn list<L: Display>(labels: &[L]) -> String {
    use core::fmt::Write;

    let mut text = String::new();
    for (position, label) in labels.iter().take(LISTED).enumerate() {
        let separator = if position == 0 { "" } else { ", " };
        // Writing to a `String` cannot fail.
        let _ = write!(text, "{separator}{label}");
    }
    if labels.len() > LISTED {
        let _ = write!(text, " and {} more", labels.len() - LISTED);
    }
    text
}

impl Direction {
    const fn verb(self) -> &'static str {
        match self {
            Self::Input => "reads",
            Self::Output => "writes",
        }
    }

    const fn noun(self) -> &'static str {
        match self {
            Self::Input => "inputs",
            Self::Output => "outputs",
        }
    }
}

impl Time {
    const fn noun(self) -> &'static str {
        match self {
            Self::FirstDeadline => "the deadline of the first job",
            Self::LastDeadline => "the deadline of the last job",
            Self::Volume => "the sum of the WCETs",
        }
    }

    const fn remedy(self) -> &'static str {
        match self {
            Self::FirstDeadline => "lower the offset or the relative deadline",
            Self::LastDeadline => "lower the number of jobs, the period or the offset",
            Self::Volume => "lower the WCETs",
        }
    }
}
