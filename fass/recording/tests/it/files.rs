//! Recordings that were altered: each is refused.

use std::collections::BTreeSet;

use random::Random;
use recording::{
    Channel, Chunk, Commit, CommittedDag, Counted, Crc, DagHeader, DagTimes, Entry, EntryKind,
    Header, MOST_WEIGHTLESS, Malformed, Recordable, Recording, Role, Schema, Stream, Times,
    VERSION, Writer, mended, to_bytes,
};

fn header() -> Header {
    let channel = |dag, role, topic: &str, schema| Channel {
        dag,
        subtask: 0,
        role,
        topic: topic.into(),
        schema,
    };
    let dag = |name: &str, graph| DagHeader {
        name: name.into(),
        graph,
    };
    Header {
        app: "demo".into(),
        dags: vec![dag("fast", 7), dag("slow", 8)],
        channels: vec![
            channel(0, Role::Source, "samples", Vec::<f64>::schema()),
            channel(
                1,
                Role::Sample,
                "samples",
                <Option<(u64, u64, Vec<f64>)>>::schema(),
            ),
        ],
    }
}

fn commit() -> Commit {
    Commit {
        cores: 2,
        dags: vec![CommittedDag {
            name: "camera".into(),
            edges: vec![(0, 1)],
            bound_ns: Some(7),
            ..CommittedDag::default()
        }],
        pins: vec![(0, 0, 1)],
        affinities: vec![(0, 0), (0, 2)],
        move_ns: 7,
        answers: vec!["dag `fast` takes at most 7ns".into()],
        locks: vec![(0, 1, "seen".into(), Some(9), 2)],
        device_ns: [4, 100],
        ..Commit::default()
    }
}

fn times() -> Times {
    let buckets = vec![(3, 1), (9, 2)];
    Times {
        written: vec![20],
        dags: vec![DagTimes {
            response: Counted { min_ns: 2, buckets },
            ..DagTimes::default()
        }],
    }
}

/// An entry of a DAG, with a place in its header or in its graph.
fn entry(what: EntryKind, (dag, place): (u16, u16), job: u64, value: &[u8]) -> Entry<'_> {
    Entry {
        what,
        dag,
        place,
        job,
        release_ns: job * 1_000,
        at_ns: job * 1_000 + 10,
        value,
    }
}

/// Returns a recording of some jobs, a job of which is lost.
fn recording() -> Vec<u8> {
    let mut writer = Writer::new(&header());
    writer.commit(&commit());
    for job in 0..10 {
        let samples = vec![0.5; usize::try_from(job % 4).expect("it is small")];
        let value = to_bytes(&samples);
        let sample = to_bytes(&Some((job, job * 10, samples)));
        let entry = |what, dag, place, value| entry(what, (dag, place), job, value);
        writer.write(&match job {
            5 => entry(EntryKind::Lost, 0, 0, &[]),
            6 => entry(EntryKind::Skip, 0, 0, &[]),
            7 => entry(EntryKind::Cut, 0, 3, &[]),
            8 => entry(EntryKind::Fault, 0, 3, &[]),
            _ => entry(EntryKind::Value, 0, 0, &value),
        });
        writer.write(&entry(EntryKind::Value, 1, 1, &sample));
        writer.events(0, 2 * job, &[[job, 1, 2], [job, 3, 4]]);
    }
    writer.times(&times());
    writer.end()
}

#[test]
fn what_is_written_is_read() {
    let bytes = recording();
    let recording = Recording::read(&bytes).unwrap();
    assert_eq!(recording.header(), &header());
    assert_eq!((recording.count(), recording.lost()), (20, 1));
    let entries: Vec<Entry<'_>> = recording.entries().collect();
    assert_eq!(entries.len(), 20);
    assert_eq!((entries[10].what, entries[10].job), (EntryKind::Lost, 5));
    assert_eq!(Vec::<f64>::from_bytes(entries[6].value), Ok(vec![0.5; 3]));
    let mut events = Vec::new();
    for chunk in recording.chunks() {
        match chunk {
            Chunk::Commit(read) => assert_eq!(read, commit()),
            Chunk::Times(read) => assert_eq!(read, times()),
            Chunk::Events(read) => {
                assert_eq!(read.before, events.len() as u64);
                events.extend(read.words());
            }
            _ => {}
        }
    }
    assert_eq!((events.len(), events[19]), (20, [9, 3, 4]));
}

