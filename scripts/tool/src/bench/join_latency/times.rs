//! A condition's raw times: read from the guest's lines, kept as a CSV file.
//!
//! The file's first line is a comment that states everything the times depend on.
//! A file whose first line differs is another condition's, and is measured anew.

use std::fmt::Write;

use join_latency::{Joined, Samples, Span};

use crate::json::Value;
use crate::protocol::{MachineLine, Transcript};

/// The columns. `subtask` 0 is the source, 1 to N are the parallel ones.
const COLUMNS: &str = "what,subtask,index,ready_ns,start_ns,finish_ns,joined_indices";

/// Gathers the times that a guest has printed.
///
/// # Errors
///
/// In words: a line is not as it should be.
pub(super) fn read_transcript(transcript: &Transcript, subtasks: usize) -> Result<Samples, String> {
    let mut samples = Samples {
        parallel: vec![Vec::new(); subtasks],
        ..Samples::default()
    };
    for line in transcript.of_kind("executions") {
        let damaged = || format!("serial line {} has no times as it should", line.number);
        let subtask = line.number_at("subtask").ok_or_else(damaged)?;
        let subtask = usize::try_from(subtask).map_err(|_| damaged())?;
        let spans = spans_of(&mut samples, subtask).ok_or_else(damaged)?;
        check_batch(line, spans.len())?;
        for times in line.value.get("times").ok_or_else(damaged)?.elements() {
            spans.push(span(numbers(times).try_into().map_err(|_| damaged())?));
        }
    }
    for line in transcript.of_kind("joins") {
        let damaged = || format!("serial line {} has no joins as it should", line.number);
        check_batch(line, samples.joins.len())?;
        for times in line.value.get("times").ok_or_else(damaged)?.elements() {
            let numbers = numbers(times);
            let [ready_ns, start_ns, finish_ns, indices @ ..] = &numbers[..] else {
                return Err(damaged());
            };
            add_join(&mut samples, [*ready_ns, *start_ns, *finish_ns], indices)
                .ok_or_else(damaged)?;
        }
    }
    Ok(samples)
}

/// Makes sure that a batch begins where the one before has ended.
fn check_batch(line: &MachineLine, before: usize) -> Result<(), String> {
    match line.number_at("first") == Some(before as u64) {
        true => Ok(()),
        false => Err(format!(
            "a batch before serial line {} is missing",
            line.number
        )),
    }
}

/// Returns the executions of a subtask; 0 is the source.
fn spans_of(samples: &mut Samples, subtask: usize) -> Option<&mut Vec<Span>> {
    match subtask {
        0 => Some(&mut samples.source),
        _ => samples.parallel.get_mut(subtask - 1),
    }
}

const fn span([start_ns, finish_ns]: [u64; 2]) -> Span {
    Span {
        start_ns,
        finish_ns,
    }
}

fn numbers(list: &Value) -> Vec<u64> {
    list.elements().iter().filter_map(Value::as_u64).collect()
}

fn add_join(samples: &mut Samples, times_ns: [u64; 3], indices: &[u64]) -> Option<()> {
    let [ready_ns, times_ns @ ..] = times_ns;
    if indices.len() != samples.parallel.len() {
        return None;
    }
    let span = span(times_ns);
    samples.joins.push(Joined { ready_ns, span });
    samples.indices.extend(indices);
    Some(())
}

/// Writes the times as CSV under a first line `# {statement}`.
pub(super) fn to_csv(samples: &Samples, statement: &str) -> String {
    let mut text = format!("# {statement}\n{COLUMNS}\n");
    let subtasks = std::iter::once(&samples.source).chain(&samples.parallel);
    // Writing into a `String` cannot fail.
    for (subtask, spans) in subtasks.enumerate() {
        for (index, span) in spans.iter().enumerate() {
            let (start_ns, finish_ns) = (span.start_ns, span.finish_ns);
            let _ = writeln!(text, "execution,{subtask},{index},,{start_ns},{finish_ns},");
        }
    }
    let sink = samples.parallel.len() + 1;
    for (index, Joined { ready_ns, span }) in samples.joins.iter().enumerate() {
        let (start_ns, finish_ns) = (span.start_ns, span.finish_ns);
        let indices = samples.indices_of(index).iter().map(u64::to_string);
        let indices = indices.collect::<Vec<_>>().join(" ");
        let _ = writeln!(
            text,
            "join,{sink},{index},{ready_ns},{start_ns},{finish_ns},{indices}"
        );
    }
    text
}

/// Reads what [`to_csv`] wrote, if the statement is this one and nothing is damaged.
pub(super) fn from_csv(text: &str, statement: &str, subtasks: usize) -> Option<Samples> {
    let mut lines = text.lines();
    let is_its_own = lines.next()?.strip_prefix("# ")? == statement && lines.next()? == COLUMNS;
    if !is_its_own || !text.ends_with('\n') {
        return None;
    }
    let mut samples = Samples {
        parallel: vec![Vec::new(); subtasks],
        ..Samples::default()
    };
    for line in lines {
        let cells: Vec<&str> = line.split(',').collect();
        let [what, subtask, _, ready_ns, start_ns, finish_ns, indices] = cells[..] else {
            return None;
        };
        let (start_ns, finish_ns) = (start_ns.parse().ok()?, finish_ns.parse().ok()?);
        if what == "join" {
            let indices: Option<Vec<u64>> =
                indices.split(' ').map(|index| index.parse().ok()).collect();
            let times_ns = [ready_ns.parse().ok()?, start_ns, finish_ns];
            add_join(&mut samples, times_ns, &indices?)?;
        } else {
            let spans = spans_of(&mut samples, subtask.parse().ok()?)?;
            spans.push(span([start_ns, finish_ns]));
        }
    }
    Some(samples)
}

#[cfg(test)]
mod tests {
    use super::{from_csv, read_transcript, to_csv};
    use crate::protocol::Transcript;

    const LOG: &str = "\
{\"kind\":\"executions\",\"subtask\":0,\"first\":0,\"times\":[[0,1],[25,26]]}
{\"kind\":\"executions\",\"subtask\":1,\"first\":0,\"times\":[[2,9]]}
{\"kind\":\"executions\",\"subtask\":1,\"first\":1,\"times\":[[27,40]]}
{\"kind\":\"executions\",\"subtask\":2,\"first\":0,\"times\":[[3,8],[28,30]]}
{\"kind\":\"joins\",\"first\":0,\"times\":[[10,11,12,0,0],[41,42,43,1,1]]}
";

    #[test]
    fn times_survive_the_way_through_the_file() {
        let samples = read_transcript(&Transcript::read(LOG), 2).unwrap();
        assert_eq!(samples.parallel[0][1].finish_ns, 40);
        assert_eq!(samples.indices, [0, 0, 1, 1]);
        let text = to_csv(&samples, "jobs=2");
        assert_eq!(from_csv(&text, "jobs=2", 2), Some(samples));
        assert_eq!(from_csv(&text, "jobs=3", 2), None);
        let cut = &text[..text.len() - 4];
        assert_eq!(from_csv(cut, "jobs=2", 2), None, "a cut file is not taken");
    }

    #[test]
    fn a_missing_batch_is_noticed() {
        let without: String = LOG.lines().filter(|line| !line.contains("[2,9]")).collect();
        let without = without.replace("}{", "}\n{");
        let message = read_transcript(&Transcript::read(&without), 2).unwrap_err();
        assert_eq!(message, "a batch before serial line 2 is missing");
    }
}
