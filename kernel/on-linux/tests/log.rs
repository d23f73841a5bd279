//! A program for Linux whose functions say lines in the log, and what it shows of them.
//!
//! With words it is that program, and without any it is the test, which starts itself.

extern crate kernel_on_linux as kernel;

use std::env;
use std::process::{Command, ExitCode};
use std::time::Duration;

use fass::log::Level;
use fass::{SubtaskAttributes, create_dag, finish_create_dags};
use kernel::{Ending, Machine};

kernel::entry!(app);

fn main() -> ExitCode {
    if env::args().len() > 1 && env::args().all(|word| !word.starts_with("--")) {
        return program();
    }
    for mechanism in ["fifo", "normal", "poll"] {
        judge(mechanism);
    }
    ExitCode::SUCCESS
}

/// Says a line in main, in each job, and at the end.
fn app(machine: &Machine) -> Result<(), Ending> {
    machine.options().finish(&[])?;
    fass::log!(Level::Info, "begins");
    let dag = create_dag();
    let period = Duration::from_millis(30);
    dag.name("front")
        .jobs(3)
        .period(period)
        .relative_deadline(period);
    let look = |job| {
        fass::log!(Level::Warn, "camera late", by_ns = 300, channel = job);
        fass::log!(Level::Debug, "looks");
    };
    dag.register_untyped_subtask(look, SubtaskAttributes::named("camera"));
    finish_create_dags(&[dag])?;
    let run = machine.run()?;
    fass::log!(Level::Error, "ends", allocations = run.allocations());
    Ok(())
}

fn said(words: &[&str]) -> String {
    let own = env::current_exe().expect("it has a file");
    let output = Command::new(own)
        .args(words)
        .output()
        .expect("it can be started");
    assert!(output.status.success(), "{output:?}");
    String::from_utf8(output.stdout).expect("it is text")
}

fn judge(mechanism: &str) {
    let mechanism = format!("mechanism={mechanism}");
    let said = |word| said(&["cores=1", &mechanism, word]);
    let text = said("log=info");
    let positions = [
        "info 0 s: begins\n",
        "warn front/camera[0] ",
        "warn front/camera[2] ",
    ]
    .map(|line| {
        text.find(line)
            .unwrap_or_else(|| panic!("no `{line}`: {text}"))
    });
    assert!(positions.is_sorted(), "{text}");
    assert!(
        text.contains(": camera late by_ns=300 channel=2\n"),
        "{text}"
    );
    let member =
        r#""subtask_name":"camera","job":2,"fields":{"by_ns":300,"channel":2},"left_out":0}"#;
    assert!(text.contains(member), "{text}");
    assert!(text.contains(": ends allocations=0\n"), "{text}");
    let count = |text: String| text.matches("{\"kind\":\"log\"").count();
    let counts = ["log=off", "log=error", "log=info", "log=debug"].map(|word| count(said(word)));
    assert_eq!(counts, [0, 1, 5, 8]);
}
