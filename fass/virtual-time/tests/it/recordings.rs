//! Recordings beyond those that lead to the same run (`replays`): what a crash leaves behind, one
//! job of a run, recordings of something else, or that have lost something; and recorded states, which
//! a replay that begins with a later job finds as that had, so that what follows from them comes again.

use std::ops::AddAssign;

use crate::support::{commit, every, job_numbers, ms, named, one_in, run, ticking};
use fass::shared::{Raiser, Sample, State};
use fass::{Dag, create_dag, finish_create_dags};
use recording::{Entry, EntryKind, Recording, Role, Writer, to_bytes};
use virtual_time::{JobShown, Passed, Report, RunError, SubtaskShown, Value, VirtualTime};

/// A source that counts on.
fn counting<T: Copy + AddAssign + From<u8>>(from: T) -> impl FnMut() -> (T,) {
    let mut count = from;
    move || {
        count += T::from(1);
        (count,)
    }
}

/// A source, what passes its numbers on, and a sink, of which these topics are recorded.
fn demo(name: &str, topics: &[&str]) -> Dag {
    let dag = every(10, name);
    dag.jobs(3);
    topics.iter().for_each(|topic| _ = dag.record::<u64>(topic));
    let source = dag.source(job_numbers(0)).writes(&["in"]);
    source.register(named("source"));
    dag.register_subtask(|(n,): (u64,)| (n,), vec!["in"], vec!["out"], named("pass"));
    dag.register_subtask(|_: (u64,)| (), vec!["out"], vec![], named("sink"));
    dag
}

fn record(machine: &VirtualTime, dags: &[Dag]) -> Vec<u8> {
    run(machine, dags);
    machine.recording()
}

fn recorded() -> Vec<u8> {
    record(&VirtualTime::new(), &[demo("demo", &["in", "out"])])
}

fn replay(recording: &[u8], dags: &[Dag]) -> Report {
    let machine = VirtualTime::new().replay(recording).expect("whole");
    run(&machine, dags)
}

/// Writes a recording again, with these entries for each of its entries.
fn altered<'e>(bytes: &'e [u8], alter: impl Fn(Entry<'e>, Role) -> Vec<Entry<'e>>) -> Vec<u8> {
    let recording = Recording::read(bytes).expect("whole");
    let mut writer = Writer::new(recording.header());
    for entry in recording.entries() {
        let role = recording.header().channels[usize::from(entry.place)].role;
        let entries = alter(entry, role);
        entries.iter().for_each(|entry| writer.write(entry));
    }
    writer.end()
}

/// A signal at the place of an entry.
fn signal(entry: Entry<'_>) -> Entry<'_> {
    let (what, value) = (EntryKind::Signal, &[][..]);
    Entry {
        what,
        value,
        ..entry
    }
}

/// Returns what a subtask got and gave.
fn of<'j>(job: &'j JobShown, subtask: &str) -> &'j SubtaskShown {
    let mut subtasks = job.subtasks.iter();
    subtasks.find(|of| of.name == subtask).expect("it is one")
}

/// Returns one of the values that passed.
fn value<'p>(passed: &'p [Passed], what: &str) -> &'p Value {
    let found = passed.iter().find(|passed| passed.what == what);
    &found.expect("it passed").value
}

/// A DAG, one that samples it and fails at what it finds in a job, and one that this one releases
/// and that fails, too. Their sources count from `from`, or ask for the time.
fn failing(from: u64) -> [Dag; 3] {
    let teller = every(1, "teller");
    let tell = teller.jobs(1_000).source(counting(from));
    tell.writes(&["told"]).register(named("tell"));
    let latest = teller.record::<u64>("told").latest::<u64>("told");

    let last = create_dag();
    last.name("last").relative_deadline(ms(4));
    let signal = last.record::<u64>("pressed").sporadic(ms(2));
    let press = last.source(counting(from)).writes(&["pressed"]);
    press.register(named("press"));
    let odd = |(presses,): (u64,)| assert!(presses != 341, "odd");
    last.register_subtask(odd, vec!["pressed"], vec![], named("odd"));

    let frail = every(2, "frail");
    frail
        .jobs(1_000)
        .record::<u64>("start")
        .record::<u64>("seen");
    let start = frail.source(|| (fass::now_ns(),)).writes(&["start"]);
    start.register(named("start"));
    let see = |told: Option<Sample<'_, u64>>, (_,): (u64,)| {
        let told = told.map_or(0, |told| *told.value);
        assert!(told != 701, "found 701");
        (told,)
    };
    let see = frail.using(latest.sample()).subtask(see).reads(&["start"]);
    see.writes(&["seen"]).register(named("see"));
    let raise = |mut raiser: Raiser<'_>, (_,): (u64,)| raiser.raise();
    let raise = frail.using(signal.raising()).subtask(raise);
    raise.reads(&["seen"]).register(named("raise"));
    [teller, last, frail]
}