#[test]
fn every_altered_byte_is_found() {
    let bytes = recording();
    for place in 0..bytes.len() {
        for bit in 0..8 {
            let mut altered = bytes.clone();
            altered[place] ^= 1 << bit;
            assert!(
                Recording::read(&altered).is_err(),
                "bit {bit} of byte {place}"
            );
        }
        assert!(Recording::read(&bytes[..place]).is_err(), "{place} bytes");
    }
}

#[test]
fn of_a_run_that_died_all_whole_entries_are_read() {
    let bytes = recording();
    let all: Vec<Entry<'_>> = Recording::read(&bytes).unwrap().entries().collect();
    let mut counts = BTreeSet::new();
    for place in 0..bytes.len() {
        let Ok(mended) = mended(&bytes[..place]) else {
            assert!(counts.is_empty(), "the header is whole before {place}");
            continue;
        };
        let recording = Recording::read(&mended).unwrap();
        assert!(recording.is_cut());
        let entries: Vec<Entry<'_>> = recording.entries().collect();
        assert_eq!(entries, all[..entries.len()], "{place} bytes");
        counts.insert(entries.len());
    }
    assert_eq!(counts, (0..=all.len()).collect());
}

#[test]
fn parts_that_are_left_out_doubled_or_turned_are_found() {
    let (bytes, mut random) = (recording(), Random::new(1));
    let mut expected = BTreeSet::new();
    for _ in 0..10_000 {
        let mut altered = bytes.clone();
        for _ in 0..=random.index(3) {
            let place = random.index(altered.len());
            let end = place + 1 + random.index(60);
            let part = place..end.min(altered.len());
            match random.index(3) {
                0 => _ = altered.drain(part),
                1 => {
                    let part = altered[part].to_vec();
                    _ = altered.splice(place..place, part);
                }
                _ => altered[part].rotate_left(1),
            }
        }
        if altered != bytes {
            let malformed = Recording::read(&altered).expect_err("it is not what was written");
            assert!(malformed.offset <= altered.len());
            expected.insert(malformed.expected);
        }
    }
    assert!(expected.len() >= 6, "{expected:#?}");
}

#[test]
fn what_was_written_wrongly_is_refused_in_spite_of_its_checksum() {
    let refused = |entry: Entry<'_>| {
        let mut writer = Writer::new(&header());
        writer.write(&entry);
        Recording::read(&writer.end()).expect_err("it is wrong")
    };
    let value = to_bytes(&vec![1.0]);
    let right = entry(EntryKind::Value, (0, 0), 0, &value);
    let of_no_dag = Entry { dag: 9, ..right };
    let of_no_channel = Entry { place: 1, ..right };
    let value = &value[..9];
    let too_short = Entry { value, ..right };
    let what = EntryKind::Skip;
    let with_value = Entry { what, ..right };
    let of_bytes = "how many elements follow, as many as there are bytes for";
    let payload = refused(of_no_dag).offset - 1;
    for (wrong, offset, expected) in [
        (of_no_dag, 1, "the number of a DAG of the header"),
        (of_no_channel, 3, "the number of a channel of the DAG"),
        (too_short, 29, of_bytes),
        (with_value, 29, "the end of the value"),
    ] {
        let offset = payload + offset;
        assert_eq!(refused(wrong), Malformed { offset, expected });
    }
    let mut of_no_dag = header();
    of_no_dag.channels[1].dag = 2;
    let malformed = Recording::read(&Writer::new(&of_no_dag).end()).unwrap_err();
    assert_eq!(malformed.expected, "channels of DAGs that the header has");
    let mut more_than_numbers = header();
    let channel = more_than_numbers.channels[0].clone();
    more_than_numbers.channels = vec![channel; usize::from(u16::MAX)];
    let malformed = Recording::read(&Writer::new(&more_than_numbers).end()).unwrap_err();
    assert_eq!(malformed.expected, "fewer than 65,535 DAGs and channels");
}

