//! A subtask whose function another function can replace after a fault.
//!
//! Nothing that a fault has ended is dropped, as it may be half changed. The function's place is
//! reused, but everything it owned is lost. The subtask *claims* the ends of the topics while it
//! receives or sends, as it would claim a state. While the app's function runs, nobody has a claim,
//! so the next function finds the ends in order. If the ends are claimed, the fault came in the
//! middle of a hand-over of values, and the subtask cannot go on.
//!
//! A function *made anew* is made by the next instance, in the instance's time. So a single place
//! for the function suffices, however many faults are survived.
//!
//! # The values of a state after faults
//!
//! A subtask ended by a fault may have left a state half changed, and never gives back its claim of
//! the value. So the value is given up with the subtask: the next use finds the next of the values
//! provided by the app, all made at the commit.
//!
//! A state may be written down, so a replay can begin with a job other than the first. The first
//! subtask permitted to change a state in a job finds the value left by all earlier jobs. Every so
//! many jobs, this value is written down before the subtask's function is called. Like a sample, it
//! goes to the platform when the instance is complete, or has failed.

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::mem;
use core::pin::pin;
use core::sync::atomic::{AtomicU8, AtomicUsize, Ordering};
use core::task::{Context, Poll, Waker};

use recording::{Recordable, Schema};
use sched_dag::engine::Alternate;

use super::cell::{SetOnce, SharedCell, WriteClaim};
use super::line::{AnyState, ChannelState};
use super::plan::{PolledSubtask, ReplacementCode, SubtaskCode};
use super::subtask::MakeBody;
use super::tuple::{MulRecv, MulSend, VecToPubs, VecToSubs};

/// Functions, one of which is the *present* one.
pub(crate) trait Alternatives<Args, Ret>: Send {
    /// Reports whether the next function is made anew each time.
    fn restarts(&self) -> bool;

    /// Makes the present function, if it is not there.
    fn prepare(&mut self);

    /// Calls the present function.
    fn call(&mut self, args: Args) -> Ret;

    /// Gives up the present function without a destructor, in favour of the next.
    fn lose(&mut self);

    /// Frees their own memory, without running destructors of owned values.
    fn forget(self: Box<Self>);
}

/// Functions made by `make` and called through `call`.
pub(crate) struct RemadeFunction<M, F, C> {
    pub(crate) make: M,
    pub(crate) present: Option<F>,
    pub(crate) call: C,
}

impl<Args, Ret, M, F, C> Alternatives<Args, Ret> for RemadeFunction<M, F, C>
where
    M: FnMut() -> F + Send,
    F: Send,
    C: FnMut(&mut F, Args) -> Ret + Send,
{
    fn restarts(&self) -> bool {
        true
    }

    fn prepare(&mut self) {
        // Here, where a fault still ends the DAG: `make` is the app's code, and may fail.
        self.present.get_or_insert_with(&mut self.make);
    }

    fn call(&mut self, args: Args) -> Ret {
        let present = self.present.get_or_insert_with(&mut self.make);
        (self.call)(present, args)
    }

    fn lose(&mut self) {
        // Not dropped: a fault may have left it half changed, and its destructor would run on that.
        mem::forget(self.present.take());
    }

    fn forget(self: Box<Self>) {
        mem::forget(*self);
    }
}

/// A function, and the one to fall back on.
pub(crate) struct FallbackPair<F, G> {
    pub(crate) first: Option<F>,
    pub(crate) second: G,
}

impl<Args, Ret, F, G> Alternatives<Args, Ret> for FallbackPair<F, G>
where
    F: FnMut(Args) -> Ret + Send,
    G: FnMut(Args) -> Ret + Send,
{
    fn restarts(&self) -> bool {
        false
    }

    fn prepare(&mut self) {}

    fn call(&mut self, args: Args) -> Ret {
        match &mut self.first {
            Some(first) => first(args),
            None => (self.second)(args),
        }
    }

    fn lose(&mut self) {
        // Not dropped, for the same reason.
        mem::forget(self.first.take());
    }

    fn forget(self: Box<Self>) {
        mem::forget(*self);
    }
}

/// Defers making the body until the commit knows the wiring.
pub(crate) fn defer<Args: VecToSubs, Ret: VecToPubs>(
    mut alternatives: Box<dyn Alternatives<Args, Ret>>,
    states: Vec<Arc<dyn Reset>>,
) -> MakeBody {
    Box::new(move |wiring, subtask| {
        alternatives.prepare();
        let restarts = alternatives.restarts();
        let both = SharedCell::new((
            <Args as VecToSubs>::gen_subs(wiring.ports(subtask)),
            <Ret as VecToPubs>::gen_pubs(wiring.ports(subtask)),
        ));
        // A fault may come before the first call, so the next function is set from the beginning.
        let next = AtomicU8::new(if restarts { ANEW } else { FALLBACK });
        let ends = Arc::new(ReplaceableEnds { both, next });
        SubtaskCode::new(Box::new(ReplaceableBody {
            alternatives,
            states,
            ends,
        }))
    })
}

