//! Ends of the program, which leave nothing behind; and what it needs to begin.
//!
//! The program under test is this very test program, started anew with a part to play.

use std::fs;
use std::os::unix::fs::MetadataExt as _;
use std::os::unix::process::{CommandExt as _, ExitStatusExt as _};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::support::{alone, ms};
use fass::{SubtaskAttributes, create_dag, finish_create_dags};
use linux::{Linux, Mechanism};

const PART: &str = "FASS_LINUX_PART";

/// Returns what starts a program for its part: a run that never ends, or what a stranger is told.
fn play(part: &str, program: &Path) -> Command {
    let mut command = Command::new(program);
    command.args(["--exact", "ends::part", "--nocapture"]);
    command.env(PART, part).stdout(Stdio::piped());
    command.stderr(Stdio::null());
    command
}

fn own_program() -> PathBuf {
    std::env::current_exe().expect("the program is there")
}

#[test]
fn part() {
    match std::env::var(PART).as_deref() {
        Ok("endless") => run_endlessly(),
        Ok("stranger") => {
            let machine = Linux::new(1, Mechanism::Fifo).expect("a processor is there");
            println!("preemptive: {}", machine.is_preemptive());
            println!("{}", machine.warnings().join("\n"));
        }
        _ => {}
    }
}

/// A run whose function also starts a program of its own.
fn run_endlessly() {
    let alone = alone(1, Mechanism::Fifo);
    let dag = create_dag();
    dag.period(ms(5)).relative_deadline(ms(5));
    let mut children = Vec::new();
    let function = move |job| {
        if job == 0 {
            let child = Command::new("sleep").arg("20").spawn().expect("it starts");
            println!("\nchild {}", child.id());
            children.push(child);
        }
    };
    dag.register_untyped_subtask(function, SubtaskAttributes::named("starts"));
    finish_create_dags(&[dag]).expect("the DAG is right");
    alone.machine.run().expect("it is committed");
}

/// Returns the scheduling class of each thread of a process, 0 being that of all programs.
fn classes(process: u32) -> Vec<String> {
    let folder = format!("/proc/{process}/task");
    let threads = fs::read_dir(folder).into_iter().flatten().flatten();
    let class = |thread: fs::DirEntry| {
        let stat = fs::read_to_string(thread.path().join("stat")).ok()?;
        // The fields after the name, which may have blanks; the 41st of all, proc(5).
        let (_, fields) = stat.rsplit_once(") ")?;
        fields.split(' ').nth(41 - 3).map(str::to_owned)
    };
    threads.filter_map(class).collect()
}

#[test]
fn a_kill_leaves_nothing_at_a_raised_level() {
    use std::io::{BufRead as _, BufReader};
    let mut program = play("endless", &own_program()).spawn().expect("it starts");
    let lines = BufReader::new(program.stdout.take().expect("it is piped")).lines();
    let mut words = lines.map_while(Result::ok);
    let child = words.find_map(|line| line.strip_prefix("child ")?.parse::<u32>().ok());
    let child = child.expect("the function starts a program");
    let threads = classes(program.id());
    let is_raised = threads.iter().any(|class| class == "1");
    let was_fifo = alone(1, Mechanism::Fifo).machine.is_preemptive();
    assert_eq!(is_raised, was_fifo, "{threads:?}");
    let of_child = classes(child);
    assert_eq!(of_child, ["0"], "what a function starts is at no level");
    program.kill().expect("it lives");
    let status = program.wait().expect("it has ended");
    assert_eq!(status.signal(), Some(9));
    assert!(!Path::new(&format!("/proc/{}/task", program.id())).exists());
    assert_eq!(classes(child), ["0"]);
    let killed = Command::new("kill").arg(child.to_string()).status();
    killed.expect("`kill` is there");
}

#[test]
fn a_stranger_is_told_what_it_may_not() {
    const NOBODY: u32 = 65_534;
    let copy = std::env::temp_dir().join(format!("fass-ends-{}", std::process::id()));
    let mut command = play("stranger", &own_program());
    // Only root can become somebody else.
    if fs::metadata("/proc/self").is_ok_and(|own| own.uid() == 0) {
        // Written by a program of its own: a child that another test starts meanwhile would hold
        // the file open, and what is open to be written cannot be started.
        let copied = Command::new("cp").arg(own_program()).arg(&copy).status();
        assert!(copied.expect("`cp` is there").success(), "it fits");
        command = play("stranger", &copy);
        command.uid(NOBODY).gid(NOBODY);
    }
    let output = command.output().expect("it has ended");
    // Without root there is none.
    let _ = fs::remove_file(copy);
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(text.contains("preemptive: false"), "{text}");
    assert!(
        text.contains("SCHED_FIFO is refused (Operation not permitted"),
        "{text}"
    );
    assert!(text.contains("; do run it as root, or `setcap"), "{text}");
}

#[test]
fn more_cores_than_there_are_is_an_error_with_a_remedy() {
    let error = Linux::new(100_000, Mechanism::Normal).expect_err("nobody has so many");
    let text = error.to_string();
    assert!(text.starts_with("100000 cores are asked for, and this program may use "));
    assert!(text.contains("; do ask for 1 to "), "{text}");
    assert!(Linux::new(0, Mechanism::Normal).is_err());
}
