//! Tests of the cells, on real threads. They also serve under Miri, where the
//! counts shrink so that a run ends.

use super::{SetOnce, SharedCell, ring};
use random::Random;
use std::collections::BTreeSet;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread;
use std::time::{Duration, Instant};
use std::vec::Vec;

const JOBS: u64 = if cfg!(miri) { 100 } else { 200_000 };

/// How long a race goes on. On a busy host a thread that waits for another one gets a few
/// turns a second.
const LONGEST: Duration = Duration::from_secs(1);

/// A value that counts how many of its kind are alive.
struct CountedValue(Arc<AtomicUsize>, u64);

impl CountedValue {
    fn new(alive: &Arc<AtomicUsize>, number: u64) -> Self {
        alive.fetch_add(1, Ordering::Relaxed);
        Self(Arc::clone(alive), number)
    }
}

impl Drop for CountedValue {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

/// A ring is a small map: whatever is put, taken and given up, and in whatever order, a value is
/// found under its own job only, a full ring gives it back, and each is dropped once.
#[test]
fn a_ring_is_a_small_map_from_jobs_to_values() {
    for seed in 0..if cfg!(miri) { 8 } else { 1_000 } {
        let (mut random, alive) = (Random::new(seed), Arc::new(AtomicUsize::new(0)));
        let (slots, room) = [(1, 1), (2, 2), (3, 3), (4, 5)][random.index(4)];
        let (mut writer, mut reader) = ring(slots);
        let mut held = BTreeSet::new();
        for _ in 0..60 {
            // Some are as far apart as they can be, and equal in the numbers of slots.
            let job = [0, u64::MAX - 7][random.index(2)] + random.within(0..=7);
            let before = alive.load(Ordering::Relaxed);
            match random.index(4) {
                0 | 1 if !held.contains(&job) => {
                    let put = writer.put(job, CountedValue::new(&alive, job));
                    assert_eq!(put.is_ok(), held.len() < room, "seed {seed}");
                    if put.is_ok() {
                        held.insert(job);
                    }
                }
                2 => {
                    let taken = reader.take(job).map(|value| value.1);
                    assert_eq!(taken, held.take(&job), "seed {seed}");
                }
                _ => {
                    reader.give_up(job);
                    held.remove(&job);
                    assert_eq!(alive.load(Ordering::Relaxed), before, "it is the writer's");
                }
            }
            let alive = alive.load(Ordering::Relaxed);
            assert!((held.len()..=room).contains(&alive), "seed {seed}");
        }
        drop(writer);
        let first = held.pop_first();
        assert_eq!(
            first.and_then(|job| reader.take(job)).map(|value| value.1),
            first
        );
        drop(reader);
        assert_eq!(alive.load(Ordering::Relaxed), 0, "seed {seed}");
    }
}

#[test]
#[should_panic(expected = "an edge needs at least one slot")]
fn a_ring_without_slots_is_refused() {
    let _ = ring::<u8>(0);
}

/// The two ends race at full speed: every value arrives, whole, in its job, or is given up.
#[test]
fn two_threads_hand_over_or_give_up_every_job() {
    for slots in [1, 2, 3, 8] {
        let (alive, is_over) = (
            Arc::new(AtomicUsize::new(0)),
            Arc::new(AtomicBool::new(false)),
        );
        let (mut writer, mut reader) = ring(slots);
        let sender = thread::spawn({
            let (alive, is_over) = (Arc::clone(&alive), Arc::clone(&is_over));
            move || {
                for job in 0.. {
                    // Several words, so that a torn hand-over would show.
                    let mut message = ([job; 5], CountedValue::new(&alive, job));
                    while let Err(back) = writer.put(job, message) {
                        if is_over.load(Ordering::Relaxed) {
                            return;
                        }
                        message = back;
                        thread::yield_now();
                    }
                }
            }
        });
        let begin = Instant::now();
        for job in (0..JOBS / 8).take_while(|job| *job < 8 || begin.elapsed() < LONGEST) {
            while reader.slot_of(job).is_none() {
                thread::yield_now();
            }
            if job % 3 == 0 {
                reader.give_up(job);
            } else {
                let (words, counted) = reader.take(job).expect("it is there");
                assert_eq!((words, counted.1), ([job; 5], job));
            }
        }
        is_over.store(true, Ordering::Relaxed);
        sender.join().expect("the sender ends");
        drop(reader);
        assert_eq!(alive.load(Ordering::Relaxed), 0);
    }
}

#[test]
fn set_once_has_one_winner_and_all_see_it() {
    for _ in 0..if cfg!(miri) { 3 } else { 300 } {
        let cell = SetOnce::new();
        let winners = AtomicUsize::new(0);
        thread::scope(|scope| {
            let setters: Vec<_> = (0..4_u64)
                .map(|number| {
                    let (cell, winners) = (&cell, &winners);
                    scope.spawn(move || {
                        if cell.set([number; 4]) {
                            winners.fetch_add(1, Ordering::Relaxed);
                        }
                        if let Some(value) = cell.get() {
                            assert_eq!(*value, [value[0]; 4], "never half written");
                        }
                    })
                })
                .collect();
            for setter in setters {
                setter.join().expect("a setter ends");
            }
        });
        assert_eq!(winners.load(Ordering::Relaxed), 1);
        assert!(cell.get().is_some());
    }
}

#[test]
fn a_claim_for_a_change_excludes_all_others() {
    let shared = SharedCell::new(1);
    {
        let mut change = shared.change().expect("free");
        *change += 1;
        assert!(shared.change().is_none() && shared.look().is_none());
    }
    let (one, other) = (shared.look().expect("free"), shared.look().expect("shared"));
    assert_eq!((*one, *other), (2, 2));
    assert!(shared.change().is_none());
    drop(one);
    assert!(shared.change().is_none());
    drop(other);
    assert!(shared.change().is_some());
}

#[test]
fn threads_never_change_a_shared_value_at_the_same_time() {
    let shared = Arc::new(SharedCell::new([0_u64; 4]));
    let threads: Vec<_> = (0..3)
        .map(|_| {
            let shared = Arc::clone(&shared);
            thread::spawn(move || {
                let mut changes = 0;
                for round in 0..JOBS {
                    if round % 3 == 0
                        && let Some(values) = shared.look()
                    {
                        assert_eq!(*values, [values[0]; 4]);
                    } else if let Some(mut values) = shared.change() {
                        values.iter_mut().for_each(|value| *value += 1);
                        changes += 1;
                    }
                }
                changes
            })
        })
        .collect();
    let changes: u64 = threads
        .into_iter()
        .map(|t| t.join().expect("no panic"))
        .sum();
    assert_eq!(shared.look().expect("free")[0], changes);
}
