//! Tests of the cells, on real threads. They also serve under Miri, where the
//! counts shrink so that a run ends.

use super::{SetOnce, Shared, Writer, ring};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};
use std::{iter, vec::Vec};

const JOBS: u64 = if cfg!(miri) { 100 } else { 200_000 };

/// How long a sender goes on. On a busy host a thread that waits for another one gets a few
/// turns a second.
const LONGEST: Duration = Duration::from_secs(1);

/// How many jobs a sender has sent, once it has ended.
struct End(AtomicU64);

impl End {
    fn new() -> Arc<Self> {
        Arc::new(Self(AtomicU64::new(u64::MAX)))
    }

    /// Calls `send` for one job after the other, until there were enough.
    fn send_jobs(&self, mut send: impl FnMut(u64)) {
        let start = Instant::now();
        let is_in_time = |job: &u64| *job < 8 || start.elapsed() < LONGEST;
        let sent = (0..JOBS / 8).take_while(is_in_time).map(&mut send).count();
        self.0.store(sent as u64, Ordering::Release);
    }

    /// Waits for what `found` finds of a job; `None` if the sender has ended before it.
    fn wait<T>(&self, job: u64, mut found: impl FnMut() -> Option<T>) -> Option<T> {
        loop {
            let is_over = self.0.load(Ordering::Acquire) <= job;
            let found = found();
            if found.is_some() || is_over {
                return found;
            }
            thread::yield_now();
        }
    }
}

/// A value that counts how many of its kind are alive.
struct Counted(Arc<AtomicUsize>, u64);

impl Counted {
    fn new(alive: &Arc<AtomicUsize>, number: u64) -> Self {
        alive.fetch_add(1, Ordering::Relaxed);
        Self(Arc::clone(alive), number)
    }
}

