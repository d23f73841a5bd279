//! Drawings of handmade traces, and of a real one.

use super::super::picture;
use super::super::tests::run_of;
use super::*;
use crate::json::{Value, parse};
use sched_dag::chains::SampledEdge;

/// A diamond of DAG `a`, `s` before `l` and `r` before `j`, under `b`, on two cores.
const HEADER: &str = "
static 2
a T=1000 D=1500 O=0 flight=2: s/2 l/2 r/2 j/2; 0>1 0>2 1>3 2>3
\"b\" T=5000 D=100 O=150: x/1";

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

fn text<'v>(event: &'v Value, name: &str) -> &'v str {
    event.get(name).and_then(Value::as_text).unwrap_or_default()
}

/// A track that is read.
#[derive(Default)]
struct Track<'v> {
    name: &'v str,
    latest_ns: f64,
    /// The slices that are open.
    open: Vec<(&'v Value, f64)>,
}

/// Draws runs, and returns the drawing as lines: a group is `group: NAME`, a slice is `TRACK: NAME
/// FROM..TO`, on a core also how it begins and ends; an instant is `TRACK: NAME AT`, an arrow
/// `NAME: FROM > TO`. Fails unless each track goes on in the order of time, its slices nest, and
/// each arrow has one end in a slice and one in another.
fn drawn(runs: &[Run], bound_ns: u64) -> Vec<String> {
    let all = parse(&convert(runs, bound_ns)).expect("valid JSON");
    let (mut lines, mut ends) = (Vec::new(), BTreeMap::<u64, Vec<_>>::new());
    let mut tracks = BTreeMap::<u64, Track<'_>>::new();
    for event in all.get("traceEvents").expect("events").elements() {
        let number = |name| event.get(name).and_then(Value::as_u64).expect(name);
        let track = tracks.entry(number("tid")).or_default();
        let name = text(event, "name");
        match (text(event, "ph"), name) {
            ("M", "thread_name") => track.name = text(event.get("args").expect("args"), "name"),
            ("M", "process_name") => {
                let name = text(event.get("args").expect("args"), "name");
                lines.push(format!("group: {name}"));
            }
            ("M", _) => {}
            (phase, _) => {
                let Some(Value::Decimal(us)) = event.get("ts") else {
                    panic!("no time: {event:?}");
                };
                let at_ns = (us * 1000.0).round();
                assert!(track.latest_ns <= at_ns, "in the order of time");
                track.latest_ns = at_ns;
                match phase {
                    "B" => track.open.push((event, at_ns)),
                    "E" => {
                        let (begun, from_ns) = track.open.pop().expect("a slice that was begun");
                        let how = |name| begun.at(&["args", name]).and_then(Value::as_text);
                        let how = how("begins").zip(how("ends"));
                        let how = how.map(|(begins, ends)| format!(", {begins} to {ends}"));
                        let (name, how) = (text(begun, "name"), how.unwrap_or_default());
                        lines.push(format!("{}: {name} {from_ns}..{at_ns}{how}", track.name));
                    }
                    "i" => lines.push(format!("{}: {name} {at_ns}", track.name)),
                    "s" | "f" => {
                        assert!(!track.open.is_empty(), "a flow has a slice at each end");
                        let ends = ends.entry(number("id")).or_default();
                        ends.push((phase, at_ns.to_string(), name));
                    }
                    other => panic!("a phase `{other}`"),
                }
            }
        }
    }
    let is_ended = |track: &Track<'_>| track.open.is_empty();
    assert!(tracks.values().all(is_ended), "each slice is ended");
    for mut ends in ends.into_values() {
        ends.sort_unstable();
        let [("f", to_ns, name), ("s", from_ns, _)] = &ends[..] else {
            panic!("an arrow has two ends: {ends:?}");
        };
        lines.push(format!("{name}: {from_ns} > {to_ns}"));
    }
    lines
}

/// Draws a run, and asserts which lines of the drawing begin with a text, in any order.
fn assert_drawn(run: &Run, begin: &str, expected: &str) {
    let lines = drawn(std::slice::from_ref(run), 10);
    let found = lines.iter().filter_map(|line| line.strip_prefix(begin));
    let mut found: Vec<&str> = found.collect();
    let mut expected: Vec<&str> = expected.lines().map(str::trim).skip(1).collect();
    found.sort_unstable();
    expected.sort_unstable();
    assert_eq!(found, expected, "{begin}: {lines:#?}");
}

#[test]
fn a_core_shows_each_piece_of_execution() {
    let pieces = "
        a/r #0 93..152, start to suspend
        preempt for \"b\"/x #0 151
        preempted a/r #0 152
        \"b\"/x #0 152..300, start to finish
        a/r #0 300..1100, resume to finish
        a/j #0 1102..1200, start to finish
        a/r #1 1301..2501, start to after the trace";
    assert_drawn(&diamond(), "core 1: ", pieces);
}

