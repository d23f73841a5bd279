//! Files that are read, and files that are refused, with the words.

use super::parse;

fn refusal(text: &str) -> String {
    parse(text).unwrap_err().to_string()
}

const GOOD: &str = "\
# Two sets.
set first
dag camera period 25ms deadline 100ms offset 1ms affinity 2,0 overrun skip in-flight 4 jobs 7 # all keys
subtask grab wcet 3ms priority 5 non-preemptive samples 1ms,2ms
subtask show wcet 500us priority 6 deadline 30ms
edge grab -> show
core 1: camera.grab  camera.show#0 # a list of a core

set second
dag alone period 1s
subtask only wcet 1ns wait 0ns wcet 2ms wait 3ms wcet 1us priority 1 # two waits
subtask rest wait 2ms wait 1ms priority 2 samples 1ms+2ms+3ms+0ns+1ms,5us+6us+7us+8us+9us
end
";

#[test]
fn a_file_is_read_and_written_back() {
    let file = parse(GOOD).unwrap();
    assert_eq!(file.sets.len(), 2);
    let camera = &file.sets[0].dags[0];
    assert_eq!(
        (camera.line, camera.subtasks[1].line, camera.edge_lines[0]),
        (3, 5, 6)
    );
    assert_eq!(&*camera.subtasks[0].samples_ns, [1_000_000, 2_000_000]);
    assert_eq!(camera.spec.relative_deadline_ns, Some(100_000_000));
    assert_eq!(
        (camera.spec.in_flight, camera.spec.jobs),
        (Some(4), Some(7))
    );
    assert_eq!(camera.spec.affinity, [2, 0]);
    let list = "core 1: camera.grab camera.show#0";
    assert_eq!(file.sets[0].lists, [(7, list.into())]);
    let show = &camera.spec.subtasks[1];
    assert_eq!(show.relative_deadline_ns, Some(30_000_000));
    // Without a deadline it is the period.
    let alone = &file.sets[1].dags[0];
    assert_eq!(alone.spec.relative_deadline_ns, Some(1_000_000_000));

    let waits = alone.spec.subtasks[0].waits.iter();
    let waits: Vec<_> = waits.map(|wait| (wait.limit_ns, wait.segment_ns)).collect();
    assert_eq!(waits, [(0, Some(2_000_000)), (3_000_000, Some(1_000))]);
    // The WCET is that of all segments.
    assert_eq!(alone.spec.subtasks[0].wcet_ns, Some(2_001_001));
    // Without a WCET the longest sample counts.
    assert_eq!(
        (alone.spec.subtasks[1].wcet_ns, alone.most_ns(1)),
        (None, 5_000_000)
    );

    let written = file.to_string();
    assert_eq!(parse(&written).unwrap().to_string(), written);
    let kept = "dag camera period 25ms deadline 100ms offset 1ms affinity 2,0 overrun skip in-flight 4 jobs 7\n\
                subtask grab wcet 3ms priority 5 non-preemptive samples 1ms,2ms\n";
    assert!(written.contains(kept), "{written}");
    let rest = "subtask rest wait 2ms wait 1ms priority 2 samples 1ms+2ms+3ms+0ns+1ms,5us+6us+7us+8us+9us\n";
    assert!(written.contains(rest), "{written}");
    let waits = "subtask only wcet 1ns wait 0ns wcet 2ms wait 3ms wcet 1us priority 1\n";
    assert!(written.contains(waits), "{written}");
}

#[test]
fn every_part_of_a_file_that_is_cut_off_is_refused() {
    for length in 0..GOOD.len() - "end\n".len() {
        let message = refusal(&GOOD[..length]);
        assert!(message.starts_with("line "), "{length}: {message}");
    }
}

