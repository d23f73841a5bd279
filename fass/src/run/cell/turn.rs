//! The waker by which futures of this crate find the turn in which they are polled.
//!
//! The app's future is polled with a special [`Waker`]. The waker wakes nobody: the scheduler
//! decides when a turn is taken. The waker's data is the state of the turn. Through the waker a
//! future of this crate asks for a wait, however deeply it is nested in other futures.
//!
//! > **Turn waker invariant.** The data of a waker with [`TURN`] as its functions points to a
//! > [`TurnState`] living at least as long as every reference to the waker. Such a waker is made in
//! > [`poll_in`] only, where the state is borrowed for longer than the waker lives, and never
//! > moves. A clone, which may live on, is a waker of another kind and does nothing.

use core::ptr;
use core::task::{Context, RawWaker, RawWakerVTable, Waker};

use crate::run::turn::TurnState;

/// The functions of turn wakers, recognised by this address. A `static` has exactly one address; a
/// `const` may have several.
static TURN: RawWakerVTable = RawWakerVTable::new(|_| inert(), |_| {}, |_| {}, |_| {});

/// The functions of clones.
static INERT: RawWakerVTable = RawWakerVTable::new(|_| inert(), |_| {}, |_| {}, |_| {});

fn inert() -> RawWaker {
    RawWaker::new(ptr::null(), &INERT)
}

/// Polls with a context in which the crate's futures find the turn.
pub(crate) fn poll_in<T>(turn: &TurnState, poll: impl FnOnce(&mut Context<'_>) -> T) -> T {
    let data = ptr::from_ref(turn).cast();
    // SAFETY: the functions neither use nor free their data, from any thread, and a clone has
    // functions of its own. The state outlives the waker, as the turn waker invariant demands.
    let waker = unsafe { Waker::new(data, &TURN) };
    poll(&mut Context::from_waker(&waker))
}

/// Returns the turn in which a future is polled with a turn waker, or `None` for any other waker.
pub(crate) fn turn_of(waker: &Waker) -> Option<&TurnState> {
    let turn = ptr::eq(waker.vtable(), &TURN).then(|| waker.data().cast::<TurnState>())?;
    // SAFETY: by the turn waker invariant the data points to a state living as long as this
    // reference to the waker, and a state is only ever shared.
    Some(unsafe { &*turn })
}
