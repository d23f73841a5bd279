//! Lines of the log on their way from the functions that say them to a reader for people.
//!
//! Neither side waits for the other: a place that somebody uses is passed over. Any thread may say
//! lines, and take them.

use core::sync::atomic::{AtomicU32, AtomicU64, Ordering};

use super::Line;
use crate::run::cell::Shared;
use crate::run::cell::current::Current;

/// How many lines can wait.
const PLACES: usize = 64;

/// Lines on their way.
struct Ring<const COUNT: usize> {
    /// Each with the line's number.
    places: [Shared<Option<(u64, Line)>>; COUNT],
    /// How many lines have been put.
    said: AtomicU64,
    /// How many lines wait.
    waiting: AtomicU32,
    left_out: AtomicU32,
}

static RING: Ring<PLACES> = Ring::new();

type Take = fn() -> Option<Line>;

/// Takes lines out of the ring, if the program says any: so an image that does not has no ring.
static TAKE: Current<Take> = Current::new(&((|| None) as Take));

/// Takes the oldest line that waits, to show it.
///
/// Platforms do so, and programs that have one without such a service. See [`Line`].
#[must_use]
pub fn take() -> Option<Line> {
    TAKE.get()()
}

/// Keeps a line until it is [taken](take). For platforms, see [`crate::Platform::log`].
pub(crate) fn keep(line: &Line) {
    static OURS: Take = || RING.take();
    TAKE.set(&OURS);
    RING.put(line);
}

impl<const COUNT: usize> Ring<COUNT> {
    const fn new() -> Self {
        Self {
            places: [const { Shared::new(None) }; COUNT],
            said: AtomicU64::new(0),
            waiting: AtomicU32::new(0),
            left_out: AtomicU32::new(0),
        }
    }

    fn put(&self, line: &Line) {
        let number = self.said.fetch_add(1, Ordering::Relaxed);
        // The one behind the latest is free, unless the ring is full or lines came at once.
        let first = usize::try_from(number % COUNT as u64).unwrap_or(0);
        let (before, from) = self.places.split_at(first);
        for place in from.iter().chain(before) {
            if let Some(mut place) = place.change()
                && place.is_none()
            {
                *place = Some((number, *line));
                self.waiting.fetch_add(1, Ordering::Relaxed);
                return;
            }
        }
        self.left_out.fetch_add(1, Ordering::Relaxed);
    }

    fn take(&self) -> Option<Line> {
        // An interrupt may have come amidst another one's look, which it must not wait for.
        for _ in 0..COUNT {
            if self.waiting.load(Ordering::Relaxed) == 0 {
                break;
            }
            let number = |place: &Shared<Option<(u64, Line)>>| {
                let line = place.look()?;
                line.as_ref().map(|(number, _)| *number)
            };
            let places = self.places.iter();
            let numbered = places.filter_map(|place| Some((number(place)?, place)));
            let (_, oldest) = numbered.min_by_key(|(number, _)| *number)?;
            // Unless somebody looks whether it is free, or has taken it.
            if let Some((_, line)) = oldest.change().and_then(|mut line| line.take()) {
                self.waiting.fetch_sub(1, Ordering::Relaxed);
                let left_out = self.left_out.swap(0, Ordering::Relaxed);
                return Some(Line { left_out, ..line });
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicBool;
    use std::thread;

    use super::*;
    use crate::run::log::{Level, Site};

    /// Makes a line that can be told from others: by its time.
    fn line(number: u64) -> Line {
        static SITE: Site = Site::new(Level::Warn, "camera late", &[]);
        Line {
            at_ns: number,
            ..Line::new(&SITE, &[])
        }
    }

    #[test]
    fn the_newest_is_left_out_where_the_ring_is_full_and_that_is_told() {
        let ring = Ring::<4>::new();
        (0..6).for_each(|by_ns| ring.put(&line(by_ns)));
        let mut taken = core::iter::from_fn(|| ring.take()).map(|line| (line.at_ns, line.left_out));
        assert!(taken.by_ref().eq([(0, 2), (1, 0), (2, 0), (3, 0)]));
        ring.put(&line(9));
        assert_eq!(taken.next(), Some((9, 0)));
    }

    #[test]
    fn a_place_that_is_in_use_for_ever_is_passed_over() {
        let ring = Ring::<4>::new();
        // As by an instance that was ended amidst of it.
        core::mem::forget(ring.places[1].change());
        (0..4).for_each(|by_ns| ring.put(&line(by_ns)));
        let taken = core::iter::from_fn(|| ring.take()).map(|line| line.at_ns);
        assert!(taken.eq([0, 1, 2]));
    }

    #[test]
    fn threads_say_lines_at_once_and_each_is_taken_whole_or_counted() {
        let lines = if cfg!(miri) { 100 } else { 50_000 };
        let ring = Ring::<8>::new();
        let is_over = AtomicBool::new(false);
        thread::scope(|scope| {
            let reader = scope.spawn(|| {
                let (mut taken, mut left_out) = ([0_u64; 2], 0);
                loop {
                    let was_over = is_over.load(Ordering::Acquire);
                    match ring.take() {
                        Some(line) => {
                            let place = usize::from(line.at_ns >= lines);
                            taken[place] += 1;
                            left_out += u64::from(line.left_out);
                        }
                        None if was_over => return (taken, left_out),
                        None => thread::yield_now(),
                    }
                }
            });
            let writers = [0, lines].map(|first| {
                let ring = &ring;
                scope.spawn(move || (first..first + lines).for_each(|by| ring.put(&line(by))))
            });
            let ended = writers.map(|writer| writer.join());
            assert!(ended.iter().all(Result::is_ok));
            is_over.store(true, Ordering::Release);
            let (taken, left_out) = reader.join().expect("it only takes");
            let late = u64::from(ring.left_out.load(Ordering::Relaxed));
            assert_eq!(taken[0] + taken[1] + left_out + late, 2 * lines);
            assert!(taken[0] > 0 && taken[1] > 0);
        });
    }
}
