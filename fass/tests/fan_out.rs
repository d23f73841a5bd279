//! One writer, many readers: what is cloned, what is shared, what is moved.

mod support;

use core::time::Duration;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, mpsc};

use fass::{Dag, Fault, Message, SubtaskAttributes, Unique, create_dag, finish_create_dags};
use support::{commit, run_job};

const PERIOD: Duration = Duration::from_millis(10);

/// A source whose topic `readers` subtasks read, all joined by a sink.
fn fan_out<M: Message + Sync>(readers: usize, mut make: impl FnMut() -> M + Send + 'static) -> Dag {
    let dag = create_dag();
    dag.name("fan-out");
    let named = SubtaskAttributes::named;
    dag.register_periodic_subtask(move || (make(),), vec!["message"], PERIOD, named("source"));
    let topics = ["first", "second", "third"];
    for topic in &topics[..readers] {
        dag.register_subtask(
            |(message,): (M,)| (Arc::new(Unique::new(message)),),
            vec!["message"],
            vec![topic],
            named(topic),
        );
    }
    dag
}

/// A value that counts how often it was cloned.
struct Counted(Arc<AtomicUsize>);

impl Clone for Counted {
    fn clone(&self) -> Self {
        self.0.fetch_add(1, Ordering::Relaxed);
        Self(Arc::clone(&self.0))
    }
}

fn join<M: Message + Sync>(dag: &Dag, readers: usize, see: mpsc::Sender<Vec<Joined<M>>>) {
    let named = SubtaskAttributes::named("sink");
    match readers {
        1 => dag.register_sink_subtask(
            move |(a,): (Joined<M>,)| see.send(vec![a]).expect("the test listens"),
            vec!["first"],
            PERIOD,
            named,
        ),
        2 => dag.register_sink_subtask(
            move |(a, b): (Joined<M>, Joined<M>)| see.send(vec![a, b]).expect("the test listens"),
            vec!["first", "second"],
            PERIOD,
            named,
        ),
        _ => dag.register_sink_subtask(
            move |(a, b, c): (Joined<M>, Joined<M>, Joined<M>)| {
                see.send(vec![a, b, c]).expect("the test listens");
            },
            vec!["first", "second", "third"],
            PERIOD,
            named,
        ),
    }
}

type Joined<M> = Arc<Unique<M>>;

#[test]
fn all_readers_but_the_last_get_a_clone() {
    for readers in 1..=3 {
        let clones = Arc::new(AtomicUsize::new(0));
        let (see, sees) = mpsc::channel();
        let counter = Arc::clone(&clones);
        let dag = fan_out(readers, move || Counted(Arc::clone(&counter)));
        join::<Counted>(&dag, readers, see);
        let mut plan = commit(&[dag]);
        for job in 0..10 {
            run_job(&mut plan, job);
        }
        assert_eq!(
            sees.try_iter().map(|all| all.len()).sum::<usize>(),
            10 * readers
        );
        assert_eq!(clones.load(Ordering::Relaxed), 10 * (readers - 1));
    }
}

#[test]
fn an_arc_is_shared_without_copying() {
    let image = Arc::new([0_u8; 1 << 16]);
    let (see, sees) = mpsc::channel();
    let written = Arc::clone(&image);
    let dag = fan_out(3, move || Arc::clone(&written));
    join::<Arc<[u8; 1 << 16]>>(&dag, 3, see);
    run_job(&mut commit(&[dag]), 0);
    let seen = sees.try_recv().expect("one job");
    assert!(
        seen.iter()
            .all(|received| Arc::ptr_eq(&***received, &image))
    );
}

#[test]
fn a_unique_message_is_moved_to_its_one_reader() {
    let (see, sees) = mpsc::channel();
    let dag = fan_out(1, || Unique::new(vec![1, 2, 3]));
    join::<Unique<Vec<i32>>>(&dag, 1, see);
    run_job(&mut commit(&[dag]), 0);
    assert_eq!(***sees.try_recv().expect("one job")[0], [1, 2, 3]);
}

#[test]
fn a_unique_message_with_two_readers_is_a_fault() {
    support::install();
    let (see, _sees) = mpsc::channel();
    let dag = fan_out(2, || Unique::new(1));
    join::<Unique<i32>>(&dag, 2, see);
    let error = finish_create_dags(&[dag]).expect_err("moved to two places");
    let codes: Vec<_> = error.faults().iter().map(Fault::code).collect();
    assert_eq!(codes, ["several_readers"]);
    let text = error.to_string();
    assert!(
        text.contains("`message`") && text.contains("Unique<i32>"),
        "{text}"
    );
}
