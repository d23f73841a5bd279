//! DAG files on the machine: generated files run by the rules, and the guest itself finds the
//! faults of a wrong file.

use std::fs;
use std::path::PathBuf;
use std::process::{Command, Output};

use harness::file::File;
use harness::markdown::{blocks, page};
use harness::{Guest, Members, Said};
use lab::golden;
use tool::{Outcome, system};
use views::protocol::Status;

const GOOD: &str = "dag x period 10ms\nsubtask a wcet 2ms\nsubtask b wcet 3ms\nedge a -> b\nend\n";

/// Boots the app with a file of `content`, which must end in `status`.
fn boot(content: &[u8], words: &str, status: Status) -> Outcome {
    let file = File::of("dag-file", "dag", content);
    let guest = Guest::new("dag-file").cores(4).module(&file.0);
    guest.word(words).end_in(status)
}

fn run(text: &str, words: &str) -> Outcome {
    boot(text.as_bytes(), words, Status::Success)
}

#[track_caller]
fn is_refused(content: &[u8], words: &str, why: &str) {
    let reason = boot(content, words, Status::Usage).reason();
    assert!(reason.contains(why), "{words}: {reason}\n  not: {why}");
}

/// Returns a generated file as the guest gets it: a copy in our format, made by the converter.
fn generated(name: &str) -> String {
    page(&format!("apps/dag-file/examples/converted/{name}"))
}

#[test]
fn generated_dags_run_without_violation_within_their_bounds() {
    for (name, dags) in [("fifo_05.dag", 1), ("gnp_03.dag", 1), ("chain_04.dag", 3)] {
        for words in [
            "policy=static",
            "policy=edf execution=uniform:0.2..1 seed=7",
        ] {
            let words = format!("jobs=20 overheads_ns=1000,10000,4000 {words}");
            let outcome = run(&generated(name), &words);
            let set = outcome.line("dag_set");
            set.has([("violations", 0), ("allocations", 0), ("dags", dags)]);
            for dag in outcome.lines("dag_run") {
                dag.has([("completed", 20)]);
                if name == "gnp_03.dag" && words.contains("static") {
                    // With the overheads stated the bound holds, and is near.
                    let tightness = dag.number("tightness_permille");
                    assert!((900..=1000).contains(&tightness), "{}", dag.text);
                }
            }
        }
    }
}

#[test]
fn what_waits_leaves_its_core_to_others_within_all_bounds() {
    let file = system::workspace().join("apps/dag-file/examples/accelerator.dag");
    let text = fs::read_to_string(file).expect("an example");
    for words in [
        "cores=0 policy=edf execution=uniform:0.3..1 seed=3",
        "cores=0,1 policy=static",
        "policy=static",
    ] {
        let words = format!("jobs=20 overheads_ns=1000,10000,4000,1000 {words}");
        let outcome = run(&text, &words);
        outcome
            .line("dag_set")
            .has([("violations", 0), ("allocations", 0)]);
        for dag in outcome.lines("dag_run") {
            dag.has([("completed", 20), ("deadline_misses", 0)]);
            assert!(dag.number("tightness_permille") <= 1000, "{}", dag.text);
        }
    }
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
    let (first, again) = (run(&text, measured), run(&text, measured));
    let figures = first.line("overheads");
    assert_eq!(figures.text, again.line("overheads").text);
    // 20 jobs of a subtask for each core, 18 of the fork, 16 of the chain and fifteen more.
    figures.has([
        ("dispatches", 20 * (4 + 18 + 16 + 15)),
        ("releases", 20 * 18),
        ("margin_percent", 10),
    ]);
    let charged = |name| (figures.number(name) * 110).div_ceil(100);
    let (owed_ns, late_ns) = (charged("owed_ns"), charged("late_ns"));
    assert!(owed_ns > 1_000 && late_ns > 1_000, "{}", figures.text);
    // The same numbers, stated.
    let (dispatch_ns, ready_ns) = (owed_ns + late_ns, owed_ns.div_ceil(10));
    let stated = format!("jobs=50 overheads_ns=0,{dispatch_ns},{owed_ns},{ready_ns}");
    let stated = run(&text, &stated);
    assert_eq!(stated.lines("overheads").len(), 0);
    let bounds = |outcome: &Outcome| -> Vec<u64> {
        let rows = outcome.lines("dag_run").into_iter();
        rows.map(|row| {
            assert!(row.number("tightness_permille") <= 1000, "{}", row.text);
            row.number("bound_ns")
        })
        .collect()
    };
    assert_eq!(bounds(&first).len(), 2);
    assert_eq!(bounds(&first), bounds(&stated));
}