#[test]
fn the_inputs_of_the_last_jobs_lead_to_the_same_faults() {
    let machine = VirtualTime::new().contain_panics().keep_latest(16);
    let bytes = record(&machine, &failing(0));
    assert!(bytes.len() < 8 << 10, "{} bytes", bytes.len());
    let recording = Recording::read(&bytes).expect("whole");
    let header = recording.header();
    let mut jobs = [0; 3];
    for entry in (recording.entries()).filter(|entry| entry.what == EntryKind::Value) {
        let channel = &header.channels[usize::from(entry.place)];
        assert_ne!(channel.role, Role::Result);
        jobs[usize::from(channel.dag)] += usize::from(channel.role == Role::Source);
    }
    assert_eq!(jobs, [16, 16, 16]);
    let clocks = recording.entries().filter(|it| it.what == EntryKind::Clock);
    assert_eq!(clocks.count(), 16, "times of the last jobs only");

    // What a fault cuts need not be recorded, for nothing behind it can run.
    let without_cuts = altered(&bytes, |entry, _| match entry.what {
        EntryKind::Cut => vec![],
        _ => vec![entry],
    });
    assert!(without_cuts.len() < bytes.len());
    for (cores, bytes) in [(1, &bytes), (4, &bytes), (2, &without_cuts)] {
        let machine = VirtualTime::new().cores(cores).contain_panics();
        let machine = machine.replay(bytes).expect("whole");
        let report = run(&machine, &failing(5_000));
        let panics = report.panics.iter().map(|panic| {
            let instance = panic.instance;
            let dag = report.task_set().dag(instance.dag);
            (dag.name(), instance.job, &*panic.message)
        });
        let mut panics: Vec<_> = panics.collect();
        panics.sort_unstable();
        assert_eq!(panics, [("frail", 350, "found 701"), ("last", 340, "odd")]);
        assert_eq!(report.divergence, None);
        let job = machine.until("frail", 350).expect("it is there");
        let see = of(&job, "see");
        assert_eq!(see.panic.as_deref(), Some("found 701"));
        let sampled = Value::Json("[700,700000000,701]".into());
        assert_eq!(value(&see.takes, "told"), &sampled);
    }
}

#[test]
fn a_fault_that_does_not_come_again_is_told() {
    // It follows from what a function remembers of jobs that are not recorded.
    let build = || {
        let dag = every(1, "tired");
        let source = dag.jobs(100).record::<u8>("go").source(|| (1_u8,));
        source.writes(&["go"]).register(named("source"));
        let mut calls = 0;
        let count = move |_: (u8,)| {
            calls += 1;
            assert!(calls != 60, "tired");
        };
        dag.register_subtask(count, vec!["go"], vec![], named("count"));
        [dag]
    };
    let machine = || VirtualTime::new().contain_panics();
    let bytes = record(&machine().keep_latest(16), &build());
    let replaying = machine().replay(&bytes).expect("whole");
    commit(&build());
    let shown = |job| replaying.until("tired", job).expect("it is there");
    let job = shown(59).to_string();
    let said = "subtask `count` of dag `tired` failed in job 59 of the recorded run, and has not in \
         this one; ";
    assert!(job.contains(": in time\n") && job.contains(said), "{job}");
    assert_eq!(shown(58).unmet_fault, None);
    let report = replaying.run();
    assert_eq!(report.panics, []);
    assert_eq!(report.lacking, Some(("tired".into(), 44)));
    let divergence = report.divergence.expect("a fault").to_string();
    assert!(divergence.starts_with(said), "{divergence}");

    // The whole run has all that they remember.
    let bytes = record(&machine(), &build());
    let report = run(&machine().replay(&bytes).expect("whole"), &build());
    let found = (report.panics.len(), report.divergence, report.lacking);
    assert_eq!(found, (1, None, None));
}

