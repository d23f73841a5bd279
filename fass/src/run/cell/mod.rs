//! The cells holding the crate's `unsafe` code. The cell of records, the places and the waker of
//! turns have files of their own.
//!
//! # The slot ring
//!
//! Here an *edge* is a topic as one of its readers sees it. Each edge is a ring of at least J
//! *slots*, J being the number of jobs the DAG may have in flight; so a job always finds a free
//! slot, if the inputs of cancelled instances are given up. A ring has exactly one [`Writer`] and
//! one [`Reader`]. Neither can be cloned, and all their methods take `&mut self`; so at any time at
//! most one thread acts for each side.
//!
//! The slot of a job carries no meaning; the job number identifies a value. One slot is *near*: the
//! only slot if one job may be in flight, and otherwise the first to be tried. Both ends go round
//! the others in the order of jobs, so each finds the right slot at once; after a cancelled job
//! they may look at all of them. (Choosing a slot by `k mod J` would require consecutive jobs in
//! flight. An overrun skipping releases breaks the sequence: with J = 2, jobs 1 and 3 can be in
//! flight together.)
//!
//! A slot has room for a value, and an atomic word, the *stamp*: 0 while the slot is empty,
//! `2k + 1` (modulo 2^64) while it has the value of job k, and 2 while it has a value that was
//! given up. (Job k + 2^63 has the stamp of job k, but no run gets there in 292 years.) One
//! soundness argument, cited below by name, covers the ring:
//!
//! > **Stamp invariant.** While a slot's stamp is even, only the ring's writer may touch the slot's
//! > value; while the stamp is odd, only the ring's reader. The value is uninitialised if the stamp
//! > is 0, and initialised otherwise. Only the side in possession of the slot changes the stamp.
//! > The writer changes 0 to `2k + 1` once the value is written. The reader changes it back to 0
//! > once the value is moved out, or to 2 to leave the value to the writer, which sets it to 0
//! > before dropping the value. A change of sides is a `Release` store (or a relaxed one, where the
//! > reader leaves a value it has not touched), and the other side loads the stamp by `Acquire`. So
//! > all accesses of one side to the value happen before all those of the other.
//!
//! The reader *gives up* the value of a cancelled job in a few instructions, and the writer drops
//! the value in place when the slot is next needed. Dropping runs the app's code, which may panic,
//! take long or never end. The scheduler cancels a job in mid-step, where app code must not run;
//! the writer runs as a subtask of the DAG, preempted and contained.
//!
//! With one thread on each side, a load and a store suffice: the ring contains no locked
//! read-modify-write. The invariant does not depend on the scheduler. On a platform running
//! instances in a wrong order, [`Writer::put`] refuses the value or [`Reader::take`] finds none,
//! but a data race never occurs.
//!
//! # The shared value
//!
//! The value of a [`SharedCell`] is changed by a single user or read by several users, never both.
//! A user *claims* the value for the time of the access. Nobody ever waits: in a correct schedule
//! every claim succeeds, and any other claim is refused.
//!
//! > **Claim invariant.** The word `claims` counts the users reading the value, or is `CHANGING`
//! > while a user may change the value. Nobody touches the value without a claim. A claim is made
//! > by an `Acquire` exchange moving `claims` from 0 to `CHANGING`, or from any smaller count to
//! > the next; it is given back by a `Release` change. So all accesses by one holder happen before
//! > all by the next conflicting holder.

pub(crate) mod outbox;
pub(crate) mod places;
pub(crate) mod turn;

use alloc::boxed::Box;
use alloc::sync::Arc;
use core::cell::UnsafeCell;
use core::mem::{ManuallyDrop, MaybeUninit};
use core::ops::{Deref, DerefMut};
use core::ptr;
use core::sync::atomic::{AtomicPtr, AtomicU8, AtomicU32, AtomicU64, Ordering};

/// The stamp of an empty slot.
const EMPTY_SLOT: u64 = 0;

/// The stamp of a slot whose value was given up.
const GIVEN_UP: u64 = 2;

/// Returns the stamp of a slot holding the value of `job`.
#[inline]
const fn stamp_of(job: u64) -> u64 {
    job << 1 | 1
}

/// Makes the ring of an edge with at least `slots` slots: the near slot and, if `slots` is more
/// than 1, others, whose number is a power of two.
///
/// # Panics
///
/// If `slots` is 0.
pub(crate) fn ring<T>(slots: usize) -> (Writer<T>, Reader<T>) {
    assert!(slots > 0, "an edge needs at least one slot");
    // A power of two, so that `search` can count without end and find its place by a mask.
    let others = match slots {
        1 => 0,
        _ => (slots - 1).next_power_of_two(),
    };
    let ring = Arc::new(Ring {
        near: Slot::empty(),
        others: (0..others).map(|_| Slot::empty()).collect(),
    });
    let writer = Writer {
        ring: Arc::clone(&ring),
        next: 0,
    };
    (writer, Reader { ring, next: 0 })
}

