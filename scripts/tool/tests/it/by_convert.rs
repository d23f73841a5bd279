//! `scripts/convert`: files of other formats against the expected words of `tests/convert`, damaged
//! ones, the way out and in again, and `run --dag` with them. YAML needs PyYAML.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use random::Random;
use tool::system::workspace;

use crate::support::{Called, assert_refused, folder, succeed};

/// Converts many files in one process; no fault of a file may end it.
const MANY: &str = "
import sys
code = compile(open(sys.argv[1]).read(), sys.argv[1], 'exec')
for path in sys.argv[2:]:
    # A new one for each file, which remembers nothing.
    convert = {'__name__': 'convert', '__doc__': ''}
    exec(code, convert)
    print(convert['main']([path, '--lines', '-o', path + '.out']), flush=True)
    print('==', flush=True, file=sys.stderr)
";

fn convert(folder: &Path, line: &str) -> Called {
    let mut command = Command::new(workspace().join("scripts/convert"));
    let output = command.args(line.split(' ')).current_dir(folder).output();
    Called::of(output.expect("python3 converts; install it"))
}

/// Converts files, and returns the exit code and the complaints of each.
fn convert_all(folder: &Path, names: &[String]) -> Vec<(String, String)> {
    let mut python = Command::new("python3");
    python.args(["-B", "-c", MANY]);
    python.arg(workspace().join("scripts/convert"));
    let output = python.args(names).current_dir(folder).output();
    let called = Called::of(output.expect("python3 starts"));
    assert_eq!(called.code, Some(0), "{}", called.complaint);
    let said = called.complaint.split("==\n").map(String::from);
    called.out.lines().map(String::from).zip(said).collect()
}

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).expect("a folder").flatten();
    let files = entries.filter(|entry| entry.path().is_file());
    let mut names: Vec<String> = files
        .map(|file| file.file_name().into_string().expect("UTF-8"))
        .collect();
    names.sort();
    names
}

/// A copy of the files to convert, in a folder of one test.
fn copied(test: &str) -> PathBuf {
    let to = folder(test);
    fs::create_dir(to.join("times")).expect("a folder");
    for (from, part) in [
        ("scripts/tool/tests/convert/in", ""),
        ("scripts/tool/tests/convert/in/times", "times"),
        // As their own tools wrote them.
        ("apps/dag-file/examples/others", ""),
    ] {
        let from = workspace().join(from);
        for name in names(&from) {
            fs::copy(from.join(&name), to.join(part).join(&name)).expect("a file");
        }
    }
    to
}

#[test]
fn each_format_comes_in_as_expected_and_what_is_left_out_or_wrong_is_told() {
    let folder = copied("formats");
    let names = names(&folder);
    let mut found = String::new();
    for (name, (code, said)) in names.iter().zip(convert_all(&folder, &names)) {
        let out = fs::read_to_string(folder.join(format!("{name}.out"))).unwrap_or_default();
        assert_eq!(out.is_empty(), code == "2", "{name}: {said}");
        found += &format!("== {name}\n{said}{out}");
    }
    fs::write(folder.join("found.txt"), &found).expect("a file");
    let place = workspace().join("scripts/tool/tests/convert/expected.txt");
    let expected = fs::read_to_string(place).expect("it is in the tree");
    let all = found.lines().zip(expected.lines());
    if let Some((found, expected)) = all.into_iter().find(|(found, expected)| found != expected) {
        panic!(
            "{found}\nnot: {expected}\nall: {}/found.txt",
            folder.display()
        );
    }
    assert_eq!(found.len(), expected.len(), "{}", folder.display());
}

/// Changes, drops or repeats a part of a text, differently for each draw.
fn damaged(text: &str, random: &mut Random) -> String {
    let mut below = |most: usize| random.index(most);
    let from = below(text.len());
    let to = (from + below(12)).min(text.len());
    let (before, part, rest) = (&text[..from], &text[from..to], &text[to..]);
    match below(4) {
        0 => [before, rest].concat(),
        1 => [before, part, part, rest].concat(),
        2 => {
            let other = ["-", "#", "\n", "9", " ", "'", "[", "{", "\"", "e9"][below(10)];
            [before, other, part, rest].concat()
        }
        _ => before.into(),
    }
}

