//! A subtask that waits: each instance is a future, polled once a turn.
//!
//! A *turn* is what an instance executes from its start, or the end of a wait, to its finish, or
//! the next wait. The function is called in the first turn; what it returns is the instance's
//! future, which is all that it keeps while it waits. That has one place, made at the commit.
//!
//! How a turn ends is told by one poll of the future. It is ready: then the instance has finished,
//! and its outputs go out. Or it is pending: then one future of ours has begun one wait in it. The
//! completion of such a turn asks for that wait, and causes nothing else.
//!
//! The waits of a subtask are stated: their number, and the limit of each. An instance that waits
//! otherwise panics with a [`WaitFault`].

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::pin::{Pin, pin};
use core::sync::atomic::{AtomicBool, AtomicU8, AtomicU32, AtomicU64, Ordering};
use core::task::{Context, Poll, Waker};
use core::time::Duration;

use sched_dag::lifecycle::Request;
use sched_dag::{Wait, worded};

use super::cell::turn::{poll_in, turn_of};
use super::effect::Effect;
use super::plan::{PolledSubtask, SubtaskCode};
use super::subtask::MakeBody;
use super::topic::{DagWiring, Publisher, Subscriber, Token};
use super::tuple::{MulRecv, MulSend, VecToPubs, VecToSubs};

worded! {
    /// A fault of an instance that does not wait as its subtask states. Its text is the message of
    /// the instance's panic.
    ///
    /// ```
    /// use core::time::Duration;
    /// use fass::{SubtaskAttributes, WaitFault, create_dag, finish_create_dags, sleep};
    ///
    /// let machine = virtual_time::VirtualTime::new().contain_panics();
    /// let (dag, period) = (create_dag(), Duration::from_millis(10));
    /// dag.name("nap").jobs(1).relative_deadline(period);
    /// let nap = || async {
    ///     sleep(Duration::from_millis(4)).await;
    /// };
    /// let limit = Duration::from_millis(3);
    /// let attributes = SubtaskAttributes::named("nap").wait(limit);
    /// dag.register_periodic_async_subtask(nap, [], period, attributes);
    /// finish_create_dags(&[dag]).unwrap();
    ///
    /// let message = &machine.run().panics[0].message;
    /// let asked = Duration::from_millis(4);
    /// assert_eq!(*message, WaitFault::TooLong { number: 0, asked, limit }.to_string());
    /// ```
    pub enum WaitFault {
        /// The function begins a wait beyond those that its subtask states.
        TooMany { stated: usize } = "wait_too_many",
            "a wait too many: the function begins one more than the {} that its subtask \
             states; state it by `wait`, or leave it out", stated;
        /// The function has returned after fewer waits than its subtask states.
        LeftOut { taken: u32, stated: usize } = "wait_left_out",
            "a wait left out: the function has returned after {} of the {} waits that \
             its subtask states; take each, one of no time if there is nothing to wait for, or \
             state fewer", taken, stated;
        /// A wait, of that number from 0 on, asks for more than its limit.
        TooLong { number: u32, asked: Duration, limit: Duration } = "wait_too_long",
            "a wait too long: wait {} asks for {:?}, and its limit is {:?}; ask \
             for less, or state a longer limit", number, asked, limit;
        /// The future begins a second wait in one turn.
        TwoAtOnce = "two_waits_at_once",
            "two waits at once: the function begins a wait before the last one has ended; await \
             one after the other";
        /// The future has returned in the turn in which it has begun a wait.
        NotAwaited = "wait_not_awaited",
            "a wait not awaited: the function has returned and dropped a wait that it has begun; \
             await it to its end";
        /// The future is pending, and no wait of ours is the reason.
        Foreign = "foreign_wait",
            "a foreign wait: the function awaits what is none of its subtask's waits, and nothing \
             would end that; await `sleep`, `until` or a device's answer";
        /// A wait of ours is begun by something else than the future of a subtask.
        Outside = "wait_outside",
            "a wait outside: it is polled by something else than the future of a subtask; await it \
             in the function of an async subtask";
    }
}

impl WaitFault {
    #[cold]
    pub(crate) fn raise(self) -> ! {
        panic!("{self}")
    }
}

