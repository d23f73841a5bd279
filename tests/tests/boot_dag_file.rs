//! DAG files on the machine: generated ones run by the rules, and what is wrong with
//! a file the guest finds out itself.

use std::fs;
use std::path::PathBuf;
use std::process::Command;

use dag_file::Length;
use harness::Guest;
use tool::dag_file::{Import, load};
use tool::golden::Golden;
use tool::protocol::Status;
use tool::{Outcome, system};

const GOOD: &str = "dag x period 10ms\nsubtask a wcet 2ms\nsubtask b wcet 3ms\nedge a -> b\nend\n";

/// Boots the app with a file of `content`, which must end in `status`.
fn boot(content: &[u8], words: &str, status: Status) -> Outcome {
    let file = system::new_log("dag-file").expect("a folder for logs");
    let module = file.with_extension("dag");
    fs::write(&module, content).expect("a file in it");
    let guest = Guest::new("dag-file").cores(4).module(&module);
    let outcome = words.split(' ').fold(guest, Guest::word).end_in(status);
    let _ = fs::remove_file(&module);
    outcome
}

fn refusal(content: &[u8], words: &str) -> String {
    let outcome = boot(content, words, Status::Usage);
    outcome.transcript.verdict().expect("it ended so").reason
}

/// A generated file as the guest gets it.
fn generated(name: &str) -> String {
    let path: PathBuf = system::workspace()
        .join("apps/dag-file/examples/rd-gen")
        .join(name);
    let import = Import {
        unit_ns: 1_000_000,
        graph: None,
        cores: 4,
        clusters: sched_dag::Clusters::Undivided,
        length: Length::Jobs(20),
    };
    load(&path, &import).expect("it is well formed").to_string()
}

#[test]
fn generated_dags_run_without_violation() {
    for (name, dags) in [
        ("fifo_05.yaml", 1),
        ("gnp_03.yaml", 1),
        ("chain_04.yaml", 3),
    ] {
        for words in [
            "policy=static",
            "policy=edf execution=uniform:0.2..1 seed=7",
        ] {
            let words = format!("jobs=20 overheads_ns=1000,10000,4000 {words}");
            let outcome = boot(generated(name).as_bytes(), &words, Status::Success);
            let set = outcome
                .transcript
                .of_kind("dag_set")
                .next()
                .expect("a line");
            assert_eq!(set.number_at("violations"), Some(0), "{name}: {}", set.text);
            assert_eq!(
                set.number_at("allocations"),
                Some(0),
                "{name}: {}",
                set.text
            );
            assert_eq!(set.number_at("dags"), Some(dags), "{name}: {}", set.text);
            for dag in outcome.transcript.of_kind("dag_run") {
                assert_eq!(dag.number_at("completed"), Some(20), "{}", dag.text);
            }
        }
    }
}

#[test]
fn a_bound_holds_with_the_overheads_stated() {
    let words = "jobs=20 overheads_ns=1000,10000,4000";
    let outcome = boot(generated("gnp_03.yaml").as_bytes(), words, Status::Success);
    let line = outcome
        .transcript
        .of_kind("dag_run")
        .next()
        .expect("a line");
    let tightness = line.number_at("tightness_permille").expect("a bound");
    assert!((900..=1000).contains(&tightness), "{}", line.text);
}

#[test]
fn overheads_that_the_kernel_measures_are_charged_hold_and_are_the_same_again() {
    // A fork wider than the cores, and a DAG that preempts it.
    let branches: String = (0..6)
        .map(|n| format!("subtask b{n} wcet 1ms\nedge split -> b{n}\nedge b{n} -> join\n"))
        .collect();
    let text = format!(
        "dag wide period 10ms\nsubtask split wcet 200us\nsubtask join wcet 200us\n{branches}\
         dag quick period 2ms offset 1ms\nsubtask a wcet 100us\nsubtask b wcet 100us\n\
         edge a -> b\nend\n"
    );
    let measured = "jobs=50 overheads=measured overheads_margin=10";
    let first = boot(text.as_bytes(), measured, Status::Success);
    let again = boot(text.as_bytes(), measured, Status::Success);
    let line = |outcome: &Outcome| outcome.transcript.of_kind("overheads").next().cloned();
    let figures = line(&first).expect("the kernel says what it has measured");
    let of_again = line(&again).expect("a line");
    assert_eq!(figures.text, of_again.text);
    let figure = |name| figures.number_at(name).expect("it is there");
    // 20 jobs of a subtask for each core, 18 of the fork, 16 of the chain and twelve more.
    assert_eq!(figure("dispatches"), 20 * (4 + 18 + 16 + 12));
    assert_eq!(figure("releases"), 20 * 15);
    assert_eq!(figure("margin_percent"), 10);
    let charged = |name| (figure(name) * 110).div_ceil(100);
    let (owed_ns, late_ns) = (charged("owed_ns"), charged("late_ns"));
    assert!(owed_ns > 1_000 && late_ns > 1_000, "{}", figures.text);
    // The same numbers, stated.
    let (dispatch_ns, ready_ns) = (owed_ns + late_ns, owed_ns.div_ceil(10));
    let stated = format!("jobs=50 overheads_ns=0,{dispatch_ns},{owed_ns},{ready_ns}");
    let stated = boot(text.as_bytes(), &stated, Status::Success);
    assert!(line(&stated).is_none());
    let bounds = |outcome: &Outcome| -> Vec<Option<u64>> {
        let rows = outcome.transcript.of_kind("dag_run");
        rows.map(|row| {
            let tightness = row.number_at("tightness_permille");
            assert!(tightness.is_some_and(|it| it <= 1000), "{}", row.text);
            row.number_at("bound_ns")
        })
        .collect()
    };
    assert_eq!(bounds(&first).len(), 2);
    assert_eq!(bounds(&first), bounds(&stated));
}

