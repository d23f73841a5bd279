//! All of a run in one file, which every command reads.

use std::fs::{self, Permissions};
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::Command;

use recording::{EntryKind, Recording};
use tool::system::workspace;
use views::record::Record;

use crate::support::{Called, assert_refused, call, folder, succeed};

const RUN: &str = "run --app autoware --cores 4 --mode deterministic --jobs 5";

fn read(folder: &Path, file: &str) -> Vec<u8> {
    fs::read(folder.join(file)).expect(file)
}

#[test]
fn a_run_that_is_kept_is_judged_drawn_shown_and_replayed() {
    let folder = folder("kept");
    let said = succeed(&folder, &format!("{RUN} --keep run.kept"));
    assert!(!said.contains("\"kind\":\"record\""), "{said}");
    let replay = ", and `--replay run.kept` repeats it\n";
    assert!(said.contains("run.kept: all of the run, "), "{said}");
    assert!(said.contains(replay), "{said}");
    let judged = succeed(&folder, "check-trace run.kept");
    assert!(judged.contains("  certified: "), "{judged}");
    succeed(&folder, "trace run.kept --out drawn.json");
    let shown = succeed(
        &folder,
        "recording run.kept --witness proof --observe wcets --csv tables",
    );
    let is_whole = shown.contains(" machine lines\n") && shown.contains("\ncomplete\n");
    assert!(is_whole, "{shown}");
    // The latency of a join ends with readiness, which events have at the same instant.
    let has_joins = shown.contains("` join to start ") && !shown.contains("join latency");
    assert!(has_joins, "{shown}");
    assert!(read(&folder, "wcets").starts_with(b"# WCETs that were observed"));
    let replayed = succeed(&folder, &format!("{RUN} --policy edf --replay run.kept"));
    assert!(replayed.contains("\"uncompared\":0"), "{replayed}");

    let bytes = read(&folder, "run.kept");
    assert!(Recording::read(&bytes).expect("whole").count() > 0);
    let row = "run --on debian --keep x | `--keep` is not for `--on debian`; leave it out";
    assert_refused(&folder, row);
}

#[test]
fn of_a_file_that_is_kept_only_what_holds_is_said() {
    let folder = folder("announced");
    let demo = workspace().join("apps/dag-file/examples/demo.dag");
    let dags = format!("run --dag {} --mode deterministic --jobs 5", demo.display());
    for (line, part) in [
        (format!("{RUN} --trace a"), "a: the events of the run, "),
        (format!("{dags} --keep a"), "a: all of the run, "),
        (
            format!("{RUN} --trace a --append trace_events=100"),
            " events, which are lost, ",
        ),
    ] {
        let said = succeed(&folder, &line);
        assert!(said.contains(part), "{line}: {said}");
        // Our folder is not the workspace, so it has none of the scripts.
        assert!(said.contains("check-trace a` judges it, "), "{said}");
        assert!(!said.contains("./scripts/"), "{said}");
        assert!(!said.contains("--replay"), "{line}: {said}");
    }
}

/// Of the robot with the charges of docs/proving.md.
#[test]
fn runs_of_apps_and_of_a_table_are_certified() {
    let folder = folder("certified");
    let robot = workspace().join("apps/dag-file/examples/robot.dag");
    let robot = format!(
        "--dag {} --cores 8 --clusters auto --occupy hold --jobs 10 --append \
         overheads_ns=0,24000,16000,0",
        robot.display()
    );
    for run in [
        "--app drone --append seconds=2",
        "--app camera --cores 2",
        &robot,
    ] {
        let line = format!("run {run} --mode deterministic --keep run.kept");
        succeed(&folder, &line);
        let judged = succeed(&folder, "check-trace run.kept");
        assert!(judged.contains("  certified: "), "{judged}");
    }
}

#[test]
fn the_proof_of_a_bound_that_is_exceeded_is_written() {
    let folder = folder("exceeded");
    let dags = "dag quick period 10ms\nsubtask only wcet 1us\nend\n";
    fs::write(folder.join("quick.dag"), dags).expect("our folder takes a file");
    // The kernel takes its time, and that is not stated.
    let line = "run --dag quick.dag --cores 1 --mode deterministic --jobs 3 --keep kept \
                --append overheads_ns=0,0,0";
    let called = call(&folder, line.split_whitespace());
    assert_eq!(called.code, Some(1), "{}{}", called.out, called.complaint);
    let why = "beyond its proven bound of 1.000 us";
    assert!(called.complaint.contains(why));
    succeed(&folder, "recording kept --witness proof");
    assert!(read(&folder, "proof").starts_with(b"machine 1 "));
}