/// The end that a wait of ours asks for.
#[derive(Clone, Copy)]
pub(crate) enum WaitEnd {
    /// The stated limit.
    Limit,
    /// So many nanoseconds after it has begun.
    After(u64),
    /// So many nanoseconds after the release of the job.
    SinceRelease(u64),
}

/// The turn asks for no wait.
const NONE: u8 = 0;
/// It asks for one of so many nanoseconds.
const AFTER: u8 = 1;
/// It asks for one until so many nanoseconds after the release.
const SINCE_RELEASE: u8 = 2;

/// No job.
const NO_JOB: u64 = u64::MAX;

/// The waits of a subtask, and how far its instance has come in them. Its users take turns, by the
/// word of the scheduler: the instance while it executes, its completion, the end of its wait. So
/// nothing in here needs an order.
pub(crate) struct TurnState {
    /// The stated limits.
    limits_ns: Box<[u64]>,
    /// The job of the instance that has started and not returned.
    job: AtomicU64,
    /// How many waits it has begun.
    begun: AtomicU32,
    /// [`NONE`], [`AFTER`] or [`SINCE_RELEASE`], and how many nanoseconds.
    asks: AtomicU8,
    asked_ns: AtomicU64,
    has_timed_out: AtomicBool,
    /// So much after the release it is at least.
    reached_ns: AtomicU64,
}

impl TurnState {
    fn new(waits: &[Wait]) -> Self {
        Self {
            limits_ns: waits.iter().map(|wait| wait.limit_ns).collect(),
            job: AtomicU64::new(NO_JOB),
            begun: AtomicU32::new(0),
            asks: AtomicU8::new(NONE),
            asked_ns: AtomicU64::new(0),
            has_timed_out: AtomicBool::new(false),
            reached_ns: AtomicU64::new(0),
        }
    }

    /// Reports whether the instance of a job has started and not returned.
    pub(crate) fn is_of(&self, job: u64) -> bool {
        self.job.load(Ordering::Relaxed) == job
    }

    fn start(&self, job: u64) {
        self.job.store(job, Ordering::Relaxed);
        self.begun.store(0, Ordering::Relaxed);
        self.asks.store(NONE, Ordering::Relaxed);
        self.reached_ns.store(0, Ordering::Relaxed);
    }

    /// Returns the job and the number of waits that it has begun.
    pub(crate) fn latest(&self) -> (u64, u32) {
        let (job, begun) = (&self.job, &self.begun);
        (job.load(Ordering::Relaxed), begun.load(Ordering::Relaxed))
    }

    /// Begins the next wait.
    fn begin(&self, end: WaitEnd) {
        let number = self.begun.load(Ordering::Relaxed);
        let stated = self.limits_ns.len();
        let Some(&limit_ns) = self.limits_ns.get(number as usize) else {
            WaitFault::TooMany { stated }.raise()
        };
        if self.asks.load(Ordering::Relaxed) != NONE {
            WaitFault::TwoAtOnce.raise()
        }
        let reached_ns = self.reached_ns.load(Ordering::Relaxed);
        // An instant of the job is judged by what is certain, not by the present time: so it is a
        // fault in each run, or in none.
        let (asks, asked_ns, most_ns) = match end {
            WaitEnd::Limit => (AFTER, limit_ns, limit_ns),
            WaitEnd::After(ns) => (AFTER, ns, ns),
            WaitEnd::SinceRelease(ns) => (SINCE_RELEASE, ns, ns.saturating_sub(reached_ns)),
        };
        if most_ns > limit_ns {
            let [asked, limit] = [most_ns, limit_ns].map(Duration::from_nanos);
            WaitFault::TooLong {
                number,
                asked,
                limit,
            }
            .raise()
        }
        self.begun.store(number + 1, Ordering::Relaxed);
        self.asked_ns.store(asked_ns, Ordering::Relaxed);
        self.asks.store(asks, Ordering::Relaxed);
        if asks == SINCE_RELEASE {
            let reached_ns = reached_ns.max(asked_ns);
            self.reached_ns.store(reached_ns, Ordering::Relaxed);
        }
    }

