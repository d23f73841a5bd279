//! Records that are correct, malformed, cut off, and altered.

pub(crate) mod made;

use random::Random;
use recording::{Chunk, Commit, Recordable, Recording, Stream, Times, Writer};

use super::Record;
use super::{
    COUNTED_TOLERANCE_NS, FIFO_TOLERANCE_NS, NORMAL_TOLERANCE_NS, REAL_TOLERANCE_NS,
    SCHED_EXT_TOLERANCE_NS,
};
use crate::made::{commit, line_of, record_of};
use crate::tests::{altered, rows};

const COMMIT: &str = "edf 2\nx T=10 D=10 O=0: a/0 b/1/7; 0>1";

const EVENTS: &str = "
0 released c0 0.0
1 start c0 0.0.1
0 ready c1 0.0.0";

fn good() -> Vec<u8> {
    record_of("", &commit(COMMIT), EVENTS)
}

#[test]
fn a_good_record_is_read_as_a_file_and_in_lines() {
    let mut commit = commit(COMMIT);
    commit.dags[0].jobs = Some(3);
    let bytes = record_of("", &commit, EVENTS);
    let log = "hello\n".to_string() + &line_of(&bytes);
    for record in [Record::read(&bytes), Record::read(log.as_bytes())] {
        let record = record.unwrap();
        let [run] = &record.runs[..] else { panic!() };
        assert_eq!((run.number, run.options.cores, run.lost), (0, 2, 0));
        assert_eq!((run.events.len(), run.complete), (3, true));
        let dag = &run.task_set.dags()[0];
        assert_eq!((dag.name(), dag.jobs()), ("x", Some(3)));
    }
    assert_eq!(Record::read(b"hello\n").unwrap().runs.len(), 0);
}

