//! Apps as programs of this computer, by `run --on linux`: the lines, the verdict and the exit
//! code are those of a guest, and the trace is judged and drawn as a guest's.
//!
//! By SCHED_FIFO where the host allows it, and without preemption where it does not.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use tool::protocol::Transcript;
use tool::system::workspace;

fn tool(words: &str) -> Output {
    tool_on(words, None)
}

/// Runs the tool, with another `PATH` if there is one.
fn tool_on(words: &str, path: Option<&Path>) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_fass-tool"));
    command.current_dir(workspace()).stdin(Stdio::null());
    if let Some(path) = path {
        command.env("PATH", path);
    }
    let output = command.args(words.split_whitespace()).output();
    output.expect("the tool can be started")
}

/// Runs the tool, which must succeed, and returns its standard output.
fn succeed(words: &str) -> String {
    succeed_on(words, None)
}

fn succeed_on(words: &str, path: Option<&Path>) -> String {
    let output = tool_on(words, path);
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    let complaint = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{words}:\n{said}{complaint}");
    said
}

/// A file of ours that is not there yet.
fn fresh(name: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = fs::remove_file(&path);
    path
}

#[test]
fn fork_join_says_what_it_says_on_the_machine_and_its_trace_is_judged_and_drawn() {
    let trace = fresh("on-linux.log");
    let trace = trace.display();
    let said = succeed(&format!(
        "run --app fork-join --on linux --subtasks 2,4 --longest 3 --jobs 10 --trace {trace}"
    ));
    let transcript = Transcript::read(&said);
    assert!(transcript.faults.is_empty(), "{:?}", transcript.faults);
    let lines: Vec<_> = transcript.of_kind("fork_join").collect();
    assert_eq!(lines.len(), 2, "{said}");
    for (line, subtasks) in lines.into_iter().zip([2, 4]) {
        for (member, value) in [
            ("subtasks", subtasks),
            ("jobs", 10),
            ("joins", 10),
            ("violations", 0),
            ("allocations", 0),
        ] {
            assert_eq!(line.number_at(member), Some(value), "{}", line.text);
        }
    }
    assert!(said.contains("N = 4: 10 jobs, 10 joins, 0 semantic violations"));
    // The bound is for a host that has much else to do.
    let judged = succeed(&format!("check-trace --bound-us 5000000 {trace}"));
    let checks = Transcript::read(&judged);
    assert_eq!(checks.of_kind("trace_check").count(), 2, "{judged}");
    let drawing = fresh("on-linux.json");
    succeed(&format!("trace {trace} -o {}", drawing.display()));
    assert!(drawing.is_file());
}

#[test]
fn cores_are_divided_as_on_the_machine_and_the_trace_says_how() {
    if linux_processors() < 2 {
        return;
    }
    let (file, trace) = (fresh("divided.dag"), fresh("divided.log"));
    for (cluster, clusters) in [(" cluster", "1,1"), ("", "auto")] {
        // By the commit's own division one core does each of them, too.
        let dag = |number: u32| {
            let cluster = match cluster {
                "" => String::new(),
                stated => format!("{stated} {number}"),
            };
            format!("dag d{number} period 20ms{cluster}\nsubtask a wcet 12ms\nsubtask b wcet 1ms\n")
        };
        fs::write(&file, format!("{}{}end\n", dag(0), dag(1))).expect("a file of ours");
        let said = succeed(&format!(
            "run --dag {} --on linux --cores 2 --clusters {clusters} --jobs 5 --occupy hold \
             --trace {}",
            file.display(),
            trace.display()
        ));
        let transcript = Transcript::read(&said);
        assert_eq!(transcript.of_kind("dag_run").count(), 2, "{said}");
        let written = fs::read_to_string(&trace).expect("it was written");
        let model = Transcript::read(&written);
        let begin = model.of_kind("trace_begin").next().expect("a trace");
        assert!(begin.text.contains("\"clusters\":[1,1]"), "{}", begin.text);
        let trace = trace.display();
        succeed(&format!("check-trace --bound-us 5000000 {trace}"));
    }
}

/// Returns how many processors this test may use.
fn linux_processors() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

