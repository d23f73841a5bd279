//! The command `recording`: tables become recordings and come back, malformed ones are refused,
//! and an independent reader opens the MCAP file.

use std::fs;
use std::path::PathBuf;
use std::process::Command;

use recording::{
    Channel, Commit, DagHeader, Entry, EntryKind, Header, Recordable, Recording, Role, Writer,
    to_bytes,
};

use crate::support::{assert_refused, call, folder, refusal, succeed};

type Value = (String, Option<f64>, [i16; 2], Vec<u64>);

/// The commit's answer about its DAG.
const ANSWER: &str = "dag `eye` takes at most 7ms, by multiple paths";

/// A recording of 5,000 values, and of other entries.
fn recording() -> Vec<u8> {
    let header = Header {
        app: "demo".into(),
        dags: vec![DagHeader {
            name: "eye".into(),
            graph: 7,
        }],
        channels: vec![Channel {
            dag: 0,
            subtask: 2,
            role: Role::Source,
            topic: "seen".into(),
            schema: Value::schema(),
        }],
    };
    let mut writer = Writer::new(&header);
    writer.commit(&Commit {
        answers: vec![ANSWER.into()],
        ..Commit::default()
    });
    for job in 0..5_000 {
        let value: Value = (
            format!("job \"{job}\", \n"),
            [None, Some(0.1), Some(f64::NAN)][usize::try_from(job % 3).expect("small")],
            [-1, 7],
            vec![u64::MAX; usize::try_from(job % 4).expect("small")],
        );
        let (what, bytes) = match job {
            70 => (EntryKind::Lost, Vec::new()),
            _ => (EntryKind::Value, to_bytes(&value)),
        };
        writer.write(&Entry {
            what,
            dag: 0,
            place: 0,
            job,
            release_ns: job * 1_000_000,
            at_ns: job * 1_000_000 + 250,
            value: &bytes,
        });
    }
    writer.end()
}

/// A folder with that recording.
fn recorded(name: &str) -> PathBuf {
    let folder = folder(name);
    fs::write(folder.join("demo.rec"), recording()).expect("the test's folder takes a file");
    folder
}

#[test]
fn a_recording_is_shown_and_becomes_tables() {
    let folder = recorded("recording-shown");
    let said = succeed(&folder, "recording demo.rec --csv tables");
    let of_source = "source `seen` of dag `eye`: 4999 values of (text, f64?, [i16; 2], [u64])";
    assert!(said.contains(of_source), "{said}");
    assert!(said.contains(ANSWER), "{said}");
    assert!(said.contains("incomplete: 1 values are lost"), "{said}");
    let table = |name: &str| fs::read_to_string(folder.join("tables").join(name));
    let begin = "job,release_ns,at_ns,0,1,2_0,2_1,3\n\
        0,0,250,\"job \"\"0\"\", \n\",,-1,7,[]\n\
        1,1000000,1000250,\"job \"\"1\"\", \n\",0.1,-1,7,[18446744073709551615]\n";
    let seen = table("eye.seen.csv").expect("a table");
    assert!(seen.starts_with(begin), "{}", &seen[..300]);
    let events = "what,dag,subtask,job,release_ns,at_ns\nlost,eye,2,70,70000000,70000250\n";
    assert_eq!(table("events.csv").expect("a table"), events);
}

