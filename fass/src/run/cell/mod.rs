//! The cells in which the crate's `unsafe` lives; that of records, and the waker of turns, are in
//! files of their own.
//!
//! # The slot ring
//!
//! For our purposes an *edge* is a topic as one of its readers sees it. Each
//! edge is a ring of J *slots*, J being the number of jobs that the DAG may
//! have in flight, up to the next power of two; so a job always finds a free slot. A
//! ring has exactly one
//! [`Writer`] and one [`Reader`]. Neither can be cloned, and everything they do
//! takes `&mut self`; so at any time at most one thread acts for each side.
//!
//! Which slot a job gets carries no meaning; what identifies a value is its job
//! number. One slot is *near*: it is all there is where one job is in flight, and taken
//! first where several may be. Both ends go round the others in the order of jobs, so that
//! each looks at the right slot at once; after a job was cancelled they may look at all of
//! them. (A slot could be chosen by `k mod J` only if jobs in flight were
//! consecutive. They are not where an overrun skips releases: with J = 2, jobs
//! 1 and 3 can be in flight together.)
//!
//! A slot holds a value and one atomic word, its *turn*: 0 while the slot is
//! empty, `2k + 1` (modulo 2^64) while it holds the value of job k, and 2 while it holds
//! one that was given up. (Job k + 2^63 has the turn of job k, but no run gets there in
//! 292 years.) One soundness argument, cited below by its name, covers the ring:
//!
//! > **Turn invariant.** While a slot's turn is even, only the ring's writer may
//! > touch the slot's value; while it is odd, only the ring's reader. The value is
//! > uninitialised if the turn is 0, and initialised otherwise.
//! > Only the side whose turn it is changes the turn: the writer from 0 to
//! > `2k + 1` once the value is written, the reader back to 0 once the value is
//! > moved out, or to 2 to leave it to the writer, which makes that 0 before it drops the
//! > value. A change of sides is a `Release` store and the other side's look at
//! > it an `Acquire` load, so all that one side did to the value
//! > happens before all that the other does.
//!
//! The reader *gives up* the value of a cancelled job, which takes a few instructions,
//! and the writer drops it in its place once it needs the slot. Dropping is the app's
//! code: it may panic, take long or never end. A job is cancelled by the scheduler in
//! mid-step, while the writer runs as a subtask of that DAG: preempted and contained.
//!
//! Because there is one thread a side, a load and a store suffice: nothing here
//! is a locked read-modify-write. The invariant does not lean on the scheduler:
//! a platform that runs instances in a wrong order gets its value refused
//! ([`Writer::put`]) or finds none ([`Reader::take`]), but never a data race.
//!
//! # The shared value
//!
//! A [`SharedCell`] value is changed by one user or looked at by several, never both. A
//! user *claims* it for that time. Nobody ever waits: the schedule is such that
//! every claim succeeds, and one that does not is refused.
//!
//! > **Claim invariant.** The word `claims` counts the users that look at the value, or
//! > is `CHANGING` while one may change it. Nobody touches the value without a
//! > claim. A claim is made by an `Acquire` exchange that moves `claims` from 0 to
//! > `CHANGING`, or from any smaller count to the next; it is given back by a
//! > `Release` change. So all that one holder did happens before all that the next
//! > conflicting one does.

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

/// The turn of a slot that holds no value.
const EMPTY_SLOT: u64 = 0;

/// The turn of a slot whose value was given up.
const GIVEN_UP: u64 = 2;

/// Returns the turn of a slot that holds the value of a job.
#[inline]
const fn turn_of(job: u64) -> u64 {
    job << 1 | 1
}

