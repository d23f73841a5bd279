//! Records of two machines, read as one: a reading goes from `left` to `right`, a wish goes back.
//!
//! The clock of `right` is 7 ms ahead, and its run began 20 ns before that of `left`. Readings 0, 1,
//! 3 and 4 take 40, 45, 110 and 40 ns, where 46 are stated; 2 is lost, 5 is on its way when the
//! records end. So job 2 of `right` hears reading 3, at 445 ns, and job 3 hears reading 4: not at 475,
//! but at 544. Wishes take 40, 50, 40 and 40 ns.

use std::fs;
use std::path::PathBuf;

use recording::{Channel, CommittedTopic, DagHeader, Header, Recordable, Role, to_bytes};
use views::record::Hop;

use crate::made::{commit, record_with};
use crate::support::{assert_refused, call, folder, succeed};
use crate::traces::machine_line;

recording::recordable! {
    struct Reading { value: f64, hop: Option<Hop> }
}

/// The epochs, by the clocks of the machines.
const EPOCHS: [u64; 2] = [1000, 7_000_980];

/// Hops from epoch to epoch, of job, putting and hearing.
fn hops<const N: usize>(from: u64, to: u64, hops: [[u64; 3]; N]) -> [Hop; N] {
    hops.map(|[job, sent, received]| Hop {
        job,
        sent_ns: from + sent,
        received_ns: to + received,
        delay_ns: 46,
    })
}

/// The events of a DAG's jobs, each with its signal and its release; a signal after the release is
/// none. The subtasks execute one after the other, for these times.
fn events(dag: u32, jobs: &[[u64; 2]], subtasks: &[u64]) -> Vec<(u64, String)> {
    let mut events = Vec::new();
    for (job, &[signal, due]) in jobs.iter().enumerate() {
        let of_job = format!("c{dag} {dag}.{job}");
        let mut add = |time: u64, what: &str, of: &str| {
            events.push((time, format!("{time} {what} {of_job}{of}")));
        };
        if signal <= due {
            add(signal, "signalled", "");
            add(due, "due", "");
        }
        add(due, "released", "");
        let mut time = due;
        for (subtask, length) in subtasks.iter().enumerate() {
            let of = format!(".{subtask}");
            add(time, "ready", &of);
            add(time, "start", &of);
            time += length;
            add(time, "finish", &of);
        }
        add(time, "completed", "");
    }
    events
}

/// A record with the messages heard by the source of a DAG. A topic has its DAG, writer and readers.
fn record<T: Recordable>(
    epoch: u64,
    dags: &str,
    topics: [(usize, &str, u32, &[u32]); 2],
    (dag, topic, heard): (u16, &str, Vec<T>),
    mut events: Vec<(u64, String)>,
) -> Vec<u8> {
    let mut commit = commit(dags);
    for (dag, name, writer, readers) in topics {
        commit.dags[dag].topics.push(CommittedTopic {
            name: name.into(),
            writer,
            readers: readers.into(),
            ..CommittedTopic::default()
        });
    }
    let names = commit.dags.iter().map(|dag| dag.name.clone());
    let header = Header {
        dags: names.map(|name| DagHeader { name, graph: 0 }).collect(),
        channels: vec![Channel {
            dag,
            subtask: 0,
            role: Role::Source,
            topic: topic.into(),
            schema: T::schema(),
        }],
        ..Header::default()
    };
    let values: Vec<Vec<u8>> = heard.iter().map(to_bytes).collect();
    events.sort_by_key(|event| event.0);
    let events: Vec<String> = events.into_iter().map(|event| event.1).collect();
    let text = format!("{{\"kind\":\"epoch\",\"ns\":{epoch}}}\n");
    record_with(&header, &values, &text, &commit, &events.join("\n"))
}

