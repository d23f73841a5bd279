//! Tests of the three slots, on real threads.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use super::{Sampler, Stage, TripleBuffer};
use crate::run::effect::Effect;

const JOBS: u64 = if cfg!(miri) { 100 } else { 300_000 };

fn sample(sampler: &mut Sampler<[u64; 8]>) -> Option<(u64, u64)> {
    let guard = sampler.look();
    let sample = guard.entry()?;
    assert_eq!(sample.value, [sample.job; 8], "whole");
    Some((sample.job, sample.completed_ns))
}

#[test]
fn what_is_staged_shows_only_when_it_happens() {
    let mut triple = Arc::new(TripleBuffer::new());
    let mut sampler = Sampler {
        triple: Arc::clone(&triple),
        front: 2,
    };
    triple.happen(5, &mut |_| ()); // an instance that never ran
    assert_eq!(sample(&mut sampler), None);
    (0..5).for_each(|job| triple.stage(job, [job; 8]));
    triple.stage(0, [0; 8]);
    assert_eq!(sample(&mut sampler), None);
    triple.happen(10, &mut |_| ());
    triple.stage(1, [1; 8]);
    assert_eq!(sample(&mut sampler), Some((0, 10)));
    triple.happen(20, &mut |_| ());
    triple.happen(30, &mut |_| ()); // an instance that has staged nothing
    assert_eq!(sample(&mut sampler), Some((1, 20)));
    assert_eq!(sample(&mut sampler), Some((1, 20)), "again");
    let guard = sampler.look();
    for job in 2..10 {
        triple.stage(job, [job; 8]);
        triple.happen(10 * job, &mut |_| ());
    }
    let held = guard.entry().map(|entry| (entry.job, entry.value));
    assert_eq!(held, Some((1, [1; 8])), "while the writer goes on");
    drop(guard);
    assert_eq!(sample(&mut sampler), Some((9, 90)));
    let (alive, mut triple) = (Arc::new(()), Arc::new(TripleBuffer::new()));
    for job in 0..5 {
        triple.stage(job, Arc::clone(&alive));
        triple.happen(job, &mut |_| ());
    }
    drop(triple);
    assert_eq!(Arc::strong_count(&alive), 1, "none is left");
}

#[test]
fn samples_are_whole_and_never_go_back() {
    let triple = Arc::new(TripleBuffer::new());
    let mut sampler = Sampler {
        triple: Arc::clone(&triple),
        front: 2,
    };
    let is_over = Arc::new(AtomicBool::new(false));
    let writer = thread::spawn({
        let (mut triple, is_over) = (triple, Arc::clone(&is_over));
        move || {
            for job in 0..JOBS {
                triple.stage(job, [job; 8]);
                triple.happen(job + 1, &mut |_| ());
            }
            is_over.store(true, Ordering::Release);
        }
    });
    let mut last = None;
    loop {
        let was_over = is_over.load(Ordering::Acquire);
        let found = sample(&mut sampler);
        assert!(found >= last, "{found:?} after {last:?}");
        last = found;
        if was_over {
            break;
        }
    }
    writer.join().expect("no panic");
    assert_eq!(last, Some((JOBS - 1, JOBS)), "the last one shows");
}
