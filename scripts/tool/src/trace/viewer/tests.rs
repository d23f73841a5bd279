//! What is drawn of traces by hand, and of a real one.

use std::collections::BTreeMap;

use super::super::model::Run;
use super::super::tests::run_of;
use super::convert;
use crate::json::{Value, parse};

/// A diamond of DAG `a`, `s` before `l` and `r` before `j`, under `b`, on two cores.
const HEADER: &str = r#"
{"kind":"trace_begin","policy":"static","preemption":"on","cores":2,"run":0}
{"kind":"trace_dag","dag":0,"name":"a","period_ns":1000,"relative_deadline_ns":1500,"offset_ns":0,"in_flight":2,"overrun":"queue","subtasks":[["s",2,0,null],["l",2,0,null],["r",2,0,null],["j",2,0,null]],"edges":[[0,1],[0,2],[1,3],[2,3]]}
{"kind":"trace_dag","dag":1,"name":"\"b\"","period_ns":5000,"relative_deadline_ns":100,"offset_ns":150,"in_flight":1,"overrun":"queue","subtasks":[["x",1,0,null]],"edges":[]}"#;

/// In job 0, `b` preempts `r` on core 1, where `r` goes on later; job 1 begins
/// before job 0 is complete, is late, and has not ended when the trace ends.
const EVENTS: &str = "
0 released c0 0.0
1 ready c0 0.0.0
2 start c0 0.0.0
90 finish c0 0.0.0
91 ready c0 0.0.1
91 ready c0 0.0.2
92 start c0 0.0.1
93 start c1 0.0.2
150 released c0 1.0
150 ready c0 1.0.0
151 request c1 1.0.0
152 suspend c1 0.0.2
152 start c1 1.0.0
251 missed c0 1.0
300 finish c1 1.0.0
300 completed c1 1.0
300 resume c1 0.0.2
400 finish c0 0.0.1
1000 released c0 0.1
1000 ready c0 0.1.0
1001 start c0 0.1.0
1100 finish c1 0.0.2
1101 ready c1 0.0.3
1102 start c1 0.0.3
1200 finish c1 0.0.3
1200 completed c1 0.0
1300 finish c0 0.1.0
1300 ready c0 0.1.1
1300 ready c0 0.1.2
1300 start c0 0.1.1
1301 start c1 0.1.2
2501 missed c0 0.1
";

fn diamond() -> Run {
    run_of(HEADER, EVENTS)
}

/// The events of a text, each an object.
fn events(text: &str) -> Vec<Value> {
    let all = parse(text).expect("valid JSON");
    all.get("traceEvents").expect("events").elements().to_vec()
}

fn text<'v>(event: &'v Value, name: &str) -> &'v str {
    event.get(name).and_then(Value::as_text).unwrap_or_default()
}

fn number(event: &Value, name: &str) -> u64 {
    let number = event.get(name).and_then(Value::as_u64);
    number.unwrap_or_else(|| panic!("no {name} in {event:?}"))
}

fn ns(event: &Value) -> u64 {
    match event.get("ts") {
        // Three decimals of a time below 2^53 ns are exact enough to be rounded.
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "rounded, not negative"
        )]
        Some(Value::Decimal(us)) => (us * 1000.0).round() as u64,
        other => panic!("no time: {other:?}"),
    }
}

/// The names of groups and tracks, by number.
fn names(events: &[Value]) -> BTreeMap<u64, String> {
    let of = |event: &&Value| text(event, "name").ends_with("_name");
    let name = |event: &Value| {
        let name = event.at(&["args", "name"]).and_then(Value::as_text);
        (number(event, "tid"), name.expect("a name").to_string())
    };
    events.iter().filter(of).map(name).collect()
}

/// A slice: track, name, begin and end.
type Slice = (String, String, u64, u64);

/// Takes the slices apart, and fails unless those of each track nest.
fn slices(events: &[Value]) -> Vec<Slice> {
    let names = names(events);
    let mut open: BTreeMap<u64, Vec<(String, u64)>> = BTreeMap::new();
    let mut latest: BTreeMap<u64, u64> = BTreeMap::new();
    let mut slices = Vec::new();
    for event in events.iter().filter(|event| text(event, "ph") != "M") {
        let (track, at_ns) = (number(event, "tid"), ns(event));
        let before = latest.insert(track, at_ns).unwrap_or(0);
        assert!(before <= at_ns, "a track goes on in the order of time");
        let open = open.entry(track).or_default();
        match text(event, "ph") {
            "B" => open.push((text(event, "name").into(), at_ns)),
            "E" => {
                let (name, begin_ns) = open.pop().expect("a slice that was begun");
                slices.push((names[&track].clone(), name, begin_ns, at_ns));
            }
            "s" | "f" => assert!(!open.is_empty(), "a flow has a slice at each end"),
            "i" => {}
            other => panic!("a phase `{other}`"),
        }
    }
    assert!(open.values().all(Vec::is_empty), "each slice is ended");
    slices
}

/// Returns the flows as pairs of times, and fails unless each has both ends.
fn flows(events: &[Value]) -> Vec<(u64, u64)> {
    let ends = |phase: &str| {
        let ends: Vec<(u64, u64)> = events
            .iter()
            .filter(|event| text(event, "ph") == phase)
            .map(|event| (number(event, "id"), ns(event)))
            .collect();
        let count = ends.len();
        let ends: BTreeMap<u64, u64> = ends.into_iter().collect();
        assert_eq!(ends.len(), count, "no two flows have one number");
        ends
    };
    let (starts, finishes) = (ends("s"), ends("f"));
    assert!(starts.keys().eq(finishes.keys()));
    starts.into_values().zip(finishes.into_values()).collect()
}