#[test]
fn a_dag_shows_its_jobs_its_subtasks_and_what_was_missed() {
    // Two jobs overlap, so they lie on two lanes.
    let jobs = "
        1: job #0 0..1200
        2: job #1, missed 1000..2501
        1: job #0, missed 150..300";
    assert_drawn(&diamond(), "jobs, lane ", jobs);
    let r = "
        #0 91..1100
        on core 1 93..152
        on core 1 300..1100
        #1 1300..2501
        on core 1 1301..2501
        ready #0 91
        ready #1 1300";
    assert_drawn(&diamond(), "r: ", r);
    let moments = "
        release #0 0
        release #1 1000
        deadline #0 1500
        deadline #1 2500
        MISS #1 2501
        release #0 150
        deadline #0 250
        MISS #0 251";
    assert_drawn(&diamond(), "releases, deadlines: ", moments);
}

#[test]
fn a_wait_ends_a_piece_and_is_shown_in_its_subtask() {
    let waits = "
0 released c0 0.0
1 ready c0 0.0.0
2 start c0 0.0.0
40 wait c0 0.0.0
60 wake c1 0.0.0
61 resume c1 0.0.0
70 wait c1 0.0.0
90 cancelled c0 0.0.0
1000 ready c0 0.1.0
1001 start c0 0.1.0
1010 wait c0 0.1.0
1100 missed c0 0.0";
    let run = run_of(HEADER, waits);
    let on_core = "
        a/s #0 2..40, start to wait
        a/s #1 1001..1010, start to wait";
    assert_drawn(&run, "core 0: ", on_core);
    assert_drawn(&run, "core 1: ", "\na/s #0 61..70, resume to wait");
    let of_subtask = "
        ready #0 1
        #0 1..90
        on core 0 2..40
        waits 40..60
        on core 1 61..70
        waits 70..90
        ready #1 1000
        #1 1000..1100
        on core 0 1001..1010
        waits 1010..1100";
    assert_drawn(&run, "s: ", of_subtask);

    let stated = format!("{HEADER}\nwait 0.0 30\nwait 0.0 20");
    let svg = picture::draw(&run_of(&stated, waits), 0..1000).expect("it has a job");
    assert_eq!(svg.matches(">waits 50 ns<").count(), 1, "{svg}");
    // Job 1 has no release.
    assert_eq!(svg.matches(" height=\"4\"").count(), 2, "{svg}");
}

/// Each is drawn twice: between cores, and between the DAGs' own tracks.
#[test]
fn an_arrow_leads_along_each_edge_whose_ends_ran() {
    let edges = "
        90 > 92
        90 > 93
        400 > 1102
        1100 > 1102
        1300 > 1300
        1300 > 1301";
    assert_drawn(&diamond(), "precedes: ", &edges.repeat(2));
}

#[test]
fn an_arrow_leads_from_a_value_to_each_instance_that_samples_it() {
    // `b/x` samples the topic of `a/s`.
    let sampling = SampledEdge {
        writer: (DagId(0), SubtaskId(0)),
        reader: (DagId(1), SubtaskId(0)),
    };
    let run = Run {
        samplings: vec![sampling],
        ..diamond()
    };
    assert_drawn(&run, "sampled by: ", &"\n90 > 152".repeat(2));
}

#[test]
fn breaches_are_shown_where_they_are() {
    let shows = |bound_ns, begin: &str| {
        let lines = drawn(&[diamond()], bound_ns);
        lines.iter().any(|line| line.starts_with(begin))
    };
    assert!(!shows(10, "group: breaches"));
    // At a bound of 0, taking a core for `b` took too long.
    assert!(shows(0, "group: breaches") && shows(0, "rules: "));
}

#[test]
fn runs_stand_side_by_side_and_share_no_number() {
    let (one, two) = (drawn(&[diamond()], 10), drawn(&[diamond(), diamond()], 10));
    assert_eq!(two.len(), 2 * one.len());
    let is_of_cores = |line: &&String| *line == "group: run 0 cores";
    assert_eq!(two.iter().filter(is_of_cores).count(), 2);
}

#[test]
fn a_picture_shows_what_cores_executed_and_each_job_with_its_deadline() {
    let svg = picture::draw(&diamond(), 0..1500).expect("it has jobs");
    let count = |part: &str| svg.matches(part).count();
    // The page, five boxes, five executions in six pieces, three of job 1, two complete jobs.
    assert_eq!(count("<rect"), 1 + 5 + 6 + 3 + 2, "{svg}");
    // An arrow for each edge.
    assert_eq!(count("<path"), 4);
    let labels = [
        ">deadline 1.5 us<",
        ">deadline 100 ns<",
        ">core 0<",
        ">core 1<",
    ];
    assert_eq!(labels.map(count), [1; 4]);
    // There is none, and neither of these is stated.
    assert_eq!([">core 2<", "WCET", ">bound"].map(count), [0; 3]);
    // Of a window only the jobs that are released in it, from where the axis begins.
    let svg = picture::draw(&diamond(), 1..1500).expect("it has jobs");
    let (whole, part) = (count("<rect"), svg.matches("<rect").count());
    assert!((1 + 5..whole).contains(&part), "{svg}");
    let why = picture::draw(&run_of(HEADER, ""), 0..1500).expect_err("no event is there");
    assert!(why.contains("keeps no job"), "{why}");
}
