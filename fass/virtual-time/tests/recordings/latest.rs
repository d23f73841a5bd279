//! What a crash leaves behind: the inputs of the last jobs, from which its fault comes again.

use fass::{Dag, Sample, Signal, create_dag, finish_create_dags};
use recording::{Recording, Role, What, Writer};
use virtual_time::{Value, VirtualTime};

use super::{counting, ms, named, record};

/// A DAG, one that samples it and fails at what it finds in a job, and one that this one releases
/// and that fails, too. Their sources count from `from`.
fn failing(from: u64) -> ([Dag; 3], Signal) {
    let teller = create_dag();
    teller.name("teller").jobs(1_000).relative_deadline(ms(1));
    let tell = counting(from);
    teller.register_periodic_subtask(tell, vec!["told"], ms(1), named("tell"));
    let latest = teller.record::<u64>("told").latest::<u64>("told");

    let last = create_dag();
    last.name("last")
        .record::<u64>("pressed")
        .relative_deadline(ms(4));
    let press = counting(from);
    let signal = last.sporadic(ms(2));
    last.source(press)
        .writes(&["pressed"])
        .register(named("press"));
    let odd = |(presses,): (u64,)| assert!(presses != 341, "odd");
    last.register_sink_subtask(odd, vec!["pressed"], ms(4), named("odd"));

    let frail = create_dag();
    frail.name("frail").jobs(1_000).record::<u8>("start");
    frail.record::<u64>("seen");
    frail.register_periodic_subtask(|| (1_u8,), vec!["start"], ms(2), named("start"));
    let see = |told: Option<Sample<'_, u64>>, (_,): (u8,)| {
        let told = told.map_or(0, |told| *told.value);
        assert!(told != 701, "found 701");
        (told,)
    };
    let uses = latest.sample();
    (frail.using(uses))
        .subtask(see)
        .reads(&["start"])
        .writes(&["seen"])
        .register(named("see"));
    let raise = |mut raiser: fass::Raiser<'_>, (_,): (u64,)| raiser.raise();
    let uses = signal.raising();
    (frail.using(uses))
        .subtask(raise)
        .reads(&["seen"])
        .due(ms(2))
        .register(named("raise"));
    ([teller, last, frail], signal)
}

#[test]
fn the_inputs_of_the_last_jobs_lead_to_the_same_faults() {
    let machine = VirtualTime::new().contain_panics().keep_latest(16);
    let bytes = record(&machine, &failing(0).0);
    assert!(bytes.len() < 8 << 10, "{} bytes", bytes.len());
    let recording = Recording::read(&bytes).expect("whole");
    let header = recording.header();
    let values = (recording.entries()).filter(|entry| entry.what == What::Value);
    let mut jobs = [0; 3];
    for entry in values {
        let channel = &header.channels[usize::from(entry.place)];
        assert_ne!(channel.role, Role::Result);
        jobs[usize::from(channel.dag)] += usize::from(channel.role == Role::Source);
    }
    assert_eq!(jobs, [16, 16, 16]);

    // What a fault cuts need not be recorded, for nothing behind it can run.
    let mut writer = Writer::new(header);
    let entries = recording.entries().filter(|entry| entry.what != What::Cut);
    entries.for_each(|entry| writer.write(&entry));
    let without_cuts = writer.finish();
    assert!(without_cuts.len() < bytes.len());
    for (cores, bytes) in [(1, &bytes), (4, &bytes), (2, &without_cuts)] {
        let machine = VirtualTime::new().cores(cores).contain_panics();
        let machine = machine.replay(bytes).expect("whole");
        finish_create_dags(&failing(5_000).0).expect("sound");
        let report = machine.run();
        assert_eq!(report.violations(), []);
        let mut panics: Vec<(u32, u64, &str)> = (report.panics.iter())
            .map(|panic| (panic.instance.dag.0, panic.instance.job, &*panic.message))
            .collect();
        panics.sort_unstable();
        assert_eq!(panics, [(1, 340, "odd"), (2, 350, "found 701")]);
        assert_eq!(report.divergence, None);
        let job = machine.until("frail", 350).expect("it is there");
        assert_eq!(job.subtasks[1].panic.as_deref(), Some("found 701"));
        let sampled = Value::Json("[700,700000000,701]".into());
        assert_eq!(job.subtasks[1].takes[1].value, sampled);
    }
}

#[test]
fn a_fault_that_does_not_come_again_is_told() {
    // It follows from what a function remembers of jobs that are not recorded.
    let build = || {
        let dag = create_dag();
        dag.name("tired").jobs(100).record::<u8>("go");
        dag.register_periodic_subtask(|| (1_u8,), vec!["go"], ms(1), named("source"));
        let mut calls = 0;
        let count = move |_: (u8,)| {
            calls += 1;
            assert!(calls != 60, "tired");
        };
        dag.register_sink_subtask(count, vec!["go"], ms(1), named("count"));
        dag
    };
    let bytes = record(
        &VirtualTime::new().contain_panics().keep_latest(16),
        &[build()],
    );
    let machine = VirtualTime::new()
        .contain_panics()
        .replay(&bytes)
        .expect("whole");
    finish_create_dags(&[build()]).expect("sound");
    let job = machine.until("tired", 59).expect("it is there").to_string();
    let said = "subtask `count` of dag `tired` failed in job 59 of the recorded run, and has not in \
         this one; ";
    assert!(job.contains(": in time\n") && job.contains(said), "{job}");
    let job = machine.until("tired", 58).expect("it is there");
    assert_eq!(job.unmet_fault, None);
    let report = machine.run();
    assert_eq!(report.panics, []);
    assert_eq!(report.lacking, Some(("tired".into(), 44)));
    assert!(
        report
            .divergence
            .expect("a fault")
            .to_string()
            .starts_with(said)
    );

    // The whole run has all that they remember.
    let bytes = record(&VirtualTime::new().contain_panics(), &[build()]);
    let machine = VirtualTime::new()
        .contain_panics()
        .replay(&bytes)
        .expect("whole");
    finish_create_dags(&[build()]).expect("sound");
    let report = machine.run();
    assert_eq!(
        (report.panics.len(), report.divergence, report.lacking),
        (1, None, None)
    );
}

#[test]
fn a_machine_that_keeps_the_last_jobs_keeps_times_of_no_others() {
    let dag = create_dag();
    dag.name("asks")
        .jobs(100)
        .relative_deadline(ms(1))
        .record::<u64>("time");
    dag.register_periodic_subtask(|| (fass::now_ns(),), vec!["time"], ms(1), named("ask"));
    let bytes = record(&VirtualTime::new().keep_latest(4), &[dag]);
    let recording = Recording::read(&bytes).expect("whole");
    let count = |what| {
        recording
            .entries()
            .filter(|entry| entry.what == what)
            .count()
    };
    assert_eq!((count(What::Value), count(What::Clock)), (4, 4));
}
