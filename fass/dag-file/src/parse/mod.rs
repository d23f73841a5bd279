//! Reads DAG files, strictly: anything not described in `docs/dag-file.md` is refused with its
//! line.
//!
//! A file is records of blank-separated words, one record a line. A word beginning with `#` begins
//! a comment. The last record is `end`, so an incomplete file is never taken for a shorter one.

mod keys;

use alloc::collections::BTreeMap;
use alloc::format;
use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec::Vec;

use sched_dag::{ClusterId, DagSpec, OverrunPolicy, Priority, SubtaskSpec, Wait};
use text::is_seen;
use text::repeated;
use text::{Line, Lines, Malformed, quoted};

use keys::Keys;

use crate::file::{DagFile, FileDag, FileSubtask, Set, executed_ns, sample_len};
use crate::time::{Time, parse_ns};

/// The words allowed at the beginning of a record.
const RECORDS: &str = "`set`, `dag`, `subtask`, `edge`, `core`, `certificate`, `state` or `end`";

/// Reads a file.
///
/// Names are resolved and each record is interpreted. Faults visible only to the commit, such as a
/// cycle, are left to [`check()`](crate::check()).
///
/// # Errors
///
/// [`Malformed`] for the first record that violates the format.
pub fn parse(text: &str) -> Result<DagFile, Malformed> {
    let mut lines = Lines::new(text);
    let mut reader = Reader::default();
    loop {
        let Some(line) = next_record(&mut lines) else {
            let (expected, remedy) = if reader.file.sets.is_empty() {
                (
                    "a `dag` record",
                    "it is empty: describe a DAG, or name another file",
                )
            } else {
                ("`end`", "a part of it is missing, or that last line is")
            };
            let Malformed { line, reason } = lines.ended(expected);
            let reason = format!("{reason}; {remedy}");
            return Err(Malformed { line, reason });
        };
        if line.kind == "end" {
            line.exactly(0)?;
            break reader.finish(&line)?;
        }
        reader.read_line(&line)?;
    }
    match next_record(&mut lines) {
        None => Ok(reader.file),
        Some(line) => Err(line.malformed(format!(
            "{} stands after `end`; remove it, or move `end` to the last line",
            quoted(line.kind)
        ))),
    }
}

/// The most bytes of a name.
const MOST_OF_NAME: usize = 255;

/// Reports whether a name can stand in a file: one word of visible characters, not too long, not an
/// arrow, and not beginning like a comment or a machine line.
pub fn is_name(word: &str) -> bool {
    let is_plain = |character: char| !character.is_whitespace() && is_seen(character);
    (1..=MOST_OF_NAME).contains(&word.len())
        && !word.starts_with(['#', '{'])
        && word != "->"
        && word.chars().all(is_plain)
}

/// Explains why a word is refused as a name.
pub fn no_name(word: &str) -> String {
    format!(
        "{} is no name; give a word of at most {MOST_OF_NAME} bytes that begins with neither `#` \
         nor `{{`",
        quoted(word)
    )
}

/// Returns the next line with more than a comment, without its comment.
fn next_record<'a>(lines: &mut Lines<'a>) -> Option<Line<'a>> {
    loop {
        let mut line = lines.next_line()?;
        if line.kind.starts_with('#') {
            continue;
        }
        let comment = line.words.iter().position(|word| word.starts_with('#'));
        line.words.truncate(comment.unwrap_or(line.words.len()));
        return Some(line);
    }
}

/// The state of the reader: the file so far.
#[derive(Default)]
struct Reader<'a> {
    file: DagFile,
    /// Names and lines of the sets.
    sets: BTreeMap<&'a str, usize>,
    /// Names and lines of the DAGs of the latest set.
    dags: BTreeMap<&'a str, usize>,
    /// Names and positions of the subtasks of the latest DAG.
    subtasks: BTreeMap<&'a str, usize>,
}

