//! Records made by hand, for tests.
//!
//! A commit is a line `static 2` or `edf 1`, with the number of cores, and a line for each DAG:
//! `fork T=100 D=90 O=10 flight=2: a/0 b/1 c/2/10 d/3; 0>1 0>2 1>3 2>3`, with `sporadic` after the
//! name if it is; a subtask has its name, its priority and, if known, its WCET. A line `wait 0.2 30`
//! states a wait of a subtask, by DAG and subtask, with its limit. Events are lines
//! such as `24 start c1 0.0.2`: time in ns, word, core, and DAG, job and subtask if it has one. A
//! line `lost 2` before them states the number of earlier events that are lost.

use recording::{Commit, CommittedDag, CommittedSubtask, Entry, EntryKind, Header, Times, Writer};
use sched_dag::journal::{Event, EventSubject};
use sched_dag::{CoreId, DagId, SubtaskId};

/// A commit, and the events of its run: a diamond of DAG `a`, `s` before `l` and `r` before `j`, above
/// `b`, on two cores. In job 0, `b` preempts `r`, which goes on later; job 1 begins before job 0 is
/// complete, and has not ended when the record ends.
pub(crate) const DIAMOND: [&str; 2] = [
    "static 2
a T=1000 D=1500 O=0 flight=2: s/2 l/2 r/2 j/2; 0>1 0>2 1>3 2>3
b T=5000 D=100 O=150: x/1",
    "
0 released c0 0.0
1 ready c0 0.0.0
2 start c0 0.0.0
90 finish c0 0.0.0
92 start c0 0.0.1
93 start c1 0.0.2
150 released c0 1.0
152 suspend c1 0.0.2
152 start c1 1.0.0
251 missed c0 1.0
300 finish c1 1.0.0
300 completed c1 1.0
300 resume c1 0.0.2
400 finish c0 0.0.1
900 skipped c0 1.1
1000 released c0 0.1
1001 start c0 0.1.0
1100 finish c1 0.0.2
1102 start c1 0.0.3
1200 finish c1 0.0.3
1200 completed c1 0.0
1300 finish c0 0.1.0
1300 start c0 0.1.1
1301 start c1 0.1.2
2501 missed c0 0.1",
];

/// Returns the lines that are not empty.
pub(crate) fn lines_of(text: &str) -> Vec<&str> {
    let lines = text.lines().map(str::trim);
    lines.filter(|line| !line.is_empty()).collect()
}

fn number<T: std::str::FromStr>(text: &str) -> T {
    text.parse()
        .ok()
        .unwrap_or_else(|| panic!("`{text}` is no number"))
}

/// Makes a commit.
pub(crate) fn commit(text: &str) -> Commit {
    let lines = lines_of(text);
    let (policy, cores) = lines[0].split_once(' ').expect("policy and cores");
    let (waits, dags): (Vec<&str>, Vec<_>) =
        (lines[1..].iter()).partition(|line| line.starts_with("wait "));
    Commit {
        policy: sched_dag::Policy::of_word(policy).expect("a policy") as u8,
        is_preemptive: true,
        cores: number(cores),
        charge_ns: Some(0),
        dags: dags.into_iter().map(dag).collect(),
        waits: waits.into_iter().map(wait).collect(),
        ..Commit::default()
    }
}

fn wait(line: &str) -> (u32, u32, u64, Option<u64>) {
    let [_, of, limit_ns] = line.split(' ').collect::<Vec<_>>()[..] else {
        panic!("`{line}` is no wait");
    };
    let (dag, subtask) = of.split_once('.').expect(line);
    (number(dag), number(subtask), number(limit_ns), None)
}

