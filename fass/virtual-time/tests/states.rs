//! Recorded states: a replay that begins with a later job finds there what that had found, so what
//! follows from it comes again. (`replays` has the same of random DAGs.)

mod support;

use fass::{Dag, State};
use recording::{Channel, Entry, Recording, Role, What, Writer, to_bytes};
use support::{commit, every, job_numbers, ms, named, run};
use virtual_time::{Report, Value, VirtualTime};

/// The job whose filter fails.
const FAULT: u64 = 5_000;

type Sums = (u64, u64);

const fn add((sum, sums): Sums, n: u64) -> Sums {
    (sum + n, sums + sum + n)
}

/// A filter that adds up the sums of numbers, and fails at the one that it has in a job: with
/// another state it fails in another job, or never.
fn filter(jobs: u64, keep: impl Fn(&State<Sums>)) -> Dag {
    let dag = every(1, "filter");
    dag.jobs(jobs).record::<u64>("in").record::<u64>("out");
    let source = dag.source(job_numbers(0)).writes(&["in"]);
    source.register(named("source"));
    let sums = dag.state("sums", (0, 0));
    keep(&sums);
    let fails_at = (0..=FAULT).fold((0, 0), add);
    let step = move |sums: &mut Sums, (n,): (u64,)| {
        *sums = add(*sums, n);
        assert!(*sums != fails_at, "too great");
        (sums.1,)
    };
    let step = dag.using(sums.update()).subtask(step).reads(&["in"]);
    step.writes(&["out"]).register(named("step"));
    dag.register_sink_subtask(|_: (u64,)| (), vec!["out"], ms(1), named("sink"));
    dag
}

fn kept() -> Dag {
    filter(6_000, |sums| _ = sums.record())
}

/// The record that a crash of it leaves.
fn crash(dag: Dag) -> Vec<u8> {
    let machine = VirtualTime::new().contain_panics().keep_latest(16);
    run(&machine, &[dag]);
    machine.recording()
}

fn replaying(recording: &[u8]) -> VirtualTime {
    let machine = VirtualTime::new().contain_panics();
    machine.replay(recording).expect("whole")
}

/// Returns the jobs that failed, what differs, and what lacks.
fn found(report: &Report) -> (Vec<u64>, Option<String>, Option<u64>) {
    let panics = report.panics.iter().map(|panic| panic.instance.job);
    let differs = report.divergence.as_ref().map(ToString::to_string);
    let lacking = report.lacking.as_ref().map(|(_, job)| *job);
    (panics.collect(), differs, lacking)
}

/// Writes a recording again, with other values of states.
fn altered(bytes: &[u8], alter: impl Fn(u64, &[u8]) -> Vec<u8>) -> Vec<u8> {
    let recording = Recording::read(bytes).expect("whole");
    let channels = &recording.header().channels;
    let mut writer = Writer::new(recording.header());
    for entry in recording.entries() {
        let is_value = entry.what == What::Value;
        let is_state = is_value && channels[usize::from(entry.place)].role == Role::State;
        let value = match is_state {
            true => &*alter(entry.job, entry.value),
            false => entry.value,
        };
        writer.write(&Entry { value, ..entry });
    }
    writer.end()
}

#[test]
fn a_fault_that_follows_from_a_recorded_state_comes_again() {
    let bytes = crash(kept());
    let recording = Recording::read(&bytes).expect("whole");
    let states = recording.entries().filter(|entry| {
        let channel = &recording.header().channels[usize::from(entry.place)];
        entry.what == What::Value && (channel.role, &*channel.topic) == (Role::State, "sums")
    });
    // Not only every 64, for of that many there are no inputs.
    let states: Vec<u64> = states.map(|entry| entry.job).collect();
    assert_eq!(states, [4_992, 5_000]);
    assert!(recording.entries().any(|it| it.what == What::Fault));
    for cores in [1, 4] {
        let machine = replaying(&bytes).cores(cores);
        let report = run(&machine, &[kept()]);
        assert_eq!(found(&report), (vec![FAULT], None, None));
        assert_eq!(report.jobs.len(), 9, "none before 4,992");
        let job = machine.until("filter", FAULT).expect("it is there");
        let step = job
            .subtasks
            .iter()
            .find(|of| of.name == "step")
            .expect("it");
        assert_eq!(step.panic.as_deref(), Some("too great"));
        let sums = step.takes.iter().find(|passed| passed.what == "sums");
        let (sum, sums_before) = (0..FAULT).fold((0, 0), add);
        let shown = Value::Json(format!("[{sum},{sums_before}]"));
        assert_eq!(
            sums.map(|passed| &passed.value),
            Some(&shown),
            "it is found"
        );
    }
}

