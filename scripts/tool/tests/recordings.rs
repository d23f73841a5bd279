//! The command `recording`: tables become recordings and come back, what is wrong is refused,
//! and an independent reader opens the MCAP file.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use recording::{Channel, DagHeader, Entry, Header, Recordable, Role, What, Writer, to_bytes};

fn run(words: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_fass-tool"));
    command.arg("recording").args(words);
    command.output().expect("the tool can be started")
}

/// A folder of a test, removed with this value.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Folder {
        let folder = std::env::temp_dir().join(format!("{name}-{}", std::process::id()));
        fs::create_dir_all(&folder).expect("a folder");
        Folder(folder)
    }

    fn file(&self, name: &str) -> String {
        self.0.join(name).to_str().expect("UTF-8").into()
    }

    fn write(&self, name: &str, content: &[u8]) -> String {
        fs::write(self.0.join(name), content).expect("a file in it");
        self.file(name)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

type Value = (String, Option<f64>, [i16; 2], Vec<u64>);

/// A recording of 5,000 values, and of something else.
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
    for job in 0..5_000 {
        let value: Value = (
            format!("job \"{job}\", \n"),
            [None, Some(0.1), Some(f64::NAN)][usize::try_from(job % 3).expect("small")],
            [-1, 7],
            vec![u64::MAX; usize::try_from(job % 4).expect("small")],
        );
        let (what, bytes) = match job {
            70 => (What::Lost, Vec::new()),
            _ => (What::Value, to_bytes(&value)),
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
    writer.finish()
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr)
}

#[test]
fn a_recording_is_shown_and_becomes_tables() {
    let folder = Folder::new("recording-shown");
    let file = folder.write("demo.rec", &recording());
    let tables = folder.file("tables");
    let output = run(&[&file, "--csv", &tables]);
    let said = said(&output);
    assert!(output.status.success(), "{said}");
    assert!(
        said.contains("source `seen` of dag `eye`: 4999 values of (text, f64?, [i16; 2], [u64])"),
        "{said}"
    );
    assert!(said.contains("incomplete: 1 values are lost"), "{said}");
    let table = fs::read_to_string(Path::new(&tables).join("eye.seen.csv")).expect("a table");
    let begin = "job,release_ns,at_ns,0,1,2_0,2_1,3\n\
        0,0,250,\"job \"\"0\"\", \n\",,-1,7,[]\n\
        1,1000000,1000250,\"job \"\"1\"\", \n\",0.1,-1,7,[18446744073709551615]\n";
    assert!(table.starts_with(begin), "{}", &table[..300]);
    let events = fs::read_to_string(Path::new(&tables).join("events.csv")).expect("a table");
    assert_eq!(
        events,
        "what,dag,subtask,job,release_ns,at_ns\nlost,eye,2,70,70000000,70000250\n"
    );
}

#[test]
fn a_table_becomes_a_recording_and_the_same_table() {
    let folder = Folder::new("recording-table");
    let table = "job,release_ns,at_ns,at_x,at_y,name,truth\n\
        0,0,5,0.1,-1e300,\"a \"\"b\"\", c\",true\n\
        2,20,25,NaN,inf,,false\n";
    let input = folder.write("in.csv", table.as_bytes());
    let (out, tables) = (folder.file("out.rec"), folder.file("tables"));
    let schema = "Row { at: At { x: f64, y: f64 }, name: text, truth: bool }";
    let output = run(&[
        &input,
        "--from-csv",
        "--out",
        &out,
        "--dag",
        "d",
        "--topic",
        "t",
        "--type",
        schema,
    ]);
    assert!(output.status.success(), "{}", said(&output));
    let output = run(&[&out, "--csv", &tables]);
    assert!(output.status.success(), "{}", said(&output));
    let back = fs::read_to_string(Path::new(&tables).join("d.t.csv")).expect("a table");
    assert_eq!(back, table);
}

#[test]
fn what_is_no_recording_and_no_such_table_is_refused_in_one_line() {
    let folder = Folder::new("recording-refused");
    let whole = recording();
    let mut altered = whole.clone();
    altered[whole.len() / 2] ^= 4;
    let mut newer = whole.clone();
    newer[8] = 4;
    let half = &whole[..whole.len() - 30];
    for (name, content, words) in [
        (
            "altered",
            &altered[..],
            "expected the checksum of all before; the file is altered",
        ),
        (
            "newer",
            &newer,
            "at byte 8: expected version 1 to 3 of recordings",
        ),
        (
            "half",
            half,
            "expected a frame of the length that it states, and more after it",
        ),
        (
            "foreign",
            b"job,x\n",
            "at byte 0: expected the mark of a recording",
        ),
    ] {
        let file = folder.write(name, content);
        let output = run(&[&file]);
        let said = said(&output);
        assert_eq!(
            (output.status.code(), said.lines().count()),
            (Some(2), 1),
            "{said}"
        );
        assert!(
            said.starts_with(&format!("recording: {file}: ")) && said.contains(words),
            "{said}"
        );
    }
    let out = folder.file("out.rec");
    for (table, options, words) in [
        (
            "a,b\n1,2\n",
            "",
            ":1: there is no column release_ns; say by --period",
        ),
        (
            "a,b\n1\n",
            "--period 1ms",
            ":2: 1 cells, and there are 2 columns",
        ),
        (
            "a,b\n1,x\n",
            "--period 1ms",
            ":2: `x` is no value of type f64",
        ),
        (
            "a\n\"1\n",
            "--period 1ms",
            ":2: a cell that begins with a quotation mark has no end",
        ),
        (
            "a,job\n1,x\n",
            "--period 1ms",
            ":2: `x` is no whole number, as column `job` has them",
        ),
        (
            "a,b\n1,2\n",
            "--period 1ms --type [f64;3]",
            "there are 2 columns for them (a, b)",
        ),
        (
            "a,b\n1,2\n",
            "--period 1ms --type [f64;",
            "`--type`, column 6: expected a number",
        ),
        (
            "a\n1\n",
            "--period 1ms --ignore b",
            "there is no column `b`; there are a",
        ),
        (
            "a,b,a\n1,2,3\n",
            "--period 1ms",
            ":1: there are two columns `a`; rename one, or --ignore both",
        ),
        (
            "job,a,job\n1,2,3\n",
            "--period 1ms",
            ":1: there are two columns `job`",
        ),
        (
            "job,a\n1,2\n0,2\n1,3\n",
            "--period 1ms",
            ":4: job 1 stands in line 2 already; number them apart",
        ),
        ("", "--period 1ms", ":1: the table is empty"),
        (
            "a\nx\n",
            "--period 1ms --type [text;257]",
            ":2: an array of more than 256 columns, [text; 257], is not read from a table",
        ),
        (
            "a\n1\n",
            "--period 1ms --type [[[[[[u8;64];64];64];64];64];64]",
            ":2: an array of more than 256 columns",
        ),
    ] {
        let file = folder.write("table.csv", table.as_bytes());
        let mut words_given = vec![
            &*file,
            "--from-csv",
            "--dag",
            "d",
            "--topic",
            "t",
            "-o",
            &out,
        ];
        words_given.extend(options.split_whitespace());
        let output = run(&words_given);
        let said = said(&output);
        assert_eq!(
            (output.status.code(), said.lines().count()),
            (Some(2), 1),
            "{said}"
        );
        assert!(said.contains(words), "{said}");
    }
    assert!(!Path::new(&out).exists());
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
    let folder = Folder::new("recording-mcap");
    let file = folder.write("demo.rec", &recording());
    let out = folder.file("demo.mcap");
    let output = run(&[&file, "--mcap", &out]);
    assert!(output.status.success(), "{}", said(&output));
    assert!(said(&output).contains("demo.mcap: 5000 messages"));
    // `./scripts/test` counts the lack of it as skipped.
    let python = match tool::recordings::independent_reader() {
        Ok(python) => python,
        Err(why) => return eprintln!("skipped: {why}"),
    };
    let read = Command::new(&python).args(["-c", READER, &out]).output();
    let read = read.expect("it can be started");
    let counts = String::from_utf8_lossy(&read.stdout);
    let wanted = "[('/eye/events', 1), ('/eye/seen', 4999)]\n";
    assert_eq!(counts, wanted, "{}", said(&read));
}

#[test]
fn what_is_recorded_of_a_job_is_shown() {
    let folder = Folder::new("recording-until");
    let file = folder.write("demo.rec", &recording());
    let said = |job: &str| {
        let output = run(&[&file, "--until", job]);
        (output.status.code(), said(&output))
    };
    let (code, shown) = said("eye/4");
    assert_eq!(code, Some(0), "{shown}");
    assert_eq!(
        shown,
        "job 4 of dag `eye`, due at 4000000 ns\n  4000250 ns, subtask 2, source `seen`: \
         [\"job \\\"4\\\", \\u000a\",0.1,[-1,7],[]]\n"
    );
    assert!(said("eye/70").1.ends_with("source `seen`: lost\n"));
    for (job, words) in [
        ("eye", "DAG/JOB is wanted"),
        ("ear/1", "there is no dag `ear`; there are `eye`"),
        ("eye/5000", "nothing is recorded of job 5000"),
    ] {
        let (code, shown) = said(job);
        assert_eq!(code, Some(2), "{shown}");
        assert!(shown.contains(words), "{shown}");
    }
}