#[test]
fn measured_overheads_cover_a_hundred_releases_at_once() {
    let dags = (0..100).map(|n| format!("dag x{n} period 100ms\nsubtask a wcet 100us\n"));
    let text = format!("{}end\n", dags.collect::<String>());
    let words = "jobs=5 overheads=measured";
    let outcome = boot(text.as_bytes(), words, Status::Success);
    let rows = outcome.transcript.of_kind("dag_run");
    let tightness = rows.filter_map(|row| row.number_at("tightness_permille"));
    let tightness: Vec<u64> = tightness.collect();
    assert_eq!(tightness.len(), 100, "not all are proven");
    assert!(tightness.iter().all(|&it| it <= 1000), "{tightness:?}");
}

#[test]
fn words_for_overheads_that_make_no_sense_are_refused() {
    for (words, part) in [
        (
            "overheads=measured overheads_ns=0,0,0",
            "`overheads=measured` and `overheads_ns` exclude each other; give one",
        ),
        (
            "overheads_margin=5",
            "add `overheads=measured`, or leave it out",
        ),
        (
            "overheads=mesured",
            "`overheads=mesured`: allowed are stated, measured",
        ),
    ] {
        let reason = refusal(GOOD.as_bytes(), words);
        assert!(reason.contains(part), "{words}: {reason}");
    }
}

#[test]
fn dags_run_in_the_clusters_that_they_state_or_that_the_commit_finds() {
    let file = |cluster: fn(u32) -> String| {
        let dag = |name: &str, number, wcets: [&str; 2]| {
            let [a, b] = wcets;
            let cluster = cluster(number);
            format!("dag {name} period 10ms{cluster}\nsubtask a wcet {a}\nsubtask b wcet {b}\n")
        };
        let much = dag("much", 1, ["8ms", "7ms"]);
        format!("{}{much}end\n", dag("little", 0, ["2ms", "2ms"]))
    };
    let stated = file(|cluster| format!(" cluster {cluster}"));
    let left_out = file(|_| String::new());
    for (text, division) in [(&stated, "clusters=1,1"), (&left_out, "clusters=auto")] {
        let words = format!("jobs=20 {division} overheads_ns=1000,10000,4000");
        let outcome = boot(text.as_bytes(), &words, Status::Success);
        let rows: Vec<_> = outcome.transcript.of_kind("dag_run").collect();
        let misses: Vec<_> = rows
            .iter()
            .map(|row| row.number_at("deadline_misses"))
            .collect();
        match division {
            // Two subtasks of 15 ms in all, on one core, each 10 ms.
            "clusters=1,1" => assert_eq!(misses, [Some(0), Some(20)]),
            _ => assert_eq!(misses, [Some(0), Some(0)], "{}", outcome.tail()),
        }
    }
    let reason = refusal(stated.as_bytes(), "jobs=1");
    assert!(
        reason.contains("line 4: dag `much` is in cluster 1"),
        "{reason}"
    );
}

#[test]
fn a_truncated_file_is_refused_by_the_guest() {
    let whole = generated("chain_04.yaml");
    for length in [whole.len() - "end\n".len(), whole.len() / 2, 30] {
        let reason = refusal(&whole.as_bytes()[..length], "jobs=1");
        assert!(reason.starts_with("DAG file, line "), "{reason}");
    }
    let all_but_end = refusal(&whole.as_bytes()[..whole.len() - 4], "jobs=1");
    assert!(
        all_but_end.contains("the file ends where `end` should be"),
        "{all_but_end}"
    );
}

