//! Runs of the machine that are recorded, and replayed on other cores.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use harness::Guest;
use recording::{Entry, Recordable, Recording, Role, What};
use tool::json::Value;
use tool::protocol::Status;
use tool::{Machine, Outcome, recordings, system};

/// A file for a recording, removed with this value.
struct File(PathBuf);

impl File {
    fn new(name: &str) -> File {
        let log = system::new_log(name).expect("a folder for logs");
        File(log.with_extension("rec"))
    }

    fn bytes(&self) -> Vec<u8> {
        recordings::received(&self.0).expect("the guest has sent it")
    }
}

impl Drop for File {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.0);
    }
}

fn guest(words: &[&str]) -> Guest {
    (words.iter()).fold(Guest::new("guest-tests"), |guest, word| guest.word(word))
}

/// Records the fork and join.
fn record(guest: Guest, file: &File) -> Outcome {
    let outcome = guest.records(&file.0, 64).succeed();
    // A PC's firmware has said something there, too.
    fs::write(&file.0, file.bytes()).expect("it is our file");
    outcome
}

fn line(outcome: &Outcome, kind: &str) -> Value {
    let line = outcome.transcript.of_kind(kind).next();
    line.expect("it says what came of it").value.clone()
}

fn numbers<const N: usize>(line: &Value, names: [&str; N]) -> [u64; N] {
    names.map(|name| line.get(name).and_then(Value::as_u64).expect(name))
}

/// Replays it, and returns how many values were compared, and how many were not computed.
fn replay(cores: u64, policy: &str, file: &Path) -> [u64; 2] {
    replay_with(&[], cores, policy, file)
}

fn replay_with(words: &[&str], cores: u64, policy: &str, file: &Path) -> [u64; 2] {
    let policy = format!("policy={policy}");
    let words = [&["test=recorded", "step=7", &policy], words].concat();
    let guest = guest(&words);
    let outcome = guest.cores(cores).replays(file).succeed();
    numbers(&line(&outcome, "replayed"), ["compared", "uncompared"])
}

#[test]
fn a_recorded_run_is_replayed_on_other_cores_and_policies() {
    let file = File::new("recorded");
    for machine in [Machine::Microvm, Machine::Q35] {
        let recorded = record(guest(&["test=recorded"]).cores(2).machine(machine), &file);
        let said = line(&recorded, "recorded");
        assert_eq!(numbers(&said, ["entries", "lost"]), [150, 0]);
    }
    let bytes = file.bytes();
    let recording = Recording::read(&bytes).expect("it is whole");
    assert_eq!(recording.header().app, "guest-tests");
    let inputs = recording
        .values::<u64>("counts", "input")
        .expect("there are");
    assert!(inputs.eq((0..50).map(|job| (job, job + 1))));
    let releases = recording
        .entries()
        .map(|entry| (entry.release_ns, entry.job));
    assert!(releases.clone().all(|(ns, job)| ns == 20_000_000 * job));
    assert!((recording.entries()).all(|entry| entry.at_ns >= entry.release_ns));

    // The step is another one: sources are not called, or all values would be others.
    for (cores, policy) in [(1, "static"), (2, "edf"), (4, "static")] {
        assert_eq!(replay(cores, policy, &file.0), [100, 0], "{cores} {policy}");
    }

    // A cluster records and replays the same.
    let divided = guest(&["test=recorded", "clusters=2,2"]).cores(4);
    record(divided, &file);
    assert_eq!(replay(1, "static", &file.0), [100, 0]);
    let divided = replay_with(&["clusters=2,2"], 4, "edf", &file.0);
    assert_eq!(divided, [100, 0]);
}

#[test]
fn functions_are_told_the_time_again_that_they_were_told() {
    let file = File::new("told");
    let recorded = record(guest(&["test=recorded", "asks=yes"]).cores(2), &file);
    let said = line(&recorded, "recorded");
    assert_eq!(numbers(&said, ["entries", "lost"]), [250, 0]);
    let bytes = file.bytes();
    let recording = Recording::read(&bytes).expect("it is whole");
    let told = recording
        .entries()
        .filter(|entry| entry.what == What::Clock);
    for entry in told {
        let times = Vec::<u64>::from_bytes(entry.value).expect("a list of times");
        assert_eq!(times.len(), 1);
        // From the kernel's entry on, and not from the first release.
        assert!(times[0] > entry.at_ns && entry.at_ns > entry.release_ns);
    }
    for (cores, policy) in [(1, "static"), (2, "edf"), (4, "static")] {
        let compared = replay_with(&["asks=yes"], cores, policy, &file.0);
        assert_eq!(compared, [100, 0], "{cores} {policy}");
    }
}