/// The record of `left`, with hops of so many wishes, and outputs of this length.
fn left(heard: usize, length: u64) -> Vec<u8> {
    let dags = "edf 2
        sense T=100 D=100 O=0 bound=20: read/0 tell/0; 0>1
        apply sporadic T=98 D=98 O=0 bound=8: hear/0";
    let wishes = [[0, 85, 105], [1, 190, 220], [2, 455, 475], [3, 555, 575]];
    let sensed = [0, 100, 200, 300, 400, 500].map(|at| [u64::MAX, at]);
    let mut all = events(0, &sensed, &[10, 10]);
    all.extend(events(1, &wishes.map(|[.., at]| [at, at]), &[length]));
    let wishes = hops(EPOCHS[1], EPOCHS[0], wishes)[..heard].to_vec();
    let topics: [(_, _, _, &[u32]); 2] = [(0, "reading", 0, &[1]), (1, "wish", 0, &[])];
    record(EPOCHS[0], dags, topics, (1, "wish", wishes), all)
}

/// The record of `right`, whose hops put the readings so much later.
fn right(later: u64) -> Vec<u8> {
    let dags = "edf 2
        act sporadic T=99 D=99 O=0 bound=16: hear/0 put/0; 0>1";
    let readings = [[0, 15, 75], [1, 115, 180], [3, 315, 445], [4, 415, 475]];
    let readings = hops(EPOCHS[0] + later, EPOCHS[1], readings).map(Some);
    let readings = readings.map(|hop| Reading { value: 0.5, hop });
    let jobs = [[75, 75], [180, 180], [445, 445], [475, 544]];
    let topics: [(_, _, _, &[u32]); 2] = [(0, "reading", 0, &[1]), (0, "wish", 1, &[])];
    let heard = (0, "reading", readings.into());
    record(EPOCHS[1], dags, topics, heard, events(0, &jobs, &[5, 11]))
}

/// A folder with both records, one like `left` that hears nothing, and one like `right` that was torn.
fn records(name: &str, later: u64) -> PathBuf {
    let (folder, right) = (folder(name), right(later));
    let write = |file, bytes: &[u8]| fs::write(folder.join(file), bytes).expect("it is written");
    write("left.rec", &left(4, 8));
    write("again.rec", &left(4, 8));
    write("deaf.rec", &left(0, 8));
    write("torn.rec", &right[..right.len() - 30]);
    write("right.rec", &right);
    folder
}

const JUDGE: &str = "check-trace --bound-us 0 left.rec right.rec";

#[test]
fn two_machines_have_one_set_of_chains_with_the_times_that_a_person_computes() {
    let folder = records("pair", 0);
    let said = succeed(&folder, JUDGE);
    // The last two outputs go back over reading 3, and over a job that this has put off. They are
    // beyond the bound of 20 + 46 + 16 + 46 + 8, which does not hold for them.
    let expected = "
left.rec right.rec: read as one, by the hops of messages
  link left:sense/tell > right:act/hear by topic `reading`
    delay                         median 40 ns, p99 110 ns, max 110 ns of 4 (stated 46 ns, which nothing proves)
    messages                      1 took longer, 2 did not come
    clock of the receiver         7000000 ns ahead, +- 40 ns
  link right:act/put > left:apply/hear by topic `wish`
    delay                         median 40 ns, p99 50 ns, max 50 ns of 4 (stated 46 ns, which nothing proves)
    messages                      0 took longer, 0 did not come
    clock of the receiver         -7000000 ns ahead, +- 40 ns
  chain left:sense/read > left:sense/tell > right:act/hear > right:act/put > left:apply/hear
    age of an output              median 128 ns, p99 183 ns, max 183 ns of 4 (bound 136 ns, of which 92 ns is the stated delay of links, which nothing proves)
    data age                      median 283 ns, p99 383 ns, max 383 ns of 3 (no bound over links)
    reaction time                 median 283 ns, p99 383 ns, max 383 ns of 4 (no bound over links)
";
    assert!(said.contains(expected), "{said}");
    let line = "\"lost\":2,\"stated_ns\":46,\"exceeded\":1,\"delay_ns\":{\"count\":4,\"median\":40,\
                \"p99\":110,\"max\":110},\"offset_ns\":7000000,\"uncertainty_ns\":40}";
    assert!(machine_line(&said, "link").text.ends_with(line), "{said}");
    // Up to the other machine its clock counts.
    let part = format!("{JUDGE} --from left:sense/read --to right:act/put");
    let age = "median 76 ns, p99 141 ns, max 141 ns of 4 (bound 82 ns, of which 46 ns";
    assert!(succeed(&folder, &part).contains(age));
    // An output in time is held against the bound, and twice 40 ns that clocks hide.
    fs::write(folder.join("left.rec"), left(4, 98)).expect("it is written");
    let late = call(&folder, JUDGE.split(' '));
    let breach = "  breach 1 times of chains are beyond their bounds";
    assert!(late.code == Some(1) && late.out.contains(breach));
}

