//! Texts that the YAML reader accepts or refuses.

use super::{Node, YamlValue, parse};
use crate::tests::rows;

/// Writes a value on one line, for comparing.
fn flat(node: &Node) -> String {
    match &node.value {
        YamlValue::Scalar(text) => format!("`{text}`"),
        YamlValue::Sequence(items) => {
            let items: Vec<String> = items.iter().map(flat).collect();
            format!("[{}]", items.join(","))
        }
        YamlValue::Mapping(members) => {
            let members = members.iter();
            let members = members.map(|(key, node)| format!("{key}={}", flat(node)));
            format!("{{{}}}", members.collect::<Vec<_>>().join(","))
        }
    }
}

fn read(text: &str) -> String {
    parse(text).map(|node| flat(&node)).unwrap()
}

#[test]
fn what_a_generator_writes_is_read() {
    let text = "\
# a graph
directed: true
graph: {}
links:
- source: 0
  target: 1   # an edge
-   source: 1
    target: 2
nodes:
  - id: \"0\"
    'quoted key': 'it''s'
  - id: 1
empty:
";
    let text = text.replace("'it''s'", "'a: b # c'");
    assert_eq!(
        read(&text),
        "{directed=`true`,graph={},links=[{source=`0`,target=`1`},{source=`1`,target=`2`}],\
         nodes=[{id=`0`,quoted key=`a: b # c`},{id=`1`}],empty=``}"
    );
    assert_eq!(read("---\na: 1\n...\n"), "{a=`1`}");
    let expected = "[`1`,[`2`,`3`],{a=`b`}]";
    assert_eq!(read("- 1\n- - 2\n  - 3\n-\n  a: b\n"), expected);
    assert_eq!(read("a: it's # no\nb: c#d"), "{a=`it's`,b=`c#d`}");
}

/// Texts that are refused, and the reasons.
const REFUSED: &str = r#"# nothing\n | line 1: the file is empty
a: 1\na: 2\n | line 2: key `a` stands here twice
a: 1\n  b: 2\n | line 2: this line's indentation fits nothing above
a: 1\n\tb: 2\n | line 2: a tab indents this line
a: &x 1\n | line 1: `&x 1`: only plain scalars
a: {b: 1}\n | line 1: `{b: 1}`: only plain scalars
a: |\n  text\n | line 1: `|`: only plain scalars
a: 'open\n | line 1: `'open`: its quote does not close
a: "x\\"\n | escapes are not read
a: 1\nnothing\n | line 2: `nothing` is no `key: value`
a: 1\n---\nb: 2\n | line 2: a second document begins here"#;

#[test]
fn lines_are_known_and_what_is_not_read_is_refused_with_its_own() {
    let YamlValue::Mapping(members) = parse("a: 1\n\n# c\nb:\n- 2\n").unwrap().value else {
        panic!("it is a mapping");
    };
    assert_eq!((members[0].1.line, members[1].1.line), (1, 5));
    for [text, words] in rows(REFUSED) {
        let message = parse(&text.replace(r"\t", "\t")).unwrap_err().to_string();
        assert!(message.contains(&words), "{message}\n  not: {words}");
    }
}

#[test]
fn very_many_keys_and_very_deep_dashes_are_read_quickly() {
    // Comparing each key with each, or copying the line at each dash, would take long.
    let keys: String = (0..100_000).map(|n| format!("k{n}: 0\n")).collect();
    let YamlValue::Mapping(members) = parse(&keys).unwrap().value else {
        panic!("it is a mapping");
    };
    assert_eq!(members.len(), 100_000);
    let fault = parse(&"- ".repeat(1_000_000)).unwrap_err();
    assert!(fault.reason.contains("levels deep"), "{fault}");
}
