//! What a recording has of one job: its values and what became of it.

use std::fmt::Write;

use recording::{Entry, Recording, Schema, Shown, What};
use replay::shown::{quoted, visible};

/// Returns the lines about a job, which is given as `DAG/JOB`.
pub(super) fn of(recording: &Recording<'_>, job: &str) -> Result<String, String> {
    let header = recording.header();
    let parts = job.rsplit_once('/');
    let Some((name, number)) =
        parts.and_then(|(dag, number)| Some((dag, number.parse::<u64>().ok()?)))
    else {
        return Err(format!(
            "`--until {}`: DAG/JOB is wanted, such as gait/17",
            visible(job)
        ));
    };
    let Some(dag) = header.dags.iter().position(|dag| dag.name == name) else {
        let there = header.dags.iter().map(|dag| quoted(&dag.name).to_string());
        let there = there.collect::<Vec<String>>().join(", ");
        return Err(format!(
            "`--until`: there is no dag {}; there are {there}",
            quoted(name)
        ));
    };
    let mut of_job = (recording.entries())
        .filter(|entry| usize::from(entry.dag) == dag && entry.job == number)
        .peekable();
    let Some(first) = of_job.peek() else {
        return Err(format!(
            "`--until`: nothing is recorded of job {number} of that dag"
        ));
    };
    let mut text = String::new();
    // Writing into a `String` cannot fail.
    let _ = writeln!(
        text,
        "job {number} of dag `{}`, due at {} ns",
        visible(name),
        first.release_ns
    );
    let times = Schema::parse("[u64]").expect("it is a schema");
    for Entry {
        what,
        place,
        at_ns,
        value,
        ..
    } in of_job
    {
        let channel = header.channels.get(usize::from(place));
        let _ = match (what, channel) {
            (What::Value | What::Lost, Some(channel)) => {
                let (role, topic) = (channel.role.name(), visible(&channel.topic));
                let shown = match what {
                    What::Lost => "lost".to_string(),
                    _ => Shown {
                        schema: &channel.schema,
                        bytes: value,
                    }
                    .to_string(),
                };
                let subtask = channel.subtask;
                writeln!(
                    text,
                    "  {at_ns} ns, subtask {subtask}, {role} `{topic}`: {shown}"
                )
            }
            (What::Clock, _) => {
                let shown = Shown {
                    schema: &times,
                    bytes: value,
                };
                writeln!(
                    text,
                    "  {at_ns} ns, subtask {place}, told the time: {shown}"
                )
            }
            (What::Cut | What::Restart | What::Fault, _) => {
                writeln!(text, "  {at_ns} ns, subtask {place}: {}", what.name())
            }
            _ => writeln!(text, "  {at_ns} ns: {}", what.name()),
        };
    }
    Ok(text)
}
