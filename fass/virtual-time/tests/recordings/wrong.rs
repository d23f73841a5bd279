//! Recordings that are of something else, have lost something, or say what cannot be.

use fass::{CommitError, Dag, Fault, OverrunPolicy, Sample, create_dag, finish_create_dags};
use recording::{Entry, Recording, Role, What, Writer};
use virtual_time::VirtualTime;

use super::{cheating, forked, ms, named, overrun, record, replay};

/// Returns what the commit says of a recording that it refuses.
fn refused(recording: &[u8], dags: &[Dag]) -> String {
    let _machine = VirtualTime::new().replay(recording).expect("whole");
    let error: CommitError = finish_create_dags(dags).expect_err("it is of something else");
    error.to_string()
}

#[test]
fn a_recording_of_something_else_is_refused() {
    let recording = record(&VirtualTime::new(), &[forked(1)]);
    let said = refused(&recording, &[cheating()]);
    assert!(
        said.contains("the recording's dag 0 is `forked`, and here it is `cheating`"),
        "{said}"
    );
    let other = cheating();
    other.name("forked");
    let said = refused(&recording, &[other]);
    assert!(
        said.contains("the recording is of another graph of dag `forked`"),
        "{said}"
    );
    let two = record(
        &VirtualTime::new(),
        &[forked(1), overrun(OverrunPolicy::Skip, 0)],
    );
    let said = refused(&two, &[forked(1)]);
    assert!(
        said.contains("the recording's dag 1 is `slow`, and here there is none"),
        "{said}"
    );
    assert!(
        VirtualTime::new()
            .replay(&recording[..recording.len() - 1])
            .is_err()
    );
}

#[test]
fn what_is_recorded_no_more_is_refused_of_a_source_and_counted_of_others() {
    let build = |topics: &[&str]| {
        let dag = create_dag();
        dag.name("demo").jobs(3);
        topics.iter().for_each(|topic| _ = dag.record::<u8>(topic));
        dag.register_periodic_subtask(|| (1_u8,), vec!["in"], ms(10), named("source"));
        let pass = |(value,): (u8,)| (value,);
        dag.register_subtask(pass, vec!["in"], vec!["out"], named("pass"));
        dag.register_sink_subtask(|_: (u8,)| (), vec!["out"], ms(10), named("sink"));
        dag
    };
    let recording = record(&VirtualTime::new(), &[build(&["in", "out"])]);
    for topics in [&["out"][..], &[]] {
        let said = refused(&recording, &[build(topics)]);
        assert!(
            said.contains("topic `in` of a source is in the recording, and is not recorded here"),
            "{said}"
        );
    }
    let (report, _) = replay(&recording, VirtualTime::new(), &[build(&["in"])]);
    assert_eq!((report.compared, report.uncompared), (0, 3));
}

#[test]
fn a_recorded_signal_to_a_periodic_dag_is_none() {
    let recorded = record(&VirtualTime::new(), &[forked(1)]);
    let recorded = Recording::read(&recorded).expect("whole");
    let mut writer = Writer::new(recorded.header());
    for entry in recorded.entries() {
        writer.write(&entry);
        let (what, value) = (What::Signal, &[][..]);
        writer.write(&Entry {
            what,
            value,
            ..entry
        });
    }
    let (report, _) = replay(&writer.finish(), VirtualTime::new(), &[forked(2)]);
    assert_eq!((report.compared, report.divergence), (60, None));
}

#[test]
fn what_has_no_room_is_lost_and_the_recording_says_so() {
    let build = || {
        let dag = create_dag();
        dag.name("large")
            .jobs(3)
            .relative_deadline(ms(10))
            .record::<Vec<u64>>("list");
        let mut length = 510;
        let source = move || {
            length += 1;
            (vec![7_u64; length],)
        };
        dag.register_periodic_subtask(source, vec!["list"], ms(10), named("source"));
        dag
    };
    let bytes = record(&VirtualTime::new(), &[build()]);
    let recording = Recording::read(&bytes).expect("whole");
    // 4 bytes and 511 times 8 fit into 4 KiB.
    assert_eq!((recording.count(), recording.lost()), (3, 2));
    let said = refused(&bytes, &[build()]);
    assert!(
        said.contains("the recording has lost topic `list` of job 1"),
        "{said}"
    );
}