struct ReplaceableBody<Args: VecToSubs, Ret: VecToPubs> {
    alternatives: Box<dyn Alternatives<Args, Ret>>,
    /// The states used by the functions.
    states: Vec<Arc<dyn Reset>>,
    ends: Arc<ReplaceableEnds<(Args::Subs, Ret::Pubs)>>,
}

/// The ends of the topics, and the kind of the next function: everything that others may look at
/// while the present function runs.
struct ReplaceableEnds<T> {
    both: SharedCell<T>,
    next: AtomicU8,
}

/// There is no other function.
const NONE: u8 = 0;
/// The next function is made anew.
const ANEW: u8 = 1;
/// The next function is the fallback.
const FALLBACK: u8 = 2;

impl<T: Send + Sync> Alternate for ReplaceableEnds<T> {
    fn is_there(&self) -> bool {
        // The claim is a test, given back at once: it fails if the fault came in mid hand-over.
        self.next.load(Ordering::Relaxed) != NONE && self.both.change().is_some()
    }

    fn is_fallback(&self) -> bool {
        self.next.load(Ordering::Relaxed) == FALLBACK
    }
}

impl<T> ReplaceableEnds<T> {
    fn claim(&self) -> WriteClaim<'_, T> {
        self.both.change().unwrap_or_else(|| refuse())
    }
}

impl<Args: VecToSubs, Ret: VecToPubs> PolledSubtask for ReplaceableBody<Args, Ret> {
    fn take_turn(&mut self, job: u64) {
        let context = &mut Context::from_waker(Waker::noop());
        // Claimed twice, for receiving and for sending, and not in between: a fault of the function
        // must find the ends free.
        let mut ends = self.ends.claim();
        // A fault in here ends the DAG: the maker of functions may be half changed.
        let next = self.ends.next.load(Ordering::Relaxed);
        self.ends.next.store(NONE, Ordering::Relaxed);
        self.alternatives.prepare();
        self.ends.next.store(next, Ordering::Relaxed);
        ends.0.grant(job);
        ends.1.grant(job);
        let received = pin!(ends.0.recv_all()).poll(context);
        // Before the function is called: it may never return.
        drop(ends);
        let Poll::Ready(args) = received else {
            return;
        };
        let results = self.alternatives.call(args);
        let sent = pin!(self.ends.claim().1.send_all(results)).poll(context);
        debug_assert!(sent.is_ready());
    }

    fn discard(&mut self, job: u64) {
        if let Some(mut ends) = self.ends.both.change() {
            ends.0.discard_all(job);
        }
    }

    fn replacement(&self) -> Option<ReplacementCode> {
        let ends: Arc<ReplaceableEnds<_>> = Arc::clone(&self.ends);
        Some(ReplacementCode(ends))
    }

    fn replace(&mut self) {
        self.alternatives.lose();
        // A state that the failed function changed may be half changed, too.
        self.states.iter().for_each(|state| state.reset());
        // There is only one fallback, so its own fault ends the DAG.
        if self.ends.is_fallback() {
            self.ends.next.store(NONE, Ordering::Relaxed);
        }
    }

    fn forget(self: Box<Self>) {
        self.alternatives.forget();
    }
}

fn refuse() -> ! {
    panic!(
        "another body of the subtask is receiving or sending: the platform runs two of one \
         subtask at the same time"
    )
}

/// The values of a state, used one after the other.
#[doc(hidden)]
pub struct ResettableState<T> {
    first: SharedCell<T>,
    /// The values after faults; empty if no fault is survived.
    others: SetOnce<Box<[SharedCell<T>]>>,
    resets: AtomicUsize,
}

/// A state of any type.
#[doc(hidden)]
pub trait Reset: Send + Sync {
    /// Gives up the present value.
    fn reset(&self);
}

impl<T> ResettableState<T> {
    pub(crate) const fn new(first: T) -> Self {
        Self {
            first: SharedCell::new(first),
            others: SetOnce::new(),
            resets: AtomicUsize::new(0),
        }
    }

    /// Provides the values after faults, once.
    pub(crate) fn provide(&self, values: impl Iterator<Item = T>) {
        self.others.set(values.map(SharedCell::new).collect());
    }

    /// Returns the present value. Besides the first, there is one for each survived fault.
    #[inline]
    pub(crate) fn present(&self) -> &SharedCell<T> {
        match self.resets.load(Ordering::Acquire) {
            0 => &self.first,
            resets => self.after(resets),
        }
    }

    #[cold]
    fn after(&self, resets: usize) -> &SharedCell<T> {
        let value = self.others.get().and_then(|others| others.get(resets - 1));
        value.unwrap_or(&self.first)
    }
}

impl<T: Send + Sync> Reset for ResettableState<T> {
    fn reset(&self) {
        self.resets.fetch_add(1, Ordering::Release);
    }
}

impl<T: Recordable + Send + Sync> AnyState for ResettableState<T> {
    fn schema(&self) -> Schema {
        T::schema()
    }

    fn stage(&self, line: &ChannelState, job: u64) {
        if let Some(value) = self.present().look() {
            line.stage::<T>(job, |out| value.encode(out));
        }
    }

    fn restore(&self, bytes: &[u8]) -> bool {
        let restored = T::from_bytes(bytes).ok().zip(self.present().change());
        let restored = restored.map(|(value, mut place)| *place = value);
        restored.is_some()
    }
}
