//! Generated files are read, and broken ones refused. `tests/it/dag_files.rs` has more of these, as
//! a person sees them.

use super::read;
use crate::system::workspace;
use crate::tests::rows;

const MS: u64 = 1_000_000;

#[test]
fn every_generated_file_is_read() {
    let folder = workspace().join("apps/dag-file/examples/rd-gen");
    let files = std::fs::read_dir(folder).unwrap().flatten();
    let paths: Vec<_> = files.map(|file| file.path()).collect();
    assert_eq!(paths.len(), 24);
    for path in paths {
        let text = std::fs::read_to_string(&path).unwrap();
        let file = read(&text, "x", MS).unwrap();
        let (place, dags) = (path.display().to_string(), &file.sets[0].dags);
        let subtasks: usize = dags.iter().map(|dag| dag.subtasks.len()).sum();
        assert_eq!(subtasks, text.matches("id: ").count(), "{place}");
        let remarks = dags.iter().flat_map(|dag| &dag.remarks);
        let left_out = remarks.filter(|remark| remark.contains("latest")).count();
        let edges: usize = dags.iter().map(|dag| dag.spec.edges.len()).sum();
        let links = text.matches("source: ").count();
        assert_eq!(edges + left_out, links, "{place}");
        let is_whole = (dags.len(), left_out) == (1, 0);
        assert!(is_whole || place.contains("chain_"), "{place}");
        // The file written for the app equals the imported one; the remarks are comments.
        let written = file.to_string();
        let lines = written.split_inclusive('\n');
        let lines: String = lines.filter(|line| !line.starts_with('#')).collect();
        assert_eq!(fass_dag_file::parse(&written).unwrap().to_string(), lines);
    }
}

#[test]
fn times_and_defaults_are_those_of_the_file() {
    let text = "nodes:\n- id: 0\n  execution_time: 2.5\n  period: 10\n  offset: 1\n\
                - id: 1\n  execution_time: 1\n  end_to_end_deadline: 8\n\
                links:\n- source: 0\n  target: 1\n  communication_time: 3\n";
    let dag = |text: &str| read(text, "x", MS).unwrap().to_string();
    assert_eq!(
        dag(text),
        "dag x period 10ms deadline 8ms offset 1ms\n\
         subtask 0 wcet 2500us\nsubtask 1 wcet 4ms\nedge 0 -> 1\n\nend\n"
    );
    // 30 Hz: time to execute in is rounded down, what it takes up.
    let text = "nodes:\n- id: 0\n  execution_time: 3.33333333\n  period: 33.33333333\n  \
                end_to_end_deadline: 16.66666667\n";
    let rounded = "dag x period 33333333ns deadline 16666666ns\nsubtask 0 wcet 3333334ns\n\nend\n";
    assert_eq!(dag(text), rounded);
}

/// The content of a file, and the refusal. `NODE` is a node called 0, of four lines with the
/// `nodes:` above it, and `ONE` one called 1, of two.
const REFUSED: &str = r"directed: true\n | line 1: the file has no nodes
directed: false\n | line 1: `directed` must be true, found `false`
multigraph: true\n | line 1: `multigraph` must be false
nodes: 3\n | line 1: `nodes` must be a sequence
nods:\n- id: 0\n | line 2: unknown key `nods`; a node-link document has directed
nodes:\n- id: 0\n | line 2: node `0` has no `execution_time`
nodes:\n- execution_time: 1\n | line 2: this node has no `id`
nodes:\n- id: 0\n  execution_time: 3\n  end_to_end_deadline: 0.0\n | line 4: end_to_end_deadline: it is 0
nodes:\n- id: 0\n  execution_time: soon\n | line 3: execution_time: `soon` is no time
nodes:\n- id: a b\n  execution_time: 1\n | line 2: id: `a b` is no name; give a word
nodes:\n- id: '{x'\n  execution_time: 1\n | line 2: id: `{x` is no name; give a word
NODE- id: 0\n  execution_time: 1\n | line 5: node `0` stands here twice, first on line 2
NODEONElinks:\n- source: 0\n  target: 1\n- source: 0\n  target: 1\n | line 10: the link from `0` to `1` stands here twice, first on line 8; drop one
NODEONE  offset: 2\nlinks:\n- source: 0\n  target: 1\n | line 5: node `1` has an `offset` and no `period`, and starts after
NODElinks:\n- source: 0\n  target: 0\n  firing_prob: 0.5\n | line 8: `firing_prob`
NODElinks:\n- source: 0\n  target: 0\n | line 6: subtask `0` of dag `x` precedes itself";

#[test]
fn a_refusal_names_line_offender_and_remedy() {
    for [text, words] in rows(REFUSED) {
        let node = "nodes:\n- id: 0\n  execution_time: 1\n  period: 9\n";
        let text = text.replace("NODE", node);
        let text = text.replace("ONE", "- id: 1\n  execution_time: 1\n");
        let message = read(&text, "x", MS).unwrap_err()[0].to_string();
        assert!(message.contains(&words), "{message}\n  not: {words}");
    }
    // Of two DAGs, the first is named after the file and its first node.
    let text = "nodes:\n- id: 0\n  execution_time: 1\n  period: 9\n- id: 1\n  execution_time: 1\n  \
                period: 7\n";
    let message = read(text, &"x".repeat(254), MS).unwrap_err()[0].to_string();
    let is_named = message.starts_with("line 2: `xxx");
    assert!(is_named && message.ends_with("; rename the file or the node"));
}