#[test]
fn what_is_recorded_in_part_is_refused() {
    let faults = |topics: &[&str]| {
        let (teller, half) = (create_dag(), create_dag());
        teller.name("teller").jobs(1).relative_deadline(ms(10));
        teller.register_periodic_subtask(|| (1_u8,), vec!["told"], ms(10), named("tell"));
        half.name("half").jobs(1);
        half.register_periodic_subtask(|| (1_u8, 2_u8), vec!["a", "b"], ms(10), named("source"));
        let sink = |_: Option<Sample<'_, u8>>, _: (u8, u8)| ();
        let uses = teller.latest::<u8>("told").sample();
        (half.using(uses))
            .subtask(sink)
            .reads(&["a", "b"])
            .due(ms(10))
            .register(named("sink"));
        for topic in topics {
            let dag = if *topic == "told" { &teller } else { &half };
            dag.record::<u8>(topic);
        }
        let _machine = VirtualTime::new();
        let refused = finish_create_dags(&[teller, half]).err();
        let faults = refused
            .map(|error| error.faults().to_vec())
            .unwrap_or_default();
        faults.iter().map(Fault::code).collect::<Vec<_>>()
    };
    let (part, sample) = ("source_partly_recorded", "sample_not_recorded");
    assert_eq!(faults(&["a"]), [part, sample]);
    assert_eq!(faults(&["a", "b"]), [sample]);
    for sound in [&[][..], &["told"], &["a", "b", "told"]] {
        assert_eq!(faults(sound), [""; 0]);
    }
}

#[test]
fn a_recorded_value_that_is_not_computed_is_a_divergence() {
    let recorded = record(&VirtualTime::new(), &[forked(1)]);
    let recorded = Recording::read(&recorded).expect("whole");
    let mut writer = Writer::new(recorded.header());
    for entry in recorded.entries() {
        // Of the last job results only, which no replay computes, as no source returns anything.
        let channel = &recorded.header().channels[usize::from(entry.place)];
        if entry.job != 19 || channel.role == Role::Result {
            writer.write(&entry);
        }
    }
    let bytes = writer.finish();
    let (report, _) = replay(&bytes, VirtualTime::new(), &[forked(2)]);
    let divergence = report.divergence.expect("one is not computed");
    assert_eq!((&*divergence.topic, divergence.job), ("left", 19));
    let said = divergence.to_string();
    assert!(
        said.contains("is recorded, and nothing is computed"),
        "{said}"
    );

    // Before its end a run may still compute it.
    let machine = VirtualTime::new().replay(&bytes).expect("whole");
    finish_create_dags(&[forked(2)]).expect("sound");
    assert_eq!(machine.run_for(ms(60)).divergence, None);
}

#[test]
fn a_second_commit_that_is_refused_leaves_the_recording_as_it_is() {
    let machine = VirtualTime::new();
    let recording = record(&machine, &[forked(1)]);
    finish_create_dags(&[overrun(OverrunPolicy::Skip, 0), cheating()]).expect_err("a second plan");
    assert_eq!(machine.recording(), recording);
}

#[test]
fn a_recording_of_more_jobs_than_a_replay_can_go_through_is_refused() {
    let recorded = record(&VirtualTime::new(), &[forked(1)]);
    let recorded = Recording::read(&recorded).expect("whole");
    let entry = recorded.entries().next().expect("the first");
    for what in [What::Value, What::Signal] {
        let mut writer = Writer::new(recorded.header());
        writer.write(&Entry {
            what,
            job: 1 << 40,
            value: match what {
                What::Value => entry.value,
                _ => &[],
            },
            ..entry
        });
        let said = refused(&writer.finish(), &[forked(1)]);
        assert!(
            said.contains("the recording has job 1099511627776 of dag `forked`"),
            "{said}"
        );
    }
}
