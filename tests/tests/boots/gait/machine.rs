//! The recorded walk on the machine, with the same bits as on the host, and at a console on Linux.

use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::process::{Command, Stdio};

use super::{Walked, walk};
use fass::{Policy, finish_create_dags};
use gait::build;
use harness::Guest;
use harness::file::File;
use tool::{Outcome, recordings, system};
use virtual_time::VirtualTime;

#[test]
fn the_machine_computes_the_bits_of_the_host_and_both_replay_what_it_recorded() {
    let file = Walked::new();
    let wanted = walk(&file.read(), 1, Policy::Edf).digest();
    let run = File::new("walk", "rec");
    let guest = Guest::new("gait").cores(2).module(&file.0.0);
    let outcome = guest.clone().records(&run.0, 1024).succeed();
    let number = |outcome: &Outcome, kind: &str, name: &str| {
        let line = outcome.transcript.of_kind(kind).next();
        line.and_then(|line| line.number_at(name)).expect(name)
    };
    assert_eq!(number(&outcome, "gait", "digest"), wanted);
    assert_eq!(number(&outcome, "gait", "jobs"), 3_511);
    for none in ["deadline_misses", "violations", "allocations"] {
        assert_eq!(number(&outcome, "gait", none), 0, "{none}");
    }
    let angles = outcome.transcript.of_kind("gait_knee");
    let angles = angles.filter_map(|line| line.value.get("angles_udeg"));
    assert_eq!(
        angles.map(|list| list.elements().len()).sum::<usize>(),
        3_511
    );

    // The recording stands before the app's own file.
    let bytes = recordings::received(&run.0).expect("the guest has sent it");
    let both = [&bytes[..], &fs::read(&file.0.0).expect("the walk")].concat();
    fs::write(&run.0, &both).expect("it is our file");
    let guest = (guest.cores(4).module(&run.0)).word(&format!("replay={}", bytes.len()));
    let outcome = guest.word("policy=edf").succeed();
    assert_eq!(number(&outcome, "gait", "digest"), wanted);
    assert_eq!(number(&outcome, "replayed", "compared"), 7_132);
    assert_eq!(number(&outcome, "replayed", "uncompared"), 0);
    let machine = VirtualTime::new().replay(&bytes).expect("it is whole");
    let (dag, walk) = build(&file.read()).expect("it has the samples");
    finish_create_dags(&[dag]).expect("it is the DAG that was recorded");
    let report = machine.run();
    assert_eq!((report.compared, report.divergence), (7_132, None));
    assert_eq!(walk.digest(), wanted);
}

/// A person looks at a walk on Linux, and ends the run.
#[test]
fn a_console_on_linux_shows_topics() {
    for mechanism in ["fifo", "poll"] {
        let file = Walked::new();
        let mut command = Command::new(system::workspace().join("scripts/run"));
        let words = "--app gait --on linux --console --append budget_factor=0 --mechanism";
        command.args(words.split(' ')).args([mechanism, "--module"]);
        let child = command
            .arg(&file.0.0)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped());
        let mut child = child.spawn().expect("the command can be run");
        let (mut input, output) = (child.stdin.take(), child.stdout.take());
        let mut lines = BufReader::new(output.expect("a pipe")).lines();
        let mut say = |words: &str| writeln!(input.as_mut().expect("a pipe"), "{words}");
        let mut wait_for = |word: &str| {
            let line = lines.find(|line| line.as_ref().is_ok_and(|line| line.contains(word)));
            line.unwrap_or_else(|| panic!("no line has `{word}`"))
                .expect("text")
        };
        wait_for("dag `gait` takes at most");
        for (words, answer) in [
            ("echo upper", "  upper["),
            ("hz sample", " Hz of "),
            ("stats", "dag 0 `gait`: running; "),
            ("shutdown", "shut down before its end"),
        ] {
            say(words).expect("it is read");
            wait_for(answer);
        }
        assert!(child.wait().expect("it ends").success());
    }
}