#[test]
fn a_job_that_a_survived_fault_has_cost_is_lost_in_the_replay_too() {
    let build = || {
        let dag = every(10, "demo");
        let make = || |(n,): (u64,)| assert!(n != 1, "one");
        dag.jobs(3).record::<u64>("in").survive_faults(one_in(2, 1));
        let source = dag.source(job_numbers(0)).writes(&["in"]);
        source.register(named("source"));
        let sink = dag.restarting(make).reads(&["in"]);
        sink.register(named("fails"));
        [dag]
    };
    let machine = || VirtualTime::new().contain_panics();
    let bytes = record(&machine(), &build());
    let replaying = machine().replay(&bytes).expect("whole");
    commit(&build());
    for (job, outcome) in [(0, "in time"), (1, "cut by a fault"), (2, "in time")] {
        let shown = replaying
            .until("demo", job)
            .expect("it is there")
            .to_string();
        let first = shown.lines().next();
        assert!(
            first.is_some_and(|line| line.ends_with(&format!(": {outcome}"))),
            "{shown}"
        );
    }
}

/// A DAG that tells, and one that samples it, asks for the time, and fails in job 3.
fn two() -> [Dag; 2] {
    let teller = every(10, "teller");
    let mut told = counting(0_u32);
    let tell = teller.jobs(20).source(move || (told().0 * 7,));
    tell.writes(&["told"]).register(named("tell"));
    let told = teller.record::<u32>("told").latest::<u32>("told");

    let asker = every(15, "asker");
    asker
        .jobs(20)
        .record::<u8>("start")
        .record::<[u32; 2]>("pair");
    let start = asker.source(|| (1_u8,)).writes(&["start"]);
    start.register(named("start"));
    let pair = |told: Option<Sample<'_, u32>>, (one,): (u8,)| {
        let told = told.map_or(0, |told| *told.value);
        assert!(fass::now_ns() != 45_000_000, "at 45 ms");
        ([told, one.into()], String::from("not recorded"))
    };
    let pair = asker.using(told.sample()).subtask(pair).reads(&["start"]);
    pair.writes(&["pair", "text"]).register(named("pair"));
    let sink = |_: ([u32; 2], String)| ();
    asker.register_subtask(sink, vec!["pair", "text"], vec![], named("sink"));
    [teller, asker]
}

#[test]
fn a_replay_stops_at_a_job_and_shows_what_its_subtasks_got_and_gave() {
    let recording = record(&VirtualTime::new().contain_panics(), &two());
    let machine = VirtualTime::new().cores(2).contain_panics();
    let machine = machine.replay(&recording).expect("whole");
    commit(&two());
    let job = machine.until("asker", 2).expect("it is there");
    assert_eq!(
        job.to_string(),
        "job 2 of dag `asker`, due at 30000000 ns: in time\n\
         \x20 `start` from 30000000 ns on core 0\n\
         \x20   gives `start`: 1\n\
         \x20 `pair` from 30000000 ns on core 1\n\
         \x20   takes `start`: 1\n\
         \x20   takes `told`: [3,30000000,28]\n\
         \x20   takes `the time`: [30000000]\n\
         \x20   gives `pair`: [28,1]\n\
         \x20   gives `text`: not recorded, a `alloc::string::String`; add `dag.record` for it\n\
         \x20 `sink` from 30000000 ns on core 1\n\
         \x20   takes `pair`: [28,1]\n\
         \x20   takes `text`: not recorded, a `alloc::string::String`; add `dag.record` for it"
    );
    // Nothing behind that job has run.
    assert_eq!(machine.run_for(ms(0)).end_ns, 30_000_000);

    // The next one fails, and has what it failed with.
    let job = machine.until("asker", 3).expect("it is there");
    let pair = of(&job, "pair");
    assert_eq!(pair.panic.as_deref(), Some("at 45 ms"));
    let told = Value::Json("[4,40000000,35]".into());
    assert_eq!(value(&pair.takes, "told"), &told);
    assert_eq!(value(&pair.gives, "pair"), &Value::None);

    // A job that is over is shown without a step.
    let again = machine.until("asker", 2).expect("it is over");
    let asked = Value::Json("[30000000]".into());
    assert_eq!(value(&of(&again, "pair").takes, "the time"), &asked);
    let refused = machine.until("nobody", 2).expect_err("there is none");
    assert!(matches!(refused, RunError::NoSuchDag { .. }));
    let said = "there is no dag `nobody`; there are `teller`, `asker`";
    assert_eq!(refused.to_string(), said);
    let late = machine.until("asker", 19).expect("the run ends before");
    assert!(late.to_string().contains("was not released"), "{late}");
}

