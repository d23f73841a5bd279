//! The recorded walk on the machine and on Linux: the same bits as on the host.

use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::process::{Command, Stdio};

use super::{File, TABLE, walk};
use fass::{Policy, finish_create_dags};
use gait::build;
use harness::Guest;
use tool::{Outcome, recordings, system};
use virtual_time::VirtualTime;

/// Replays a recorded walk in virtual time, where it must give the same bits.
fn replay(file: &File, bytes: &[u8], cores: u32, policy: Policy, compared: u64, wanted: u64) {
    let machine = VirtualTime::new().cores(cores).policy(policy);
    let machine = machine.replay(bytes).expect("it is whole");
    let (dag, walk) = build(&file.read()).expect("it has the samples");
    finish_create_dags(&[dag]).expect("it is the DAG that was recorded");
    let report = machine.run();
    assert_eq!((report.compared, report.divergence), (compared, None));
    assert_eq!(walk.digest(), wanted);
}

#[test]
fn the_machine_computes_the_bits_of_the_host_and_both_replay_what_it_recorded() {
    let file = File::new();
    let wanted = walk(&file.read(), 1, Policy::Edf).digest();
    let log = system::new_log("walk").expect("a folder for logs");
    let run = log.with_extension("rec");
    let guest = Guest::new("gait").cores(2).module(&file.0);
    let outcome = guest.clone().records(&run, 1024).succeed();
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
    let bytes = recordings::received(&run).expect("the guest has sent it");
    let both = [&bytes[..], &fs::read(&file.0).expect("the walk")].concat();
    fs::write(&run, &both).expect("it is our file");
    let guest = (guest.cores(4).module(&run)).word(&format!("replay={}", bytes.len()));
    let outcome = guest.word("policy=edf").succeed();
    let _ = fs::remove_file(&run);
    assert_eq!(number(&outcome, "gait", "digest"), wanted);
    assert_eq!(number(&outcome, "replayed", "compared"), 7_132);
    assert_eq!(number(&outcome, "replayed", "uncompared"), 0);
    for cores in [1, 2, 4, 8] {
        for policy in [Policy::StaticPriority, Policy::Edf] {
            replay(&file, &bytes, cores, policy, 7_132, wanted);
        }
    }
}

/// Two seconds of the walk, in real time.
#[test]
fn a_walk_that_linux_recorded_is_replayed_on_linux_on_the_machine_and_on_the_host() {
    let all = fs::read_to_string(system::workspace().join(TABLE)).expect("the table");
    let [table, run] = ["csv", "rec"].map(|extension| {
        let log = system::new_log("short-walk").expect("a folder for logs");
        log.with_extension(extension)
    });
    let rows: Vec<&str> = all.lines().take(241).collect();
    fs::write(&table, rows.join("\n") + "\n").expect("it is our file");
    let file = File::of(&table.to_string_lossy());
    let [recorded, module] = [&run, &file.0].map(|path| path.to_string_lossy().into_owned());
    let digest = |words: &str| {
        // In real time, a busy host may take a budget's time from a call that needs little.
        let unbudgeted = ["--append", "budget_factor=0", "--module", &module];
        let words: Vec<&str> = words.split_whitespace().chain(unbudgeted).collect();
        let transcript = harness::run("gait", &words);
        let number = |kind, name| transcript.of_kind(kind).next()?.number_at(name);
        let compared = number("replayed", "compared");
        (number("gait", "digest").expect("the app's line"), compared)
    };
    let (wanted, _) = digest(&format!("--on linux --cores 2 --keep {recorded}"));
    for place in [
        "--on linux --cores 1",
        "--on linux --mechanism poll",
        "--cores 1",
        "--cores 4",
    ] {
        let found = digest(&format!("{place} --replay {recorded}"));
        assert_eq!(found, (wanted, Some(488)), "{place}");
    }
    let bytes = fs::read(&run).expect("the recording");
    replay(&file, &bytes, 1, Policy::StaticPriority, 488, wanted);
    for path in [&table, &run] {
        let _ = fs::remove_file(path);
    }
}

/// A person looks at a walk on Linux, and ends it.
#[test]
fn a_console_on_linux_shows_topics() {
    for mechanism in ["fifo", "poll"] {
        let file = File::new();
        let mut command = Command::new(system::workspace().join("scripts/run"));
        let words = "--app gait --on linux --console --append budget_factor=0 --mechanism";
        command.args(words.split(' ')).args([mechanism, "--module"]);
        let child = command
            .arg(&file.0)
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