/// A part of the good record, its replacement, and the refusal.
const WRONG: &str = "
edf 2 | edf 0 | commit 0: it is for 0 cores; 1 to 64 are possible
edf 2 | edf 4294967295 | commit 0: it is for 4294967295 cores; 1 to 64 are possible
T=10 | T=0 | commit 0: dag `x`
0>1 | 0>2 | commit 0: dag `x`
0>1 | 0>1 1>0 | commit 0: dag `x`
c1 0.0.0 | c2 0.0.0 | events of run 0: Event {
c1 0.0.0 | c1 0.0.2 | events of run 0: Event {
c1 0.0.0 | c1 1.0.0 | events of run 0: Event {
0 released | 2 released | time goes back in the events of core 0 of run 0; each core's must be";

#[test]
fn whatever_is_wrong_is_named() {
    let all = format!("{COMMIT}\n--{EVENTS}");
    for [from, to, says] in rows(WRONG) {
        let altered = altered(&all, [&from, &to]);
        let (committed, events) = altered.split_once("--").unwrap();
        let said = Record::read(&record_of("", &commit(committed), events)).unwrap_err();
        assert!(said.starts_with(&says) && !said.contains('\n'), "{said}");
    }
    let mut orphan = Writer::begin(Vec::new());
    orphan.times(&Times::default());
    let said = Record::read(&orphan.end()).unwrap_err();
    assert_eq!(said, "run 0 has no commit before it");
    let said = Record::read(b"{\"kind\":\"record\",\"bytes\":\"iUZ?\"}\n").unwrap_err();
    assert_eq!(said, "serial line 1: its bytes are not in base 64");
}

/// Lost events are the oldest, and those after the last ones that were sent.
#[test]
fn events_that_are_missing_are_counted_and_a_run_that_died_is_not_complete() {
    let mut record = Writer::begin(Vec::new());
    record.commit(&commit(COMMIT));
    record.events(0, 4, &[[0, 0, 0]]);
    let died = Record::sent(&record.clone().end(), "").unwrap();
    assert_eq!((died.runs[0].lost, died.runs[0].complete), (4, false));
    let mut twice = record.clone();
    twice.commit(&commit(COMMIT));
    let said = Record::read(&twice.end()).unwrap_err();
    assert_eq!(said, "a commit within run 0");
    record.times(&Times {
        written: vec![8],
        ..Times::default()
    });
    let bytes = record.end();
    let ended = Record::read(&bytes).unwrap();
    assert_eq!((ended.runs[0].lost, ended.runs[0].complete), (7, true));
    // The record of a guest that was killed has the part sent until then.
    let cut = Record::sent(&bytes[..bytes.len() - 1], "").unwrap();
    assert_eq!(cut.runs.len(), 1);
}

/// Each chunk altered, and the checksum made right again: it is refused in a line, or is another
/// record.
#[test]
fn of_10_000_altered_records_none_is_more_than_a_line() {
    let (bytes, mut random, mut refused) = (good(), Random::new(1), 0);
    let recording = Recording::read(&bytes).unwrap();
    let chunks: Vec<Chunk<'_>> = recording.chunks().collect();
    for _ in 0..10_000 {
        let mut altered: Stream<Vec<u8>> = Stream::begin(Vec::new());
        for chunk in &chunks {
            match chunk {
                Chunk::Commit(commit) => {
                    let mut bytes = recording::to_bytes(commit);
                    let place = random.index(bytes.len());
                    bytes[place] ^= 1 << random.index(8);
                    match Commit::from_bytes(&bytes) {
                        Ok(commit) => altered.commit(&commit),
                        Err(malformed) => {
                            refused += 1;
                            assert!(!malformed.to_string().contains('\n'));
                        }
                    }
                }
                Chunk::Events(events) => {
                    let mut words: Vec<_> = events.words().collect();
                    let place = random.index(words.len());
                    words[place][random.index(3)] ^= 1 << random.index(64);
                    altered.events(0, random.within(0..=1) * random.within(0..=1), &words);
                }
                Chunk::Times(times) => altered.times(times),
                _ => {}
            }
        }
        if let Err(said) = Record::read(&altered.end()) {
            refused += 1;
            assert!(!said.contains('\n') && said.len() < 1000, "{said}");
        }
    }
    assert!(refused > 5_000, "{refused}");
}

#[test]
fn a_chain_of_many_subtasks_is_no_cycle() {
    let subtasks: Vec<String> = (0..3000).map(|n| format!("s{n}/0")).collect();
    let edges: Vec<String> = (1..3000).map(|n| format!("{}>{n}", n - 1)).collect();
    let (subtasks, edges) = (subtasks.join(" "), edges.join(" "));
    let chain = commit(&format!("edf 2\nx T=10 D=10 O=0: {subtasks}; {edges}"));
    let record = Record::read(&record_of("", &chain, "")).unwrap();
    assert_eq!(record.runs[0].task_set.dags()[0].subtasks().len(), 3000);
}

#[test]
fn a_record_says_how_strictly_it_is_judged() {
    let of = |clock: &str, words: &str| {
        let (clock, preempts) = clock.split_once(' ').unwrap_or((clock, "false"));
        let boot = r#"{"kind":"boot","version":"1","app":"a","cpus":2,"memory_kib":1"#;
        let rest = format!(
            "\"clock\":\"{clock}\",\"preemptive\":{preempts},\"command_line\":\"{words}\"}}"
        );
        let record = record_of(&format!("{boot},{rest}\n"), &commit(COMMIT), EVENTS);
        Record::read(&record).unwrap().runs.remove(0).usual_bound_ns
    };
    let expected = COUNTED_TOLERANCE_NS;
    assert_eq!(of("pit", "policy=edf mode=deterministic"), expected);
    assert_eq!(of("pit", "mode=threads"), REAL_TOLERANCE_NS);
    assert_eq!(of("linux true", "policy=edf"), FIFO_TOLERANCE_NS);
    let expected = SCHED_EXT_TOLERANCE_NS;
    assert_eq!(of("linux true", "mechanism=sched_ext"), expected);
    assert_eq!(of("linux", "mechanism=fifo"), NORMAL_TOLERANCE_NS);
    assert_eq!(
        Record::read(&good()).unwrap().runs[0].usual_bound_ns,
        REAL_TOLERANCE_NS
    );
}
