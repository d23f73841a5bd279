//! A subtask whose function another one can replace after a fault.
//!
//! Of what a fault has ended nothing is dropped: it may be half changed. The function's own
//! memory is given back, what it owned is not. The ends of the topics are *claimed* for the time in
//! which the subtask receives or sends, as a state would be. While the app's function runs
//! nobody has a claim; so the next function finds the ends as they should be. If it does not,
//! the fault came while values were handed over, and the subtask cannot go on.
//!
//! A function that is *made anew* is made by the next instance, in its time: neither the commit
//! nor the fault does so. However many faults are survived, there is one function.

use alloc::boxed::Box;
use alloc::sync::Arc;
use core::pin::pin;
use core::sync::atomic::{AtomicU8, Ordering};
use core::task::{Context, Poll, Waker};

use super::cell::{Changing, Shared};
use super::plan::{Body, Next, Replacement, Subtask};
use super::reset::Reset;
use super::subtask::MakeBody;
use super::tuple::{MulRecv, MulSend, VecToPubs, VecToSubs};

/// A function of a subtask, whichever.
pub(crate) type Function<Args, Ret> = Box<dyn Call<Args, Ret>>;

/// What can be called, and given up.
pub(crate) trait Call<Args, Ret>: Send {
    fn call(&mut self, args: Args) -> Ret;

    /// Gives its own memory back, without a destructor of what it owns.
    fn forget(self: Box<Self>);
}

impl<Args, Ret, F: FnMut(Args) -> Ret + Send> Call<Args, Ret> for F {
    fn call(&mut self, args: Args) -> Ret {
        self(args)
    }

    fn forget(self: Box<Self>) {
        core::mem::forget(*self);
    }
}

/// What makes functions.
pub(crate) type Make<Args, Ret> = Box<dyn FnMut() -> Function<Args, Ret> + Send>;

/// What makes the functions of a subtask.
pub(crate) enum Functions<Args, Ret> {
    /// All of them.
    Anew(Make<Args, Ret>),
    /// The first one, and the one to fall back on.
    Two(Function<Args, Ret>, Function<Args, Ret>),
}

/// Defers making the body until the commit knows the wiring.
pub(crate) fn defer<Args: VecToSubs, Ret: VecToPubs>(
    functions: Functions<Args, Ret>,
    states: Arc<[Arc<dyn Reset>]>,
) -> MakeBody {
    Box::new(move |wiring, subtask| {
        let (f, make, fallback, next) = match functions {
            Functions::Anew(mut make) => (make(), Some(make), None, ANEW),
            Functions::Two(first, second) => (first, None, Some(second), FALLBACK),
        };
        Body::new(Box::new(Replaceable {
            f: Some(f),
            make,
            fallback,
            states,
            ends: Arc::new(Ends {
                ends: Shared::new((
                    <Args as VecToSubs>::gen_subs(wiring.ports(subtask)),
                    <Ret as VecToPubs>::gen_pubs(wiring.ports(subtask)),
                )),
                next: AtomicU8::new(next),
            }),
        }))
    })
}

/// No function is next: there is none, or it is just being made.
const NONE: u8 = 0;
/// One that is made anew is next.
const ANEW: u8 = 1;
/// The one to fall back on is next.
const FALLBACK: u8 = 2;

struct Replaceable<Args: VecToSubs, Ret: VecToPubs> {
    /// None from a fault to the next turn.
    f: Option<Function<Args, Ret>>,
    make: Option<Make<Args, Ret>>,
    fallback: Option<Function<Args, Ret>>,
    states: Arc<[Arc<dyn Reset>]>,
    ends: Arc<Ends<Args, Ret>>,
}

/// What others may look at while the function runs.
struct Ends<Args: VecToSubs, Ret: VecToPubs> {
    ends: Shared<(Args::Subs, Ret::Pubs)>,
    next: AtomicU8,
}

impl<Args: VecToSubs, Ret: VecToPubs> Next for Ends<Args, Ret> {
    fn is_there(&self) -> bool {
        self.next.load(Ordering::Relaxed) != NONE && self.ends.change().is_some()
    }

    fn is_fallback(&self) -> bool {
        self.next.load(Ordering::Relaxed) == FALLBACK
    }
}

impl<Args: VecToSubs, Ret: VecToPubs> Replaceable<Args, Ret> {
    /// Returns the function; after a fault that is another one.
    fn function(&mut self) -> &mut Function<Args, Ret> {
        let Self {
            f, make, fallback, ..
        } = self;
        f.get_or_insert_with(|| {
            // A fault from here on ends the DAG: what makes functions may be half changed.
            let next = &self.ends.next;
            let before = next.swap(NONE, Ordering::Relaxed);
            let made = fallback.take().or_else(|| Some(make.as_mut()?()));
            if before == ANEW {
                next.store(ANEW, Ordering::Relaxed);
            }
            made.expect("it is replaced only if there is another one")
        })
    }

    fn claim(&self) -> Changing<'_, (Args::Subs, Ret::Pubs)> {
        self.ends.ends.change().unwrap_or_else(|| refuse())
    }
}

impl<Args: VecToSubs, Ret: VecToPubs> Subtask for Replaceable<Args, Ret> {
    fn take_turn(&mut self, job: u64) {
        let context = &mut Context::from_waker(Waker::noop());
        let mut ends = self.claim();
        ends.0.grant(job);
        ends.1.grant(job);
        let received = pin!(ends.0.recv_all()).poll(context);
        drop(ends);
        let Poll::Ready(args) = received else {
            return;
        };
        let results = self.function().call(args);
        let sent = pin!(self.claim().1.send_all(results)).poll(context);
        debug_assert!(sent.is_ready());
    }

    fn discard(&mut self, job: u64) {
        if let Some(mut ends) = self.ends.ends.change() {
            ends.0.discard_all(job);
        }
    }

    fn replacement(&self) -> Option<Replacement> {
        Some(Replacement(Arc::<Ends<Args, Ret>>::clone(&self.ends)))
    }

    fn replace(&mut self) {
        if let Some(lost) = self.f.take() {
            lost.forget();
        }
        self.states.iter().for_each(|state| state.reset());
    }

    fn forget(mut self: Box<Self>) {
        match self.f.take() {
            Some(lost) => lost.forget(),
            None => core::mem::forget(self.make.take()),
        }
    }
}

fn refuse() -> ! {
    panic!(
        "another body of the subtask is receiving or sending: the platform runs two of one \
         subtask at the same time"
    )
}