impl<'a> Reader<'a> {
    fn read_line(&mut self, line: &Line<'a>) -> Result<(), Malformed> {
        match line.kind {
            "set" => self.take_set(line),
            "dag" => self.take_dag(line),
            "subtask" => self.take_subtask(line),
            "edge" => self.take_edge(line),
            "core" => self.take_list(line),
            "certificate" | "state" => self.take_certificate(line),
            other => {
                let remedy = match self.file.sets.is_empty() {
                    // Perhaps none of the file's lines is meant for this reader.
                    true => "write a file of another format as docs/dag-file.md says",
                    false => "make it a comment with #",
                };
                let found = quoted(other);
                Err(line.malformed(format!(
                    "expected {RECORDS}, found {found}; correct it, or {remedy}"
                )))
            }
        }
    }

    fn take_set(&mut self, line: &Line<'a>) -> Result<(), Malformed> {
        line.exactly(1)?;
        let name = line.words[0];
        if !is_name(name) {
            return Err(line.malformed(no_name(name)));
        }
        self.close(line)?;
        if let Some(first) = self.sets.insert(name, line.number) {
            return Err(twice(line, name, first));
        }
        self.dags.clear();
        self.file.sets.push(Set {
            name: name.into(),
            ..Set::default()
        });
        Ok(())
    }

    fn take_dag(&mut self, line: &Line<'a>) -> Result<(), Malformed> {
        if self.file.sets.is_empty() {
            self.file.sets.push(Set::default());
        } else if self.dag().is_some() {
            self.close(line)?;
        }
        let dag = read_dag(line)?;
        let set = self.file.sets.last_mut();
        let dags = &mut set.ok_or_else(|| line.malformed("no set"))?.dags;
        dags.push(dag);
        if let Some(first) = self.dags.insert(line.words[0], line.number) {
            return Err(twice(line, line.words[0], first));
        }
        self.subtasks.clear();
        Ok(())
    }

    fn take_subtask(&mut self, line: &Line<'a>) -> Result<(), Malformed> {
        let (spec, subtask) = read_subtask(line)?;
        let dag = self.open_dag(line)?;
        let position = dag.subtasks.len();
        dag.spec.subtasks.push(spec);
        dag.subtasks.push(subtask);
        match self.subtasks.insert(line.words[0], position) {
            None => Ok(()),
            Some(first) => {
                let first = self.open_dag(line)?.subtasks[first].line;
                Err(twice(line, line.words[0], first))
            }
        }
    }

    fn take_edge(&mut self, line: &Line<'a>) -> Result<(), Malformed> {
        let &[earlier, "->", later] = &line.words[..] else {
            return Err(line.malformed("expected `edge A -> B` with two names of subtasks"));
        };
        self.open_dag(line)?;
        let position = |name: &str| {
            self.subtasks.get(name).copied().ok_or_else(|| {
                line.malformed(format!(
                    "no subtask {} stands before this line in the DAG; add one, or correct the name",
                    quoted(name)
                ))
            })
        };
        let edge = (position(earlier)?, position(later)?);
        let dag = self.open_dag(line)?;
        dag.spec.edges.push(edge);
        dag.edge_lines.push(line.number);
        Ok(())
    }

    fn take_list(&mut self, line: &Line<'a>) -> Result<(), Malformed> {
        self.open_dag(line)?;
        let list = format!("core {}", line.words.join(" "));
        if let Some(set) = self.file.sets.last_mut() {
            set.lists.push((line.number, list));
        }
        Ok(())
    }

    /// Takes a line of a certificate as it is: only the commit can judge its proof.
    fn take_certificate(&mut self, line: &Line<'a>) -> Result<(), Malformed> {
        self.open_dag(line)?;
        if let Some(set) = self.file.sets.last_mut() {
            set.certificate.push_str(line.kind);
            for word in &line.words {
                set.certificate.push(' ');
                set.certificate.push_str(word);
            }
            set.certificate.push('\n');
        }
        Ok(())
    }

    /// Returns the latest DAG of the latest set.
    fn dag(&mut self) -> Option<&mut FileDag> {
        self.file.sets.last_mut()?.dags.last_mut()
    }

    fn open_dag(&mut self, line: &Line<'_>) -> Result<&mut FileDag, Malformed> {
        self.dag().ok_or_else(|| {
            line.malformed(format!(
                "`{}` stands before any `dag`; begin with `dag NAME period 25ms`",
                line.kind
            ))
        })
    }

