//! Stopping at a job, and what is seen of it.

use fass::{Dag, Sample, create_dag, finish_create_dags};
use virtual_time::{RunError, Value, VirtualTime};

use super::{ms, named, record};

/// A DAG that tells, and one that samples it, asks for the time, and fails in job 3.
fn two() -> [Dag; 2] {
    let teller = create_dag();
    teller.name("teller").jobs(20).relative_deadline(ms(10));
    teller.record::<u32>("told");
    let mut told = 0_u32;
    let tell = move || {
        told += 7;
        (told,)
    };
    teller.register_periodic_subtask(tell, vec!["told"], ms(10), named("tell"));
    let told = teller.latest::<u32>("told");

    let asker = create_dag();
    asker
        .name("asker")
        .jobs(20)
        .record::<u8>("start")
        .record::<[u32; 2]>("pair");
    asker.register_periodic_subtask(|| (1_u8,), vec!["start"], ms(15), named("start"));
    let pair = |told: Option<Sample<'_, u32>>, (one,): (u8,)| {
        let told = told.map_or(0, |told| *told.value);
        assert!(fass::now_ns() != 45_000_000, "at 45 ms");
        ([told, one.into()], String::from("not recorded"))
    };
    asker
        .using(told.sample())
        .subtask(pair)
        .reads(&["start"])
        .writes(&["pair", "text"])
        .register(named("pair"));
    let sink = |_: ([u32; 2], String)| ();
    asker.register_sink_subtask(sink, vec!["pair", "text"], ms(15), named("sink"));
    [teller, asker]
}

#[test]
fn a_replay_stops_at_a_job_and_shows_what_its_subtasks_got_and_gave() {
    let recording = record(&VirtualTime::new().contain_panics(), &two());
    let machine = VirtualTime::new().cores(2).contain_panics();
    let machine = machine.replay(&recording).expect("whole");
    finish_create_dags(&two()).expect("sound");
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
    let pair = &job.subtasks[1];
    assert_eq!(pair.panic.as_deref(), Some("at 45 ms"));
    assert_eq!(pair.takes[1].value, Value::Json("[4,40000000,35]".into()));
    assert_eq!(pair.gives[0].value, Value::None);

    // A job that is over is shown without a step.
    let again = machine.until("asker", 2).expect("it is over");
    assert_eq!(again.subtasks[1].takes[2].what, "the time");
    let refused = machine.until("nobody", 2).expect_err("there is none");
    assert!(matches!(refused, RunError::NoSuchDag { .. }));
    let said = refused.to_string();
    assert_eq!(
        said,
        "there is no dag `nobody`; there are `teller`, `asker`"
    );
    let late = machine.until("asker", 19).expect("the run ends before");
    assert!(late.to_string().contains("was not released"), "{late}");
}
