//! A program for Linux whose functions say lines in the log, and what it shows of them.
//!
//! With words of a command line it is that program, and else the test, which starts itself: so
//! it is its own harness, which takes filters and ends as others do.

extern crate kernel_on_linux as kernel;

use std::env;
use std::hint::black_box;
use std::process::{Command, ExitCode};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread;
use std::time::Duration;

use fass::{SubtaskAttributes, create_dag, finish_create_dags};
use kernel::{AppError, Machine};

kernel::entry!(app);

fn main() -> ExitCode {
    let words: Vec<String> = env::args().skip(1).collect();
    if words.iter().any(|word| word.starts_with("cores=")) {
        return program();
    }
    let mut filters = words
        .iter()
        .filter(|word| !word.starts_with('-'))
        .peekable();
    if filters.peek().is_some() && !filters.any(|word| "log_by_mechanism".contains(word.as_str())) {
        println!("test result: ok. 0 passed; 0 failed");
        return ExitCode::SUCCESS;
    }
    for mechanism in ["fifo", "normal", "poll"] {
        judge(&format!("mechanism={mechanism}"));
    }
    println!("test result: ok. 1 passed; 0 failed");
    ExitCode::SUCCESS
}

/// Says a line in main, lines in each job, and a line at the end.
fn app(machine: &Machine) -> Result<(), AppError> {
    let words = [("no", false), ("yes", true)];
    let is_broken = machine.options().choice("broken", &words)?;
    machine.options().finish(&["broken"])?;
    fass::log!(Info, "begins");
    let (dag, period) = (create_dag(), Duration::from_millis(30));
    dag.name("front").jobs(3).period(period);
    dag.relative_deadline(period);
    let look = move |job| {
        fass::log!(Warn, "camera late", by_ns = 300, channel = job);
        fass::log!(Debug, "looks");
        assert!(!is_broken, "it is broken");
    };
    dag.register_untyped_subtask(look, SubtaskAttributes::named("camera"));
    finish_create_dags(&[dag])?;
    // What the app's own threads allocate meanwhile is not the jobs'.
    let is_over = AtomicBool::new(false);
    let run = thread::scope(|scope| {
        scope.spawn(|| {
            while !is_over.load(Relaxed) {
                drop(black_box(vec![0_u8; 64]));
            }
        });
        let run = machine.run();
        is_over.store(true, Relaxed);
        run
    })?;
    fass::log!(Error, "ends", allocations = run.allocations());
    Ok(())
}

fn judge(mechanism: &str) {
    let said = |word| {
        let own = env::current_exe().expect("it has a file");
        let words = ["cores=1", mechanism, word];
        let output = Command::new(own).args(words).output();
        String::from_utf8(output.expect("it can be started").stdout).expect("it is text")
    };
    let text = said("log=info");
    let mut rest = text.as_str();
    for line in [
        "info 0 ns: begins\n",
        "warn front/camera[0] ",
        " ns: camera late by_ns=300 channel=2\n",
        r#""subtask_name":"camera","job":2,"fields":{"by_ns":300,"channel":2},"left_out":0}"#,
        " ns: ends allocations=0\n",
    ] {
        let (_, behind) = rest.split_once(line).expect(&text);
        rest = behind;
    }
    let place = format!(": it is broken; at {}:", file!());
    assert!(said("broken=yes").contains(&place), "{place}");
    let count = |text: String| text.matches("{\"kind\":\"log\"").count();
    let counts = ["log=off", "log=error", "log=info", "log=debug"].map(|word| count(said(word)));
    assert_eq!(counts, [0, 1, 5, 8]);
}