/// The writing end of an edge. There is only one, and no clone.
pub(crate) struct Writer<T> {
    ring: Arc<Ring<T>>,
    /// The other slot to try first, counted up without end.
    next: usize,
}

/// The reading end of an edge. There is only one, and no clone.
pub(crate) struct Reader<T> {
    ring: Arc<Ring<T>>,
    /// The other slot to try first, counted up without end.
    next: usize,
}

impl<T> Writer<T> {
    /// Puts the value of `job` into a free slot, or returns the value if all slots are taken. Drops
    /// a given-up value before reusing the slot.
    // Always: otherwise inlining depends on chance, and a call costs each reader 20 instructions.
    #[inline(always)]
    pub(crate) fn put(&mut self, job: u64, value: T) -> Result<(), T> {
        let slot = match self.ring.near(EMPTY_SLOT) {
            Some(slot) => slot,
            None => match self.make_room() {
                Some(slot) => slot,
                None => return Err(value),
            },
        };
        let place = slot.value.get().cast::<T>();
        // SAFETY: by the stamp invariant an empty slot is the writer's alone,
        // and `&mut self` makes us the only thread that acts as the writer.
        unsafe { place.write(value) };
        slot.stamp.store(stamp_of(job), Ordering::Release);
        Ok(())
    }

    /// Finds an empty slot, or empties a slot whose value was given up.
    #[cold]
    fn make_room(&mut self) -> Option<&Slot<T>> {
        let slot = (self.ring).search(&mut self.next, |stamp| stamp & 1 == 0)?;
        if slot.stamp.load(Ordering::Relaxed) == GIVEN_UP {
            // The store comes first: should `drop` panic, the value is not dropped again.
            slot.stamp.store(EMPTY_SLOT, Ordering::Relaxed);
            let place = slot.value.get().cast::<T>();
            // SAFETY: by the stamp invariant the value of a slot that was given up is initialised
            // and the writer's alone, and `&mut self` makes us the only thread that acts as the
            // writer. The stamp is 0 already, so nobody drops the value a second time.
            unsafe { place.drop_in_place() };
        }
        Some(slot)
    }
}

impl<T> Reader<T> {
    /// Moves the value of `job` out of the slot, or returns `None` if no slot holds the value of
    /// exactly this job.
    #[inline]
    pub(crate) fn take(&mut self, job: u64) -> Option<T> {
        let slot = self.slot_of(job)?;
        let place = slot.value.get().cast::<T>();
        // SAFETY: by the stamp invariant the value of a slot with an odd stamp is initialised and
        // the reader's alone, and `&mut self` makes us the only thread that acts as the reader. The
        // store below gives the slot away, so the value is not read twice.
        let value = unsafe { place.read() };
        slot.stamp.store(EMPTY_SLOT, Ordering::Release);
        Some(value)
    }

    /// Leaves the value of `job`, if present in a slot, to the writer.
    pub(crate) fn give_up(&mut self, job: u64) {
        if let Some(slot) = self.slot_of(job) {
            // Relaxed suffices: this end has not touched the value, so the writer's drop needs no
            // order with a read here.
            slot.stamp.store(GIVEN_UP, Ordering::Relaxed);
        }
    }

    #[inline]
    fn slot_of(&mut self, job: u64) -> Option<&Slot<T>> {
        let stamp = stamp_of(job);
        match self.ring.near(stamp) {
            Some(slot) => Some(slot),
            None => (self.ring).search(&mut self.next, |other| other == stamp),
        }
    }
}

/// The slots of an edge, shared by the two ends.
struct Ring<T> {
    near: Slot<T>,
    others: Box<[Slot<T>]>,
}

/// A place for a single value.
struct Slot<T> {
    stamp: AtomicU64,
    value: UnsafeCell<MaybeUninit<T>>,
}

// SAFETY: the value is reached through the two ends only, and both follow the stamp invariant. A
// value is thereby handed from one thread to another but never shared, so `T: Send` is enough.
unsafe impl<T: Send> Sync for Slot<T> {}

impl<T> Ring<T> {
    /// Returns the near slot if the slot has the given stamp, as is nearly always the case. Loads
    /// the stamp by `Acquire`.
    #[inline]
    fn near(&self, stamp: u64) -> Option<&Slot<T>> {
        (self.near.stamp.load(Ordering::Acquire) == stamp).then_some(&self.near)
    }

