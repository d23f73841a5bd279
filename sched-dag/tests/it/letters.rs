//! Letters between clusters: the letters of one sender are served in the order in which it left
//! them, as far as `lifecycle` promises that, however the receiver's step falls between two of them.
//!
//! Sender and receiver are threads that meet at each round. So the test needs no particular memory
//! model, and under Miri each seed tries other interleavings of few rounds.

use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;

use sched_dag::lifecycle::{LifecyclePlan, Mailboxes, ModeEntry, PendingRequests, Request, divide};
use sched_dag::{ClusterId, CommitOptions, CoreDivision, DagId, DagSpec, ModeId, Policy, verify};

use crate::support::hand::Hand;
use crate::support::{PREEMPTIVE, Spec, dag};

const HERE: ClusterId = ClusterId(1);

/// The letters of DAG 1, to cluster 1.
fn letters() -> Mailboxes {
    let spec = |cluster| DagSpec {
        cluster: Some(ClusterId(cluster)),
        ..dag(10, 10, 1, &[0], &[])
    };
    let options = CommitOptions::new(Policy::Edf, 2).with_clusters(CoreDivision::Of(vec![1, 1]));
    let set = verify(&[spec(0), spec(1)], &options).expect("it is right");
    let modes = LifecyclePlan::new(2, true).with_modes(vec![vec![], vec![DagId(1)]]);
    let (letters, _) = divide(&set.task_set, Some(&modes)).expect("its modes are in one cluster");
    letters
}

/// Returns in how many of so many rounds the second of two requests is taken first.
fn inversions(letters: &Mailboxes, rounds: u64, [first, second]: [Request; 2]) -> u64 {
    let (sent, taken) = (AtomicU64::new(0), AtomicU64::new(0));
    let wait_for = |word: &AtomicU64, round| {
        let mut looks = 0_u32;
        while word.load(Ordering::Acquire) < round {
            looks += 1;
            // There may be one processor for both.
            match looks % 512 {
                0 => thread::yield_now(),
                _ => std::hint::spin_loop(),
            }
        }
    };
    let mut inverted = 0;
    thread::scope(|scope| {
        scope.spawn(|| {
            for round in 1..=rounds {
                letters.send(None, first, |_| ());
                letters.send(None, second, |_| ());
                sent.store(round, Ordering::Release);
                wait_for(&taken, round);
            }
        });
        for round in 1..=rounds {
            let mut order = Vec::with_capacity(2);
            while order.len() < 2 {
                // With the last look all is there.
                let is_last = sent.load(Ordering::Acquire) == round;
                letters.take_all(HERE, |request| order.push(request));
                assert!(
                    !is_last || order.len() == 2,
                    "{order:?} of {first:?}, {second:?}"
                );
            }
            inverted += u64::from(order != [first, second]);
            taken.store(round, Ordering::Release);
        }
    });
    inverted
}

#[test]
fn letters_of_one_sender_are_taken_in_its_order() {
    let to = DagId(1);
    let enter = Request::Enter(ModeId(1), ModeEntry::AtOnce);
    let rounds = if cfg!(miri) { 10 } else { 60_000 };
    let in_order = [
        [Request::Resume(to), Request::Signal(to)],
        [enter, Request::Signal(to)],
        [enter, Request::Resume(to)],
        [Request::Signal(to), Request::Close(to)],
        [Request::Signal(to), Request::ShutDown],
    ];
    let letters = letters();
    let inverted = in_order.map(|pair| inversions(&letters, rounds, pair));
    assert_eq!(inverted, [0; 5], "of {rounds} each, of {in_order:?}");
}

#[test]
fn a_signal_after_a_resumption_finds_the_dag_resumed() {
    let letters = letters();
    for lifecycle in [None, Some(LifecyclePlan::new(2, true))] {
        let mut hand = Hand::new(
            &[dag(9, 9, 1, &[0], &[]), dag(9, 9, 1, &[0], &[]).sporadic()],
            PREEMPTIVE,
        );
        let boxed = lifecycle.map(|plan| Box::new(plan) as Box<_>);
        let mut requests = PendingRequests::new(2, boxed);
        let to = DagId(1);
        for asked in [
            &[Request::Pause(to)][..],
            &[Request::Resume(to), Request::Signal(to)],
        ] {
            for request in asked {
                letters.send(None, *request, |_| ());
            }
            let mut moment = hand.scheduler.at(0);
            requests.take_letters(&letters, HERE, &mut moment);
            requests.serve(&mut moment);
        }
        hand.must("0: off 1, on 1, signalled 1.0, released 0.0, released 1.0");
    }
}