#[test]
fn with_messages_one_way_or_a_torn_record_less_is_known_and_that_is_said() {
    let folder = records("less", 0);
    let said = succeed(&folder, "check-trace --bound-us 0 deaf.rec right.rec");
    let unknown = "\"max\":70},\"offset_ns\":7000040,\"uncertainty_ns\":null";
    assert!(said.contains(unknown), "{said}");
    let said = succeed(&folder, "check-trace --bound-us 0 left.rec torn.rec");
    assert!(said.contains("the record ends before the run"), "{said}");
    assert_eq!(machine_line(&said, "link").number_at("lost"), Some(2));
}

#[test]
fn clocks_may_drift_while_messages_go() {
    // All messages take 60 ns, and within a millisecond the clock of `right` gains 100 ns.
    let dags = "edf 2
        sense T=1000000 D=100 O=0 bound=20: read/0 tell/0; 0>1
        apply sporadic T=100 D=100 O=0 bound=8: hear/0";
    let mut all = events(0, &[[u64::MAX, 0], [u64::MAX, 1_000_000]], &[10, 10]);
    all.extend(events(1, &[[145; 2], [1_000_145; 2]], &[8]));
    let wishes = hops(0, 0, [[0, 85, 145], [1, 1_000_185, 1_000_145]]);
    let topics: [(_, _, _, &[u32]); 2] = [(0, "reading", 0, &[1]), (1, "wish", 0, &[])];
    let left = record(0, dags, topics, (1, "wish", wishes.into()), all);
    let dags = "edf 2
        act sporadic T=100 D=100 O=0 bound=16: hear/0 put/0; 0>1";
    let readings = hops(0, 0, [[0, 15, 75], [1, 1_000_015, 1_000_175]]);
    let all = events(0, &[[75; 2], [1_000_175; 2]], &[5, 11]);
    let topics: [(_, _, _, &[u32]); 2] = [(0, "reading", 0, &[1]), (0, "wish", 1, &[])];
    let right = record(0, dags, topics, (0, "reading", readings.into()), all);
    let folder = folder("drift");
    for (name, record) in [("left.rec", left), ("right.rec", right)] {
        fs::write(folder.join(name), record).expect("it is written");
    }
    let said = succeed(&folder, JUDGE);
    let clock = "50 ns ahead, +- 210 ns";
    let is_told = said.contains(clock) && !said.contains("1 took longer");
    assert!(is_told, "{said}");
}

#[test]
fn records_that_do_not_belong_together_are_judged_alone_and_not_drawn() {
    let said = call(&records("apart", 500), JUDGE.split(' '));
    let why = "0 subtasks of the others may have put the messages of topic `reading` in right.rec";
    assert!(said.complaint.contains(why), "{}", said.complaint);
    assert_eq!(said.out.matches("\"breaches\":0").count(), 2);
    let row = "trace left.rec again.rec right.rec | 2 subtasks of the others may have put the";
    assert_refused(&records("ambiguous", 0), row);
}

#[test]
fn a_picture_has_both_machines_on_one_axis_and_an_arrow_for_each_message() {
    let folder = records("drawn-pair", 0);
    let drawn = succeed(&folder, "trace left.rec right.rec");
    // Job 0 of `sense` begins 20 ns after the run of `right`.
    for part in [
        ": right:cores\"",
        "\"ts\":0.020,\"name\":\"left:sense/read #0\"",
    ] {
        assert!(drawn.contains(part), "{part}: {drawn}");
    }
    let svg = succeed(&folder, "trace left.rec right.rec --svg --periods 6");
    assert!(svg.contains(">right:core 0<"), "{svg}");
    assert_eq!(svg.matches("stroke-dasharray").count(), 8, "{svg}");
    // Without a time it begins where the first message is sent.
    let first = succeed(&folder, "trace left.rec right.rec --svg");
    assert!(first.contains("stroke-dasharray"), "{first}");
}