#[test]
fn what_is_wrong_is_said_with_its_line() {
    let cycle = GOOD.replace("end", "edge b -> a\nend");
    for (content, words, reason) in [
        (
            "",
            "jobs=1",
            "no DAG file; give one with `qemu -initrd FILE`",
        ),
        (
            "\n",
            "jobs=1",
            "DAG file, line 2: the file ends where a `dag` record should be",
        ),
        (&cycle, "jobs=1", "DAG file, line 5: dag `x` has a cycle"),
        (
            GOOD,
            "execution=often",
            "`execution`: `often`: give wcet, uniform:0.2..1",
        ),
        (
            GOOD,
            "jobs=1 seconds=1",
            "`jobs` and `seconds` exclude each other",
        ),
        (GOOD, "jbos=1", "`jbos` is no option"),
    ] {
        let found = refusal(content.as_bytes(), words);
        assert!(found.contains(reason), "{found}\n  not: {reason}");
    }
    let found = refusal(b"dag x period 1ms\n\xff\xfe", "jobs=1");
    assert_eq!(found, "DAG file, line 2: it is not UTF-8 text");
}

#[test]
fn what_only_the_guest_finds_has_the_line_of_the_persons_file() {
    let file = system::new_log("dag-file").expect("a folder for logs");
    let file = file.with_extension("yaml");
    let text = "# a period of six days\nnodes:\n- id: 0\n  execution_time: 1\n  period: 584000\n";
    fs::write(&file, text).expect("a file in it");
    let path = file.to_str().expect("UTF-8");
    let mut run = Command::new(system::workspace().join("scripts/run"));
    run.args(["--mode", "deterministic", "--timeout", "100"]);
    run.args(["--dag", path, "--unit", "1s", "--append", "jobs=1000000"]);
    let output = run.output().expect("the tool can be started");
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{said}");
    let reason = format!("run: {path}:3: the deadline of the last job of dag");
    assert!(said.starts_with(&reason), "{said}");
    let _ = fs::remove_file(&file);
}

#[test]
fn no_jobs_and_no_seconds_are_refused_and_so_are_signs() {
    for (words, allowed) in [
        ("jobs=0", "1 to 1000000"),
        ("seconds=0", "1 to 1000000000"),
        ("jobs=+5", "1 to 1000000"),
    ] {
        let said = refusal(GOOD.as_bytes(), words);
        assert_eq!(
            said,
            format!("`{words}`: allowed are whole numbers from {allowed}")
        );
    }
}

#[test]
fn misses_are_a_failure_only_where_none_may_be_missed() {
    let late = GOOD.replace("period 10ms", "period 10ms deadline 4ms");
    boot(late.as_bytes(), "jobs=3", Status::Success);
    let outcome = boot(late.as_bytes(), "jobs=3 deadlines=strict", Status::Failure);
    let reason = outcome.transcript.verdict().expect("it ended so").reason;
    assert_eq!(reason, "dag `x` missed 3 deadlines, and none may be missed");
}

#[test]
fn more_subtasks_than_memory_are_refused() {
    let mut many = String::from("dag many period 1s\n");
    for number in 0..2000 {
        many += &format!("subtask s{number} wcet 1us\n");
    }
    let reason = refusal(format!("{many}end\n").as_bytes(), "jobs=1");
    assert!(
        reason.contains("2000 subtasks and 4 cores need"),
        "{reason}"
    );
}

#[test]
fn the_pages_commands_name_files_that_are_there_and_the_first_one_runs() {
    let page = system::workspace().join("docs/dag-file.md");
    let blocks = harness::markdown::blocks(&fs::read_to_string(page).expect("the page"));
    let of_info = |info: &str| blocks.iter().find(|block| block.info == info);
    let commands = &of_info("console").expect("commands").text;
    let words = |line: &str| -> Vec<String> {
        let command = line.split(" #").next().unwrap_or_default();
        let words = command.split_whitespace();
        words
            .skip_while(|word| *word != "--dag")
            .map(String::from)
            .collect()
    };
    let commands: Vec<Vec<String>> = commands.lines().map(words).collect();
    assert_eq!(commands.len(), 5);
    for words in &commands {
        let path = system::workspace().join(&words[1]);
        assert!(path.exists(), "{} is not there", words[1]);
    }
    let demo = system::workspace().join(&commands[0][1]);
    let demo = fs::read_to_string(demo).expect("it is there");
    let golden = Golden {
        file: "docs/dag-file.md",
        below: "```text\n",
        text: &of_info("text").expect("the example").text,
    };
    golden.assert_is(&demo);

    let written = ["dot", "trace"].map(|option| {
        let file = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("demo.{option}"));
        (
            format!("--{option}"),
            file.to_str().expect("UTF-8").to_string(),
        )
    });
    let mut run = Command::new(system::workspace().join("scripts/run"));
    run.current_dir(system::workspace());
    run.args(&commands[0]).args(["--mode", "deterministic"]);
    for (option, file) in &written {
        run.args([option, file]);
    }
    let output = run.output().expect("the tool can be started");
    let said = String::from_utf8_lossy(&output.stdout);
    assert_eq!(output.status.code(), Some(0), "{said}");
    assert!(said.contains("\"dag\":\"camera\""), "{said}");
    // What else was written is said.
    for (_, file) in &written {
        let hint = |line: &str| line.starts_with(&format!("{file}: "));
        assert!(said.lines().any(hint), "{said}");
    }
}