    /// Ends a turn whose future is pending.
    fn expect_wait(&self) {
        if self.asks.load(Ordering::Relaxed) == NONE {
            WaitFault::Foreign.raise()
        }
    }

    /// Ends the last turn.
    fn finish(&self) {
        if self.asks.load(Ordering::Relaxed) != NONE {
            WaitFault::NotAwaited.raise()
        }
        let (taken, stated) = (self.begun.load(Ordering::Relaxed), self.limits_ns.len());
        if (taken as usize) < stated {
            WaitFault::LeftOut { taken, stated }.raise()
        }
        self.job.store(NO_JOB, Ordering::Relaxed);
    }

    /// Takes what the turn that has ended asks for, if it has not finished.
    fn take_request(&self) -> Option<Request> {
        let ns = self.asked_ns.load(Ordering::Relaxed);
        let asks = self.asks.load(Ordering::Relaxed);
        self.asks.store(NONE, Ordering::Relaxed);
        match asks {
            NONE => None,
            AFTER => Some(Request::Wait(ns)),
            _ => Some(Request::WaitUntil(ns)),
        }
    }

    /// Learns how the wait has ended, before the next turn.
    pub(crate) fn wake(&self, has_timed_out: bool) {
        self.has_timed_out.store(has_timed_out, Ordering::Relaxed);
    }
}

/// A wait of a future of ours, which the first poll begins.
pub(crate) struct WaitStep {
    end: WaitEnd,
    /// The job, and the number of waits with this one.
    begun: Option<(u64, u32)>,
}

impl WaitStep {
    pub(crate) const fn new(end: WaitEnd) -> Self {
        Self { end, begun: None }
    }

    /// Returns the job and the number of the wait, if it has begun.
    pub(crate) fn id(&self) -> Option<(u64, u32)> {
        self.begun.map(|(job, count)| (job, count - 1))
    }

    /// Lets it end after that much time at most.
    pub(crate) fn shorten(&mut self, limit: Duration) {
        self.end = WaitEnd::After(nanoseconds(limit));
    }

    /// Begins it, or returns whether it has ended by its limit.
    pub(crate) fn poll(&mut self, context: &Context<'_>) -> Poll<bool> {
        let Some(turn) = turn_of(context.waker()) else {
            WaitFault::Outside.raise()
        };
        let Some(begun) = self.begun else {
            turn.begin(self.end);
            self.begun = Some(turn.latest());
            return Poll::Pending;
        };
        // An answer is for the latest wait only.
        let is_latest = begun == turn.latest();
        if is_latest && turn.asks.load(Ordering::Relaxed) != NONE {
            return Poll::Pending;
        }
        Poll::Ready(!is_latest || turn.has_timed_out.load(Ordering::Relaxed))
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
fn nanoseconds(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}

/// The effects of a subtask that waits: the real ones, which happen when it has finished.
pub(crate) struct TurnEffects {
    turn: Arc<TurnState>,
    real: Vec<Box<dyn Effect>>,
}

impl TurnEffects {
    pub(crate) fn new(turn: Arc<TurnState>, real: Vec<Box<dyn Effect>>) -> Self {
        Self { turn, real }
    }
}

impl Effect for TurnEffects {
    fn happen(&mut self, completed_ns: u64, ask: &mut dyn FnMut(Request)) {
        match self.turn.take_request() {
            None => {
                let real = self.real.iter_mut();
                real.for_each(|effect| effect.happen(completed_ns, ask));
            }
            Some(request) => {
                self.real.iter_mut().for_each(|effect| effect.wait());
                ask(request);
            }
        }
    }

    fn fail(&mut self, failed_ns: u64) {
        let real = self.real.iter_mut();
        real.for_each(|effect| effect.fail(failed_ns));
    }
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
        match pin!(self.0.recv_all()).poll(&mut Context::from_waker(Waker::noop())) {
            Poll::Ready(args) => args,
            Poll::Pending => unreachable!("a job that is granted is there"),
        }
    }

    fn send(&mut self, job: u64, results: Pubs::Items) {
        self.1.grant(job);
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