#[test]
fn a_recording_that_does_not_fit_is_refused() {
    let both = &["in", "out"];
    let of_two = [demo("demo", both), ticking("slow", 1)];
    of_two[1].jobs(1);
    let of_two = record(&VirtualTime::new(), &of_two);
    let graph = every(10, "demo");
    let source = graph.record::<u64>("in").source(job_numbers(0));
    source.writes(&["in"]).register(named("source"));
    let list = || {
        let dag = every(10, "demo");
        dag.jobs(3).record::<Vec<u64>>("list");
        let mut lengths = 511..;
        // 4 bytes and 511 times 8 fit into 4 KiB.
        let source = dag.source(move || (vec![7_u64; lengths.next().unwrap_or(0)],));
        source.writes(&["list"]).register(named("source"));
        dag
    };
    let lost = record(&VirtualTime::new(), &[list()]);
    let read = Recording::read(&lost).expect("whole");
    assert_eq!((read.count(), read.lost()), (3, 2));
    let whole = recorded();
    let job = 1 << 40;
    let [far_value, far_signal] = [|entry| entry, signal].map(|as_what| {
        altered(&whole, |entry, _| match entry.job {
            0 => vec![as_what(Entry { job, ..entry })],
            _ => vec![],
        })
    });
    let other_name = "the recording's dag 0 is `demo`, and here it is `other`";
    let other_graph = "the recording is of another graph of dag `demo`";
    let fewer = "the recording's dag 1 is `slow`, and here there is none";
    let forgotten = "topic `in` of a source is in the recording, and is not recorded here";
    let has_lost = "the recording has lost topic `list` of job 1";
    let later = |offset, period| {
        let dag = demo("demo", both);
        dag.offset(offset).period(period);
        dag
    };
    let faster = "job 1 of dag `demo` was due at 10000000 ns, and is due at 5000000 ns here";
    let offset = "job 0 of dag `demo` was due at 0 ns, and is due at 7000000 ns here";
    let too_far = "the recording has job 1099511627776 of dag `demo`";
    for (recording, dag, words) in [
        (&whole, demo("other", both), other_name),
        (&whole, graph, other_graph),
        (&of_two, demo("demo", both), fewer),
        (&whole, demo("demo", &["out"]), forgotten),
        (&whole, demo("demo", &[]), forgotten),
        (&lost, list(), has_lost),
        (&far_value, demo("demo", both), too_far),
        (&far_signal, demo("demo", both), too_far),
        (&whole, later(ms(0), ms(5)), faster),
        (&whole, later(ms(7), ms(10)), offset),
    ] {
        let _machine = VirtualTime::new().replay(recording).expect("whole");
        let said = finish_create_dags(&[dag]).expect_err(words).to_string();
        assert!(said.contains(words), "{said}");
    }
}

#[test]
fn results_that_are_recorded_no_more_are_counted() {
    let report = replay(&recorded(), &[demo("demo", &["in"])]);
    assert_eq!((report.compared, report.uncompared), (0, 3));
}

#[test]
fn a_recorded_signal_to_a_periodic_dag_is_none() {
    let recorded = recorded();
    let with_signals = altered(&recorded, |entry, _| vec![entry, signal(entry)]);
    let report = replay(&with_signals, &[demo("demo", &["in", "out"])]);
    assert_eq!((report.compared, report.divergence), (3, None));
}

