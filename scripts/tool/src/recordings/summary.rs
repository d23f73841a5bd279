//! What is in a recording, as a table.

use std::fmt::Write;

use recording::{Chunk, Commit, Counted, Recording, Times, What};
use replay::shown::visible;

use crate::proof::{observed, wcets};

/// Returns the lines.
pub(super) fn of(recording: &Recording<'_>) -> String {
    let header = recording.header();
    let mut values = vec![0_u64; header.channels.len()];
    let mut others = [
        (What::Signal, 0),
        (What::Skip, 0),
        (What::Cut, 0),
        (What::Restart, 0),
        (What::Clock, 0),
        (What::Fault, 0),
    ];
    let mut span_ns: Option<(u64, u64)> = None;
    for entry in recording.entries() {
        let (first, last) = span_ns.unwrap_or((entry.release_ns, entry.at_ns));
        span_ns = Some((first.min(entry.release_ns), last.max(entry.at_ns)));
        match others.iter_mut().find(|(what, _)| *what == entry.what) {
            Some((_, count)) => *count += 1,
            None if entry.what == What::Value => values[usize::from(entry.place)] += 1,
            None => {}
        }
    }
    let mut text = String::new();
    // Writing into a `String` cannot fail.
    let _ = writeln!(
        text,
        "recording of `{}`, {} entries",
        visible(&header.app),
        recording.count()
    );
    if let Some((first, last)) = span_ns {
        let _ = writeln!(text, "from {first} ns to {last} ns");
    }
    for (channel, values) in header.channels.iter().zip(values) {
        let dag = visible(&header.dags[usize::from(channel.dag)].name);
        let (role, topic) = (channel.role.name(), visible(&channel.topic));
        let schema = channel.schema.to_string();
        let schema = visible(&schema);
        let _ = writeln!(
            text,
            "  {role} `{topic}` of dag `{dag}`: {values} values of {schema}"
        );
    }
    for (what, count) in others {
        if count > 0 {
            let _ = writeln!(text, "  {count} times {}", what.name());
        }
    }
    let (mut commits, mut events, mut runs, mut lines) = (Vec::new(), 0, 0, 0);
    let mut tables = String::new();
    for chunk in recording.chunks() {
        match chunk {
            Chunk::Header(_) | Chunk::Entry(_) => {}
            Chunk::Text(text) => lines += text.lines().count(),
            Chunk::Commit(commit) => commits.push(commit),
            Chunk::Events(some) => events += some.words().count(),
            Chunk::Times(times) => {
                tables += &commits
                    .last()
                    .map_or(String::new(), |of| table(runs, of, &times));
                runs += 1;
            }
        }
    }
    let counts = [
        (commits.len(), "commits"),
        (events, "events"),
        (runs, "runs that have ended"),
        (lines, "machine lines"),
    ];
    for (count, what) in counts {
        if count > 0 {
            let _ = writeln!(text, "  {count} {what}");
        }
    }
    let _ = match recording.lost() {
        _ if recording.is_cut() => writeln!(
            text,
            "incomplete: it says nothing of what came after its last entry"
        ),
        0 => writeln!(text, "complete"),
        lost => writeln!(text, "incomplete: {lost} values are lost"),
    };
    text + &tables
}

/// Shows what all jobs of a run took, also those whose events are lost.
fn table(run: usize, commit: &Commit, times: &Times) -> String {
    let mut text = String::new();
    let mut row = |name: &str, counted: &Counted| {
        let times = observed::distribution(counted);
        let figures = [times.min(), times.median(), times.p99(), times.max()];
        let figures = figures
            .map(|ns| format!("{:>12}", wcets::shown(ns)))
            .concat();
        // Writing into a `String` cannot fail.
        let _ = match times.count() {
            0 => Ok(()),
            count => writeln!(text, "  {name:<34}{count:>8}{figures}"),
        };
    };
    for (dag, times) in commit.dags.iter().zip(&times.dags) {
        let name = visible(&dag.name).to_string();
        row(&format!("`{name}` response"), &times.response);
        row(&format!("`{name}` release jitter"), &times.release_jitter);
        for (subtask, times) in dag.subtasks.iter().zip(&times.subtasks) {
            let name = visible(&subtask.name).to_string();
            row(&format!("  `{name}` join latency"), &times.join_latency);
            row(&format!("  `{name}` execution"), &times.execution);
            if let Some((response, ..)) = &times.sink {
                row(&format!("  `{name}` response"), response);
            }
        }
    }
    match text.is_empty() {
        true => text,
        false => format!(
            "run {run}{:>39}         min      median         p99         max\n{text}",
            "count"
        ),
    }
}
