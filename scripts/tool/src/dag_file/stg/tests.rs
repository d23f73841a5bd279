//! Published graphs are read, and broken ones refused.

use super::{read, read_graphs};
use crate::system::workspace;

fn set() -> String {
    std::fs::read_to_string(workspace().join("apps/dag-file/examples/stg50.json")).unwrap()
}

#[test]
fn the_published_graphs_are_read() {
    let graphs = read_graphs(&set()).unwrap();
    assert_eq!(graphs.len(), 45);
    assert_eq!(
        (graphs[0].name.as_str(), graphs[0].costs.len()),
        ("50/rand0000", 52)
    );
    assert!(graphs[1].line > graphs[0].line);
    let all = read(&set(), None, 1000).unwrap();
    assert_eq!((all.sets.len(), all.most_subtasks()), (45, 50));
    let one = read(&set(), Some("50/rand0004"), 1000).unwrap();
    assert_eq!(one.sets[0].dags[0].spec.period_ns, Some(232_000));
}

#[test]
fn a_refusal_names_line_offender_and_remedy() {
    let message = read(&set(), Some("50/rand0001"), 1)
        .unwrap_err()
        .to_string();
    assert!(
        message.contains("there is no graph `50/rand0001`; name one of the 45"),
        "{message}"
    );
    let cut = &set()[..5000];
    let message = read(cut, None, 1).unwrap_err().to_string();
    assert!(
        message.contains("this is no JSON") && !message.starts_with("line 1:"),
        "{message}"
    );
    for (text, words) in [
        ("{}", "the file has no `graphs`"),
        ("", "this is no JSON"),
        (
            r#"{"graphs":[{"name":"a","c":[-1]}]}"#,
            "a cost is no whole number from 0 on",
        ),
        (
            r#"{"graphs":[{"name":"a","c":[0]}]}"#,
            "graph `a` has no cost above 0",
        ),
        (
            "{\"graphs\":[\n{\"name\":\"a\",\"c\":[1],\"edges\":[[0,1]]}]}",
            "line 2: graph `a`: an edge must be two vertices from 0 to 0",
        ),
        (
            r#"{"graphs":[{"name":"a","c":[1],"edges":[[0]]}]}"#,
            "an edge must be two vertices",
        ),
        (
            r#"{"graphs":[{"name":"a","cost":[1]}]}"#,
            "unknown key `cost`",
        ),
        (
            r#"{"graphs":[{"name":"a","c":[18446744073709551615,1]}]}"#,
            "choose a shorter unit",
        ),
        (
            r#"{"apps":[],"comments":[]}"#,
            "the file has no `graphs`; of JSON a task graph set is read, {\"graphs\":[",
        ),
        (
            "{\"c\":\"a\",\n\"graphs\":[{\"name\":\"b\",\"c\":[1]},\n\n{\"name\":\"a\",\"c\":[0]}]}",
            "line 4: graph `a` has no cost above 0",
        ),
        (
            "{\"graphs\":[{\"name\":\"b\",\"c\":[1]},\n{\"c\":[1]}]}",
            "line 2: graph 1 of the list has no `name`; give it a word",
        ),
        (
            "{\"graphs\":[{\"name\":\"b\",\"c\":[1]},\n5]}",
            "line 2: graph 1 of the list is no object but a value of type integer",
        ),
        (
            "{\"graphs\":[{\"name\":\"b\",\"c\":[1]},\n{\"name\":\"b\",\"c\":[1]}]}",
            "line 2: graph `b` stands here twice, first on line 1; rename one",
        ),
        (
            r#"{"graphs":[{"name":"{a","c":[1]}]}"#,
            "`{a` is no name; give a word",
        ),
        (
            r#"{"graphs":[{"name":"a","c":[1,2],"edges":5}]}"#,
            "graph `a`: `edges` is no list but a value of type integer",
        ),
        (
            r#"{"graphs":[{"name":"a","c":[1,2],"edges":null}]}"#,
            "graph `a`: `edges` is no list but a value of type null",
        ),
        (
            r#"{"graphs":[{"name":"a","c":[1,2],"edges":{}}]}"#,
            "graph `a`: `edges` is no list but a value of type object",
        ),
        (
            r#"{"graphs":[{"name":"a","c":[1,2],"edges":[[0,1],[0,1]]}]}"#,
            "graph `a`: edge [0,1] stands twice; drop one",
        ),
        (
            r#"{"graphs":[{"name":"a","c":[3,0,4],"edges":[[0,1],[1,2]]}]}"#,
            "graph `a`: vertex 1 has cost 0 and stands between others",
        ),
        (
            r#"{"graphs":[{"name":"a","c":[3,0],"edges":[[1,1]]}]}"#,
            "graph `a`: vertex 1 has cost 0 and stands between others",
        ),
    ] {
        let message = read(text, None, 1).unwrap_err().to_string();
        assert!(message.contains(words), "{message}\n  not: {words}");
    }
}

#[test]
fn costs_beyond_any_number_do_not_wrap() {
    let costs = vec!["9223372036854775808"; 32].join(",");
    let text = format!("{{\"graphs\":[{{\"name\":\"a\",\"c\":[{costs}]}}]}}");
    let message = read(&text, None, 1 << 60).unwrap_err().to_string();
    assert!(message.contains("choose a shorter unit"), "{message}");
}

#[test]
fn very_many_graphs_are_read_and_very_many_vertices_refused() {
    // Looking for each graph's line from the beginning would take long.
    let graphs: Vec<String> = (0..20_000)
        .map(|n| format!("{{\"name\":\"g{n}\",\"c\":[1]}}"))
        .collect();
    let graphs = read_graphs(&format!("{{\"graphs\":[{}]}}", graphs.join(",\n"))).unwrap();
    assert_eq!((graphs.len(), graphs[19_999].line), (20_000, 20_000));
    let costs = vec!["1"; 100_001].join(",");
    let text = format!("{{\"graphs\":[{{\"name\":\"a\",\"c\":[{costs}]}}]}}");
    let message = read(&text, None, 1).unwrap_err().to_string();
    assert!(
        message.ends_with("100001 vertices, and 100000 at most are read"),
        "{message}"
    );
}