#[test]
fn samples_and_told_times_are_on_the_time_of_the_run_as_all_else_is() {
    let folder = folder("recording-epoch");
    let mut header = Recording::read(&recording())
        .expect("whole")
        .header()
        .clone();
    header.channels[0].role = Role::Sample;
    header.channels[0].schema = <Option<(u64, u64, u8)>>::schema();
    let mut writer = Writer::new(&header);
    writer.text("{\"kind\":\"epoch\",\"ns\":1000}\n");
    let (dag, place, job, release_ns, at_ns) = (0, 0, 0, 0, 300);
    for (what, value) in [
        (EntryKind::Value, to_bytes(&Some((7_u64, 1_250_u64, 9_u8)))),
        (EntryKind::Value, to_bytes(&None::<(u64, u64, u8)>)),
        (EntryKind::Clock, to_bytes(&vec![1_260_u64, 1_270])),
    ] {
        let value = &value;
        writer.write(&Entry {
            what,
            dag,
            place,
            job,
            release_ns,
            at_ns,
            value,
        });
    }
    fs::write(folder.join("demo.rec"), writer.end()).expect("a file");
    let said = succeed(&folder, "recording demo.rec --until eye/0 --csv tables");
    for words in [
        "sample `seen`: [7,250,9]\n",
        "`seen`: null\n",
        "told the time: [260,270]\n",
    ] {
        assert!(said.contains(words), "{said}");
    }
    let table = fs::read_to_string(folder.join("tables/eye.seen.sampled.csv")).expect("a table");
    assert!(table.contains("0,0,300,\"[7,250,9]\"\n"), "{table}");
}

#[test]
fn what_is_recorded_of_a_job_is_shown() {
    let folder = recorded("recording-until");
    let shown = "job 4 of dag `eye`, due at 4000000 ns\n  4000250 ns, subtask 2, source `seen`: \
                 [\"job \\\"4\\\", \\u000a\",0.1,[-1,7],[]]\n";
    let of_4 = succeed(&folder, "recording demo.rec --until eye/4");
    assert_eq!(of_4, shown);
    let of_70 = succeed(&folder, "recording demo.rec --until eye/70");
    assert!(of_70.ends_with("source `seen`: lost\n"), "{of_70}");
    let rows = "
recording demo.rec --until eye | DAG/JOB is wanted
recording demo.rec --until ear/1 | there is no dag `ear`; there are `eye`
recording demo.rec --until eye/5000 | nothing is recorded of job 5000";
    assert_refused(&folder, rows);
}