#[test]
fn a_call_may_take_longer_than_its_wcet_by_the_charge_of_each_segment() {
    let text = format!(
        "dag w period 20ms\nsubtask s wcet 10us{}\nend\n",
        " wait 1us wcet 10us".repeat(20)
    );
    let outcome = run(&text, "jobs=20 overheads_ns=1000,10000,4000,1000");
    assert_eq!(
        outcome.lines("wcet_exceeded").len(),
        0,
        "{}",
        outcome.tail()
    );
}

#[test]
fn measured_overheads_cover_a_hundred_releases_at_once() {
    let dags = (0..100).map(|n| format!("dag x{n} period 100ms\nsubtask a wcet 100us\n"));
    let text = format!("{}end\n", dags.collect::<String>());
    let outcome = run(&text, "jobs=5 overheads=measured");
    let rows = outcome.lines("dag_run");
    assert_eq!(rows.len(), 100);
    for row in rows {
        assert!(row.number("tightness_permille") <= 1000, "{}", row.text);
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
    for (text, division, expected) in [
        // Two subtasks of 15 ms in all, on one core, each 10 ms.
        (&stated, "clusters=1,1", [0, 20]),
        (&left_out, "clusters=auto", [0, 0]),
    ] {
        let words = format!("jobs=20 {division} overheads_ns=1000,10000,4000");
        let outcome = run(text, &words);
        let rows = outcome.lines("dag_run").into_iter();
        let misses: Vec<u64> = rows.map(|row| row.number("deadline_misses")).collect();
        assert_eq!(misses, expected, "{}", outcome.tail());
    }
    let why = "line 4: dag `much` is in cluster 1";
    is_refused(stated.as_bytes(), "jobs=1", why);
}

#[test]
fn what_an_owner_leaves_is_lent_on_the_machine_and_on_linux() {
    let file = system::workspace().join("apps/dag-file/examples/lent.dag");
    let file = file.display().to_string();
    let of = "--cores 2 --clusters auto --jobs 20";
    let charged = "--mode deterministic --append overheads=measured";
    for (place, is_exact) in [(charged, true), ("--on linux", false)] {
        let words = [place, of].map(|words| words.split(' ')).into_iter();
        let words: Vec<&str> = words.flatten().collect();
        let said = harness::run(&file, &words);
        said.line("dag_set")
            .has([("violations", 0), ("allocations", 0)]);
        let tests = said.lines("dag_run").into_iter().map(|dag| {
            dag.has([("completed", 20)]);
            let tightness = dag.number("tightness_permille");
            assert!(!is_exact || tightness <= 1000, "{}", dag.text);
            dag.text.contains("its entries in a table") || dag.text.contains("what tables leave")
        });
        assert_eq!(tests.collect::<Vec<_>>(), [true, true]);
    }
}

/// The tests of `dag-file` have the faults of a file, the tests of the kernel's options those of a
/// word: here are the results of both.
#[test]
fn what_is_wrong_is_said_by_the_guest_with_its_line() {
    let cycle = GOOD.replace("end", "edge b -> a\nend");
    let cut = &GOOD[..GOOD.len() - 4];
    let many = (0..2000).map(|number| format!("subtask s{number} wcet 1us\n"));
    let many = format!("dag many period 1s\n{}end\n", many.collect::<String>());
    for (content, words, why) in [
        (
            "",
            "jobs=1",
            "no DAG file; give one with `qemu -initrd FILE`",
        ),
        (
            cut,
            "jobs=1",
            "DAG file, line 5: the file ends where `end` should be",
        ),
        (&cycle, "jobs=1", "DAG file, line 5: dag `x` has a cycle"),
        (&many, "jobs=1", "2000 subtasks and 4 cores need"),
        (
            GOOD,
            "jobs=1 seconds=1",
            "`jobs` and `seconds` exclude each other",
        ),
        (
            GOOD,
            "overheads=measured overheads_ns=0,0,0",
            "`overheads=measured` and `overheads_ns` exclude each other; give one",
        ),
        (
            GOOD,
            "overheads_ns=0,0,0,0,4000,0",
            "`overheads_ns` has a device interrupt as long as its distance, which leaves a core no time",
        ),
        (
            GOOD,
            "overheads_margin=5",
            "add `overheads=measured`, or leave it out",
        ),
    ] {
        is_refused(content.as_bytes(), words, why);
    }
    let why = "DAG file, line 2: it is not UTF-8 text";
    is_refused(b"dag x period 1ms\n\xff\xfe", "jobs=1", why);
}

/// Runs the script `run`, deterministically.
fn script(words: &[&str]) -> Output {
    let mut run = Command::new(system::workspace().join("scripts/run"));
    run.current_dir(system::workspace());
    run.args(["--mode", "deterministic"]).args(words);
    run.output().expect("the tool can be started")
}

#[test]
fn what_only_the_guest_finds_has_the_line_of_the_persons_file() {
    let text = "@TASK_GRAPH 0 {\nPERIOD 584000\n\tTASK a TYPE 0\n}\n@PE 0 {\n# type exec_time\n\
                0 1\n}\n";
    let file = File::of("dag-file", "tgff", text);
    let path = file.0.to_str().expect("UTF-8");
    let words = ["--timeout", "100", "--dag", path];
    let output = script(&[&words[..], &["--append", "jobs=1000000"]].concat());
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{said}");
    let reason = format!("run: {path}:1: the deadline of the last job of dag");
    assert!(said.contains(&reason), "{said}");
}

#[test]
fn misses_are_a_failure_only_where_none_may_be_missed() {
    let late = GOOD.replace("period 10ms", "period 10ms deadline 4ms");
    let _ = run(&late, "jobs=3");
    let strict = "jobs=3 deadlines=strict";
    let reason = boot(late.as_bytes(), strict, Status::Failure).reason();
    assert_eq!(reason, "dag `x` missed 3 deadlines, and none may be missed");
}

#[test]
fn the_pages_commands_name_files_that_are_there_and_the_first_one_runs() {
    let blocks = blocks(&page("docs/dag-file.md"));
    let of_info = |info: &str| blocks.iter().find(|block| block.info == info);
    let commands = of_info("console").expect("commands").text.lines();
    let commands = commands.map(|line| {
        let words = line.split(" #").next().unwrap_or_default();
        let words = words.split_whitespace();
        words
            .skip_while(|word| *word != "--dag")
            .collect::<Vec<_>>()
    });
    let commands: Vec<_> = commands.collect();
    assert_eq!(commands.len(), 7);
    for words in &commands {
        let path = system::workspace().join(words[1]);
        assert!(path.exists(), "{} is not there", words[1]);
    }
    let text = &of_info("text").expect("the example").text;
    golden::assert_is("docs/dag-file.md", "```text\n", text, &page(commands[0][1]));

    let written = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("demo.trace");
    let written = written.to_str().expect("UTF-8");
    let more = ["--trace", written];
    let output = script(&[&commands[0][..], &more].concat());
    let said = String::from_utf8_lossy(&output.stdout);
    assert_eq!(output.status.code(), Some(0), "{said}");
    assert!(said.contains("\"dag\":\"camera\""), "{said}");
    // What else was written is said.
    let hint = |line: &str| line.starts_with(&format!("{written}: "));
    assert!(said.lines().any(hint), "{said}");
}

/// Draws a page's pictures by the page's commands; before each drawing command comes a run.
fn assert_drawn(document: &str, pictures: usize) {
    let trace = File::new("picture", "trace");
    let shown = blocks(&page(document)).into_iter();
    let shown = shown.filter(|block| block.text.contains("--svg"));
    let commands: Vec<String> = shown
        .flat_map(|block| block.text.lines().map(String::from).collect::<Vec<_>>())
        .collect();
    assert_eq!(commands.len(), 2 * pictures, "{document}");
    for command in commands {
        let (command, picture) = match command.split_once(" -o ") {
            Some((command, picture)) => (command, Some(picture)),
            None => (&*command, None),
        };
        let mut words = command.trim_start_matches("$ ").split_whitespace();
        let program = words.next().expect("a command");
        let words = words.map(|word| match word {
            "run.trace" => trace.0.as_os_str(),
            word => word.as_ref(),
        });
        let mut command = Command::new(system::workspace().join(program));
        let output = command
            .args(words)
            .current_dir(system::workspace())
            .output();
        let Output {
            status,
            stdout,
            stderr,
        } = output.expect("it can be started");
        let stderr = String::from_utf8_lossy(&stderr);
        assert!(status.success(), "{program}: {stderr}");
        let Some(picture) = picture else { continue };
        let drawn = String::from_utf8(stdout).expect("text");
        let file = format!("docs/{picture}");
        let kept = page(&file);
        let [kept, drawn] = [&kept, &drawn].map(|text| &text["<svg".len()..]);
        golden::assert_is(&file, "<svg", kept, drawn);
    }
}

#[test]
fn the_pages_pictures_are_what_their_commands_draw() {
    assert_drawn("README.md", 1);
    assert_drawn("docs/guide.md", 2);
    assert_drawn("docs/bounds.md", 1);
}