/// A file that is refused, and the words of the refusal. `{dag}` is a line, `dag x` of
/// 1 ms, and `{a}` the line of its subtask `a`.
const REFUSED: &str = r"
=> line 1: the file ends where a `dag` record should be; it is empty: describe a DAG, or name
end => line 1: the file has no dag; add one before `end`
{dag}{a}subtask b core 2 => line 3: `core` is no more; state `core 2: dag.a dag.b` after the DAGs, or of
dag x period 1ms order fixed => line 1: `order` is no more; state
core 2: x.a => line 1: `core` stands before any
dig x => line 1: expected `set`, `dag`, `subtask`, `edge`, `core`, `certificate`, `state` or `end`, found `dig`; correct it, or write a file of another
dag x => line 1: dag `x` has no period; add `period 25ms`
dag => line 1: `dag` lacks its name
dag x perod 1ms => line 1: unknown key `perod`; a dag has `period`, `deadline`,
dag x period => line 1: `period` lacks its value
dag x period 1ms period 2ms => line 1: `period` stands here twice; give it once
dag x period -1ms => line 1: period: `-1ms` is negative; give a time from 0 on
dag x period 99999999999s => line 1: period: `99999999999s` is more than 64 bits
dag x period 1ms overrun wait => overrun: `wait` is none of queue, skip and abort
dag x period 1ms affinity 0,,2 => line 1: affinity: `` is no whole number from 0 to 4294967295
dag x period 1ms affinity => line 1: `affinity` lacks its value
dag x period 1ms in-flight 4294967296 => in-flight: `4294967296` is no whole number
\nsubtask a wcet 1ms => line 2: `subtask` stands before any `dag`; begin with
{dag}subtask a => line 2: subtask `a` has no wcet; add `wcet 3ms`
{dag}subtask a wcet 1ms nice 3 => line 2: unknown key `nice`; a subtask has `wcet`,
{dag}subtask a wcet 1ms samples 1us,2ms => line 2: the sample `2ms` is longer than the wcet 1ms
{dag}subtask a wcet 1ms wait 1ms wcet 1ms samples 1ms => line 2: the sample `1ms` is not of 3 times
{dag}subtask a wait 1ms => line 2: subtask `a` has no wcet
{dag}subtask a wcet 0ns => line 2: wcet: it is 0, and
{dag}subtask a wcet 1ms wait 3ms => line 2: no segment follows `wait 3ms`; add one, as in `wait 3ms wcet 1ms`
{dag}subtask a wcet 1ms wait 3ms priority 1 wcet 1ms => line 2: no segment follows `wait 3ms`
{dag}subtask a wait 3ms wcet 1ms => line 2: `wait` stands between two segments, as in
{dag}subtask a wcet 1ms wait => line 2: `wait` lacks its value
{dag}subtask a wcet 1ms wait -1ms wcet 1ms => line 2: wait: `-1ms` is negative
{dag}subtask a wcet 1ms wait 3ms wcet 0ms => line 2: wcet: it is 0, and
{dag}subtask a wcet 1ms wait 3ms wcet 1ms wcet 1ms => line 2: `wcet` stands here twice
{dag}subtask a wcet 10000000000s wait 0s wcet 10000000000s => line 2: wcet: the segments together are more than
{dag}dag y period 1ms => line 2: dag `x` of line 1 ends here without a subtask
{dag}{a}{a} => line 3: subtask `a` stands here twice, first on line 2
{dag}{a}edge a -> b => line 3: no subtask `b` stands before this line
{dag}{a}edge a b => line 3: expected `edge A -> B`
{dag}{a}{dag} => line 3: dag `x` stands here twice, first on line 1
{dag}{a}subtask b wcet 1ms\nedge a -> b\nedge b -> a\nedge a -> b\nend => line 6: the edge from `a` to `b` \
stands here twice, first on line 4; drop one
set a\n{dag}{a}set a => line 4: set `a` stands here twice, first on line 1; rename one
set a\nset b => line 2: set `a` ends here without a DAG
dag {x period 1ms => line 1: `{x` is no name; give a word
set {x => line 1: `{x` is no name; give a word
{dag}{a}end\n\nx => line 5: `x` stands after `end`
{dag}{a} => line 3: the file ends where `end` should be; a part of it is missing";

#[test]
fn a_refusal_names_line_offender_and_remedy() {
    let rows = REFUSED.replace(" \\\n", " ");
    for row in rows.lines().skip(1) {
        let (text, words) = row.split_once("=> ").expect(row);
        let text = text.trim_end().replace(r"\n", "\n");
        let text = text.replace("{dag}", "dag x period 1ms\n");
        let message = refusal(&text.replace("{a}", "subtask a wcet 1ms\n"));
        assert!(message.contains(words), "{message}\n  not: {words}");
    }
    // What a terminal would act on is written in letters.
    let right_to_left = refusal("dag x\u{202e}y period 1ms");
    assert!(right_to_left.contains("line 1: `x\\u{202e}y` is no name"));
    assert!(refusal("\u{1b}[2J").contains("found `\\u{1b}[2J`"));
}

#[test]
fn the_example_of_the_documentation_is_read() {
    let page = include_str!("../../../../docs/dag-file.md");
    let example = page
        .split("```text\n")
        .nth(1)
        .and_then(|rest| rest.split("```").next());
    let file = parse(example.unwrap()).unwrap();
    let names = file.sets[0].dags.iter().map(|dag| dag.spec.name.as_str());
    assert_eq!(names.collect::<Vec<_>>(), ["camera", "control"]);
}

#[test]
fn a_name_has_an_end() {
    let text = |length: usize| {
        format!(
            "dag {} period 1ms\nsubtask a wcet 1us\nend",
            "x".repeat(length)
        )
    };
    assert!(parse(&text(255)).is_ok());
    let message = refusal(&text(1_000_000));
    assert!(
        message.contains("of at most 255 bytes") && message.len() < 200,
        "{message}"
    );
}

#[test]
fn very_many_dags_and_sets_are_read() {
    // Comparing each name with each would take long.
    let dag = |n: u32| format!("dag d{n} period 1ms\nsubtask a wcet 1us\n");
    let dags: String = (0..30_000).map(dag).collect();
    assert_eq!(
        parse(&format!("{dags}end")).unwrap().sets[0].dags.len(),
        30_000
    );
    let sets: String = (0..30_000)
        .map(|n| format!("set s{n}\n{}", dag(0)))
        .collect();
    assert_eq!(parse(&format!("{sets}end")).unwrap().sets.len(), 30_000);
}
