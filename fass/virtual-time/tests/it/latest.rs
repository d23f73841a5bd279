//! Latest values between DAGs, in virtual time.

use crate::support::{Seen, every, job_numbers, ms, named, run, taking};
use fass::shared::{Latest, Sample};
use fass::{Dag, Unique, finish_create_dags};
use virtual_time::VirtualTime;

/// Offers job numbers as `count`, every `period`, each after 4 ms of work.
fn writer(period_ms: u64, jobs: u64) -> (Dag, Latest<u64>) {
    let dag = every(period_ms, "writer");
    let source = dag.jobs(jobs).source(job_numbers(4));
    source.writes(&["count"]).register(taking("write", 4));
    let latest = dag.latest("count");
    (dag, latest)
}

/// When a sample was taken, and its job and completion, in milliseconds.
type Sampled = (u64, Option<(u64, u64)>);

/// Samples every `period`: the time of each sample, its value and its completion.
fn reader(latest: &Latest<u64>, period_ms: u64, jobs: u64) -> (Dag, Seen<Sampled>) {
    let dag = every(period_ms, "reader");
    let (seen, keep) = Seen::shared();
    let look = move |count: Option<Sample<'_, u64>>| {
        let found = count.map(|count| {
            assert_eq!(*count.value, count.job);
            (count.job, count.completed_ns / 1_000_000)
        });
        keep.add((fass::now_ns() / 1_000_000, found));
    };
    let source = dag.jobs(jobs).using(latest.sample()).source(look);
    source.register(taking("read", 1));
    (dag, seen)
}

#[test]
fn a_value_shows_to_each_reader_when_its_instance_is_complete_and_not_before() {
    // In one cluster, or across two, whichever comes first.
    for (sizes, [writes, reads]) in [(&[][..], [0; 2]), (&[1, 2], [0, 1]), (&[2, 1], [1, 0])] {
        let machine = VirtualTime::new().cores(3).clusters(sizes);
        let (write, latest) = writer(10, 4);
        let (often, seen_often) = reader(&latest, 2, 20);
        let (rarely, seen_rarely) = reader(&latest, 25, 2);
        rarely.name("rarely");
        if !sizes.is_empty() {
            write.cluster(writes);
            often.cluster(reads);
            rarely.cluster(reads);
        }
        run(&machine, &[write, often, rarely]);
        let shown = |now_ms: u64| {
            let job = now_ms.checked_sub(4).map(|since_ms| since_ms / 10);
            (now_ms, job.map(|job| (job, 10 * job + 4)))
        };
        let at = |period_ms| (0_u64..).map(move |job| shown(job * period_ms));
        assert!(seen_often.all().into_iter().eq(at(2).take(20)));
        assert!(seen_rarely.all().into_iter().eq(at(25).take(2)));
    }
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
    let [write, read] = ["write", "read"].map(|name| every(10, name));
    let source = write.jobs(2).source(|| (Unique::new(7),));
    source.writes(&["key"]).register(named("write"));
    let key = write.latest::<Unique<i32>>("key");
    let look = |key: Option<Sample<'_, Unique<i32>>>| assert_eq!(**key.unwrap().value, 7);
    let source = read.jobs(2).offset(ms(5)).using(key.sample()).source(look);
    source.register(named("read"));
    let report = run(&machine, &[write, read]);
    assert_eq!(report.dag("read").statistics().completed, 2);
}