    /// Checks that the latest set and DAG are not empty, before the next record.
    fn close(&mut self, next: &Line<'_>) -> Result<(), Malformed> {
        let Some(set) = self.file.sets.last() else {
            return Ok(());
        };
        match set.dags.last() {
            None => Err(next.malformed(format!(
                "set {} ends here without a DAG; add one, or remove the set",
                quoted(&set.name)
            ))),
            Some(dag) if dag.subtasks.is_empty() => Err(next.malformed(format!(
                "dag {} of line {} ends here without a subtask; add one",
                quoted(&dag.spec.name),
                dag.line
            ))),
            Some(dag) => refuse_repeated_edge(dag),
        }
    }

    fn finish(&mut self, end: &Line<'_>) -> Result<(), Malformed> {
        if self.file.sets.is_empty() {
            return Err(end.malformed("the file has no dag; add one before `end`"));
        }
        self.close(end)
    }
}

/// Returns the error of a record whose name is taken.
fn twice(line: &Line<'_>, name: &str, first: usize) -> Malformed {
    let (kind, name) = (line.kind, quoted(name));
    line.malformed(format!(
        "{kind} {name} stands here twice, first on line {first}; rename one"
    ))
}

/// Makes sure that no edge of a DAG appears twice.
///
/// # Errors
///
/// The first surplus edge.
pub fn refuse_repeated_edge(dag: &FileDag) -> Result<(), Malformed> {
    let Some((first, second)) = repeated(&dag.spec.edges) else {
        return Ok(());
    };
    let (earlier, later) = dag.spec.edges[second];
    let name = |subtask: usize| quoted(&dag.spec.subtasks[subtask].name);
    Err(Malformed {
        line: dag.edge_lines[second],
        reason: format!(
            "the edge from {} to {} stands here twice, first on line {}; drop one",
            name(earlier),
            name(later),
            dag.edge_lines[first]
        ),
    })
}

fn read_dag(line: &Line<'_>) -> Result<FileDag, Malformed> {
    let (name, mut keys) = Keys::new(line)?;
    let mut spec = DagSpec {
        name,
        ..DagSpec::default()
    };
    while let Some(key) = keys.next_key()? {
        match key {
            "period" => spec.period_ns = Some(keys.time_ns(key)?),
            "deadline" => spec.relative_deadline_ns = Some(keys.time_ns(key)?),
            "offset" => spec.offset_ns = keys.time_ns(key)?,
            "cluster" => spec.cluster = Some(ClusterId(keys.number(key)?)),
            "affinity" => spec.affinity = keys.numbers(key)?,
            "in-flight" => spec.in_flight = Some(keys.number(key)?),
            "jobs" => spec.jobs = Some(keys.number(key)?.into()),
            "overrun" => {
                spec.overrun = match keys.value(key)? {
                    "queue" => OverrunPolicy::Queue,
                    "skip" => OverrunPolicy::Skip,
                    "abort" => OverrunPolicy::Abort,
                    other => {
                        return Err(line.malformed(format!(
                            "overrun: {} is none of queue, skip and abort",
                            quoted(other)
                        )));
                    }
                }
            }
            "order" => {
                return Err(keys.malformed(
                    "`order` is no more; state the order of a core by `core 2: dag.a dag.b` after \
                     the DAGs, or by `clusters=auto`",
                ));
            }
            other => {
                return Err(keys.unknown(
                    other,
                    "`period`, `deadline`, `offset`, `cluster`, `affinity`, `overrun`, \
                     `in-flight`, `jobs`",
                ));
            }
        }
    }
    if spec.period_ns.is_none() {
        let message = format!(
            "dag {} has no period; add `period 25ms`",
            quoted(&spec.name)
        );
        return Err(line.malformed(message));
    }
    spec.relative_deadline_ns = spec.relative_deadline_ns.or(spec.period_ns);
    Ok(FileDag {
        spec,
        line: line.number,
        ..FileDag::default()
    })
}