    /// Finds a slot whose stamp satisfies `is_meant`, from other slot `next` on, and moves `next`
    /// past it. Loads each stamp by `Acquire`.
    #[cold]
    fn search(&self, next: &mut usize, is_meant: impl Fn(u64) -> bool) -> Option<&Slot<T>> {
        for _ in 0..self.others.len() {
            let slot = (self.others).get(*next & (self.others.len() - 1))?;
            *next = next.wrapping_add(1);
            if is_meant(slot.stamp.load(Ordering::Acquire)) {
                return Some(slot);
            }
        }
        // The near slot again: in `make_room` its value may have been given up, so `near` did not
        // match.
        is_meant(self.near.stamp.load(Ordering::Acquire)).then_some(&self.near)
    }
}

impl<T> Slot<T> {
    const fn empty() -> Self {
        Self {
            stamp: AtomicU64::new(EMPTY_SLOT),
            value: UnsafeCell::new(MaybeUninit::uninit()),
        }
    }
}

impl<T> Drop for Slot<T> {
    fn drop(&mut self) {
        if *self.stamp.get_mut() != EMPTY_SLOT {
            // SAFETY: by the stamp invariant the value of a slot with a stamp other than 0 is
            // initialised; `&mut self` shows that both ends are gone.
            unsafe { self.value.get_mut().assume_init_drop() };
        }
    }
}

/// The claims of a value being changed; also greater than any count of readers.
const CHANGING: u32 = u32::MAX;

/// A value that a single user may change or several users may read.
pub(crate) struct SharedCell<T> {
    claims: AtomicU32,
    value: UnsafeCell<ManuallyDrop<T>>,
}

// SAFETY: by the claim invariant threads have either one `&mut T` or several `&T` between them. `T:
// Send` because one thread after another changes the value, and moves the value out of and into the
// cell; `T: Sync` because several threads read the value at once.
unsafe impl<T: Send + Sync> Sync for SharedCell<T> {}

/// The claim of a user that may change the value.
pub struct WriteClaim<'a, T>(&'a SharedCell<T>);

/// The claim of a user reading the value.
pub struct ReadClaim<'a, T>(&'a SharedCell<T>);

impl<T> SharedCell<T> {
    pub(crate) const fn new(value: T) -> Self {
        Self {
            claims: AtomicU32::new(0),
            value: UnsafeCell::new(ManuallyDrop::new(value)),
        }
    }

    /// Claims the value for a change, unless somebody else has a claim.
    pub(crate) fn change(&self) -> Option<WriteClaim<'_, T>> {
        let claim = self
            .claims
            .compare_exchange(0, CHANGING, Ordering::Acquire, Ordering::Relaxed);
        claim.ok().map(|_| WriteClaim(self))
    }

    /// Claims the value for reading, unless somebody may change the value.
    pub(crate) fn look(&self) -> Option<ReadClaim<'_, T>> {
        // One count less than the maximum, which means `CHANGING`.
        let one_more = |claims| (claims < CHANGING - 1).then(|| claims + 1);
        let claim = self
            .claims
            .fetch_update(Ordering::Acquire, Ordering::Relaxed, one_more);
        claim.ok().map(|_| ReadClaim(self))
    }
}

impl<T> Drop for SharedCell<T> {
    fn drop(&mut self) {
        // A value left half changed by a fault is not dropped: its destructor might see a broken
        // value.
        if *self.claims.get_mut() != CHANGING {
            // SAFETY: `&mut self` shows that no claim is in use, and `drop` runs only once.
            unsafe { ManuallyDrop::drop(self.value.get_mut()) };
        }
    }
}

impl<T> Deref for WriteClaim<'_, T> {
    type Target = T;

    fn deref(&self) -> &T {
        // SAFETY: by the claim invariant this claim is the only claim, and `&self` keeps it from
        // giving out `&mut T` meanwhile.
        unsafe { &*self.0.value.get() }
    }
}

impl<T> DerefMut for WriteClaim<'_, T> {
    fn deref_mut(&mut self) -> &mut T {
        // SAFETY: by the claim invariant this claim is the only claim, and `&mut self` keeps it
        // from giving out another reference meanwhile.
        unsafe { &mut *self.0.value.get() }
    }
}

impl<T> Deref for ReadClaim<'_, T> {
    type Target = T;

    fn deref(&self) -> &T {
        // SAFETY: by the claim invariant nobody may change the value while this
        // claim exists.
        unsafe { &*self.0.value.get() }
    }
}

/// A value that a single user at a time may change, and nobody else reads.
pub(crate) struct ExclusiveCell<T>(SharedCell<T>);

// SAFETY: by the claim invariant threads have one `&mut T` between them, as a claim for reading is
// never made. `T: Send` because one thread after another has the reference.
unsafe impl<T: Send> Sync for ExclusiveCell<T> {}