#[test]
fn foreign_and_newer_files_are_told() {
    let said = |bytes: &[u8]| Recording::read(bytes).unwrap_err().to_string();
    let foreign = "at byte 0: expected the mark of a recording, 0x89 and `FASSREC`";
    assert_eq!(said(b""), foreign);
    assert_eq!(said(b"sample,upper_acc_x\n0,1.5\n"), foreign);
    assert_eq!(
        said(&of_version(VERSION + 1, &recording())),
        "at byte 8: expected version 1 to 10 of recordings, which are those that are read"
    );
    let mut more = recording();
    more.push(0);
    assert!(said(&more).ends_with("expected the end of the file"));
}

/// Returns a recording of few bytes whose values would have very many parts.
fn of_weightless_parts(parts: usize) -> Vec<u8> {
    let mut header = header();
    header.channels.truncate(1);
    header.channels[0].schema = Schema::Tuple(vec![Schema::Tuple(Vec::new()); parts]);
    let mut writer = Writer::new(&header);
    for job in 0..100 {
        writer.write(&entry(EntryKind::Value, (0, 0), job, &[]));
    }
    writer.end()
}

#[test]
fn a_type_with_too_many_parts_that_take_no_bytes_is_refused() {
    let most = MOST_WEIGHTLESS - 1; // the tuple itself takes none either
    assert!(Recording::read(&of_weightless_parts(most)).is_ok());
    let malformed = Recording::read(&of_weightless_parts(most + 1)).unwrap_err();
    let expected = "a type with at most 64 parts that take no bytes";
    assert_eq!(malformed.expected, expected);
    let text = format!("({})", "(), ".repeat(most + 1));
    assert_eq!(Schema::parse(&text).unwrap_err().1, expected);
}

/// Returns a recording as another version would have written it: with that number, and the
/// checksums that follow from it.
fn of_version(version: u16, bytes: &[u8]) -> Vec<u8> {
    let mut other = [&bytes[..8], &version.to_le_bytes()].concat();
    let mut crc = Crc::new();
    crc.update(&other);
    let mut rest = &bytes[10..];
    while !rest.is_empty() {
        let length = rest[1..5].try_into().expect("4 bytes");
        let length = usize::try_from(u32::from_le_bytes(length)).expect("32 bits");
        let (frame, after) = rest.split_at(5 + length);
        crc.update(frame);
        other.extend(frame);
        other.extend(crc.value().to_le_bytes());
        rest = &after[4..];
    }
    other
}

#[test]
fn a_recording_of_the_version_before_is_read() {
    let bytes = recording();
    assert_eq!(of_version(VERSION, &bytes), bytes);
    let before = of_version(1, &bytes);
    let before = Recording::read(&before).unwrap();
    assert_eq!((before.count(), before.lost()), (20, 1));
}

#[test]
fn a_commit_of_a_version_before_has_no_waits_pins_answers_or_device() {
    let commit = Commit {
        cores: 2,
        ..Commit::default()
    };
    // Versions 5 to 9 end it before the numbers of these, and no version elsewhere.
    let are_one = [48, 44, 28, 20, 4].map(|lacks| (lacks, true));
    for (lacks, is_one) in are_one
        .into_iter()
        .chain([(12, false), (32, false), (37, false)])
    {
        let mut bytes = Stream::begin(Vec::new()).end();
        let end = bytes.split_off(10);
        let payload = to_bytes(&commit);
        let payload = &payload[..payload.len() - lacks];
        let length = u32::try_from(payload.len()).expect("it is short");
        bytes.extend([&[6], &length.to_le_bytes()[..], payload, &[0; 4]].concat());
        bytes.extend(end);
        let bytes = of_version(6, &bytes);
        let chunk = Recording::read(&bytes)
            .ok()
            .and_then(|all| all.chunks().next());
        assert_eq!(chunk.is_some(), is_one, "{lacks}");
    }
}