fn read_subtask(line: &Line<'_>) -> Result<(SubtaskSpec, FileSubtask), Malformed> {
    let (name, mut keys) = Keys::new(line)?;
    let mut spec = SubtaskSpec {
        name,
        ..SubtaskSpec::default()
    };
    let mut samples = None;
    while let Some(key) = keys.next_key()? {
        match key {
            "wcet" if spec.waits.is_empty() => read_segments(&mut keys, &mut spec)?,
            "wait" if spec.wcet_ns.is_none() => read_waits(&mut keys, &mut spec)?,
            "wcet" | "wait" => {
                let message = "`wait` stands between two segments, as in `wcet 1ms wait 3ms wcet \
                               1ms`; move it";
                return Err(line.malformed(message));
            }
            "priority" => spec.priority = Some(Priority(keys.number(key)?)),
            "core" => {
                return Err(keys.malformed(
                    "`core` is no more; state `core 2: dag.a dag.b` after the DAGs, or of the DAG \
                     `affinity 2`",
                ));
            }
            "non-preemptive" => spec.non_preemptive = true,
            "deadline" => spec.relative_deadline_ns = Some(keys.time_ns(key)?),
            "samples" => samples = Some(keys.value(key)?),
            other => {
                return Err(keys.unknown(
                    other,
                    "`wcet`, after it any `wait` and `wcet`, `priority`, \
                     `non-preemptive`, `deadline`, `samples`",
                ));
            }
        }
    }
    let mut subtask = FileSubtask {
        line: line.number,
        ..FileSubtask::default()
    };
    match samples {
        Some(samples) => subtask.samples_ns = read_samples(line, samples, &spec)?,
        None if spec.wcet_ns.is_none() => {
            let message = format!("subtask {} has no wcet; add `wcet 3ms`", quoted(&spec.name));
            return Err(line.malformed(message));
        }
        None => {}
    }
    Ok((spec, subtask))
}

/// Reads samples: separated by commas, with `+` between the times of each sample.
fn read_samples(
    line: &Line<'_>,
    samples: &str,
    spec: &SubtaskSpec,
) -> Result<Arc<[u64]>, Malformed> {
    let mut samples_ns = Vec::new();
    for sample in samples.split(',') {
        let first = samples_ns.len();
        for time in sample.split('+') {
            let time_ns = parse_ns(time);
            samples_ns.push(time_ns.map_err(|why| line.malformed(format!("samples: {why}")))?);
        }
        let (of_sample, wanted) = (&samples_ns[first..], sample_len(spec));
        if of_sample.len() != wanted {
            return Err(line.malformed(format!(
                "the sample {} is not of {wanted} times; give one for each segment, and for each \
                 wait between, as in 1ms+3ms+1ms",
                quoted(sample)
            )));
        }
        if let Some(wcet_ns) = spec
            .wcet_ns
            .filter(|wcet_ns| executed_ns(of_sample) > *wcet_ns)
        {
            return Err(line.malformed(format!(
                "the sample {} is longer than the wcet {}; raise the wcet, or drop the sample",
                quoted(sample),
                Time(wcet_ns)
            )));
        }
    }
    Ok(samples_ns.into())
}

/// Reads the limits of waits between segments without WCETs.
fn read_waits(keys: &mut Keys<'_, '_>, spec: &mut SubtaskSpec) -> Result<(), Malformed> {
    loop {
        spec.waits.push(Wait {
            limit_ns: keys.time_ns("wait")?,
            segment_ns: None,
        });
        if !keys.next_if("wait") {
            return Ok(());
        }
    }
}

/// Reads the WCET, or the WCETs of the first segment and, each after a limit, of further segments.
fn read_segments(keys: &mut Keys<'_, '_>, spec: &mut SubtaskSpec) -> Result<(), Malformed> {
    let mut sum_ns = keys.wcet_ns()?;
    while keys.next_if("wait") {
        let limit_ns = keys.time_ns("wait")?;
        if !keys.next_if("wcet") {
            let limit = Time(limit_ns);
            return Err(keys.malformed(format!(
                "no segment follows `wait {limit}`; add one, as in `wait {limit} wcet 1ms`"
            )));
        }
        let segment_ns = keys.wcet_ns()?;
        sum_ns = sum_ns.checked_add(segment_ns).ok_or_else(|| {
            let why = "wcet: the segments together are more than 64 bits of nanoseconds hold; shorten \
                       one";
            keys.malformed(why)
        })?;
        spec.waits.push(Wait {
            limit_ns,
            segment_ns: Some(segment_ns),
        });
    }
    spec.wcet_ns = Some(sum_ns);
    Ok(())
}

#[cfg(test)]
mod tests;
