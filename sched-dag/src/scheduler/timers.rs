//! When something happens to each DAG without a completion.
//!
//! Many DAGs often have one time in common: all that are released together, and have been
//! released together next time, too. So it is *runs* of DAGs with one time that are put in
//! order, by a heap, and a DAG joins or leaves a run in constant time. Only the run that was
//! joined last is looked at; a time that comes up again later makes another run. That costs
//! order among equal times, which has no meaning, and nothing else.

use alloc::boxed::Box;
use alloc::vec::Vec;
use core::hash::{Hash, Hasher};

use super::heap::IndexedHeap;
use crate::ids::to_u32;

/// Stands where a DAG is in no run.
const NONE: u32 = u32::MAX;

/// The times of DAGs, each of which has one or none.
#[derive(Clone, Debug)]
pub(super) struct Timers {
    /// By DAG.
    entries: Box<[Entry]>,
    /// The times of the runs.
    runs: IndexedHeap<u64>,
    /// The first DAG of each run.
    firsts: Box<[u32]>,
    /// The runs without a DAG.
    unused: Vec<u32>,
    /// The run that was joined or made last.
    latest: u32,
}

/// A DAG in its run, which is a ring.
#[derive(Clone, Copy, Debug)]
struct Entry {
    time_ns: u64,
    /// [`NONE`] if it has no time.
    run: u32,
    next: u32,
    previous: u32,
}

impl Timers {
    /// Makes them for so many DAGs, none of which has a time.
    #[inline]
    pub(super) fn new(dags: usize) -> Self {
        let entry = |dag| Entry {
            time_ns: 0,
            run: NONE,
            next: dag,
            previous: dag,
        };
        let count = to_u32(dags);
        Self {
            entries: (0..count).map(entry).collect(),
            runs: IndexedHeap::new(dags),
            firsts: (0..count).collect(),
            unused: (0..count).rev().collect(),
            latest: 0,
        }
    }

    /// Returns the least time, [`u64::MAX`] if there is none.
    #[inline]
    pub(super) fn earliest_ns(&self) -> u64 {
        self.runs.peek().map_or(u64::MAX, |(time_ns, _)| time_ns)
    }

    /// Returns the least time and a DAG that has it: of its run, the one that joined first.
    #[inline]
    pub(super) fn peek(&self) -> Option<(u64, usize)> {
        let (time_ns, run) = self.runs.peek()?;
        Some((time_ns, self.firsts[run] as usize))
    }

    /// Gives a DAG a time, or another one; `None` takes it away.
    #[inline]
    pub(super) fn set(&mut self, dag: usize, time_ns: Option<u64>) {
        let Entry {
            time_ns: before_ns,
            run,
            ..
        } = self.entries[dag];
        match time_ns {
            Some(time_ns) if run == NONE || before_ns != time_ns => self.change(dag, time_ns),
            None if run != NONE => {
                self.leave(dag);
                self.entries[dag].run = NONE;
            }
            _ => {}
        }
    }

    /// Gives a DAG a time that it does not have.
    #[inline]
    fn change(&mut self, dag: usize, time_ns: u64) {
        let Entry { run, next, .. } = self.entries[dag];
        let joins = self.runs.key(self.latest as usize) == Some(time_ns);
        self.entries[dag].time_ns = time_ns;
        if run != NONE {
            if next as usize == dag && !joins {
                // It is a run by itself, and remains one.
                self.runs.set(run as usize, time_ns);
                self.latest = run;
                return;
            }
            self.leave(dag);
        }
        match joins {
            true => self.join(dag),
            false => self.begin(dag, time_ns),
        }
    }

    #[inline]
    fn leave(&mut self, dag: usize) {
        let Entry {
            run,
            next,
            previous,
            ..
        } = self.entries[dag];
        if next as usize == dag {
            self.runs.remove(run as usize);
            self.unused.push(run);
            return;
        }
        self.entries[next as usize].previous = previous;
        self.entries[previous as usize].next = next;
        let first = &mut self.firsts[run as usize];
        if *first as usize == dag {
            *first = next;
        }
    }

    /// Puts a DAG last in the latest run.
    #[inline]
    fn join(&mut self, dag: usize) {
        let next = self.firsts[self.latest as usize];
        let number = to_u32(dag);
        let previous = core::mem::replace(&mut self.entries[next as usize].previous, number);
        self.entries[previous as usize].next = number;
        let entry = &mut self.entries[dag];
        (entry.run, entry.next, entry.previous) = (self.latest, next, previous);
    }

    /// Makes a DAG a run by itself.
    #[inline]
    fn begin(&mut self, dag: usize, time_ns: u64) {
        let run = self.unused.pop();
        let run = run.expect("there are as many runs as DAGs");
        let number = to_u32(dag);
        let entry = &mut self.entries[dag];
        (entry.run, entry.next, entry.previous) = (run, number, number);
        self.firsts[run as usize] = number;
        self.runs.set(run as usize, time_ns);
        self.latest = run;
    }
}

/// By what means the times are in order says nothing of what will happen.
impl Hash for Timers {
    fn hash<H: Hasher>(&self, state: &mut H) {
        for entry in &self.entries {
            (entry.run != NONE).then_some(entry.time_ns).hash(state);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Draws numbers without a library (Knuth, MMIX).
    fn draw(state: &mut u64, below: u64) -> u64 {
        *state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (*state >> 33) % below
    }

    #[test]
    fn the_least_of_the_times_is_found_however_they_change() {
        for (dags, times) in [(1, 3), (2, 2), (7, 3), (50, 4), (50, 1_000)] {
            let mut timers = Timers::new(dags);
            let mut expected = vec![None; dags];
            let mut state = 1;
            for _ in 0..5_000 {
                let dag = usize::try_from(draw(&mut state, dags as u64)).expect("it is an index");
                let time = Some(draw(&mut state, times)).filter(|_| draw(&mut state, 5) > 0);
                timers.set(dag, time);
                expected[dag] = time;
                let least = expected.iter().flatten().min().copied();
                let peeked = timers.peek();
                assert_eq!(peeked.map(|(time, _)| time), least);
                assert!(peeked.is_none_or(|(time, dag)| expected[dag] == Some(time)));
                assert_eq!(timers.earliest_ns(), least.unwrap_or(u64::MAX));
            }
        }
    }

    #[test]
    fn of_dags_that_have_joined_one_after_the_other_the_first_is_first() {
        let mut timers = Timers::new(4);
        for dag in [2, 0, 3, 1] {
            timers.set(dag, Some(5));
        }
        for dag in [2, 0, 3, 1] {
            assert_eq!(timers.peek(), Some((5, dag)));
            timers.set(dag, Some(9));
        }
        assert_eq!(timers.peek(), Some((9, 2)));
    }
}
