//! A subtask that waits: each instance is a future, polled once a [turn](super::turn).
//!
//! The function is called in the first turn; what it returns is the instance's future, which is all
//! that it keeps while it waits. That has one place, made at the commit. It is polled with a waker
//! by which a future of ours finds the turn, to begin its wait.

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

/// A wait of a future of ours, which the first poll begins.
pub(crate) struct WaitStep {
    end: WaitEnd,
    /// The address of the turns, the job, and the number of waits with this one.
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

    /// Lets it end otherwise.
    pub(crate) fn end(&mut self, end: WaitEnd) {
        self.end = end;
    }

    /// Returns the job and the number that it will have, if it has not begun.
    pub(crate) fn next_id(&self, context: &Context<'_>) -> Option<(u64, u32)> {
        let turn = turn_of(context.waker()).filter(|_| self.begun.is_none());
        turn.map(TurnState::latest)
    }

    /// Begins it, or returns whether it has ended by its limit.
    pub(crate) fn poll(&mut self, context: &Context<'_>) -> Poll<bool> {
        let Some(turn) = turn_of(context.waker()) else {
            WaitFault::Outside.raise()
        };
        let address = turn.address();
        let Some((begun_in, job, count)) = self.begun else {
            // The first poll is in the turn that ends with this wait.
            turn.begin(self.end);
            let (job, count) = turn.latest();
            self.begun = Some((address, job, count));
            return Poll::Pending;
        };
        let (present, latest) = turn.latest();
        // Of another instance nothing is known here.
        if self.is_over || (begun_in, job) != (address, present) {
            WaitFault::Outside.raise()
        }
        // An answer is for the latest wait only.
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

/// Waits for that much time, in the function of an async subtask; no longer than the wait's limit.
///
/// A sleep of no time is a wait, too: the instance gives its core up, and competes for one again.
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
/// With a [`WaitFault`], in the turn in which it begins, if the wait is not as stated.
pub async fn sleep(duration: Duration) {
    WaitStep::new(WaitEnd::After(nanoseconds(duration))).await;
}

/// Waits, in the function of an async subtask, until that much time has passed since the release of
/// its job; for no time if it has.
///
/// The limit of the wait has to be that long, less what an earlier `until` of the instance has
/// waited for; when the job started does not matter.
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
/// With a [`WaitFault`], in the turn in which it begins, if the wait is not as stated.
pub async fn until(since_release: Duration) {
    WaitStep::new(WaitEnd::SinceRelease(nanoseconds(since_release))).await;
}

/// Returns a duration as a number, the last one if it is beyond that.
pub(crate) fn nanoseconds(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}

/// The ends of a subtask's edges.
trait SubtaskEnds: Send {
    /// The argument of its function.
    type Args;
    /// The result.
    type Ret;

    fn receive(&mut self, job: u64) -> Self::Args;

    fn send(&mut self, job: u64, results: Self::Ret);

    fn discard(&mut self, job: u64);
}

/// Those of a typed subtask.
struct TypedEnds<Subs, Pubs>(Subs, Pubs);

impl<Subs: MulRecv + Send, Pubs: MulSend + Send> SubtaskEnds for TypedEnds<Subs, Pubs> {
    type Args = Subs::Items;
    type Ret = Pubs::Items;

    fn receive(&mut self, job: u64) -> Subs::Items {
        self.0.grant(job);
        // Its inputs are there, or it would not be eligible, so one poll is enough.
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

/// Those of an untyped one.
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

/// Defers making the body of an untyped one.
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

/// The body of a subtask whose function is async.
struct WaitingBody<F, Fut, E> {
    f: F,
    ends: E,
    /// The place of the instance's future, which stays where it is.
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
            // That of an instance that was cancelled while it waited. Here, as it is the app's code.
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
                // Before the outputs go out: its destructor is the function's, and may panic.
                future.set(None);
                ends.send(job, results);
            }
        }
    }

    fn discard(&mut self, job: u64) {
        self.ends.discard(job);
    }

    fn turn(&self) -> Option<&Arc<TurnState>> {
        Some(&self.turn)
    }

    fn forget(self: Box<Self>) {
        core::mem::forget(self.f);
        // With its place: nothing else may be put where a future is that was not dropped.
        core::mem::forget(self.future);
    }
}