/// Makes the ring of one edge with `slots` slots at least; besides the near one a power of two.
///
/// # Panics
///
/// If `slots` is 0.
pub(crate) fn ring<T>(slots: usize) -> (Writer<T>, Reader<T>) {
    assert!(slots > 0, "an edge needs at least one slot");
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

/// The writing end of an edge. There is one, and it cannot be cloned.
pub(crate) struct Writer<T> {
    ring: Arc<Ring<T>>,
    /// The other slot to look at first, counted on and on.
    next: usize,
}

/// The reading end of an edge. There is one, and it cannot be cloned.
pub(crate) struct Reader<T> {
    ring: Arc<Ring<T>>,
    /// The other slot to look at first, counted on and on.
    next: usize,
}

impl<T> Writer<T> {
    /// Puts the value of `job` into a free slot, or gives the value back if all
    /// are taken. Drops the value in a slot that was given up, if it takes that.
    // Always: whether it becomes a call is chance else, and a call costs each reader 20 instructions.
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
        // SAFETY: by the turn invariant an empty slot is the writer's alone,
        // and `&mut self` makes us the only thread that acts as the writer.
        unsafe { place.write(value) };
        slot.turn.store(turn_of(job), Ordering::Release);
        Ok(())
    }

    /// Finds an empty slot, or makes one so that was given up.
    #[cold]
    fn make_room(&mut self) -> Option<&Slot<T>> {
        let slot = (self.ring).search(&mut self.next, |turn| turn & 1 == 0)?;
        if slot.turn.load(Ordering::Relaxed) == GIVEN_UP {
            // First, so that the value is not dropped again should its `drop` panic.
            slot.turn.store(EMPTY_SLOT, Ordering::Relaxed);
            let place = slot.value.get().cast::<T>();
            // SAFETY: by the turn invariant the value of a slot that was given up is
            // initialised and the writer's alone, and `&mut self` makes us the only
            // thread that acts as the writer. The turn says already that it is gone.
            unsafe { place.drop_in_place() };
        }
        Some(slot)
    }
}

impl<T> Reader<T> {
    /// Moves the value of `job` out of its slot, or returns `None` if no slot
    /// holds that very job's value.
    #[inline]
    pub(crate) fn take(&mut self, job: u64) -> Option<T> {
        let slot = self.slot_of(job)?;
        let place = slot.value.get().cast::<T>();
        // SAFETY: by the turn invariant a slot with a turn other than 0 is
        // initialised and the reader's alone, and `&mut self` makes us the only
        // thread that acts as the reader. The store below ends our turn, so the
        // value is not read twice.
        let value = unsafe { place.read() };
        slot.turn.store(EMPTY_SLOT, Ordering::Release);
        Some(value)
    }

    /// Leaves the value of `job`, if some slot holds it, to the writer.
    pub(crate) fn give_up(&mut self, job: u64) {
        if let Some(slot) = self.slot_of(job) {
            // Relaxed suffices: this end has not touched the value, which the writer drops.
            slot.turn.store(GIVEN_UP, Ordering::Relaxed);
        }
    }

    #[inline]
    fn slot_of(&mut self, job: u64) -> Option<&Slot<T>> {
        let turn = turn_of(job);
        match self.ring.near(turn) {
            Some(slot) => Some(slot),
            None => (self.ring).search(&mut self.next, |other| other == turn),
        }
    }
}

/// The slots of one edge, which its two ends share.
struct Ring<T> {
    near: Slot<T>,
    others: Box<[Slot<T>]>,
}

/// A place for one value.
struct Slot<T> {
    turn: AtomicU64,
    value: UnsafeCell<MaybeUninit<T>>,
}

// SAFETY: the value is reached through the two ends only, which follow the turn
// invariant; a value is thereby handed from one thread to another but never
// shared, which is why `T: Send` is enough.
unsafe impl<T: Send> Sync for Slot<T> {}

impl<T> Ring<T> {
    /// Returns the near slot if it has the given turn, as it nearly always does. Its look
    /// at the turn is an `Acquire`.
    #[inline]
    fn near(&self, turn: u64) -> Option<&Slot<T>> {
        (self.near.turn.load(Ordering::Acquire) == turn).then_some(&self.near)
    }

    /// Finds a slot whose turn is meant, by such a look, from other slot `next` on, and
    /// moves `next` behind it.
    #[cold]
    fn search(&self, next: &mut usize, is_meant: impl Fn(u64) -> bool) -> Option<&Slot<T>> {
        for _ in 0..self.others.len() {
            let slot = (self.others).get(*next & (self.others.len() - 1))?;
            *next = next.wrapping_add(1);
            if is_meant(slot.turn.load(Ordering::Acquire)) {
                return Some(slot);
            }
        }
        is_meant(self.near.turn.load(Ordering::Acquire)).then_some(&self.near)
    }
}

impl<T> Slot<T> {
    const fn empty() -> Self {
        Self {
            turn: AtomicU64::new(EMPTY_SLOT),
            value: UnsafeCell::new(MaybeUninit::uninit()),
        }
    }
}

