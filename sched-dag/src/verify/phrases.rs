//! Phrases of the texts of faults and warnings that depend on what is at fault.

use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;
use core::fmt::{self, Display};
use core::time::Duration;

use super::label::{DagLabel, SubtaskLabel};

/// How many subtasks a message lists before it only counts the rest.
const LISTED: usize = 8;

/// Returns a time as messages print it.
pub(super) const fn ns(ns: u64) -> Duration {
    Duration::from_nanos(ns)
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

/// Returns subtasks of several DAGs as a list names them.
pub(super) fn members(subtasks: &[(DagLabel, SubtaskLabel)]) -> Vec<String> {
    let named = |(dag, subtask): &(DagLabel, SubtaskLabel)| format!("{subtask} of {dag}");
    subtasks.iter().map(named).collect()
}

/// Returns a cycle's subtasks, and the first one again.
pub(super) fn ring(hops: &[SubtaskLabel]) -> impl Display {
    fmt::from_fn(move |f| {
        for hop in hops {
            write!(f, "{hop} -> ")?;
        }
        hops.first().map_or(Ok(()), |first| first.fmt(f))
    })
}

/// Returns how a subtask precedes itself, and the remedy.
pub(super) fn own_input(topic: Option<&String>) -> impl Display {
    fmt::from_fn(move |f| match topic {
        Some(topic) => write!(
            f,
            "reads topic `{topic}`, which it writes itself; keep the value in the subtask's own \
             state"
        ),
        None => f.write_str("precedes itself; remove the edge"),
    })
}

/// Returns which clusters can be stated, of so many.
pub(super) fn one_up_to(clusters: usize) -> impl Display {
    fmt::from_fn(move |f| write!(f, "state one up to cluster {}", clusters.saturating_sub(1)))
}

/// Returns why a cluster does not exist where there are so many, and the remedy.
pub(super) fn undivided(clusters: usize) -> impl Display {
    fmt::from_fn(move |f| match clusters {
        0 => f.write_str("this machine's cores are not divided; leave its cluster out"),
        _ => write!(f, "there is none; {}", one_up_to(clusters)),
    })
}
