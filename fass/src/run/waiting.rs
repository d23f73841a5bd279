//! The body of a waiting subtask: each instance is a future, polled once in each
//! [turn](super::turn).
//!
//! The function is called in the first turn and returns the instance's future. An instance keeps
//! nothing else while it waits. The future has one place, made at the commit. It is polled with a
//! waker through which futures of this crate find the turn, to begin their waits.

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::pin::{Pin, pin};
use core::task::{Context, Poll, Waker};
use core::time::Duration;

use super::cell::turn::{poll_in, turn_of};
use super::plan::{PolledSubtask, SubtaskCode};
use super::subtask::MakeBody;
use super::topic::{DagWiring, Publisher, Subscriber, Token};
use super::tuple::{MulRecv, MulSend, VecToPubs, VecToSubs};
use super::turn::{TurnState, WaitEnd, WaitFault};

/// A wait, begun by the first poll.
pub(crate) struct WaitStep {
    end: WaitEnd,
    /// The address of the turns, the job, and the number of waits including the present wait.
    begun: Option<(usize, u64, u32)>,
    is_over: bool,
}

impl WaitStep {
    pub(crate) const fn new(end: WaitEnd) -> Self {
        Self {
            end,
            begun: None,
            is_over: false,
        }
    }

    /// Returns the job and the number of the wait, if it has begun.
    pub(crate) fn id(&self) -> Option<(u64, u32)> {
        self.begun.map(|(_, job, count)| (job, count - 1))
    }

    /// Changes the requested end of the wait.
    pub(crate) fn end(&mut self, end: WaitEnd) {
        self.end = end;
    }

    /// Returns the job and the number it will have, if the wait has not begun.
    pub(crate) fn next_id(&self, context: &Context<'_>) -> Option<(u64, u32)> {
        let turn = turn_of(context.waker()).filter(|_| self.begun.is_none());
        turn.map(TurnState::latest)
    }

    /// Begins the wait, or returns whether it has ended by its limit.
    pub(crate) fn poll(&mut self, context: &Context<'_>) -> Poll<bool> {
        let Some(turn) = turn_of(context.waker()) else {
            WaitFault::Outside.raise()
        };
        let address = turn.address();
        let Some((begun_in, job, count)) = self.begun else {
            // The turn of the first poll is the turn ended by this wait.
            turn.begin(self.end);
            let (job, count) = turn.latest();
            self.begun = Some((address, job, count));
            return Poll::Pending;
        };
        let (present, latest) = turn.latest();
        // This state knows nothing of waits begun in another instance.
        if self.is_over || (begun_in, job) != (address, present) {
            WaitFault::Outside.raise()
        }
        // An answer is for the latest wait only; an older wait counts as timed out.
        let is_latest = count == latest;
        if is_latest && turn.is_asking() {
            return Poll::Pending;
        }
        self.is_over = true;
        Poll::Ready(!is_latest || turn.has_timed_out())
    }
}

impl Future for WaitStep {
    type Output = bool;

    fn poll(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<bool> {
        self.get_mut().poll(context)
    }
}

/// Waits for `duration`, in the function of an async subtask; never longer than the wait's limit.
///
/// A sleep of zero length is a wait, too: the instance gives up the core, and competes for a core
/// again.
///
/// ```
/// use core::time::Duration;
/// use fass::{SubtaskAttributes, create_dag, finish_create_dags, sleep};
///
/// let machine = virtual_time::VirtualTime::new();
/// let ms = Duration::from_millis;
/// let dag = create_dag();
/// dag.name("blink").jobs(2).relative_deadline(ms(10));
/// let blink = move || async move {
///     sleep(ms(3)).await;
/// };
/// let attributes = SubtaskAttributes::named("blink").wcet(ms(1)).wait(ms(5)).wcet(ms(1));
/// dag.register_periodic_async_subtask(blink, [], ms(10), attributes);
/// finish_create_dags(&[dag]).unwrap();
///
/// let report = machine.run();
/// assert_eq!(report.jobs[1].response_time_ns(), Some(5_000_000)); // 1 + 3 + 1
/// ```
///
/// # Panics
///
/// With a [`WaitFault`], in the turn beginning the wait, if the wait is not as stated.
pub async fn sleep(duration: Duration) {
    WaitStep::new(WaitEnd::After(nanoseconds(duration))).await;
}

/// Waits, in the function of an async subtask, until `since_release` has passed since the release
/// of the job; for no time if it has passed already.
///
/// The limit of the wait must be at least `since_release`, less the time covered by an earlier
/// `until` of the instance; when the job started does not matter.
///
/// ```
/// use core::time::Duration;
/// use fass::{SubtaskAttributes, create_dag, finish_create_dags, until};
///
/// let machine = virtual_time::VirtualTime::new();
/// let ms = Duration::from_millis;
/// let dag = create_dag();
/// dag.name("shutter").jobs(1).relative_deadline(ms(10));
/// let shutter = move || async move {
///     until(ms(4)).await;
///     until(ms(6)).await;
/// };
/// let attributes = SubtaskAttributes::named("shutter").wait(ms(4)).wait(ms(2));
/// dag.register_periodic_async_subtask(shutter, [], ms(10), attributes);
/// finish_create_dags(&[dag]).unwrap();
/// assert_eq!(machine.run().jobs[0].response_time_ns(), Some(6_000_000));
/// ```
///
/// # Panics
///
/// With a [`WaitFault`], in the turn beginning the wait, if the wait is not as stated.
pub async fn until(since_release: Duration) {
    WaitStep::new(WaitEnd::SinceRelease(nanoseconds(since_release))).await;
}

/// Converts a duration to nanoseconds, saturating at `u64::MAX`.
pub(crate) fn nanoseconds(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}

/// The ends of a subtask's edges.
trait SubtaskEnds: Send {
    /// The argument of the subtask's function.
    type Args;
    /// The result of the function's future.
    type Ret;

