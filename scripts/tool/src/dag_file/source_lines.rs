//! What the guest says of a DAG file, with the lines of the file that its person has.
//!
//! The guest reads the file in our format, as it was written for it, and the commit
//! knows names alone. Whatever can be told before a boot has been told by then with the
//! right lines ([`load`](super::load())); what remains are words for the guest that the
//! host does not read, and a machine that is too small.

use std::path::Path;

use dag_file::{DagFile, FileDag, parse};

/// Returns what the guest says with `path` and its lines in place of the words `DAG
/// file`, one line a fault; `None` if it speaks of no file.
pub(super) fn translate(said: &str, path: &Path, file: &DagFile) -> Option<String> {
    let place = path.display();
    let said = said.strip_prefix("DAG file")?;
    if let Some(reason) = said.strip_prefix(": ") {
        return Some(format!("{place}: {reason}"));
    }
    let mut lines = Vec::new();
    for fault in said.strip_prefix(", line ")?.split("; line ") {
        let (line, reason) = fault.split_once(": ")?;
        lines.push(match source_line(file, line.parse().ok()?) {
            Some(line) => format!("{place}:{line}: {reason}"),
            None => format!("{place}: {reason}"),
        });
    }
    Some(lines.join("\n"))
}

/// Returns the line of the person's file that became this line of the guest's.
fn source_line(file: &DagFile, line: usize) -> Option<usize> {
    let written = parse(&file.to_string()).ok()?;
    let dags = |file: &DagFile| -> Vec<Vec<usize>> {
        let dags = file.sets.iter().flat_map(|set| &set.dags);
        dags.map(lines).collect()
    };
    let (written, read) = (dags(&written), dags(file));
    let mut pairs = written.iter().flatten().zip(read.iter().flatten());
    pairs
        .find(|(written, _)| **written == line)
        .map(|(_, read)| *read)
}

/// Returns all lines of a DAG, in an order that is the same for every writing of it.
fn lines(dag: &FileDag) -> Vec<usize> {
    let subtasks = dag.subtasks.iter().map(|subtask| subtask.line);
    let all = std::iter::once(dag.line).chain(subtasks);
    all.chain(dag.edge_lines.iter().copied()).collect()
}

#[cfg(test)]
mod tests {
    use super::translate;
    use dag_file::parse;
    use std::path::Path;

    /// What the guest says, and what the person is told.
    const SAID: &str = r"DAG file, line 1: late; drop it | f.dag:3: late; drop it
DAG file, line 2: a | f.dag:5: a
DAG file, line 4: a | f.dag:8: a
DAG file, line 1: a: b; c; line 6: d | f.dag:3: a: b; c\nf.dag:9: d
DAG file, line 99: a | f.dag: a
DAG file: too large | f.dag: too large";

    #[test]
    fn the_guests_lines_become_those_of_the_file() {
        let text = "# one\n\ndag x period 1s\n# two\nsubtask a wcet 1ms\nsubtask b wcet 1ms\n\n\
                    edge a -> b\ndag y period 1s\nsubtask a wcet 1ms\nend";
        let file = parse(text).unwrap();
        // The guest's has no comments.
        assert!(file.to_string().starts_with("dag x "));
        let told = |said: &str| translate(said, Path::new("f.dag"), &file);
        for row in SAID.lines() {
            let (said, expected) = row.split_once(" | ").expect(row);
            assert_eq!(told(said), Some(expected.replace(r"\n", "\n")), "{said}");
        }
        assert_eq!(told("`jbos` is no option"), None);
    }
}
