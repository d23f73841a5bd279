//! A subtask as a future: the loop of the paper's figure 4.
//!
//! [`create_subtask`] turns a function that does not wait (the others have `waiting`) into a single
//! future for the subtask's whole life, polled once for each instance. In each poll the future
//! receives all inputs, calls the function, sends all outputs, and comes to rest at the next
//! `recv_all`. Nothing leaves before the function has returned (R3).
//!
//! The figure generates subscribers and publishers in the future's first poll. Here they are
//! generated before the future is made: otherwise a source might publish before a later subtask
//! listens, and that subtask's topics would be one job behind forever.
//!
//! An untyped subtask works like a typed one, with tokens for values. Here it has no future, since
//! its function takes no inputs to wait for.

use alloc::boxed::Box;
use alloc::vec::Vec;
use core::convert::Infallible;
use core::pin::{Pin, pin};
use core::task::{Context, Poll, Waker, ready};

use super::plan::{PolledSubtask, SubtaskCode};
use super::topic::{DagWiring, Publisher, Subscriber, Token};
use super::tuple::{MulRecv, MulSend, VecToPubs, VecToSubs};

/// Makes a registered subtask's body at the commit, from the DAG's wiring and the subtask's number.
pub(crate) type MakeBody = Box<dyn FnOnce(&mut DagWiring, usize) -> SubtaskCode>;

/// Defers [`create_subtask`] until the commit knows the wiring.
pub(crate) fn defer<F, Args, Ret>(f: F) -> MakeBody
where
    F: FnMut(Args) -> Ret + Send + 'static,
    Args: VecToSubs,
    Ret: VecToPubs,
{
    Box::new(move |wiring, subtask| SubtaskCode::new(Box::new(create_subtask(f, wiring, subtask))))
}

/// Makes the future of one subtask. Its ends of the topics exist on return.
fn create_subtask<F, Args, Ret>(
    f: F,
    wiring: &mut DagWiring,
    subtask: usize,
) -> PollLoop<F, Args::Subs, Ret::Pubs>
where
    F: FnMut(Args) -> Ret + Send + 'static,
    Args: VecToSubs,
    Ret: VecToPubs,
{
    PollLoop {
        f,
        subs: <Args as VecToSubs>::gen_subs(wiring.ports(subtask)),
        pubs: <Ret as VecToPubs>::gen_pubs(wiring.ports(subtask)),
    }
}

/// The loop of the paper's figure, one iteration for each poll. The loop waits in a single place,
/// so no state has to be kept between polls: an iteration neither begins by finding its place, nor
/// ends with a look at the closed gate.
struct PollLoop<F, Subs, Pubs> {
    f: F,
    subs: Subs,
    pubs: Pubs,
}

/// Nothing in the loop is pinned: a turn's futures do not outlive the turn.
impl<F, Subs, Pubs> Unpin for PollLoop<F, Subs, Pubs> {}

impl<F, Subs: MulRecv, Pubs: MulSend> Future for PollLoop<F, Subs, Pubs>
where
    F: FnMut(Subs::Items) -> Pubs::Items,
{
    type Output = Infallible;

    #[inline(always)]
    fn poll(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Infallible> {
        let Self { f, subs, pubs } = self.get_mut();
        let args = ready!(pin!(subs.recv_all()).poll(context));
        let results = f(args);
        // Sending never waits, so no later poll has to continue here.
        let sent = pin!(pubs.send_all(results)).poll(context);
        debug_assert!(sent.is_ready());
        Poll::Pending
    }
}

impl<F, Subs: MulRecv, Pubs: MulSend> PolledSubtask for PollLoop<F, Subs, Pubs>
where
    F: FnMut(Subs::Items) -> Pubs::Items,
    Self: Send,
{
    fn take_turn(&mut self, job: u64) {
        self.subs.grant(job);
        self.pubs.grant(job);
        match Pin::new(self).poll(&mut Context::from_waker(Waker::noop())) {
            Poll::Pending => {}
            Poll::Ready(never) => match never {},
        }
    }

    fn discard(&mut self, job: u64) {
        self.subs.discard_all(job);
    }

    fn forget(self: Box<Self>) {
        core::mem::forget(self.f);
    }
}

/// Defers making the subtask until the commit knows the wiring.
pub(crate) fn defer_untyped<F: FnMut(u64) + Send + 'static>(f: F) -> MakeBody {
    Box::new(move |wiring, subtask| {
        let (before, after) = wiring.tokens(subtask);
        SubtaskCode::new(Box::new(UntypedLoop { f, before, after }))
    })
}

struct UntypedLoop<F> {
    f: F,
    before: Vec<Subscriber<Token>>,
    after: Publisher<Token>,
}

impl<F: FnMut(u64) + Send> PolledSubtask for UntypedLoop<F> {
    fn take_turn(&mut self, job: u64) {
        // Tokens carry nothing, but have to leave their slots to later jobs.
        self.before.iter_mut().for_each(|edge| {
            edge.recv(job);
        });
        (self.f)(job);
        self.after.send(job, Token);
    }

    fn discard(&mut self, job: u64) {
        self.before.iter_mut().for_each(|edge| edge.discard(job));
    }

    fn forget(self: Box<Self>) {
        core::mem::forget(self.f);
    }
}
