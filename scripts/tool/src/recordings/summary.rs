//! What is in a recording, as a table.

use std::fmt::Write;

use recording::{Recording, What};
use replay::shown::visible;

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
    let lines = recording.texts().flat_map(str::lines).count();
    if lines > 0 {
        let _ = writeln!(text, "  {lines} machine lines of the run");
    }
    let _ = match recording.lost() {
        _ if recording.is_cut() => writeln!(
            text,
            "incomplete: it says nothing of what came after its last entry"
        ),
        0 => writeln!(text, "complete"),
        lost => writeln!(text, "incomplete: {lost} values are lost"),
    };
    text
}