fn instants<'e>(events: &'e [Value], track: &str) -> Vec<(u64, &'e str)> {
    let names = names(events);
    let of = |event: &&Value| text(event, "ph") == "i" && names[&number(event, "tid")] == track;
    let all = events.iter().filter(of);
    all.map(|event| (ns(event), text(event, "name"))).collect()
}

fn slice(track: &str, name: &str, begin_ns: u64, end_ns: u64) -> Slice {
    (track.into(), name.into(), begin_ns, end_ns)
}

#[test]
fn a_core_shows_each_piece_of_execution() {
    let events = events(&convert(&[diamond()], 10));
    let slices = slices(&events);
    let of_core_1: Vec<_> = slices.iter().filter(|slice| slice.0 == "core 1").collect();
    let expected = [
        slice("core 1", "a/r #0", 93, 152),
        slice("core 1", "\"b\"/x #0", 152, 300),
        slice("core 1", "a/r #0", 300, 1100),
        slice("core 1", "a/j #0", 1102, 1200),
        slice("core 1", "a/r #1", 1301, 2501),
    ];
    assert!(of_core_1.into_iter().eq(&expected), "{slices:#?}");
    assert_eq!(
        instants(&events, "core 1"),
        [(151, "preempt for \"b\"/x #0"), (152, "preempted a/r #0")]
    );
    let begins_and_ends: Vec<_> = events
        .iter()
        .filter(|event| text(event, "name") == "a/r #0" && text(event, "ph") == "B")
        .map(|event| ["begins", "ends"].map(|name| text(event.get("args").expect("args"), name)))
        .collect();
    assert_eq!(
        begins_and_ends,
        [["start", "suspend"], ["resume", "finish"]]
    );
}

#[test]
fn a_dag_shows_its_jobs_its_subtasks_and_what_was_missed() {
    let events = events(&convert(&[diamond()], 10));
    let slices = slices(&events);
    for expected in [
        // Two jobs overlap, so they lie on two lanes.
        slice("jobs, lane 1", "job #0", 0, 1200),
        slice("jobs, lane 2", "job #1, missed", 1000, 2501),
        slice("jobs, lane 1", "job #0, missed", 150, 300),
        slice("r", "#0", 91, 1100),
        slice("r", "on core 1", 93, 152),
        slice("r", "on core 1", 300, 1100),
    ] {
        assert!(slices.contains(&expected), "{expected:?} in {slices:#?}");
    }
    let moments = instants(&events, "releases, deadlines");
    let expected = [
        (0, "release #0"),
        (1000, "release #1"),
        (1500, "deadline #0"),
        (2500, "deadline #1"),
        (2501, "MISS #1"),
        (150, "release #0"),
        (250, "deadline #0"),
        (251, "MISS #0"),
    ];
    assert_eq!(moments, expected);
    assert_eq!(
        instants(&events, "j"),
        [(1101, "ready #0")],
        "a ready instant"
    );
}

#[test]
fn an_arrow_leads_along_each_edge_whose_ends_ran() {
    let events = events(&convert(&[diamond()], 10));
    let mut flows = flows(&events);
    flows.sort_unstable();
    let one = [
        (90, 92),
        (90, 93),
        (400, 1102),
        (1100, 1102),
        (1300, 1300),
        (1300, 1301),
    ];
    let both: Vec<_> = one.into_iter().flat_map(|arrow| [arrow, arrow]).collect();
    assert_eq!(flows, both);
}

#[test]
fn an_arrow_leads_from_a_value_to_each_instance_that_samples_it() {
    // `b/x` samples what `a/s` writes.
    let graph = r#"
{"kind":"graph","commit":0,"policy":"edf","preemption":"on","cores":2,"overhead_ns":[],"period_ns":1,"relative_deadline_ns":1,"offset_ns":0,"in_flight":1,"overrun":"queue","subtasks":[],"edges":[],"hash":1,"sporadic":false,"jobs":[],"states":[],"dag":0,"name":"a","bound_ns":[],"topics":[["t","u8",0,[1,2],1]],"samples":[]}
{"kind":"graph","commit":0,"policy":"edf","preemption":"on","cores":2,"overhead_ns":[],"period_ns":1,"relative_deadline_ns":1,"offset_ns":0,"in_flight":1,"overrun":"queue","subtasks":[],"edges":[],"hash":1,"sporadic":false,"jobs":[],"states":[],"dag":1,"name":"\"b\"","bound_ns":[9],"topics":[],"samples":[[0,0,0,null]]}"#;
    let events = events(&convert(&[run_of(&format!("{graph}{HEADER}"), EVENTS)], 10));
    assert_eq!(flows(&events).len(), 14);
    let of_samples = |event: &&Value| text(event, "name") == "sampled by";
    let ends = events.iter().filter(of_samples);
    let ends: Vec<_> = ends.map(|event| (text(event, "ph"), ns(event))).collect();
    let once = [("s", 90), ("f", 152)];
    assert_eq!(ends, [once, once].concat());
}

#[test]
fn breaches_are_shown_where_they_are() {
    let group = |text: &str| {
        names(&events(text))
            .into_values()
            .any(|name| name == "breaches")
    };
    assert!(!group(&convert(&[diamond()], 10)));
    // At a bound of 0, taking a core for `b` took too long.
    let text = convert(&[diamond()], 0);
    assert!(group(&text));
    assert!(!instants(&events(&text), "rules").is_empty());
}

#[test]
fn runs_stand_side_by_side_and_share_no_number() {
    let events = events(&convert(&[diamond(), diamond()], 10));
    slices(&events);
    assert_eq!(flows(&events).len(), 24);
    let names = names(&events);
    assert_eq!(
        names.values().filter(|name| *name == "run 0 cores").count(),
        2
    );
}