#[test]
fn a_dag_file_is_run_and_a_graph_is_drawn() {
    let dot = fresh("on-linux.dot");
    let said = succeed(&format!(
        "run --dag apps/dag-file/examples/demo.dag --on linux --jobs 5 --dot {}",
        dot.display()
    ));
    let transcript = Transcript::read(&said);
    assert_eq!(transcript.of_kind("dag_run").count(), 2, "{said}");
    assert_eq!(transcript.of_kind("verdict").count(), 1, "{said}");
    let drawn = fs::read_to_string(dot).expect("it is written");
    assert!(drawn.starts_with("digraph"), "{drawn}");
}

/// Makes a folder of all programs that there are but QEMU's, and of no package manager.
fn programs_without_qemu() -> PathBuf {
    const MANAGERS: [&str; 5] = ["apt-get", "dnf", "pacman", "zypper", "apk"];
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("without-qemu");
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir(&folder).expect("it is ours");
    let path = std::env::var_os("PATH").expect("there is one");
    for file in std::env::split_paths(&path).filter_map(|path| fs::read_dir(path).ok()) {
        for file in file.flatten() {
            let name = file.file_name().to_string_lossy().into_owned();
            if !name.starts_with("qemu-") && !MANAGERS.contains(&&*name) {
                // Of two programs of a name the first one counts.
                let _ = std::os::unix::fs::symlink(file.path(), folder.join(name));
            }
        }
    }
    folder
}

#[test]
fn the_evaluation_is_repeated_with_its_baselines_without_qemu() {
    let programs = programs_without_qemu();
    let out = Path::new(env!("CARGO_TARGET_TMPDIR")).join("on-linux-evaluation");
    let _ = fs::remove_dir_all(&out);
    let words = format!(
        "bench join-latency --on linux --subtasks 2 --policies fass,exact --jobs 4 --out {}",
        out.display()
    );
    let said = succeed_on(&words, Some(&programs));
    assert!(
        said.contains("2 conditions of 4 jobs; mode linux, 4 cores"),
        "{said}"
    );
    for joins in ["FasS (DAG)", "ExactTime"] {
        let row = said
            .lines()
            .find(|line| line.contains(joins))
            .expect("a row");
        let words: Vec<&str> = row.split_whitespace().collect();
        // All four jobs are joined, each with its own values.
        assert!(
            words.windows(3).any(|part| part == ["1.000", "4", "0"]),
            "{row}"
        );
    }
    assert!(out.join("summary.json").is_file());
}

#[test]
fn what_is_wrong_has_the_exit_code_and_the_line_that_it_has_on_the_machine() {
    for (words, code, says) in [
        (
            "run --app fork-join --on linux --append sed=3",
            2,
            "the app refused its command line: `sed` is no option; there are longest, ",
        ),
        (
            "run --app fork-join --on linux --cores 64",
            2,
            "64 cores are asked for, and this program may use ",
        ),
        (
            "run --app fork-join --on linux --append mechanism=sched-ext",
            2,
            "`mechanism=sched-ext`: allowed are fifo, sched_ext, normal",
        ),
        (
            "run --app faults --on linux",
            2,
            "app `faults` has no program for Linux; these have: autoware, ",
        ),
        (
            "run --app gait --on linux",
            2,
            "no recording; give one by `./scripts/run --app gait --module FILE`",
        ),
        (
            "run --app fork-join --on linux --mode threads",
            2,
            "`--mode` is not for `--on linux`; leave it out, or give `--on debian`",
        ),
    ] {
        let output = tool(words);
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{words}: {said}");
        assert!(said.contains(says), "{words}: {said}");
    }
}

/// That the guest says success means that the policy was there until the program's end, and not after.
#[test]
#[ignore = "fetches 145 MB of Debian's; `cargo test -p tool --test on_linux -- --ignored` runs it"]
fn in_a_guest_both_mechanisms_keep_the_rules() {
    for mechanism in ["fifo", "sched_ext"] {
        let trace = fresh(&format!("in-guest-{mechanism}.log"));
        let trace = trace.display();
        let said = succeed(&format!(
            "run --on debian --mechanism {mechanism} --app fork-join --subtasks 2,4,6 --longest 5 \
             --jobs 10 --trace {trace}"
        ));
        let transcript = Transcript::read(&said);
        let lines: Vec<_> = transcript.of_kind("fork_join").collect();
        assert_eq!(lines.len(), 3, "{said}");
        for line in lines {
            assert_eq!(line.number_at("joins"), Some(10), "{}", line.text);
            assert_eq!(line.number_at("violations"), Some(0), "{}", line.text);
        }
        succeed(&format!("check-trace --bound-us 5000000 {trace}"));
    }
}