impl<T> Drop for Slot<T> {
    fn drop(&mut self) {
        if *self.turn.get_mut() != EMPTY_SLOT {
            // SAFETY: by the turn invariant a slot with a turn other than 0 is
            // initialised; `&mut self` shows that both ends are gone.
            unsafe { self.value.get_mut().assume_init_drop() };
        }
    }
}

/// The claims of a value that is being changed; also more than can ever look.
const CHANGING: u32 = u32::MAX;

/// A value that one may change or several look at.
pub(crate) struct SharedCell<T> {
    claims: AtomicU32,
    value: UnsafeCell<ManuallyDrop<T>>,
}

// SAFETY: by the claim invariant threads have either one `&mut T` or several `&T`
// between them. `T: Send` because the value is changed, and moved out of and into
// its place, by one thread after another; `T: Sync` because several look at it.
unsafe impl<T: Send + Sync> Sync for SharedCell<T> {}

/// The claim of a user that may change the value.
pub struct WriteClaim<'a, T>(&'a SharedCell<T>);

/// The claim of a user that looks at the value.
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

    /// Claims the value for a look, unless somebody may change it.
    pub(crate) fn look(&self) -> Option<ReadClaim<'_, T>> {
        let one_more = |claims| (claims < CHANGING - 1).then(|| claims + 1);
        let claim = self
            .claims
            .fetch_update(Ordering::Acquire, Ordering::Relaxed, one_more);
        claim.ok().map(|_| ReadClaim(self))
    }
}

impl<T> Drop for SharedCell<T> {
    fn drop(&mut self) {
        // One that a fault has left half changed stays as it is.
        if *self.claims.get_mut() != CHANGING {
            // SAFETY: `&mut self` shows that no claim is in use, and it is done once.
            unsafe { ManuallyDrop::drop(self.value.get_mut()) };
        }
    }
}

impl<T> Deref for WriteClaim<'_, T> {
    type Target = T;

    fn deref(&self) -> &T {
        // SAFETY: by the claim invariant this claim is the only one, and `&self`
        // keeps it from giving out `&mut T` meanwhile.
        unsafe { &*self.0.value.get() }
    }
}

impl<T> DerefMut for WriteClaim<'_, T> {
    fn deref_mut(&mut self) -> &mut T {
        // SAFETY: by the claim invariant this claim is the only one, and `&mut self`
        // keeps it from giving out another reference meanwhile.
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

/// A value that one at a time may change, and nobody looks at.
pub(crate) struct ExclusiveCell<T>(SharedCell<T>);

// SAFETY: by the claim invariant threads have one `&mut T` between them, as no claim is made for a
// look. `T: Send` because one thread after another has it.
unsafe impl<T: Send> Sync for ExclusiveCell<T> {}

impl<T> ExclusiveCell<T> {
    pub(crate) const fn new(value: T) -> Self {
        Self(SharedCell::new(value))
    }

    /// Claims the value, unless somebody else has a claim.
    pub(crate) fn change(&self) -> Option<WriteClaim<'_, T>> {
        self.0.change()
    }

    /// Forgets a claim that a fault has left, when it has ended the instance that had it.
    ///
    /// # Safety
    ///
    /// No claim is in use, nor will one be that was made before.
    pub(crate) unsafe fn forget_claim(&self) {
        self.0.claims.store(0, Ordering::Release);
    }
}

impl<T> Drop for WriteClaim<'_, T> {
    fn drop(&mut self) {
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

/// A value that is set at most once and then read by everybody.
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

// SAFETY: by the set-once invariant the value is written by one thread before
// any thread reads it. `T: Send` as the owner drops it, `T: Sync` as all look at it.
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

    /// Sets the value, and reports whether this call was the one that did.
    pub fn set(&self, value: T) -> bool {
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

    /// Returns the value, or `None` while none is set.
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
            // SAFETY: by the set-once invariant it is initialised, and `&mut self` is alone.
            unsafe { self.value.get_mut().assume_init_drop() };
        }
    }
}

/// Which of several values is current. Reading it is a load.
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
        // SAFETY: by the current invariant it is valid, and only looked at, for ever.
        unsafe { &*current }
    }
}

#[cfg(test)]
mod tests;