impl Drop for Counted {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

#[test]
fn a_value_is_found_under_its_own_job_only() {
    let (mut writer, mut reader) = ring(2);
    assert_eq!(reader.take(0), None);
    assert_eq!(writer.put(0, 'a'), Ok(()));
    assert_eq!(reader.take(2), None, "another job");
    assert_eq!(reader.take(1), None, "another job");
    assert_eq!(reader.take(0), Some('a'));
    assert_eq!(reader.take(0), None, "taken once");
}

#[test]
fn jobs_need_not_be_consecutive() {
    let (mut writer, mut reader) = ring(2);
    assert_eq!(writer.put(1, 'a'), Ok(()));
    assert_eq!(writer.put(3, 'b'), Ok(()), "although 1 = 3 (mod 2)");
    assert_eq!(reader.take(1), Some('a'));
    assert_eq!(writer.put(100, 'c'), Ok(()));
    assert_eq!(reader.take(100), Some('c'));
    assert_eq!(reader.take(3), Some('b'));
}

/// A value that is never taken costs its slot and nothing else.
#[test]
fn a_forgotten_value_blocks_only_its_slot() {
    let (mut writer, mut reader) = ring(2);
    assert_eq!(writer.put(0, 0), Ok(()));
    for job in 1..10 {
        assert_eq!(writer.put(job, job), Ok(()));
        assert_eq!(reader.take(job), Some(job));
    }
    assert_eq!(reader.take(0), Some(0));
}

#[test]
fn a_full_ring_gives_the_value_back() {
    let (mut writer, mut reader) = ring(2);
    assert_eq!(writer.put(0, 'a'), Ok(()));
    assert_eq!(writer.put(1, 'b'), Ok(()));
    assert_eq!(writer.put(2, 'c'), Err('c'));
    assert_eq!(reader.take(0), Some('a'));
    assert_eq!(writer.put(2, 'c'), Ok(()));
    assert_eq!(reader.take(1), Some('b'));
    assert_eq!(reader.take(2), Some('c'));
}

#[test]
fn jobs_may_be_written_and_read_out_of_order() {
    let (mut writer, mut reader) = ring(3);
    for job in [2, 0, 1] {
        assert_eq!(writer.put(job, job), Ok(()));
    }
    for job in [1, 2, 0] {
        assert_eq!(reader.take(job), Some(job));
    }
}

#[test]
fn the_last_job_numbers_have_turns() {
    let (mut writer, mut reader) = ring(1);
    assert_eq!(writer.put(u64::MAX, 7), Ok(()));
    assert_eq!(reader.take(0), None);
    assert_eq!(reader.take(u64::MAX), Some(7));
    assert_eq!(writer.put(u64::MAX - 1, 7), Ok(()));
    assert_eq!(reader.take(u64::MAX - 1), Some(7));
}

#[test]
#[should_panic(expected = "an edge needs at least one slot")]
fn a_ring_without_slots_is_refused() {
    let _ = ring::<u8>(0);
}

#[test]
fn values_that_nobody_took_are_dropped_once() {
    let alive = Arc::new(AtomicUsize::new(0));
    let (mut writer, mut reader) = ring(3);
    for job in 0..3 {
        assert!(writer.put(job, Counted::new(&alive, job)).is_ok());
    }
    drop(reader.take(1));
    assert_eq!(alive.load(Ordering::Relaxed), 2);
    drop(writer);
    assert_eq!(alive.load(Ordering::Relaxed), 2, "the reader still could");
    drop(reader);
    assert_eq!(alive.load(Ordering::Relaxed), 0);
}

#[test]
fn a_value_that_is_given_up_makes_room_and_is_dropped_once() {
    let alive = Arc::new(AtomicUsize::new(0));
    let (mut writer, mut reader) = ring(2);
    assert!(writer.put(0, Counted::new(&alive, 0)).is_ok());
    assert!(writer.put(1, Counted::new(&alive, 1)).is_ok());
    reader.give_up(0);
    reader.give_up(0);
    reader.give_up(7);
    assert!(reader.take(0).is_none(), "it is the writer's");
    assert_eq!(alive.load(Ordering::Relaxed), 2);
    assert!(writer.put(2, Counted::new(&alive, 2)).is_ok());
    assert_eq!(alive.load(Ordering::Relaxed), 2, "0 has made way for 2");
    assert!(writer.put(3, Counted::new(&alive, 3)).is_err(), "full");
    assert_eq!(reader.take(1).map(|value| value.1), Some(1));
    reader.give_up(2);
    drop((writer, reader));
    assert_eq!(alive.load(Ordering::Relaxed), 0);
}

/// The message of the races below: several words, so that a torn hand-over would show.
type Message = ([u64; 5], Counted);

/// Sends every job's message from a thread of its own.
fn send(mut writer: Writer<Message>, alive: &Arc<AtomicUsize>, end: &Arc<End>) -> JoinHandle<()> {
    let (alive, end) = (Arc::clone(alive), Arc::clone(end));
    thread::spawn(move || {
        end.send_jobs(|job| {
            let mut message = ([job; 5], Counted::new(&alive, job));
            while let Err(back) = writer.put(job, message) {
                message = back;
                thread::yield_now();
            }
        });
    })
}

/// The reader takes every other job's value and gives up the rest, at full speed.
#[test]
fn given_up_slots_race_with_their_writer() {
    for slots in [1, 2, 4] {
        let (alive, end) = (Arc::new(AtomicUsize::new(0)), End::new());
        let (writer, mut reader) = ring(slots);
        let sender = send(writer, &alive, &end);
        for job in 0.. {
            let is_there = || {
                let mut slots = iter::once(&reader.ring.near).chain(&reader.ring.others);
                let is_its = |slot: &super::Slot<_>| {
                    slot.turn.load(Ordering::Acquire) == super::turn_of(job)
                };
                slots.any(is_its).then_some(())
            };
            if end.wait(job, is_there).is_none() {
                break;
            }
            if job % 2 == 0 {
                reader.give_up(job);
            } else {
                let (words, counted) = reader.take(job).expect("it is there");
                assert_eq!((words, counted.1), ([job; 5], job));
            }
        }
        sender.join().expect("the sender ends");
        drop(reader);
        assert_eq!(alive.load(Ordering::Relaxed), 0);
    }
}

/// The two ends race at full speed; every value arrives, whole, in its job.
#[test]
fn two_threads_hand_over_every_job_intact() {
    for slots in [1, 2, 3, 8] {
        let (alive, end) = (Arc::new(AtomicUsize::new(0)), End::new());
        let (writer, mut reader) = ring(slots);
        let sender = send(writer, &alive, &end);
        for job in 0.. {
            let Some((words, counted)) = end.wait(job, || reader.take(job)) else {
                break;
            };
            assert_eq!(words, [job; 5]);
            assert_eq!(counted.1, job);
        }
        sender.join().expect("the sender ends");
        drop(reader);
        assert_eq!(alive.load(Ordering::Relaxed), 0);
    }
}

/// A chain over three threads: what arrives was handed over twice.
#[test]
fn a_chain_of_rings_keeps_jobs_apart() {
    let (mut first_writer, mut first_reader) = ring(2);
    let (mut second_writer, mut second_reader) = ring(2);
    let (end, middle_end) = (End::new(), End::new());
    let source = thread::spawn({
        let end = Arc::clone(&end);
        move || {
            end.send_jobs(|job| {
                while first_writer.put(job, job * 3).is_err() {
                    thread::yield_now();
                }
            });
        }
    });
    let middle = thread::spawn({
        let middle_end = Arc::clone(&middle_end);
        move || {
            let mut jobs = 0;
            while let Some(value) = end.wait(jobs, || first_reader.take(jobs)) {
                while second_writer.put(jobs, value + 1).is_err() {
                    thread::yield_now();
                }
                jobs += 1;
            }
            middle_end.0.store(jobs, Ordering::Release);
        }
    });
    for job in 0.. {
        let Some(value) = middle_end.wait(job, || second_reader.take(job)) else {
            break;
        };
        assert_eq!(value, job * 3 + 1);
    }
    source.join().expect("the source ends");
    middle.join().expect("the middle ends");
}

#[test]
fn set_once_keeps_the_first_value() {
    let cell = SetOnce::new();
    assert_eq!(cell.get(), None);
    assert!(cell.set(1));
    assert!(!cell.set(2));
    assert_eq!(cell.get(), Some(&1));
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
    let shared = Shared::new(1);
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
    let shared = Arc::new(Shared::new([0_u64; 4]));
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
