//! A subtask whose function another one can replace after a fault.
//!
//! Of what a fault has ended nothing is dropped: it may be half changed. The function's place is
//! used again, what it owned is lost. The ends of the topics are *claimed* for the time in which
//! the subtask receives or sends, as a state would be. While the app's function runs nobody has a
//! claim; so the next function finds the ends as they should be. If they are claimed, the fault
//! came while values were handed over, and the subtask cannot go on.
//!
//! A function that is *made anew* is made by the next instance, in its time. So, however many
//! faults are survived, there is one place for it.
//!
//! # A state's value, and those that take its place after faults
//!
//! A subtask that a fault has ended may have left a state half changed, and its claim of
//! the value is never given back. So the value is given up with it: the next use finds
//! the next of the values that the app has given for that, all made at the commit.
//!
//! A state may be written down, so that a replay can begin with a later job than the first one. The
//! first subtask that may change a state in a job finds there what all jobs before have left.
//! So much is written down every so many jobs, before its function is called, and goes to the
//! platform as a sample does: when the instance is complete, or has failed.

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

/// Functions of which one is the *present* one.
pub(crate) trait Alternatives<Args, Ret>: Send {
    /// Reports whether the one after the present one is made anew, each time.
    fn restarts(&self) -> bool;

    /// Makes the present one, if it is not there.
    fn prepare(&mut self);

    /// Calls the present one.
    fn call(&mut self, args: Args) -> Ret;

    /// Gives the present one up, without a destructor: the next one takes its place.
    fn lose(&mut self);

    /// Gives their own memory back, without a destructor of what they own.
    fn forget(self: Box<Self>);
}

/// Functions that `make` makes, which are called by way of `call`.
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
        // A fault may come before the first call, so this is told from the beginning on.
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
    /// The states that they use.
    states: Vec<Arc<dyn Reset>>,
    ends: Arc<ReplaceableEnds<(Args::Subs, Ret::Pubs)>>,
}

/// The ends of the topics, and which function is next: all that others may look at while the
/// present one runs.
struct ReplaceableEnds<T> {
    both: SharedCell<T>,
    next: AtomicU8,
}

/// There is no other function.
const NONE: u8 = 0;
/// The next one is made anew.
const ANEW: u8 = 1;
/// The next one is that to fall back on.
const FALLBACK: u8 = 2;

impl<T: Send + Sync> Alternate for ReplaceableEnds<T> {
    fn is_there(&self) -> bool {
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
        // Claimed twice, for receiving and for sending, and not between: a fault of the function
        // must find them free.
        let mut ends = self.ends.claim();
        // A fault in here ends the DAG: what makes functions may be half changed.
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

/// The values of a state, one after the other.
#[doc(hidden)]
pub struct ResettableState<T> {
    first: SharedCell<T>,
    /// The values after faults; none where no fault is survived.
    others: SetOnce<Box<[SharedCell<T>]>>,
    resets: AtomicUsize,
}

/// A state of whatever type.
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

    /// Returns the present value. There is one for each fault that is survived.
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