impl<T> ExclusiveCell<T> {
    pub(crate) const fn new(value: T) -> Self {
        Self(SharedCell::new(value))
    }

    /// Claims the value, unless somebody else has a claim.
    pub(crate) fn change(&self) -> Option<WriteClaim<'_, T>> {
        self.0.change()
    }

    /// Removes a claim left behind by an instance that a fault has ended.
    ///
    /// # Safety
    ///
    /// No claim is in use, and no claim made before will be used again.
    pub(crate) unsafe fn forget_claim(&self) {
        self.0.claims.store(0, Ordering::Release);
    }
}

impl<T> Drop for WriteClaim<'_, T> {
    fn drop(&mut self) {
        // A store suffices: as long as this claim is there, nobody else changes the count.
        self.0.claims.store(0, Ordering::Release);
    }
}

impl<T> Drop for ReadClaim<'_, T> {
    fn drop(&mut self) {
        self.0.claims.fetch_sub(1, Ordering::Release);
    }
}

const EMPTY: u8 = 0;
const WRITING: u8 = 1;
const SET: u8 = 2;

/// A value set at most once and then read by everybody.
///
/// > **Set-once invariant.** Only the thread moving `state` from `EMPTY` to `WRITING` writes the
/// > value, and then stores `SET` by `Release`. All others load `SET` by `Acquire` first.
///
/// ```
/// static PLACE: fass::platform::SetOnce<u32> = fass::platform::SetOnce::new();
/// assert_eq!(PLACE.get(), None);
/// assert!(PLACE.set(1) && !PLACE.set(2));
/// assert_eq!(PLACE.get(), Some(&1));
/// ```
#[derive(Debug)]
pub struct SetOnce<T> {
    state: AtomicU8,
    value: UnsafeCell<MaybeUninit<T>>,
}

// SAFETY: by the set-once invariant one thread writes the value before any thread reads the value.
// `T: Send` as the owner drops the value, `T: Sync` as all threads read the value.
unsafe impl<T: Send + Sync> Sync for SetOnce<T> {}

impl<T> SetOnce<T> {
    /// Makes an empty place.
    #[allow(clippy::new_without_default, reason = "it is for statics")]
    pub const fn new() -> Self {
        Self {
            state: AtomicU8::new(EMPTY),
            value: UnsafeCell::new(MaybeUninit::uninit()),
        }
    }

    /// Sets the value, unless the value is set already. Reports whether this call has set the
    /// value.
    pub fn set(&self, value: T) -> bool {
        // Relaxed suffices: the claim itself guards nothing, and the store of `SET` publishes the
        // value.
        let claim =
            self.state
                .compare_exchange(EMPTY, WRITING, Ordering::Relaxed, Ordering::Relaxed);
        if claim.is_err() {
            return false;
        }
        let place = self.value.get().cast::<T>();
        // SAFETY: we moved the state from `EMPTY` to `WRITING`, so by the
        // set-once invariant we alone may write, and nobody reads yet.
        unsafe { place.write(value) };
        self.state.store(SET, Ordering::Release);
        true
    }

    /// Returns the value, or `None` before the value is set.
    #[inline]
    pub fn get(&self) -> Option<&T> {
        if self.state.load(Ordering::Acquire) != SET {
            return None;
        }
        let place = self.value.get().cast::<T>();
        // SAFETY: the state is `SET`, so by the set-once invariant the value is
        // initialised and no longer written, as long as this borrow of the cell lasts.
        Some(unsafe { &*place })
    }
}

impl<T> Drop for SetOnce<T> {
    fn drop(&mut self) {
        if *self.state.get_mut() == SET {
            // SAFETY: by the set-once invariant the value is initialised, and `&mut self` is the
            // only access.
            unsafe { self.value.get_mut().assume_init_drop() };
        }
    }
}

/// A pointer to the current one of several static values. Reading the pointer is a single load.
///
/// > **Current invariant.** The pointer always comes from a `&'static T`.
pub(crate) struct CurrentIndex<T: 'static>(AtomicPtr<T>);

impl<T: Sync> CurrentIndex<T> {
    pub(crate) const fn new(first: &'static T) -> Self {
        Self(AtomicPtr::new(ptr::from_ref(first).cast_mut()))
    }

    pub(crate) fn set(&self, next: &'static T) {
        let next = ptr::from_ref(next).cast_mut();
        self.0.store(next, Ordering::Release);
    }

    #[inline]
    pub(crate) fn get(&self) -> &'static T {
        let current = self.0.load(Ordering::Acquire);
        // SAFETY: by the current invariant the pointer is valid for ever, and the value is only
        // ever shared.
        unsafe { &*current }
    }
}

#[cfg(test)]
mod tests;