#[test]
fn what_shares_behind_the_schedulers_back_is_found_by_a_replay() {
    let file = File::new("cheats");
    let words = ["test=recorded", "cheats=yes"];
    record(guest(&words).cores(2), &file);
    let outcome = guest(&words).replays(&file.0).end_in(Status::Failure);
    let reason = outcome.transcript.verdict().expect("a verdict").reason;
    let wanted =
        "topic `first` of dag `counts` diverges in job 0: 2 is recorded, and 1 is computed";
    assert!(reason.starts_with(wanted), "{reason}");
    let said = line(&outcome, "replayed");
    assert_eq!(said.get("topic").and_then(Value::as_text), Some("first"));
}

#[test]
fn what_does_not_fit_is_named_job_by_job() {
    let file = File::new("long");
    let guest = guest(&["test=recorded_long"]).cores(1);
    let outcome = guest.records(&file.0, 16).succeed();
    let bytes = file.bytes();
    let recording = Recording::read(&bytes).expect("it is whole");
    assert!(!recording.is_cut() && recording.lost() > 0);
    let of = |wanted: What| {
        let entries = recording
            .entries()
            .filter(move |entry| entry.what == wanted);
        let places = entries.map(|entry: Entry<'_>| (entry.place, entry.job));
        places.collect::<BTreeSet<(u16, u64)>>()
    };
    let (kept, lost) = (of(What::Value), of(What::Lost));
    assert!(kept.is_disjoint(&lost) && kept.len() > 8);
    let all = (0..8).flat_map(|link| (0..20).map(move |job| (link, job)));
    assert_eq!(&kept | &lost, all.collect());
    assert_eq!(recording.count(), 8 * 20, "each once");
    let said = line(&outcome, "recorded");
    assert_eq!(said.get("complete").and_then(Value::as_bool), Some(false));
    assert_eq!(numbers(&said, ["lost"]), [recording.lost()]);
}

#[test]
fn of_a_run_that_dies_there_is_what_came_before() {
    let file = File::new("dies");
    let words = ["test=recorded", "dies_in=20"];
    assert!(guest(&words).records(&file.0, 64).boot().judge().is_err());
    assert!(Recording::read(&file.bytes()).is_err());
    let mended = recording::mended(&file.bytes()).expect("the header");
    let recording = Recording::read(&mended).expect("it is mended");
    assert!(recording.is_cut());
    assert!(
        (40..=63).contains(&recording.count()),
        "{}",
        recording.count()
    );
    fs::write(&file.0, &mended).expect("it is our file");
    let [compared, _] = replay(1, "static", &file.0);
    assert!((30..=42).contains(&compared), "{compared}");
}

#[test]
fn what_a_failed_instance_had_sampled_is_there() {
    let file = File::new("crash");
    for guest in [
        guest(&["test=recorded_crash"]).keeps(&file.0),
        guest(&["test=recorded_crash"]).records(&file.0, 64),
    ] {
        let outcome = guest.cores(2).end_in(Status::Failure);
        let fault = line(&outcome, "fault");
        let [job] = numbers(&fault, ["job"]);
        let message = fault.get("message").and_then(Value::as_text);
        let bytes = file.bytes();
        let recording = Recording::read(&bytes).expect("it is whole");
        let channels = recording.header().channels.iter();
        let samples = (0_u16..).zip(channels);
        let mut samples = samples.filter(|(_, channel)| channel.role == Role::Sample);
        let (place, _) = samples.next().expect("one subtask samples");
        let entries =
            (recording.entries()).filter(|entry| (entry.what, entry.place) == (What::Value, place));
        let last = entries.max_by_key(|entry| entry.job);
        let last = last.expect("it has sampled");
        assert_eq!(last.job, job);
        let sample = <Option<(u64, u64, u64)>>::from_bytes(last.value).expect("a sample");
        let found = sample.map(|(_, _, told)| format!("found {told}"));
        assert_eq!(found.as_deref(), message);
    }
}

#[test]
fn a_recording_that_does_not_fit_is_refused() {
    let file = File::new("other");
    let recorded = Guest::new("guest-tests").word("test=recorded_long");
    let _ = recorded.records(&file.0, 1024).succeed();
    let refused = |guest: Guest, reason: &str| {
        let outcome = guest.end_in(Status::Usage);
        let said = outcome.transcript.verdict().expect("a verdict").reason;
        assert!(said.contains(reason), "{said}");
    };
    let counts = || guest(&["test=recorded"]);
    refused(
        counts().replays(&file.0),
        "the recording's dag 0 is `chain`, and here it is `counts`",
    );
    let bytes = file.bytes();
    fs::write(&file.0, &bytes[..bytes.len() - 1]).expect("it is our file");
    let reason = format!(
        "the recording, at byte {}: expected 4 bytes of a checksum",
        bytes.len() - 4
    );
    refused(counts().replays(&file.0), &reason);
    refused(
        guest(&["test=overrun"]).replays(&file.0),
        "`replay`: no topic of the app is recorded",
    );
    refused(
        counts().word("record=64"),
        "there is no debug port at 0x402",
    );
}