    fn receive(&mut self, job: u64) -> Self::Args;

    fn send(&mut self, job: u64, results: Self::Ret);

    fn discard(&mut self, job: u64);
}

/// The ends of a typed subtask.
struct TypedEnds<Subs, Pubs>(Subs, Pubs);

impl<Subs: MulRecv + Send, Pubs: MulSend + Send> SubtaskEnds for TypedEnds<Subs, Pubs> {
    type Args = Subs::Items;
    type Ret = Pubs::Items;

    fn receive(&mut self, job: u64) -> Subs::Items {
        self.0.grant(job);
        // The inputs are there, or the instance would not be eligible; so a single poll is enough.
        match pin!(self.0.recv_all()).poll(&mut Context::from_waker(Waker::noop())) {
            Poll::Ready(args) => args,
            Poll::Pending => unreachable!("a job that is granted is there"),
        }
    }

    fn send(&mut self, job: u64, results: Pubs::Items) {
        self.1.grant(job);
        // A slot is free: no more jobs are in flight than an edge has slots.
        let sent = pin!(self.1.send_all(results)).poll(&mut Context::from_waker(Waker::noop()));
        debug_assert!(sent.is_ready());
    }

    fn discard(&mut self, job: u64) {
        self.0.discard_all(job);
    }
}

/// The ends of an untyped subtask.
struct UntypedEnds(Vec<Subscriber<Token>>, Publisher<Token>);

impl SubtaskEnds for UntypedEnds {
    type Args = u64;
    type Ret = ();

    fn receive(&mut self, job: u64) -> u64 {
        self.0.iter_mut().for_each(|edge| {
            edge.recv(job);
        });
        job
    }

    fn send(&mut self, job: u64, (): ()) {
        self.1.send(job, Token);
    }

    fn discard(&mut self, job: u64) {
        self.0.iter_mut().for_each(|edge| edge.discard(job));
    }
}

/// Defers making the body of an async function until the commit knows the wiring.
pub(crate) fn defer<F, Args, Fut, Ret>(f: F) -> MakeBody
where
    F: FnMut(Args) -> Fut + Send + 'static,
    Fut: Future<Output = Ret> + Send + 'static,
    Args: VecToSubs,
    Ret: VecToPubs,
{
    Box::new(move |wiring, subtask| {
        let subs = <Args as VecToSubs>::gen_subs(wiring.ports(subtask));
        let pubs = <Ret as VecToPubs>::gen_pubs(wiring.ports(subtask));
        make(f, TypedEnds(subs, pubs), wiring, subtask)
    })
}

/// Defers making the body of an untyped async function.
pub(crate) fn defer_untyped<F, Fut>(f: F) -> MakeBody
where
    F: FnMut(u64) -> Fut + Send + 'static,
    Fut: Future<Output = ()> + Send + 'static,
{
    Box::new(move |wiring, subtask| {
        let (before, after) = wiring.tokens(subtask);
        make(f, UntypedEnds(before, after), wiring, subtask)
    })
}

fn make<F, Fut, E>(f: F, ends: E, wiring: &DagWiring, subtask: usize) -> SubtaskCode
where
    F: FnMut(E::Args) -> Fut + Send + 'static,
    Fut: Future<Output = E::Ret> + Send + 'static,
    E: SubtaskEnds + 'static,
{
    SubtaskCode::new(Box::new(WaitingBody {
        f,
        ends,
        future: Box::pin(None),
        turn: Arc::new(TurnState::new(wiring.waits(subtask))),
    }))
}

/// The body of a subtask with an async function.
struct WaitingBody<F, Fut, E> {
    f: F,
    ends: E,
    /// The place of the instance's future, which never moves.
    future: Pin<Box<Option<Fut>>>,
    turn: Arc<TurnState>,
}

impl<F, Fut, E> PolledSubtask for WaitingBody<F, Fut, E>
where
    F: FnMut(E::Args) -> Fut + Send,
    Fut: Future<Output = E::Ret> + Send,
    E: SubtaskEnds,
{
    fn take_turn(&mut self, job: u64) {
        let Self {
            f,
            ends,
            future,
            turn,
        } = self;
        if !turn.is_of(job) {
            // A future left here belongs to an instance cancelled during a wait. Dropped here, in
            // an instance, as its destructor is code of the app.
            future.set(None);
            let args = ends.receive(job);
            turn.start(job);
            future.set(Some(f(args)));
        }
        let Some(present) = future.as_mut().as_pin_mut() else {
            unreachable!("an instance that has started has its future");
        };
        match poll_in(turn, |context| present.poll(context)) {
            Poll::Pending => turn.expect_wait(),
            Poll::Ready(results) => {
                turn.finish();
                // Before the outputs go out: the future's destructor is code of the app, and may
                // panic.
                future.set(None);
                ends.send(job, results);
            }
        }
    }

    fn discard(&mut self, job: u64) {
        // Without the future, whose destructor may not run in the scheduler's step; the next
        // instance drops it.
        self.ends.discard(job);
    }

    fn turn(&self) -> Option<&Arc<TurnState>> {
        Some(&self.turn)
    }

    fn forget(self: Box<Self>) {
        core::mem::forget(self.f);
        // With its place: a future that was not dropped is pinned, so its memory may not be reused.
        core::mem::forget(self.future);
    }
}
