//! Generated files are read, and broken ones refused.

use super::read;
use crate::system::workspace;

const MS: u64 = 1_000_000;

fn refusal(text: &str) -> String {
    read(text, "x", MS).unwrap_err()[0].to_string()
}

#[test]
fn every_generated_file_is_read() {
    let folder = workspace().join("apps/dag-file/examples/rd-gen");
    let mut count = 0;
    for entry in std::fs::read_dir(folder).unwrap().flatten() {
        let path = entry.path();
        let text = std::fs::read_to_string(&path).unwrap();
        let file = read(&text, "x", MS).unwrap();
        let dags = &file.sets[0].dags;
        let subtasks: usize = dags.iter().map(|dag| dag.subtasks.len()).sum();
        assert_eq!(subtasks, text.matches("id: ").count(), "{}", path.display());
        let left_out: usize = dags
            .iter()
            .map(|dag| {
                dag.remarks
                    .iter()
                    .filter(|remark| remark.contains("latest"))
                    .count()
            })
            .sum();
        let edges: usize = dags.iter().map(|dag| dag.spec.edges.len()).sum();
        assert_eq!(
            edges + left_out,
            text.matches("source: ").count(),
            "{}",
            path.display()
        );
        let is_chain = path.display().to_string().contains("chain_");
        assert!(
            is_chain || (dags.len() == 1 && left_out == 0),
            "{}",
            path.display()
        );
        // What the app will read is what was imported.
        let written = file.to_string();
        assert_eq!(
            dag_file::parse(&written).unwrap().to_string().len(),
            written
                .lines()
                .filter(|line| !line.starts_with('#'))
                .map(|line| line.len() + 1)
                .sum::<usize>()
        );
        count += 1;
    }
    assert_eq!(count, 24);
}

#[test]
fn times_and_defaults_are_those_of_the_file() {
    let text = "nodes:\n- id: 0\n  execution_time: 2.5\n  period: 10\n  offset: 1\n\
                - id: 1\n  execution_time: 1\n  end_to_end_deadline: 8\n\
                links:\n- source: 0\n  target: 1\n  communication_time: 3\n";
    let file = read(text, "x", MS).unwrap();
    assert_eq!(
        file.to_string(),
        "dag x period 10ms deadline 8ms offset 1ms\n\
         subtask 0 wcet 2500us\nsubtask 1 wcet 4ms\nedge 0 -> 1\n\nend\n"
    );
}

#[test]
fn a_refusal_names_line_offender_and_remedy() {
    let node = "nodes:\n- id: 0\n  execution_time: 1\n  period: 9\n";
    for (text, words) in [
        ("directed: true\n", "line 1: the file has no nodes"),
        (
            "directed: false\n",
            "line 1: `directed` must be true, found `false`",
        ),
        ("multigraph: true\n", "line 1: `multigraph` must be false"),
        (
            "nodes: 3\n",
            "line 1: `nodes` must be a sequence, here is a scalar",
        ),
        (
            "nods:\n- id: 0\n",
            "line 2: unknown key `nods`; a node-link document has directed",
        ),
        (
            "nodes:\n- id: 0\n",
            "line 2: node `0` has no `execution_time`",
        ),
        (
            "nodes:\n- execution_time: 1\n",
            "line 2: this node has no `id`",
        ),
        (
            "nodes:\n- id: 0\n  execution_time: -3\n",
            "line 3: execution_time: `-3` is negative",
        ),
        (
            "nodes:\n- id: 0\n  execution_time: 3\n  period: 0\n",
            "line 4: period: it is 0; give more",
        ),
        (
            "nodes:\n- id: 0\n  execution_time: 3\n  end_to_end_deadline: 0.0\n",
            "line 4: end_to_end_deadline: it is 0",
        ),
        (
            "{node}- id: 1\n  execution_time: 18446744073709\nlinks:\n- source: 0\n  target: 1\n",
            "line 2: the longest path of dag `x` is more than 64 bits of nanoseconds",
        ),
        (
            "nodes:\n- id: 0\n  execution_time: soon\n",
            "line 3: execution_time: `soon` is no time",
        ),
        (
            "nodes:\n- id: 0\n  execution_time: 99999999999999999999\n",
            "line 3: execution_time: `99999999999999999999` units of 1ms are more",
        ),
        (
            "nodes:\n- id: a b\n  execution_time: 1\n",
            "line 2: id: `a b` is no name; give a word",
        ),
        (
            "nodes:\n- id: 0\n  exec: 1\n",
            "line 3: unknown key `exec`; a node has id, execution_time",
        ),
        (
            "{node}- id: 0\n  execution_time: 1\n",
            "line 5: node `0` stands here twice, first on line 2",
        ),
        (
            "nodes:\n- id: 0\n  execution_time: 0\n",
            "line 3: execution_time: it is 0; give more",
        ),
        (
            "nodes:\n- id: '{x'\n  execution_time: 1\n",
            "line 2: id: `{x` is no name; give a word",
        ),
        (
            "{node}links:\n- source: 0\n  target: 0\nedges: []\n",
            "line 8: `links` and `edges` both list the edges; keep one",
        ),
        (
            "{node}- id: 1\n  execution_time: 1\nlinks:\n- source: 0\n  target: 1\n  \
             communication_time: 3\n- source: 0\n  target: 1\n  communication_time: 3\n",
            "line 11: the link from `0` to `1` stands here twice, first on line 8; drop one",
        ),
        (
            "{node}- id: 1\n  execution_time: 1\n  offset: 2\nlinks:\n- source: 0\n  target: 1\n",
            "line 5: node `1` has an `offset` and no `period`, and starts after",
        ),
        (
            "{node}links:\n- source: 0\n  target: 7\n",
            "line 7: target: there is no node `7`; add it",
        ),
        (
            "{node}links:\n- source: 0\n",
            "line 6: this link lacks its `source` or its `target`",
        ),
        (
            "{node}links:\n- source: 0\n  target: 0\n  firing_prob: 0.5\n",
            "line 8: `firing_prob`",
        ),
        (
            "{node}links:\n- source: 0\n  target: 0\n",
            "line 6: subtask `0` of dag `x` precedes itself",
        ),
        (
            "{node}- id: 1\n  execution_time: 1\nlinks:\n- source: 0\n  target: 1\n- source: 1\n  target: 0\n",
            "line 10: dag `x` has a cycle",
        ),
    ] {
        let message = refusal(&text.replace("{node}", node));
        assert!(message.contains(words), "{message}\n  not: {words}");
    }
}

#[test]
fn a_name_that_is_too_long_for_the_guest_is_refused_here() {
    let text = "nodes:\n- id: 0\n  execution_time: 1\n  period: 9\n- id: 1\n  execution_time: 1\n  \
                period: 7\n";
    let message = read(text, &"x".repeat(254), MS).unwrap_err()[0].to_string();
    assert!(message.starts_with("line 2: `xxx"), "{message}");
    assert!(
        message.ends_with("; rename the file or the node"),
        "{message}"
    );
}
