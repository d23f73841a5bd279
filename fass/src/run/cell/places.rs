//! The fifth cell: places used in turn by two sides, a putter and a taker.
//!
//! A value stays in its place. The putter changes its own places, and *shows* them to the taker,
//! all at once; the taker gives each back. So no value is ever moved, and each side keeps its
//! number of places even if a fault ends an instance in the middle.
//!
//! > **Place invariant.** The places from `read` on up to `written` are the taker's; all others are
//! > the putter's. Only the putter moves `written`, only the taker moves `read`, both by `Release`
//! > and over places of their own; each loads the other's index by `Acquire`. There is a single
//! > putter and a single taker, whose methods take `&mut self`.

use alloc::boxed::Box;
use alloc::sync::Arc;
use core::cell::UnsafeCell;
use core::sync::atomic::{AtomicUsize, Ordering};

struct Places<T> {
    /// The number of places is a power of two, so an index wraps by a mask.
    places: Box<[UnsafeCell<T>]>,
    /// The number of places ever shown, and of places ever given back.
    written: AtomicUsize,
    read: AtomicUsize,
}

// SAFETY: by the place invariant a single thread has a place at a time, and `T: Send` permits
// handing a value from one thread to another.
unsafe impl<T: Send> Sync for Places<T> {}

/// The end for filling places. There is only one, and no clone.
pub(crate) struct Putter<T>(Arc<Places<T>>);

/// The end for emptying places. There is only one, and no clone.
pub(crate) struct Taker<T>(Arc<Places<T>>);

/// Tells anybody how many places are the taker's.
pub(crate) struct PlaceLevel<T>(Arc<Places<T>>);

/// Makes places for at least `count` values.
pub(crate) fn places<T>(
    count: usize,
    value: impl FnMut() -> T,
) -> (Putter<T>, Taker<T>, PlaceLevel<T>) {
    let count = count.max(1).next_power_of_two();
    let values = core::iter::repeat_with(value).map(UnsafeCell::new);
    let places = Arc::new(Places {
        places: values.take(count).collect(),
        written: AtomicUsize::new(0),
        read: AtomicUsize::new(0),
    });
    let [putter, taker] = [&places, &places].map(Arc::clone);
    (Putter(putter), Taker(taker), PlaceLevel(places))
}

impl<T> Places<T> {
    #[inline]
    fn place(&self, number: usize) -> &UnsafeCell<T> {
        &self.places[number & (self.places.len() - 1)]
    }
}

impl<T> Putter<T> {
    /// Returns the place `ahead` places behind the shown ones, unless the taker has it.
    #[inline]
    pub(crate) fn place(&mut self, ahead: usize) -> Option<&mut T> {
        let places = &*self.0;
        let written = places.written.load(Ordering::Relaxed);
        // Wrapping, since both numbers are counted up without end, and only their distance matters.
        let shown = written.wrapping_sub(places.read.load(Ordering::Acquire));
        if ahead >= places.places.len() - shown {
            return None;
        }
        let place = places.place(written.wrapping_add(ahead)).get();
        // SAFETY: by the place invariant the place is the putter's, and `&mut self` keeps us from
        // giving out another reference meanwhile.
        Some(unsafe { &mut *place })
    }

    /// Shows the putter's next places to the taker.
    ///
    /// # Panics
    ///
    /// If the places are not the putter's.
    #[inline]
    pub(crate) fn show(&mut self, count: usize) {
        if count > 0 {
            assert!(self.place(count - 1).is_some(), "the place is the taker's");
            let written = self.0.written.load(Ordering::Relaxed);
            (self.0.written).store(written.wrapping_add(count), Ordering::Release);
        }
    }
}

impl<T> Taker<T> {
    /// Returns a mark between the shown places and later ones.
    #[inline]
    pub(crate) fn mark(&self) -> usize {
        self.0.written.load(Ordering::Acquire)
    }

    /// Returns the oldest place shown before the mark.
    #[inline]
    pub(crate) fn front(&mut self, mark: usize) -> Option<&mut T> {
        let places = &*self.0;
        let read = places.read.load(Ordering::Relaxed);
        // Not by the mark alone: once `read` has passed the mark, the next place may be the
        // putter's.
        if read == mark || read == self.mark() {
            return None;
        }
        // SAFETY: by the place invariant the place is the taker's, and `&mut self` keeps us from
        // giving out another reference meanwhile.
        Some(unsafe { &mut *places.place(read).get() })
    }

    /// Gives the oldest place back, if there is one.
    #[inline]
    pub(crate) fn give_back(&mut self) {
        let read = self.0.read.load(Ordering::Relaxed);
        // Otherwise `read` would pass `written`, and all places would count as the taker's.
        if read != self.mark() {
            self.0.read.store(read.wrapping_add(1), Ordering::Release);
        }
    }
}

impl<T> PlaceLevel<T> {
    /// Reports whether no place is the taker's.
    #[inline]
    pub(crate) fn is_empty(&self) -> bool {
        let written = self.0.written.load(Ordering::Acquire);
        written == self.0.read.load(Ordering::Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use std::thread;

    use super::{Putter, Taker, places};

    fn put(putter: &mut Putter<u64>, value: u64) -> bool {
        let place = putter.place(0).map(|place| *place = value);
        place.is_some_and(|()| {
            putter.show(1);
            true
        })
    }

    fn take(taker: &mut Taker<u64>) -> Option<u64> {
        let value = *taker.front(taker.mark())?;
        taker.give_back();
        Some(value)
    }

    #[test]
    fn what_is_staged_is_shown_at_once_and_no_place_is_shown_twice() {
        let (mut putter, mut taker, level) = places(3, || 0);
        let ahead = (0..5).map(|ahead| putter.place(ahead).map(|place| *place = ahead as u64 + 1));
        assert_eq!(ahead.flatten().count(), 4, "a power of two");
        assert!(level.is_empty() && taker.front(usize::MAX).is_none());
        putter.show(4);
        assert!(!level.is_empty() && putter.place(0).is_none());
        let mark = taker.mark();
        assert_eq!((take(&mut taker), take(&mut taker)), (Some(1), Some(2)));
        assert!(put(&mut putter, 9));
        assert_eq!((take(&mut taker), take(&mut taker)), (Some(3), Some(4)));
        assert_eq!(taker.front(mark), None, "what comes behind the mark waits");
        assert_eq!((take(&mut taker), take(&mut taker)), (Some(9), None));
    }

    #[test]
    fn threads_hand_values_over_in_order() {
        let values = if cfg!(miri) { 200 } else { 100_000 };
        let (mut putter, mut taker, _) = places(4, || 0);
        thread::scope(|scope| {
            scope.spawn(|| {
                for value in 0..values {
                    while !put(&mut putter, value) {
                        thread::yield_now();
                    }
                }
            });
            for value in 0..values {
                while taker.front(taker.mark()).is_none() {
                    thread::yield_now();
                }
                assert_eq!(take(&mut taker), Some(value));
            }
        });
    }
}