fn dag(line: &str) -> CommittedDag {
    let (head, rest) = line.split_once(": ").expect(line);
    let (subtasks, edges) = rest.split_once(';').unwrap_or((rest, ""));
    let mut words = head.split(' ');
    let mut dag = CommittedDag {
        name: words.next().expect("a name").into(),
        in_flight: 1,
        ..CommittedDag::default()
    };
    for word in words {
        match word.split_once('=').unwrap_or((word, "")) {
            ("T", ns) => dag.period_ns = number(ns),
            ("D", ns) => dag.relative_deadline_ns = number(ns),
            ("O", ns) => dag.offset_ns = number(ns),
            ("flight", jobs) => dag.in_flight = number(jobs),
            ("bound", ns) => dag.bound_ns = Some(number(ns)),
            ("hash", hash) => dag.hash = number(hash),
            _ => dag.is_sporadic = word == "sporadic",
        }
    }
    let subtask = |text: &str| {
        let parts: Vec<&str> = text.split('/').collect();
        CommittedSubtask {
            name: parts[0].into(),
            priority: number(parts[1]),
            wcet_ns: parts.get(2).map(|ns| number(ns)),
            ..CommittedSubtask::default()
        }
    };
    dag.subtasks = subtasks.split_whitespace().map(subtask).collect();
    let edge = |text: &str| {
        let (from, to) = text.split_once('>').expect(text);
        (number(from), number(to))
    };
    dag.edges = edges.split_whitespace().map(edge).collect();
    dag
}

/// Makes an event from its line.
pub(crate) fn event(line: &str) -> Event {
    let [time, word, core, of] = line.split(' ').collect::<Vec<_>>()[..] else {
        panic!("`{line}` is no event");
    };
    let of: Vec<u64> = of.split('.').map(number).collect();
    let small = |number: u64| u32::try_from(number).expect("it is small");
    Event {
        time_ns: number(time),
        what: word.parse().expect(line),
        core: CoreId(number(&core[1..])),
        dag: DagId(small(of[0])),
        job: of[1],
        subtask: of.get(2).map(|&subtask| SubtaskId(small(subtask))),
    }
}

/// Makes a record of one run, after a text.
pub(crate) fn record_of(text: &str, commit: &Commit, events: &str) -> Vec<u8> {
    record_with(&Header::default(), &[], text, commit, events)
}

/// Makes one that has values, too: of the first channel, by job.
pub(crate) fn record_with(
    header: &Header,
    values: &[Vec<u8>],
    text: &str,
    commit: &Commit,
    events: &str,
) -> Vec<u8> {
    let mut record = Writer::begin(Vec::new());
    record.header(header);
    record.text(text);
    record.commit(commit);
    for (job, value) in (0..).zip(values) {
        record.write(&Entry {
            what: EntryKind::Value,
            dag: header.channels[0].dag,
            place: 0,
            job,
            release_ns: 0,
            at_ns: 0,
            value,
        });
    }
    let mut lines = lines_of(events);
    let lost = lines.first().and_then(|line| line.strip_prefix("lost "));
    let lost = lost.map_or(0, number);
    if lost > 0 {
        lines.remove(0);
    }
    let words = lines.into_iter().map(|line| {
        let event = event(line);
        let of_job = EventSubject::of_job(event.dag, event.job);
        let subject = event.instance().map_or(of_job, EventSubject::of);
        Event::words(event.time_ns, event.what, event.core, subject)
    });
    let words: Vec<[u64; 3]> = words.collect();
    record.events(0, lost, &words);
    record.times(&Times {
        written: vec![lost + words.len() as u64],
        ..Times::default()
    });
    record.end()
}

/// Makes the line of a serial log with the bytes of a record.
pub(crate) fn line_of(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let of_three = |three: &[u8]| {
        let byte = |place: usize| u32::from(three.get(place).copied().unwrap_or(0));
        let bits = byte(0) << 16 | byte(1) << 8 | byte(2);
        let digit = |place| match place <= three.len() {
            true => char::from(DIGITS[(bits >> (18 - 6 * place) & 63) as usize]),
            false => '=',
        };
        (0..4).map(digit).collect::<String>()
    };
    let text: String = bytes.chunks(3).map(of_three).collect();
    format!("{{\"kind\":\"record\",\"bytes\":\"{text}\"}}\n")
}