#[test]
fn a_damaged_file_is_refused_in_one_line_or_becomes_one_that_our_reader_takes() {
    let folder = copied("damaged");
    let mut random = Random::new(62);
    let mut damages = Vec::new();
    let all = names(&folder);
    let codes = convert_all(&folder, &all).into_iter();
    let good = all.iter().zip(codes).filter(|(_, (code, _))| code == "0");
    for (name, _) in good {
        let text = fs::read_to_string(folder.join(name)).expect("UTF-8");
        for number in 0..20 {
            let damage = format!("{number}-{name}");
            fs::write(folder.join(&damage), damaged(&text, &mut random)).expect("a file");
            damages.push(damage);
        }
    }
    let mut refused = 0;
    for (name, (code, said)) in damages.iter().zip(convert_all(&folder, &damages)) {
        assert!(
            said.lines()
                .all(|line| line.starts_with(&format!("{name}:"))),
            "{said}"
        );
        if code == "2" {
            refused += 1;
            assert_eq!(said.lines().count(), 1, "{said}");
        } else {
            let out = fs::read_to_string(folder.join(format!("{name}.out"))).expect("a file");
            let read = fass_dag_file::parse(&out);
            assert!(read.is_ok(), "{name}: {:?}\n{out}", read.err());
        }
    }
    assert!(refused > 50 && refused + 50 < damages.len(), "{refused}");
}

#[test]
fn examples_in_our_format_are_the_converters() {
    let examples = workspace().join("apps/dag-file/examples");
    let folder = folder("examples");
    let names = names(&examples.join("rd-gen"));
    for name in &names {
        fs::copy(examples.join("rd-gen").join(name), folder.join(name)).expect("a file");
    }
    convert_all(&folder, &names);
    for name in &names {
        let out = fs::read_to_string(folder.join(format!("{name}.out"))).expect("a file");
        let bare = |line: &str| line.split(" # ").next().unwrap_or_default().to_string() + "\n";
        let copy = examples.join("converted").join(name.replace("yaml", "dag"));
        let copy = fs::read_to_string(copy).expect("a copy");
        assert_eq!(out.lines().map(bare).collect::<String>(), copy, "{name}");
    }
    assert_eq!(names.len(), 24);
}

const OURS: &str = "dag a period 10ms deadline 9ms offset 1ms\nsubtask s wcet 1500us priority 0\n\
    subtask t wcet 3ms priority 2\nedge s -> t\n\ndag b period 20ms deadline 40ms\n\
    subtask u wcet 250us priority 1\n\nend\n";

/// A set with words that only our format has.
const OWN: &str = "set a\n\ndag a period 10ms in-flight 2 overrun skip # kept\n\
    subtask s samples 1ms non-preemptive priority 3\n\
    subtask t wcet 1ms wait 2ms wcet 1ms priority 1\n\
    core 0: a.s\ncertificate v1 of 0\nend\n";

/// Converts, and returns what is told to be lost.
fn lost(folder: &Path, line: &str) -> String {
    let called = convert(folder, line);
    assert_eq!(called.code, Some(0), "{}", called.complaint);
    called.complaint
}