/// Makes a recording of a table by these options, or says why not.
fn from_csv<'o>(options: &'o [&'o str]) -> impl Iterator<Item = &'o str> {
    let always = "recording in.csv --from-csv --out out.rec --dag d --topic t";
    always.split(' ').chain(options.iter().copied())
}

#[test]
fn a_table_becomes_a_recording_and_the_same_table() {
    let folder = folder("recording-table");
    let table = "job,release_ns,at_ns,at_x,at_y,name,truth\n\
        0,0,5,0.1,-1e300,\"a \"\"b\"\", c\",true\n\
        2,20,25,NaN,inf,,false\n";
    fs::write(folder.join("in.csv"), table).expect("a file");
    let schema = "Row { at: At { x: f64, y: f64 }, name: text, truth: bool }";
    let made = call(&folder, from_csv(&["--type", schema]));
    assert_eq!(made.code, Some(0), "{}", made.complaint);
    succeed(&folder, "recording out.rec --csv tables");
    let back = fs::read_to_string(folder.join("tables/d.t.csv"));
    assert_eq!(back.expect("a table"), table);
}

/// The lines of a table, the options, and the refusal. A line's end is `/`.
const WRONG: &str = "
a,b/1,2/ |  | in.csv:1: there is no column release_ns; say by --period
a,b/1/ | --period 1ms | in.csv:2: 1 cells, and there are 2 columns
a,b/1,x/ | --period 1ms | in.csv:2: `x` is no value of type f64
a/\"1/ | --period 1ms | in.csv:2: a cell that begins with a quotation mark has no end
a,job/1,x/ | --period 1ms | in.csv:2: `x` is no whole number, as column `job` has them
a,b/1,2/ | --period 1ms --type [f64;3] | there are 2 columns for them (a, b)
a,b/1,2/ | --period 1ms --type [f64; | `--type`, column 6: expected a number
a/1/ | --period 1ms --ignore b | there is no column `b`; there are a
a,b,a/1,2,3/ | --period 1ms | in.csv:1: there are two columns `a`; rename one, or --ignore both
job,a,job/1,2,3/ | --period 1ms | in.csv:1: there are two columns `job`
job,a/1,2/0,2/1,3/ | --period 1ms | in.csv:3: job 0 at 0 ns is not after line 2, job 1 at 1000000 ns; put the rows in the order
release_ns,a/0,1/10000000,3/5000000,5/ | --period 5ms | in.csv:4: job 2 at 5000000 ns is not after line 3, job 1 at 10000000 ns
release_ns,a/0,1/0,3/ |  | in.csv:3: job 1 at 0 ns is not after line 2, job 0 at 0 ns
release_ns,a/0,1/5000000,3/20000000,5/ | --period 5ms | in.csv:4: job 2 is due at 10000000 ns by --period, and at 20000000 ns by column release_ns
 | --period 1ms | in.csv:1: the table is empty
a/x/ | --period 1ms --type [text;257] | in.csv:2: an array of more than 256 columns, [text; 257], is not read from a table
a/1/ | --period 1ms --type [[[[[[u8;64];64];64];64];64];64] | in.csv:2: an array of more than 256 columns";

#[test]
fn a_table_that_does_not_fit_is_refused_with_its_line() {
    let folder = folder("recording-wrong");
    for row in WRONG.lines().skip(1) {
        let [table, options, words] = row.split(" | ").collect::<Vec<_>>()[..] else {
            panic!("{row}");
        };
        fs::write(folder.join("in.csv"), table.replace('/', "\n")).expect("a file");
        let options: Vec<&str> = options.split_whitespace().collect();
        let said = refusal(&folder, from_csv(&options));
        assert!(said.contains(words), "{said}");
    }
    assert!(!folder.join("out.rec").exists());
}

/// Reads an MCAP file, with and without its index, and prints the counts of messages.
const READER: &str = r#"
import json, sys
from mcap.reader import NonSeekingReader, make_reader
counts = []
for make in (make_reader, NonSeekingReader):
    with open(sys.argv[1], "rb") as file:
        reader = make(file) if make is make_reader else make(file, validate_crcs=True)
        topics = {}
        for schema, channel, message in reader.iter_messages():
            fields = json.loads(schema.data)
            value = json.loads(message.data)
            assert fields["type"] == "object" and set(fields["required"]) <= set(value)
            assert value["job"] == message.sequence
            assert message.log_time == message.publish_time + 250
            topics[channel.topic] = topics.get(channel.topic, 0) + 1
        counts.append(topics)
with open(sys.argv[1], "rb") as file:
    summary = make_reader(file).get_summary()
    counts.append({summary.channels[id].topic: count
        for id, count in summary.statistics.channel_message_counts.items()})
    late = list(make_reader(file).iter_messages(topics=["/eye/seen"], start_time=4_999_000_000))
    assert len(late) == 1 and json.loads(late[0][2].data)["value"]["2"] == [-1, 7]
assert counts[0] == counts[1] == counts[2], counts
print(sorted(counts[0].items()))
"#;

#[test]
fn an_independent_reader_opens_the_mcap_file() {
    let folder = recorded("recording-mcap");
    let said = succeed(&folder, "recording demo.rec --mcap demo.mcap");
    assert!(said.contains("demo.mcap: 5000 messages"), "{said}");
    // `./scripts/test` counts the missing reader as skipped.
    let python = match tool::recordings::independent_reader() {
        Ok(python) => python,
        Err(why) => return eprintln!("skipped: {why}"),
    };
    let out = folder.join("demo.mcap");
    let read = Command::new(&python).args(["-c", READER]).arg(out).output();
    let read = read.expect("it can be started");
    let counts = String::from_utf8_lossy(&read.stdout);
    let wanted = "[('/eye/events', 1), ('/eye/seen', 4999)]\n";
    assert_eq!(counts, wanted, "{read:?}");
}
