//! The waker by which a future of ours finds the turn in which it is polled.
//!
//! A future of the app is polled with a [`Waker`] of our own. It wakes nobody: the scheduler
//! decides when a turn is taken. Its data is the state of the turn, and that is how a future of ours
//! asks for a wait, however deep it lies in futures of others.
//!
//! > **Turn waker invariant.** The data of a waker with [`TURN`] for its functions points to a
//! > [`TurnState`] that lives at least as long as every reference to the waker. Such a waker is made
//! > in [`poll_in`] only, where the state is borrowed for longer than the waker lives, and never
//! > moves; a clone of one, which may live on, is a waker of another kind that does nothing.

use core::ptr;
use core::task::{Context, RawWaker, RawWakerVTable, Waker};

use crate::run::turn::TurnState;

/// The functions of our wakers, which are known by this address. A `static` has one.
static TURN: RawWakerVTable = RawWakerVTable::new(|_| inert(), |_| {}, |_| {}, |_| {});

/// The functions of their clones.
static INERT: RawWakerVTable = RawWakerVTable::new(|_| inert(), |_| {}, |_| {}, |_| {});

fn inert() -> RawWaker {
    RawWaker::new(ptr::null(), &INERT)
}

/// Polls with a context in which futures of ours find the turn.
pub(crate) fn poll_in<T>(turn: &TurnState, poll: impl FnOnce(&mut Context<'_>) -> T) -> T {
    let data = ptr::from_ref(turn).cast();
    // SAFETY: the functions neither use nor free what they get, from any thread, and a clone has
    // functions of its own. The state outlives the waker, as the turn waker invariant demands.
    let waker = unsafe { Waker::new(data, &TURN) };
    poll(&mut Context::from_waker(&waker))
}

/// Returns the turn in which a future is polled with this waker, if it is in one.
pub(crate) fn turn_of(waker: &Waker) -> Option<&TurnState> {
    let turn = ptr::eq(waker.vtable(), &TURN).then(|| waker.data().cast::<TurnState>())?;
    // SAFETY: by the turn waker invariant it points to a state that lives as long as this
    // reference to the waker, and a state is only ever shared.
    Some(unsafe { &*turn })
}