#[test]
fn a_replay_of_signals_leaves_no_file_unless_an_instance_has_failed() {
    let folder = folder("signals");
    let gaps = workspace().join("apps/cruise/gaps.txt");
    let run = format!(
        "run --app cruise --mode deterministic --jobs 30 --input {} --append releases=packets",
        gaps.display()
    );
    succeed(&folder, &format!("{run} --keep run.rec"));
    let recording = read(&folder, "run.rec");
    let recording = Recording::read(&recording).expect("whole");
    let signals = recording.entries();
    let signals = signals.filter(|entry| entry.what == EntryKind::Signal);
    let signals = signals.count();
    assert!(signals > 3, "{signals}");
    // Packets that arrive in the replay release nothing.
    let replayed = succeed(
        &folder,
        &format!("{run} --cores 2 --policy edf --replay run.rec"),
    );
    let said = format!("\"compared\":{signals},\"uncompared\":0");
    assert!(replayed.contains(&said), "{said}: {replayed}");
    assert!(!replayed.contains("before the fault"), "{replayed}");
}

#[test]
fn of_a_run_that_died_what_it_said_until_then_is_kept() {
    tool::install::ensure_qemu().expect("QEMU");
    let folder = folder("died");
    let stub = folder.join("qemu");
    let script = "#!/bin/sh\nexec timeout --signal KILL 5 qemu-system-x86_64 \"$@\"\n";
    fs::write(&stub, script).expect("our folder takes a file");
    fs::set_permissions(&stub, Permissions::from_mode(0o755)).expect("it is ours");
    let line = "run --app autoware --cores 4 --mode threads --jobs 10000 --qemu ./qemu --keep died";
    let called = call(&folder, line.split(' '));
    assert_eq!(called.code, Some(1), "{}{}", called.out, called.complaint);
    let bytes = read(&folder, "died");
    let kept = Recording::read(&bytes).expect("it is whole as far as it goes");
    assert!(kept.is_cut() && kept.header().app == "autoware");
    let record = Record::read(&bytes).expect("it is whole as far as it goes");
    assert!(!record.lines.contains("\"kind\":\"verdict\""));
    let [run] = &record.runs[..] else { panic!() };
    assert!(
        !run.complete && run.events.len() > 100,
        "{}",
        run.events.len()
    );
    succeed(&folder, "check-trace --bound-us 5000000 died");
    let shown = succeed(&folder, "recording died");
    assert!(shown.contains("\nincomplete: it says nothing of what came after its last entry\n"));
}

#[test]
fn what_finds_no_room_is_a_failure_of_the_disk_and_a_part_of_the_run() {
    let folder = folder("no-room");
    let image = tool::image::build("camera").expect("it can be built");
    let image = image.display();
    let run = format!("run --image {image} --mode deterministic --cores 1 --append jobs=100");
    for (blocks, option, words) in [
        (60, "--keep kept", "a part of the run, "),
        (
            2,
            "--serial log",
            "but its log log has no end: a file may not be longer",
        ),
    ] {
        // As `scripts/tool/start` does.
        let line = format!("trap '' XFSZ; ulimit -f {blocks}; exec \"$0\" {run} {option}");
        let tool = env!("CARGO_BIN_EXE_fass-tool");
        let called = Command::new("sh")
            .args(["-c", &line, tool])
            .current_dir(&folder)
            .output();
        let called = Called::of(called.expect("a shell"));
        let said = called.out + &called.complaint;
        assert_eq!(called.code, Some(1), "{said}");
        let is_told = said.contains(words) && said.contains("may not be longer");
        assert!(is_told, "{said}");
    }
    assert!(succeed(&folder, "recording kept").contains("\nincomplete: "));
}

#[test]
fn a_run_on_linux_of_which_no_topic_is_recorded_is_kept_too() {
    let folder = folder("kept-on-linux");
    let line = "run --on linux --app fork-join --cores 1 --jobs 3 --subtasks 2 --keep run.kept";
    succeed(&folder, line);
    let bytes = read(&folder, "run.kept");
    let kept = Recording::read(&bytes).expect("it is whole");
    assert_eq!((kept.count(), kept.header().app.as_str()), (0, "fork-join"));
    let record = Record::read(&bytes).expect("it is whole");
    let counts = (record.commits.len(), record.runs.len(), record.times.len());
    assert_eq!(counts, (1, 1, 1));
    assert!(record.lines.contains("\"kind\":\"verdict\""));
}

#[test]
fn lines_of_the_log_are_kept_wherever_they_are_said() {
    let folder = folder("kept-log");
    let line = "run --app drone --cores 2 --keep run.kept --on";
    // However long the host lets an instance wait, it is within its budget.
    let words = ["--append", "set=reserve=95 budget_factor=0"];
    for on in ["machine", "linux"] {
        let called = call(&folder, format!("{line} {on}").split(' ').chain(words));
        assert_eq!(called.code, Some(0), "{}{}", called.out, called.complaint);
        let record = Record::read(&read(&folder, "run.kept")).expect("it is whole");
        let transcript = record.transcript();
        let low = transcript.of_kind("log").next().expect(&record.lines);
        let said = ["level", "message", "subtask_name"].map(|member| low.text_at(member));
        assert_eq!(said, ["warn", "battery low", "drain"].map(Some));
        assert!(low.number_at("fields.reserve") == Some(95), "{}", low.text);
        // The battery is looked at each 100 ms.
        let job = low.number_at("job").expect("an instance says it");
        assert!(
            low.number_at("time_ns") >= Some(100_000_000 * job),
            "{}",
            low.text
        );
    }
}