#[test]
fn sets_go_out_to_others_and_come_back() {
    let folder = folder("out");
    fs::write(folder.join("ours.dag"), OURS).expect("a file");
    let read = |name: &str| fs::read_to_string(folder.join(name)).expect("a file");
    for text in [OURS, OWN] {
        fs::write(folder.join("own.dag"), text).expect("a file");
        assert_eq!(lost(&folder, "own.dag -o back.dag"), "");
        assert_eq!(read("back.dag"), text);
    }
    let said = lost(&folder, "own.dag --to yaml -o survey.yaml");
    assert!(
        said.contains("own.dag:4: the WCET of a subtask that states none is"),
        "{said}"
    );
    let said = lost(&folder, "ours.dag --to yaml -o survey.yaml");
    assert!(
        said.contains("ours.dag:1: offsets are left out\n"),
        "{said}"
    );
    assert!(said.contains("priorities are left out, "), "{said}");
    lost(&folder, "survey.yaml --unit 250us -o back.dag");
    let mut plain = OURS.replace(" offset 1ms", "");
    (0..3).for_each(|n| plain = plain.replace(&format!(" priority {n}"), ""));
    assert_eq!(read("back.dag"), plain);

    let said = lost(&folder, "ours.dag --to simso --cores 2 -o simso.xml");
    assert!(
        said.contains("ours.dag:1: dag `a` becomes one task"),
        "{said}"
    );
    assert_eq!(read("simso.xml").matches("<processor ").count(), 2);
    lost(&folder, "simso.xml -o back.dag");
    let joined = "subtask a wcet 4500us\n\ndag b period 20ms deadline 40ms\nsubtask b wcet";
    assert!(read("back.dag").contains(joined), "{}", read("back.dag"));
}

#[test]
fn jobs_and_precedences_go_out_as_a_pair_of_tables() {
    let folder = folder("tables");
    fs::write(folder.join("ours.dag"), OURS).expect("a file");
    let read = |name: &str| fs::read_to_string(folder.join(name)).expect("a file");
    let said = lost(&folder, "ours.dag --to sag -o sag.csv");
    assert!(
        said.contains("ours.dag:2: a job executes to its end there"),
        "{said}"
    );
    assert!(said.contains("is no proof for ever\n"), "{said}");
    // Offsets: up to 1 ms and twice the hyperperiod of 20 ms.
    let (jobs, edges) = (read("sag.csv"), read("sag.prec.csv"));
    let head = "Task ID, Job ID, Arrival min, Arrival max, Cost min, Cost max, Deadline, Priority\n\
                1, 1, 1000000, 1000000, 0, 1500000, 10000000, 0\n\
                2, 2, 1000000, 1000000, 0, 3000000, 10000000, 2\n\
                1, 3, 11000000, 11000000, 0, 1500000, 20000000, 0\n";
    assert!(jobs.starts_with(head), "{jobs}");
    let last = "\n3, 11, 40000000, 40000000, 0, 250000, 80000000, 1\n";
    assert!(jobs.ends_with(last), "{jobs}");
    let head =
        "Predecessor TID, Predecessor JID, Successor TID, Successor JID\n1, 1, 2, 2\n1, 3, 2, 4\n";
    assert!(edges.starts_with(head), "{edges}");
    // Jobs of `b` overlap; of its subtask one instance comes after the other.
    assert!(edges.ends_with("\n3, 9, 3, 10\n3, 10, 3, 11\n"), "{edges}");
    // Under EDF a subtask is as urgent as the most urgent sink that follows.
    let sinks = "dag a period 9ns\nsubtask s wcet 1ns\nsubtask t wcet 1ns deadline 5ns\n\
                 subtask u wcet 1ns\nedge s -> u\nedge s -> t\nend\n";
    fs::write(folder.join("sinks.dag"), sinks).expect("a file");
    let said = lost(&folder, "sinks.dag --to sag -o sag.csv");
    assert!(!said.contains("no proof"), "{said}");
    let rows = "\n1, 1, 0, 0, 0, 1, 5, 5\n2, 2, 0, 0, 0, 1, 5, 5\n3, 3, 0, 0, 0, 1, 9, 9\n";
    assert!(read("sag.csv").ends_with(rows), "{}", read("sag.csv"));
}

