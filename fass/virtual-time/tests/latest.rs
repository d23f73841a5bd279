//! Latest values between DAGs, in virtual time.

mod support;

use support::run;

use fass::{Dag, Latest, Sample, Unique, create_dag, finish_create_dags};
use support::sharing::{Seen, job_numbers, ms, named, taking};
use virtual_time::VirtualTime;

/// Offers job numbers as `count`, every `period`, each after 4 ms of work.
fn writer(period_ms: u64, jobs: u64) -> (Dag, Latest<u64>) {
    let dag = create_dag();
    dag.name("writer")
        .jobs(jobs)
        .relative_deadline(ms(period_ms));
    let source = job_numbers(4);
    dag.register_periodic_subtask(source, vec!["count"], ms(period_ms), taking("write", 4));
    let latest = dag.latest("count");
    (dag, latest)
}

/// When a sample was taken, and its job and completion, in milliseconds.
type Sampled = (u64, Option<(u64, u64)>);

/// Samples every `period`: the time of each sample, its value and its completion.
fn reader(latest: &Latest<u64>, period_ms: u64, jobs: u64) -> (Dag, Seen<Sampled>) {
    let dag = create_dag();
    dag.name("reader")
        .jobs(jobs)
        .relative_deadline(ms(period_ms));
    let (seen, keep) = Seen::shared();
    dag.period(ms(period_ms))
        .using(latest.sample())
        .source(move |count: Option<Sample<'_, u64>>| {
            let found = count.map(|count| {
                assert_eq!(*count.value, count.job);
                (count.job, count.completed_ns / 1_000_000)
            });
            keep.add((fass::now_ns() / 1_000_000, found));
        })
        .register(taking("read", 1));
    (dag, seen)
}

#[test]
fn a_value_shows_when_its_instance_is_complete_and_not_before() {
    let machine = VirtualTime::new().cores(2);
    let (write, latest) = writer(10, 3);
    let (read, seen) = reader(&latest, 2, 13);
    finish_create_dags(&[write, read]).unwrap();
    assert_eq!(machine.run().violations(), []);
    let seen = seen.all();
    let of = |job: u64| Some((job, 10 * job + 4));
    let expected = (0..13).map(|k| {
        let now_ms = 2 * k;
        (
            now_ms,
            if now_ms < 4 {
                None
            } else {
                of((now_ms - 4) / 10)
            },
        )
    });
    assert_eq!(seen[..], expected.collect::<Vec<_>>());
}

#[test]
fn several_readers_each_have_their_own_view() {
    let machine = VirtualTime::new().cores(3);
    let (write, latest) = writer(10, 5);
    let (one, seen_by_one) = reader(&latest, 5, 10);
    let (other, seen_by_other) = reader(&latest, 25, 2);
    one.name("one");
    other.name("other");
    run(&machine, &[write, one, other]);
    assert_eq!(seen_by_one.all()[5], (25, Some((2, 24))));
    assert_eq!(seen_by_other.all()[1], (25, Some((2, 24))));
}

#[test]
fn the_staleness_bound_holds_and_is_told_at_commit() {
    for (writer_ms, reader_ms) in [(10, 3), (10, 7), (25, 4), (9, 30)] {
        let machine = VirtualTime::new();
        let (write, latest) = writer(writer_ms, 40);
        let (read, seen) = reader(&latest, reader_ms, 36 * writer_ms / reader_ms);
        let commit = finish_create_dags(&[write, read]).unwrap();
        let staleness = &commit.staleness()[0];
        let text = staleness.to_string();
        let start = "subtask `read` of dag `reader` samples topic `count` of dag `writer`, less";
        assert!(text.starts_with(start), "{text}");
        let bound_ms = staleness.bound.unwrap().as_millis();
        machine.run();
        for (now_ms, sample) in seen.all() {
            if let Some((job, _)) = sample {
                let age_ms = now_ms - job * writer_ms;
                assert!(u128::from(age_ms) < bound_ms, "{writer_ms}, {reader_ms}");
            }
        }
    }
}

#[test]
fn a_message_that_only_moves_has_one_sampler() {
    let machine = VirtualTime::new();
    let dag = create_dag();
    dag.jobs(2).relative_deadline(ms(10));
    let source = || (Unique::new(7),);
    dag.register_periodic_subtask(source, vec!["key"], ms(10), named("write"));
    let key = dag.latest::<Unique<i32>>("key");
    let read = create_dag();
    read.jobs(2).relative_deadline(ms(10)).offset(ms(5));
    read.period(ms(10))
        .using(key.sample())
        .source(|key: Option<Sample<'_, Unique<i32>>>| assert_eq!(**key.unwrap().value, 7))
        .register(named("read"));
    finish_create_dags(&[dag, read.clone()]).unwrap();
    assert_eq!(machine.run().dag(&read).statistics().completed, 2);
}

#[test]
fn a_panicking_instance_publishes_nothing() {
    let machine = VirtualTime::new().contain_panics();
    let dag = create_dag();
    dag.jobs(5).relative_deadline(ms(10));
    let mut job = 0_u64;
    let source = move || {
        job += 1;
        assert!(job < 3, "enough");
        (job,)
    };
    dag.register_periodic_subtask(source, vec!["job"], ms(10), named("write"));
    let latest = dag.latest::<u64>("job");
    let (read, seen) = {
        let read = create_dag();
        read.jobs(5).relative_deadline(ms(10)).offset(ms(5));
        let (seen, keep) = Seen::shared();
        read.period(ms(10))
            .using(latest.sample())
            .source(move |job: Option<Sample<'_, u64>>| keep.add(*job.unwrap().value))
            .register(named("read"));
        (read, seen)
    };
    run(&machine, &[dag, read]);
    assert_eq!(seen.all()[..], [1, 2, 2, 2, 2]);
}
#[test]
fn the_same_set_can_be_built_again() {
    let run = || {
        let machine = VirtualTime::new().cores(2);
        let (write, latest) = writer(10, 3);
        let (read, seen) = reader(&latest, 3, 8);
        finish_create_dags(&[write, read]).unwrap();
        let events = machine.run().event_lines();
        (events, seen.all())
    };
    assert_eq!(run(), run());
}