#[test]
fn a_recorded_value_that_is_not_computed_is_a_divergence() {
    let recorded = recorded();
    // Of the last job results only, which no replay computes, as no source returns anything.
    let bytes = altered(&recorded, |entry, role| {
        let is_kept = entry.job != 2 || role == Role::Result;
        is_kept.then_some(entry).into_iter().collect()
    });
    let demo = || [demo("demo", &["in", "out"])];
    let divergence = replay(&bytes, &demo()).divergence;
    let divergence = divergence.expect("one is not computed");
    assert_eq!((&*divergence.topic, divergence.job), ("out", 2));
    let said = divergence.to_string();
    assert!(
        said.contains("2 is recorded, and nothing is computed"),
        "{said}"
    );

    // Before its end a run may still compute it.
    let machine = VirtualTime::new().replay(&bytes).expect("whole");
    commit(&demo());
    assert_eq!(machine.run_for(ms(5)).divergence, None);
}

#[test]
fn a_second_commit_that_is_refused_leaves_the_recording_as_it_is() {
    let machine = VirtualTime::new();
    let recording = record(&machine, &[demo("demo", &["in"])]);
    finish_create_dags(&[demo("other", &["in", "out"])]).expect_err("a second plan");
    assert_eq!(machine.recording(), recording);
}

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
    record(&machine, &[dag])
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

#[test]
fn a_fault_that_follows_from_a_recorded_state_comes_again() {
    let bytes = crash(kept());
    let recording = Recording::read(&bytes).expect("whole");
    let states = recording.entries().filter(|entry| {
        let channel = &recording.header().channels[usize::from(entry.place)];
        entry.what == EntryKind::Value && (channel.role, &*channel.topic) == (Role::State, "sums")
    });
    // Not only every 64, for of that many there are no inputs.
    let states: Vec<u64> = states.map(|entry| entry.job).collect();
    assert_eq!(states, [4_992, 5_000]);
    assert!(recording.entries().any(|it| it.what == EntryKind::Fault));
    for cores in [1, 4] {
        let machine = replaying(&bytes).cores(cores);
        let report = run(&machine, &[kept()]);
        assert_eq!(found(&report), (vec![FAULT], None, None));
        assert_eq!(report.jobs.len(), 9, "none before 4,992");
        let job = machine.until("filter", FAULT).expect("it is there");
        let step = of(&job, "step");
        assert_eq!(step.panic.as_deref(), Some("too great"));
        let (sum, sums) = (0..FAULT).fold((0, 0), add);
        let shown = Value::Json(format!("[{sum},{sums}]"));
        assert_eq!(value(&step.takes, "sums"), &shown, "it is found");
    }
}

#[test]
fn an_altered_state_is_found() {
    let bytes = crash(kept());
    let is_state = |entry: &Entry<'_>, role| entry.what == EntryKind::Value && role == Role::State;
    let shorter = altered(&bytes, |entry, role| match is_state(&entry, role) {
        true => vec![Entry {
            value: &entry.value[1..],
            ..entry
        }],
        false => vec![entry],
    });
    let refused = VirtualTime::new().replay(&shorter).unwrap_err().to_string();
    assert!(refused.contains("expected a u64, 8 bytes"), "{refused}");

    // What is one of its type is not what the filter had.
    let value = &*to_bytes(&(1_u64, 2_u64));
    let later = altered(&bytes, |entry, role| match entry.job {
        FAULT if is_state(&entry, role) => vec![Entry { value, ..entry }],
        _ => vec![entry],
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
    let error = finish_create_dags(&[other]).unwrap_err().to_string();
    let said = "state `sums` was recorded with values of type (u64, u64), and is of type u64 now";
    assert!(error.contains(said), "{error}");
}

#[test]
fn a_late_job_of_a_long_recording_is_computed_at_once() {
    const LAST: u64 = 4_050;
    let long = || filter(LAST + 1, |sums| _ = sums.record());
    let bytes = record(&VirtualTime::new(), &[long()]);
    let machine = replaying(&bytes).from("filter", LAST);
    commit(&[long()]);
    let job = machine.until("filter", LAST).expect("it is there");
    let release_ns = job.times.and_then(|times| times.release_ns);
    assert_eq!(release_ns, Some(LAST * 1_000_000));
    let report = machine.run();
    assert_eq!(found(&report), (vec![], None, None));
    // From job 4,032 on, of which the state is recorded, and compared with the results.
    assert_eq!((report.jobs.len(), report.compared), (19, 20));

    let refused = replaying(&bytes).from("filtre", 3);
    let error = finish_create_dags(&[kept()]).unwrap_err().to_string();
    drop(refused);
    assert!(error.contains("no inputs of a dag `filtre`"), "{error}");
}