#[test]
fn a_command_line_that_is_wrong_is_refused_in_a_line() {
    let folder = folder("convert-line");
    fs::write(folder.join("ours.dag"), OURS).expect("a file");
    // PyYAML's composer in C overflows its stack by it.
    fs::write(folder.join("deep.yaml"), "[".repeat(100_000)).expect("a file");
    // Each was quadratic.
    let quotes = format!("digraph a {{ {}", "\\\"".repeat(40_000));
    fs::write(folder.join("quotes.dot"), quotes).expect("a file");
    let blanks = format!("digraph a {{ a [b=1]{}{{ }}", " ".repeat(40_000));
    fs::write(folder.join("blanks.dot"), blanks).expect("a file");
    let digits = "1".repeat(3_000_000);
    let digits = format!("{{\"nodes\":[{{\"id\":\"a\",\"execution_time\":{digits}}}]}}");
    fs::write(folder.join("digits.json"), digits).expect("a file");
    fs::write(folder.join("never.dag"), OURS.replace("20ms", "0ms")).expect("a file");
    let zeros = format!("ours.dag --unit {}1ms", "0".repeat(5_000));
    let nines = format!("ours.dag --unit {}{}s", "0".repeat(25), "9".repeat(30));
    for (line, code, words) in [
        ("--help", 0, ""),
        ("ours.dag --to png", 2, "png"),
        ("deep.yaml", 2, "nested too deeply"),
        ("quotes.dot", 2, "of DOT nodes, edges"),
        ("blanks.dot", 2, "of DOT nodes, edges"),
        ("digits.json", 2, "is no time"),
        ("never.dag --to sag -o a.csv", 2, "a period of 0"),
        ("ours.dag --to yaml --unit 1s", 2, "give another --unit"),
        (zeros.as_str(), 0, ""),
        (nines.as_str(), 2, "is no time"),
        // Never read, as it has no end.
        ("/dev/zero", 2, "the ending of its name tells no format"),
        ("none.yaml", 2, "No such file or directory"),
        ("ours.dag -o none/a.dag", 1, "No such file or directory"),
        ("ours.dag --to sag", 2, "FILE.csv"),
    ] {
        let Called {
            code: found,
            complaint,
            ..
        } = convert(&folder, line);
        assert_eq!(found, Some(code), "{line}: {complaint}");
        assert!(complaint.contains(words), "{complaint}");
        assert_eq!(
            complaint.lines().count(),
            usize::from(code > 0),
            "{complaint}"
        );
    }
}

#[test]
fn a_run_converts_and_its_own_faults_have_the_lines_of_the_file() {
    let folder = copied("run");
    let odd = "\u{feff}nodes:\n- id: a\n  execution_time: 5\n  end_to_end_deadline: 9\n";
    fs::write(folder.join("#h.YAML"), odd).expect("a file");
    for (file, words) in [
        ("#h.YAML", "dag _#h period 9ms"),
        (
            "measured-times.yaml --unit 1us",
            "wcet 4100us samples 4ms,4100us,3900us",
        ),
        ("exponent.yaml --unit 1ms", "subtask 0 wcet 10ns"),
        (
            "graphs.json --graph b_c --unit 100us",
            "dag b_c period 350us",
        ),
        ("rdgen.dot", "subtask 2 wcet 7ms"),
        ("task-graph.tgff", "deadline 15ms"),
    ] {
        let printed = succeed(&folder, &format!("run --print-dag --dag {file}"));
        assert!(printed.contains(words), "{printed}");
        fs::write(folder.join("printed.dag"), &printed).expect("a file");
        let again = succeed(&folder, "run --print-dag --dag printed.dag");
        assert_eq!(again, printed);
    }
    let late = "# a comment\nnodes:\n- id: b\n  execution_time: 9\n  end_to_end_deadline: 500000000\n  \
                period: 500000000\n  offset: 18000000000\n";
    fs::write(folder.join("late.yaml"), late).expect("a file");
    let slow = format!("{{\"a\":[{}1]}}", "1,".repeat(2_000_000));
    fs::write(folder.join("slow.json"), slow).expect("a file");
    let rows = "
run --on host --timeout 1 --dag slow.json | slow.json: its conversion took too long; `--timeout` gives it longer
run --dag branching.yaml | branching.yaml:16: `branch_unit_id`: conditional branches are not run
run --dag cycle.yaml | cycle.yaml:9: dag `cycle` has a cycle
run --dag graphs.json --graph d | graphs.json:1: there is no graph `d`; name one of the 2
run --dag rdgen.dot --graph d | `--graph d` is for a set of task graphs in JSON; leave it out
run --dag late.yaml --unit 1s | late.yaml:3: the deadline of the first job of dag";
    assert_refused(&folder, rows.trim_start());
}
