//! A condition's raw times: from the guest's lines into a CSV file, and back.
//!
//! The file's first line is a comment that states everything the times depend on.
//! A file whose first line differs is another condition's, and is measured anew.

use std::collections::BTreeMap;
use std::fmt::Write;

use join_latency::{Joined, Samples, Span};

use crate::json::Value;
use crate::protocol::Transcript;

/// The columns. `subtask` 0 is the source, 1 to N are the parallel ones, the next one is the join.
const COLUMNS: &str = "what,subtask,index,ready_ns,start_ns,finish_ns,joined_indices";

/// Returns the times that a guest has printed as CSV, under a first line `# {statement}`.
///
/// # Errors
///
/// In words: a line is not as it should be, or there are not so many jobs.
pub(super) fn write(
    transcript: &Transcript,
    statement: &str,
    subtasks: usize,
    jobs: u64,
) -> Result<String, String> {
    let sink = subtasks as u64 + 1;
    let mut text = format!("# {statement}\n{COLUMNS}\n");
    let mut counts: BTreeMap<u64, u64> = BTreeMap::new();
    let lines = transcript.machine.iter();
    for line in lines.filter(|line| ["executions", "joins"].contains(&&*line.kind)) {
        let number = line.number;
        let damaged = || format!("serial line {number} has no times as it should");
        let subtask = match &*line.kind {
            "joins" => sink,
            _ => line.number_at("subtask").ok_or_else(damaged)?,
        };
        let index = counts.entry(subtask).or_default();
        if line.number_at("first") != Some(*index) {
            return Err(format!("a batch before serial line {number} is missing"));
        }
        for times in line.value.get("times").ok_or_else(damaged)?.elements() {
            let numbers = times.elements().iter().filter_map(Value::as_u64);
            // Writing into a `String` cannot fail.
            let _ = match numbers.collect::<Vec<_>>()[..] {
                [start_ns, finish_ns] if subtask < sink => {
                    writeln!(text, "execution,{subtask},{index},,{start_ns},{finish_ns},")
                }
                [ready_ns, start_ns, finish_ns, ref joined @ ..] if joined.len() == subtasks => {
                    let joined: Vec<String> = joined.iter().map(u64::to_string).collect();
                    let joined = joined.join(" ");
                    writeln!(
                        text,
                        "join,{sink},{index},{ready_ns},{start_ns},{finish_ns},{joined}"
                    )
                }
                _ => return Err(damaged()),
            };
            *index += 1;
        }
    }
    match counts.get(&0).copied().unwrap_or_default() {
        all if all == jobs => Ok(text),
        some => Err(format!("the guest printed {some} of {jobs} jobs")),
    }
}

/// Reads what [`write()`] wrote, if the statement is this one and nothing is damaged.
pub(super) fn read(text: &str, statement: &str, subtasks: usize) -> Option<Samples> {
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
        let [what, subtask, _, ready_ns, start_ns, finish_ns, joined] = cells[..] else {
            return None;
        };
        let span = Span {
            start_ns: start_ns.parse().ok()?,
            finish_ns: finish_ns.parse().ok()?,
        };
        if what == "join" {
            let joined = joined.split(' ').map(|index| index.parse().ok());
            samples
                .indices
                .extend(joined.collect::<Option<Vec<u64>>>()?);
            let ready_ns = ready_ns.parse().ok()?;
            samples.joins.push(Joined { ready_ns, span });
        } else {
            match subtask.parse::<usize>().ok()? {
                0 => samples.source.push(span),
                parallel => samples.parallel.get_mut(parallel - 1)?.push(span),
            }
        }
    }
    Some(samples)
}

#[cfg(test)]
mod tests {
    use super::{read, write};
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
        let text = write(&Transcript::read(LOG), "jobs=2", 2, 2).unwrap();
        let samples = read(&text, "jobs=2", 2).unwrap();
        assert_eq!(samples.source[1].start_ns, 25);
        assert_eq!(samples.parallel[0][1].finish_ns, 40);
        assert_eq!(samples.joins[1].ready_ns, 41);
        assert_eq!(samples.indices, [0, 0, 1, 1]);
        assert_eq!(read(&text, "jobs=3", 2), None);
        let cut = &text[..text.len() - 4];
        assert_eq!(read(cut, "jobs=2", 2), None, "a cut file is not taken");
    }

    #[test]
    fn a_missing_batch_or_job_is_noticed() {
        let without: String = LOG.lines().filter(|line| !line.contains("[2,9]")).collect();
        let without = without.replace("}{", "}\n{");
        let message = write(&Transcript::read(&without), "", 2, 2).unwrap_err();
        assert_eq!(message, "a batch before serial line 2 is missing");
        let message = write(&Transcript::read(LOG), "", 2, 3).unwrap_err();
        assert_eq!(message, "the guest printed 2 of 3 jobs");
        let message = write(&Transcript::read(LOG), "", 3, 2).unwrap_err();
        assert_eq!(message, "serial line 5 has no times as it should");
    }
}
