//! Runs recorded on the machine, and replayed on other cores.

use std::collections::BTreeSet;
use std::fs;

use harness::file::File;
use harness::{Guest, Members, Said, lawful_runs};
use recording::{Entry, EntryKind, Recordable, Recording};
use tool::{Machine, Outcome, recordings};
use views::protocol::Status;

/// Returns the bytes sent by the guest to a file.
fn bytes(file: &File) -> Vec<u8> {
    recordings::received(&file.0).expect("the guest has sent it")
}

fn guest(words: &str) -> Guest {
    Guest::test("recorded").word(words)
}

/// Records the fork and join, checks that no entry is lost, and returns the number of entries.
fn record(guest: Guest, file: &File) -> u64 {
    let outcome = guest.records(&file.0, 64).succeed();
    // A PC's firmware has said something there, too.
    fs::write(&file.0, bytes(file)).expect("it is our file");
    let line = outcome.line("recorded");
    line.has([("lost", 0)]);
    line.number("entries")
}

/// Replays the recording on a number of cores. Returns the number of compared values, and the
/// number of values not computed. The step differs from the recording's: if sources were called,
/// all values would differ.
fn replay(cores: u64, words: &str, file: &File) -> [u64; 2] {
    let guest = guest("step=7").word(words).cores(cores);
    let outcome = guest.replays(&file.0).succeed();
    let line = outcome.line("replayed");
    ["compared", "uncompared"].map(|member| line.number(member))
}

/// Cores and policies different from the recording's.
const OTHERS: [(u64, &str); 3] = [(1, "policy=static"), (2, "policy=edf"), (4, "policy=slack")];

#[test]
fn a_recorded_run_is_replayed_on_other_cores_and_policies() {
    let file = File::new("recorded", "rec");
    for machine in [Machine::Microvm, Machine::Q35] {
        assert_eq!(record(guest("").cores(2).machine(machine), &file), 250);
    }
    let bytes = bytes(&file);
    let recording = Recording::read(&bytes).expect("it is whole");
    assert_eq!(recording.header().app, "guest-tests");
    let inputs = recording.values::<u64>("counts", "input");
    let inputs = inputs.expect("there are");
    assert!(inputs.eq((0..50).map(|job| (job, job + 1))));
    // Times are from the kernel's entry on, and not from the first release.
    for entry in recording.entries() {
        assert_eq!(entry.release_ns, 20_000_000 * entry.job);
        assert!(entry.at_ns >= entry.release_ns);
        if entry.what == EntryKind::Clock {
            let times = Vec::<u64>::from_bytes(entry.value).expect("a list of times");
            assert!(times.len() == 1 && times[0] > entry.at_ns);
        }
    }

    for (cores, words) in OTHERS {
        assert_eq!(replay(cores, words, &file), [100, 0], "{cores} {words}");
    }

    // A cluster records and replays the same.
    record(guest("clusters=2,2 policy=fifo").cores(4), &file);
    assert_eq!(replay(1, "policy=static", &file), [100, 0]);
    let divided = replay(4, "clusters=2,2 policy=edf", &file);
    assert_eq!(divided, [100, 0]);
}

#[test]
fn what_shares_behind_the_schedulers_back_is_found_by_a_replay() {
    let file = File::new("cheats", "rec");
    record(guest("cheats=yes").cores(2), &file);
    let guest = guest("cheats=yes").replays(&file.0);
    let outcome = guest.end_in(Status::Failure);
    let reason = outcome.reason();
    let wanted =
        "topic `first` of dag `counts` diverges in job 0: 2 is recorded, and 1 is computed";
    assert!(reason.starts_with(wanted), "{reason}");
    outcome.line("replayed").reads([("topic", "first")]);
}

#[test]
fn what_does_not_fit_is_named_job_by_job() {
    let file = File::new("long", "rec");
    let guest = Guest::test("recorded_long").records(&file.0, 16);
    let outcome = guest.succeed();
    let bytes = bytes(&file);
    let recording = Recording::read(&bytes).expect("it is whole");
    assert!(!recording.is_cut() && recording.lost() > 0);
    let of = |wanted: EntryKind| {
        let entries = recording.entries();
        let entries = entries.filter(move |entry| entry.what == wanted);
        let places = entries.map(|entry: Entry<'_>| (entry.place, entry.job));
        places.collect::<BTreeSet<(u16, u64)>>()
    };
    let (kept, lost) = (of(EntryKind::Value), of(EntryKind::Lost));
    assert!(kept.is_disjoint(&lost) && kept.len() > 8);
    let all = (0..8).flat_map(|link| (0..20).map(move |job| (link, job)));
    assert_eq!(&kept | &lost, all.collect());
    assert_eq!(recording.count(), 8 * 20, "each once");
    let said = outcome.line("recorded");
    assert!(said.text.contains("\"complete\":false"), "{}", said.text);
    said.has([("lost", recording.lost())]);
}

#[test]
fn a_recording_that_does_not_fit_is_refused() {
    let file = File::new("other", "rec");
    record(guest(""), &file);
    for (test, reason) in [
        (
            "recorded_long",
            "the recording's dag 0 is `counts`, and here it is `chain`",
        ),
        ("overrun", "`replay`: no topic of the app is recorded"),
    ] {
        let said = Guest::test(test).replays(&file.0).refusal();
        assert!(said.contains(reason), "{said}");
    }
}

#[test]
fn without_a_debug_port_the_record_goes_to_the_console() {
    let outcome = guest("keep=256").cores(2).succeed();
    let bytes = views::record::bytes_of_log(&outcome.serial).expect("whole lines");
    let recording = Recording::read(&bytes).expect("it is whole");
    assert_eq!((recording.lost(), recording.is_cut()), (0, false));
    assert!(recording.count() > 100, "{}", recording.count());
    assert_eq!(lawful_runs(&outcome, u64::MAX).len(), 1);
}

/// The PC's clock begins with 2000 where instructions are counted, and in the replay ten years later.
#[test]
fn unix_time_is_an_input_of_a_run() {
    let file = File::new("unix-time", "rec");
    let last_s = |outcome: &Outcome| outcome.line("stamped").number("last_ns") / 1_000_000_000;
    let stamped = Guest::test("stamped");
    let recorded = stamped.clone().records(&file.0, 64).succeed();
    fs::write(&file.0, bytes(&file)).expect("it is our file");
    assert_eq!(last_s(&recorded), 946_684_800);
    let later = [("base=2000", "base=2010")];
    let apart = stamped.clone().altered(&later, "").succeed();
    assert_eq!(last_s(&apart), 1_262_304_000);
    let replayed = stamped.altered(&later, "").replays(&file.0).succeed();
    assert_eq!(last_s(&replayed), 946_684_800);
    replayed
        .line("replayed")
        .has([("compared", 5), ("uncompared", 0)]);
}
