//! A subtask whose function another one can replace after a fault.
//!
//! What a fault has abandoned stays where it is: the function, what it has on its stack,
//! and the body. The ends of the topics are shared by all bodies of the subtask, and each
//! *claims* them for the time in which it receives or sends, as it would a state. While
//! the app's function runs nobody has a claim; so the next body finds the ends free. If
//! it does not, the fault came while values were handed over, and the subtask cannot go on.

use alloc::boxed::Box;
use alloc::sync::Arc;
use core::pin::pin;
use core::task::{Context, Poll, Waker};

use super::cell::{Changing, Shared};
use super::plan::{Body, Subtask};
use super::reset::Reset;
use super::subtask::MakeBody;
use super::tuple::{MulRecv, MulSend, VecToPubs, VecToSubs};

/// A function of a subtask, whichever.
pub(crate) type Function<Args, Ret> = Box<dyn FnMut(Args) -> Ret + Send>;

/// What makes the functions of a subtask: the first one, and those that replace it.
pub(crate) struct Functions<Args, Ret> {
    pub(crate) make: Box<dyn FnMut() -> Function<Args, Ret>>,
    /// What comes after all others.
    pub(crate) fallback: Option<Function<Args, Ret>>,
    /// Whether `make` makes more than the first one.
    pub(crate) restarts: bool,
    /// The states that they use.
    pub(crate) states: Arc<[Arc<dyn Reset>]>,
}

/// Defers making the bodies until the commit knows the wiring, and how many faults are
/// survived.
pub(crate) fn defer<Args: VecToSubs, Ret: VecToPubs>(
    mut functions: Functions<Args, Ret>,
) -> MakeBody {
    Box::new(move |wiring, subtask| {
        let ends = Arc::new(Shared::new((
            <Args as VecToSubs>::gen_subs(wiring.ports(subtask)),
            <Ret as VecToPubs>::gen_pubs(wiring.ports(subtask)),
        )));
        let body = |f, is_fallback| {
            Body::new(Box::new(Replaceable {
                f,
                ends: Arc::clone(&ends),
                states: Arc::clone(&functions.states),
                is_fallback,
            }))
        };
        let first = body((functions.make)(), false);
        // The last one is taken first.
        let fallback = functions.fallback.take().map(|f| body(f, true));
        let restarts = if functions.restarts { wiring.faults } else { 0 };
        let anew = (0..restarts).map(|_| body((functions.make)(), false));
        let others = fallback.into_iter().chain(anew).collect();
        wiring.others.push((subtask, others));
        first
    })
}

struct Replaceable<Args: VecToSubs, Ret: VecToPubs> {
    f: Function<Args, Ret>,
    ends: Arc<Shared<(Args::Subs, Ret::Pubs)>>,
    states: Arc<[Arc<dyn Reset>]>,
    is_fallback: bool,
}

impl<Args: VecToSubs, Ret: VecToPubs> Replaceable<Args, Ret> {
    fn claim(&self) -> Changing<'_, (Args::Subs, Ret::Pubs)> {
        self.ends.change().unwrap_or_else(|| refuse())
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
        let results = (self.f)(args);
        let sent = pin!(self.claim().1.send_all(results)).poll(context);
        debug_assert!(sent.is_ready());
    }

    fn discard(&mut self, job: u64) {
        if let Some(mut ends) = self.ends.change() {
            ends.0.discard_all(job);
        }
    }

    fn can_take_over(&self) -> bool {
        self.ends.change().is_some()
    }

    fn take_over(&mut self) {
        self.states.iter().for_each(|state| state.reset());
    }

    fn is_fallback(&self) -> bool {
        self.is_fallback
    }
}

fn refuse() -> ! {
    panic!(
        "another body of the subtask is receiving or sending: the platform runs two of one \
         subtask at the same time"
    )
}
