//! Published graphs are read, and broken ones refused. `tests/it/dag_files.rs` has more of these,
//! as a person sees them.

use super::{read, read_graphs};
use crate::system::workspace;
use crate::tests::rows;

fn set() -> String {
    std::fs::read_to_string(workspace().join("apps/dag-file/examples/stg50.json")).unwrap()
}

fn refusal(text: &str, graph: Option<&str>, unit_ns: u64) -> String {
    read(text, graph, unit_ns).unwrap_err().to_string()
}

#[test]
fn the_published_graphs_are_read() {
    let graphs = read_graphs(&set()).unwrap();
    let first = &graphs[0];
    let described = (graphs.len(), &*first.name, first.costs.len());
    assert_eq!(described, (45, "50/rand0000", 52));
    assert!(graphs[1].line > first.line);
    let all = read(&set(), None, 1000).unwrap();
    assert_eq!((all.sets.len(), all.most_subtasks()), (45, 50));
    let one = read(&set(), Some("50/rand0004"), 1000).unwrap();
    assert_eq!(one.sets[0].dags[0].spec.period_ns, Some(232_000));
    let message = refusal(&set(), Some("50/rand0001"), 1);
    let words = "there is no graph `50/rand0001`; name one of the 45";
    assert!(message.contains(words), "{message}");
    let message = refusal(&set()[..5000], None, 1);
    let is_elsewhere = !message.starts_with("line 1:");
    assert!(is_elsewhere && message.contains("this is no JSON"));
}

/// The content of the list of graphs, and the refusal.
const REFUSED: &str = r#" | the file has no `graphs`
{"name":"a","c":[-1]} | a cost is no whole number from 0 on
\n{"name":"a","c":[1],"edges":[[0,1]]} | line 2: graph `a`: an edge must be two vertices from 0 to 0
{"name":"a","c":[1],"edges":[[0]]} | an edge must be two vertices
{"name":"a","cost":[1]} | unknown key `cost`
{"name":"a","c":[18446744073709551615,1]} | choose a shorter unit
{"name":"b","c":[1]},\n\n{"name":"a","c":[0]} | line 3: graph `a` has no cost above 0
{"name":"b","c":[1]},\n{"c":[1]} | line 2: graph 1 of the list has no `name`; give it a word
{"name":"b","c":[1]},\n5 | line 2: graph 1 of the list is no object
{"name":"{a","c":[1]} | `{a` is no name; give a word
{"name":"a","c":[1,2],"edges":5} | graph `a`: `edges` is no list
{"name":"a","c":[1,2],"edges":[[0,1],[0,1]]} | graph `a`: edge [0,1] stands twice; drop one
{"name":"a","c":[3,0],"edges":[[1,1]]} | graph `a`: vertex 1 has cost 0 and stands between others"#;

#[test]
fn a_refusal_names_line_offender_and_remedy() {
    for [graphs, words] in rows(REFUSED) {
        let text = format!("{{\"graphs\":[{graphs}]}}");
        let message = refusal(&text, None, 1);
        assert!(message.contains(&words), "{message}\n  not: {words}");
    }
    assert!(refusal("", None, 1).contains("this is no JSON"));
    // A sum that exceeds 64 bits, and whose product with the unit exceeds 128.
    let costs = ["9223372036854775808"; 32].join(",");
    let text = format!("{{\"graphs\":[{{\"name\":\"a\",\"c\":[{costs}]}}]}}");
    assert!(refusal(&text, None, 1 << 60).contains("choose a shorter unit"));
}

#[test]
fn very_many_graphs_are_read() {
    // Looking for each graph's line from the beginning would take long.
    let graphs = (0..20_000).map(|n| format!("{{\"name\":\"g{n}\",\"c\":[1]}}"));
    let graphs: Vec<String> = graphs.collect();
    let graphs = read_graphs(&format!("{{\"graphs\":[{}]}}", graphs.join(",\n"))).unwrap();
    assert_eq!((graphs.len(), graphs[19_999].line), (20_000, 20_000));
}