#[test]
fn without_the_state_a_replay_says_what_it_lacks() {
    let build = || filter(6_000, |_| ());
    let report = run(&replaying(&crash(build())), &[build()]);
    let (panics, differs, lacking) = found(&report);
    assert_eq!((panics, lacking), (vec![], Some(4_985)));
    let said = "subtask `step` of dag `filter` failed in job 5000 of the recorded run, and has not";
    assert!(differs.is_some_and(|text| text.starts_with(said)));
}

#[test]
fn an_altered_state_is_found() {
    let bytes = crash(kept());
    let mut flipped = bytes.clone();
    flipped[bytes.len() / 2] ^= 1;
    let refused = VirtualTime::new().replay(&flipped).unwrap_err().to_string();
    assert!(refused.contains("the file is altered"), "{refused}");
    let shorter = altered(&bytes, |_, value| value[1..].to_vec());
    let refused = VirtualTime::new().replay(&shorter).unwrap_err().to_string();
    assert!(refused.contains("expected a u64, 8 bytes"), "{refused}");

    // What is one of its type is not what the filter had.
    let later = altered(&bytes, |job, value| match job {
        FAULT => to_bytes(&(1_u64, 2_u64)),
        _ => value.to_vec(),
    });
    let (_, differs, _) = found(&run(&replaying(&later), &[kept()]));
    let said = "state `sums` of dag `filter` diverges in job 5000: [1,2] is recorded, and ";
    assert!(differs.is_some_and(|text| text.starts_with(said)));

    // Another type is refused.
    let other = every(1, "filter");
    other.jobs(6_000).record::<u64>("in").record::<u64>("out");
    let source = other.source(job_numbers(0)).writes(&["in"]);
    source.register(named("source"));
    let sums = other.state("sums", 0_u64);
    sums.record();
    let step = other
        .using(sums.update())
        .subtask(|_: &mut u64, n: (u64,)| n);
    let step = step.reads(&["in"]).writes(&["out"]);
    step.register(named("step"));
    other.register_sink_subtask(|_: (u64,)| (), vec!["out"], ms(1), named("sink"));
    let _machine = replaying(&bytes);
    let error = fass::finish_create_dags(&[other]).unwrap_err().to_string();
    let said = "state `sums` was recorded with values of type (u64, u64), and is of type u64 now";
    assert!(error.contains(said), "{error}");
}

#[test]
fn a_late_job_of_a_long_recording_is_computed_at_once() {
    const LAST: u64 = 1_000_050;
    let machine = VirtualTime::new();
    run(&machine, &[filter(1, |sums| _ = sums.record())]);
    let bytes = machine.recording();
    let short = Recording::read(&bytes).expect("whole");
    let mut writer = Writer::new(short.header());
    let place = |role: Role| {
        let mut channels = (0_u16..).zip(&short.header().channels);
        let found = channels.find(|(_, channel): &(u16, &Channel)| channel.role == role);
        found.expect("there is one").0
    };
    let [source, result, state] = [Role::Source, Role::Result, Role::State].map(place);
    let mut sums = (0, 0);
    for job in 0..=LAST {
        let mut write = |place, value: &[u8]| {
            writer.write(&Entry {
                what: What::Value,
                dag: 0,
                place,
                job,
                release_ns: job * 1_000_000,
                at_ns: job * 1_000_000,
                value,
            });
        };
        // The jobs between would take the test long to write.
        let is_written = !(100..LAST - 1_000).contains(&job);
        if is_written && job % 64 == 0 {
            write(state, &to_bytes(&sums));
        }
        if is_written {
            write(source, &to_bytes(&job));
        }
        sums = add(sums, job);
        if is_written && job % 1_000 == 0 {
            write(result, &to_bytes(&sums.1));
        }
    }
    let machine = replaying(&writer.end()).from("filter", LAST);
    commit(&[filter(2 * LAST, |sums| _ = sums.record())]);
    let job = machine.until("filter", LAST).expect("it is there");
    assert!(
        job.times
            .is_some_and(|times| times.release_ns == LAST * 1_000_000)
    );
    let report = machine.run();
    assert_eq!(found(&report), (vec![], None, None));
    assert_eq!(
        (report.jobs.len(), report.compared),
        (51, 2),
        "from 1,000,000 on"
    );

    let refused = replaying(&bytes).from("filtre", 3);
    let error = fass::finish_create_dags(&[kept()]).unwrap_err().to_string();
    drop(refused);
    assert!(error.contains("no inputs of a dag `filtre`"), "{error}");
}
