//! Devices: peers answering the questions of a subtask, possibly late or never.
//!
//! A device has two ends. One subtask *asks*: the subtask is async, sends a question and waits for
//! the answer, or until the limit of that wait. The other end belongs to the *driver*: a DAG of its
//! own, a thread of Linux, or a test takes the question and answers. So, besides the answer itself,
//! the only influence of a device on a DAG is to end a wait before its limit.
//!
//! If the driver is a DAG, the questions themselves can release the driver's jobs
//! ([`Device::served_by`]). The driver's time is then a part of the wait, and its faults stay in
//! its own DAG.
//!
//! # Guarantees
//!
//! - The driver sees a question only after the wait for the answer has begun (R3). In a replay of
//!   recorded answers the driver sees none.
//! - An answer ends exactly the wait for which it was given, once. The driver gets back a second
//!   answer, and one to a wait that is over or to a job that is gone.
//! - Neither end waits for the other or takes a lock; and nothing is allocated.
//!
//! # How the two ends meet
//!
//! Each question has a number, counted from 1, unique over all devices: so a ticket is of no use to
//! another device's driver. The word `posted` holds the number of the question waiting for its
//! answer. Either end decides the question by exchanging the number for 0: the driver by answering,
//! the asking end by giving up, or when its instance is cancelled. After the wait's last instant
//! the driver does not decide any more, even if the asking end has had no core yet. There are two
//! places for questions: while the driver is taking a question just given up, the asking end writes
//! the next question to the other place. The place of the answer belongs to the driver until the
//! driver has answered, and then to the asking end.
//!
//! A [wire](super::wire_waits) is a device, too: its driver reports an answer, and the asking end
//! takes the answer from the wire. The answer may be there before the question.

mod driver;

use alloc::boxed::Box;
use alloc::string::String;
use alloc::sync::Arc;
use core::fmt;
use core::pin::Pin;
use core::sync::atomic::{AtomicU32, AtomicU64, AtomicUsize, Ordering, fence};
use core::task::{Context, Poll};
use core::time::Duration;

use recording::{Recordable, Schema};
use sched_dag::SubtaskId;
use sched_dag::lifecycle::Request;

use super::dag::Dag;
use super::record::EDGE;
use super::signal::{Signal, unknown_signal};
use super::uses::{Uses, sealed};
use super::waiting::TimedOut;
use crate::draft::fault::Fault;
use crate::draft::part::{CheckedDag, DraftPart, PartKind};
use crate::run::answers::{AnyAnswers, AnyDevice, AskedDevice, RecordedAnswers};
use crate::run::cell::turn::turn_of;
use crate::run::cell::{SetOnce, SharedCell};
use crate::run::effect::{Effect, RequestTarget};
use crate::run::line::ChannelState;
use crate::run::turn::{TurnState, WaitEnd, WaitFault};
use crate::run::waiting::{WaitStep, nanoseconds};

pub use driver::{DeviceDriver, Ticket};

/// Makes a device with the given name: the asking subtask's end, and the driver's.
///
/// See [`Device`].
#[must_use]
pub fn create_device<Q, A>(name: &str) -> (Device<Q, A>, DeviceDriver<Q, A>)
where
    Q: Send + Sync + 'static,
    A: Send + Sync + 'static,
{
    let cell = Arc::new(DeviceCell {
        name: name.into(),
        asking: SetOnce::new(),
        turn: AtomicUsize::new(0),
        server: SetOnce::new(),
        bell: SetOnce::new(),
        questions: [(); 2].map(|()| SharedCell::new(None)),
        answer: SharedCell::new(None),
        source: SetOnce::new(),
        answers: SetOnce::new(),
        posted_ns: AtomicU64::new(0),
        took_ns: AtomicU64::new(0),
        last_ns: AtomicU64::new(0),
        staged: AtomicU64::new(0),
        latest: AtomicU64::new(0),
        posted: AtomicU64::new(0),
    });
    let driver = DeviceDriver {
        cell: Arc::clone(&cell),
        taken: 0,
    };
    (Device(cell), driver)
}

/// The asking subtask's end of a device. Made by [`create_device`].
///
/// # Examples
///
/// A camera's DAG asks an accelerator for the objects in a frame, and goes on without an answer if
/// the accelerator is late:
///
/// ```
/// use core::time::Duration;
/// use fass::shared::{Asker, create_device};
/// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
/// use virtual_time::VirtualTime;
///
/// let machine = VirtualTime::new();
/// let (ms, named) = (Duration::from_millis, SubtaskAttributes::named);
/// let (accelerator, driver) = create_device::<u32, u32>("accelerator");
///
/// let dag = create_dag();
/// dag.name("vision").jobs(2);
/// let mut frame = 0_u32;
/// let camera = move || {
///     frame += 1;
///     (frame,)
/// };
/// dag.register_periodic_subtask(camera, ["frame"], ms(20), named("camera").wcet(ms(1)));
/// dag.using(accelerator.asking())
///     .async_subtask(|accelerator: Asker<u32, u32>, (frame,): (u32,)| async move {
///         (accelerator.ask(frame).await.ok(),)
///     })
///     .reads(&["frame"])
///     .writes(&["objects"])
///     .register(named("detect").wcet(ms(1)).wait(ms(5)).wcet(ms(2)));
/// let mut expected = [Some(10), None].into_iter();
/// let show = move |(objects,): (Option<u32>,)| assert_eq!(Some(objects), expected.next());
/// dag.register_sink_subtask(show, ["objects"], ms(20), named("show").wcet(ms(1)));
/// finish_create_dags(&[dag]).unwrap();
///
/// // The first answer comes after 3 ms, the second one too late.
/// machine.answers(driver, move |frame, _job| [(ms(3 * u64::from(frame)), frame * 10)]);
/// let report = machine.run();
/// let response_ns = |job: usize| report.jobs[job].response_time_ns();
/// assert_eq!([response_ns(0), response_ns(1)], [Some(8_000_000), Some(10_000_000)]);
/// ```
pub struct Device<Q, A>(Arc<DeviceCell<Q, A>>);

/// The declaration that a subtask asks a [`Device`]: the function gets an [`Asker`]. Made by
/// [`Device::asking`].
///
/// See [`Device`].
#[derive(Debug)]
pub struct DeviceUse<Q, A>(Device<Q, A>);

/// The handle with which an async function asks a device.
///
/// See [`Device`].
pub struct Asker<Q, A>(Arc<DeviceCell<Q, A>>);

/// A question waiting for its answer, as a future. Made by [`Asker::ask`].
///
/// See [`Device`].
#[must_use = "the question is sent when this is awaited"]
pub struct PendingAnswer<'a, Q, A> {
    cell: &'a DeviceCell<Q, A>,
    question: Option<Q>,
    wait: WaitStep,
    /// The question's number, 0 before the question has one.
    number: u64,
    /// The answer of the recorded run, in a replay.
    recorded: Option<A>,
}

/// A question, with its number and the wait for its answer: the job, and the wait's number within
/// the job.
struct Question<Q> {
    number: u64,
    wait: (u64, u32),
    question: Q,
}

/// The place of the answers, for a device whose driver keeps none of its own.
pub(in crate::api) trait AnswerSource<A>: Send + Sync {
    /// Reports whether there is an answer.
    fn is_there(&self) -> bool;

    /// Takes the answer.
    fn take(&self) -> Option<A>;
}

/// The cell shared by both ends of a device.
struct DeviceCell<Q, A> {
    name: String,
    /// The asking subtask.
    asking: SetOnce<(Arc<RequestTarget>, SubtaskId)>,
    /// The turns of the asking subtask, identified by their address.
    turn: AtomicUsize,
    /// The DAG released by a question.
    server: SetOnce<Arc<RequestTarget>>,
    /// A word changed by each question, for a driver's thread to sleep on.
    bell: SetOnce<Arc<AtomicU32>>,
    questions: [SharedCell<Option<Question<Q>>>; 2],
    /// The answer, with the number of its question.
    answer: SharedCell<Option<(u64, A)>>,
    /// The source of the answers, if they are not in `answer`.
    source: SetOnce<Box<dyn AnswerSource<A>>>,
    /// The recorder of the answers, if they are recorded.
    answers: SetOnce<Box<dyn AnyAnswers<A>>>,
    /// The time at which the latest question was posted, and the time until its answer, if
    /// recorded.
    posted_ns: AtomicU64,
    took_ns: AtomicU64,
    /// The last instant at which the question may be answered.
    last_ns: AtomicU64,
    /// The number of the question to be posted at the end of the turn, or 0.
    staged: AtomicU64,
    /// The number of the question posted last, or 0.
    latest: AtomicU64,
    /// The number of the question waiting for its answer, or 0.
    posted: AtomicU64,
}

/// The count of question numbers given so far, over all devices.
static QUESTIONS: AtomicU64 = AtomicU64::new(0);

impl<Q, A> DeviceCell<Q, A> {
    /// Writes a question to a free place without showing it to the driver yet, and returns its
    /// number.
    fn stage(&self, wait: (u64, u32), question: Q) -> u64 {
        // Relaxed: the number only has to be unique; `posted` hands the question over.
        let number = QUESTIONS.fetch_add(1, Ordering::Relaxed) + 1;
        // The driver holds at most one of the two places.
        let place = self.questions.iter().find_map(SharedCell::change);
        let mut place = place.expect("the driver's end is used by one thread at a time");
        let question = Question {
            number,
            wait,
            question,
        };
        let older = place.replace(question);
        // The older question belongs to the app, and dropping it may panic: so not inside the
        // place.
        drop(place);
        drop(older);
        self.staged.store(number, Ordering::Relaxed);
        number
    }

    /// Takes the answer to an answered question.
    fn take_answer(&self, number: u64) -> A {
        let answer = match self.source.get() {
            Some(source) => source.take(),
            None => {
                let mut place = self.answer.change();
                let answer = place
                    .as_mut()
                    .and_then(|place| place.take_if(|(of, _)| *of == number));
                answer.map(|(_, answer)| answer)
            }
        };
        match answer {
            Some(answer) => answer,
            None => panic!(
                "the platform has ended the wait for an answer of device `{}`, which has given none",
                self.name
            ),
        }
    }

    /// Panics outside a turn of the asking subtask: the question would take a wait of another
    /// subtask.
    fn check_turn(&self, context: &Context<'_>) {
        let turn = turn_of(context.waker()).map_or(0, TurnState::address);
        if turn != self.turn.load(Ordering::Relaxed) {
            WaitFault::Outside.raise()
        }
    }

    /// Decides a question waiting for its answer, and reports whether this call decided the
    /// question.
    fn decide(&self, number: u64) -> bool {
        let posted = &self.posted;
        // Acquire: if the driver has decided, the answer is in its place.
        let decided = posted.compare_exchange(number, 0, Ordering::AcqRel, Ordering::Acquire);
        decided.is_ok()
    }
}

/// Posts the question staged by an instance, after the instance's turn has ended in the wait for
/// the answer.
struct QuestionPost<Q, A> {
    cell: Arc<DeviceCell<Q, A>>,
    /// Whether a sleeping thread has to be woken for the question.
    rings: bool,
    is_muted: bool,
}

impl<Q: Send + Sync, A: Send + Sync> Effect for QuestionPost<Q, A> {
    fn happen(&mut self, _: u64, _: &mut dyn FnMut(Request)) {}

    fn bind(&mut self, turn: usize) {
        self.cell.turn.store(turn, Ordering::Relaxed);
    }

    fn wait(&mut self, (ended_ns, limit_ns): (u64, u64), ask: &mut dyn FnMut(Request)) -> bool {
        let cell = &*self.cell;
        let number = cell.staged.load(Ordering::Relaxed);
        if number == 0 {
            return false;
        }
        cell.staged.store(0, Ordering::Relaxed);
        // All these before `posted`: the driver may answer as soon as it sees the number.
        cell.posted_ns.store(ended_ns, Ordering::Relaxed);
        cell.took_ns.store(0, Ordering::Relaxed);
        let last_ns = ended_ns.saturating_add(limit_ns);
        cell.last_ns.store(last_ns, Ordering::Relaxed);
        cell.latest.store(number, Ordering::Relaxed);
        // Release: the question is in its place.
        cell.posted.store(number, Ordering::Release);
        // The driver is called only now: it must find the question.
        if let Some(server) = cell.server.get().filter(|_| !self.is_muted) {
            ask(Request::Signal(server.dag()));
        }
        if let Some(bell) = cell.bell.get() {
            bell.fetch_add(1, Ordering::Release);
            self.rings = true;
        }
        cell.source.get().is_some_and(|source| {
            // Pairs with the driver's fence: either this side sees an answer coming now, or the
            // driver sees the question.
            fence(Ordering::SeqCst);
            source.is_there() && cell.decide(number)
        })
    }

    fn bell(&mut self) -> Option<Arc<AtomicU32>> {
        let rings = core::mem::take(&mut self.rings);
        rings.then(|| self.cell.bell.get().cloned()).flatten()
    }

    fn withdraw(&mut self) {
        // Not by `decide`, which needs the number: only the latest question can still be open.
        self.cell.posted.store(0, Ordering::Release);
    }

    fn mute(&mut self) {
        self.is_muted = true;
    }
}

impl<Q, A> Device<Q, A> {
    /// Returns the declaration that a subtask asks the device, for [`Dag::using`]. A device has one
    /// such subtask.
    #[must_use = "a use has no effect until a subtask is registered with it"]
    pub fn asking(&self) -> DeviceUse<Q, A> {
        DeviceUse(Self(Arc::clone(&self.0)))
    }

    /// Lets each question raise `signal`, which releases the driver's sporadic DAG. The signal is
    /// raised in the step in which the wait for the answer begins, and not in a replay; its DAG
    /// still keeps the least distance of releases. The driver answers at once, or starts work
    /// leading to an answer later. Returns `true` if `signal` is the device's first signal and
    /// comes before the commit; otherwise the call has no effect.
    ///
    /// Call the method before the commit of the asking DAG. The commit must have the signal's DAG,
    /// too.
    ///
    /// ```
    /// use core::time::Duration;
    /// use fass::shared::{Asker, create_device};
    /// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
    ///
    /// let machine = virtual_time::VirtualTime::new();
    /// let (ms, named) = (Duration::from_millis, SubtaskAttributes::named);
    /// let (adder, mut driver) = create_device::<u32, u32>("adder");
    /// let (asks, serves) = (create_dag(), create_dag());
    /// asks.name("asks").jobs(2).period(ms(10)).relative_deadline(ms(10));
    /// let ask = |adder: Asker<u32, u32>| async move { assert_eq!(adder.ask(1).await, Ok(2)) };
    /// let ask = asks.using(adder.asking()).async_source(ask);
    /// ask.register(named("ask").wait(ms(5)));
    ///
    /// serves.name("serves").relative_deadline(ms(2));
    /// adder.served_by(&serves.sporadic(ms(5)));
    /// let serve = move || {
    ///     fass::execute_for(ms(1), fass::Occupation::Spin);
    ///     if let Some((ticket, number)) = driver.question() {
    ///         driver.answer(ticket, number + 1).expect("it waits");
    ///     }
    /// };
    /// serves.source(serve).register(named("serve"));
    /// finish_create_dags(&[asks, serves]).unwrap();
    /// let report = machine.run();
    /// assert_eq!(report.dag("serves").statistics().completed, 2);
    /// assert!(report.dag("asks").jobs().all(|job| job.response_time_ns() == Some(1_000_000)));
    /// ```
    pub fn served_by(&self, signal: &Signal) -> bool {
        // After the commit nobody checks any more whether the signal's DAG belongs to the plan.
        let asking = self.0.asking.get();
        let is_committed = asking.is_some_and(|(dag, _)| dag.get().is_some());
        !is_committed && self.0.server.set(Arc::clone(&signal.target))
    }
}

impl<Q, A: Recordable + Send + Sync + 'static> Device<Q, A> {
    /// Records the answers, where the platform records. Each answer is recorded with the time it
    /// took, after the instance that got the answer is complete or has failed. A replay takes the
    /// recorded answers instead of asking: its waits are as long as in the recorded run, and a wait
    /// whose answer is missing in the recording lasts until its limit.
    ///
    /// Answers are recorded along with topics, so record topics of the DAG, too ([`Dag::record`]).
    /// If a topic of a source is recorded, the commit demands a record of all answers to the DAG's
    /// subtasks other than sources. If the answers of a job take more than 4 KiB together, they are
    /// lost. Call the method before the commit.
    ///
    /// ```
    /// use core::time::Duration;
    /// use fass::shared::{Asker, create_device};
    /// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
    /// use virtual_time::VirtualTime;
    ///
    /// let ms = Duration::from_millis;
    /// let commit = || {
    ///     let (sonar, driver) = create_device::<u32, u32>("sonar");
    ///     sonar.record();
    ///     let dag = create_dag();
    ///     dag.name("depth").jobs(3).record::<u32>("ping").record::<u32>("echo");
    ///     let ping = SubtaskAttributes::named("ping");
    ///     dag.register_periodic_subtask(|| (7_u32,), ["ping"], ms(20), ping);
    ///     let listen = |sonar: Asker<u32, u32>, (ping,): (u32,)| async move {
    ///         (sonar.ask(ping).await.unwrap_or(0),)
    ///     };
    ///     let listen = dag.using(sonar.asking()).async_subtask(listen);
    ///     let named = SubtaskAttributes::named("listen");
    ///     listen.reads(&["ping"]).writes(&["echo"]).register(named.wait(ms(5)));
    ///     let show = SubtaskAttributes::named("show");
    ///     dag.register_sink_subtask(|_: (u32,)| (), ["echo"], ms(20), show);
    ///     finish_create_dags(&[dag]).unwrap();
    ///     driver
    /// };
    /// let machine = VirtualTime::new();
    /// let mut depth = 10;
    /// machine.answers(commit(), move |_ping, job| {
    ///     depth += 1;
    ///     Some((ms(4 * job), depth)) // the last one is late
    /// });
    /// let recorded = machine.run();
    /// let recording = machine.recording();
    ///
    /// let machine = VirtualTime::new().replay(&recording).unwrap();
    /// let _driver = commit(); // which is not asked
    /// let report = machine.run();
    /// assert_eq!((report.compared, report.divergence), (3, None));
    /// assert_eq!(report.jobs, recorded.jobs); // at the same times
    /// ```
    pub fn record(&self) -> &Self {
        let answers = RecordedAnswers::new(&EDGE);
        // A second call changes nothing.
        let _ = self.0.answers.set(Box::new(answers));
        self
    }
}

impl<Q: Send + Sync, A: Send + Sync> AnyDevice for DeviceCell<Q, A> {
    fn name(&self) -> &str {
        &self.name
    }

    fn line(&self) -> Option<(Schema, Arc<ChannelState>)> {
        self.answers.get().map(|answers| answers.line())
    }

    fn server(&self) -> Option<&Arc<RequestTarget>> {
        self.server.get()
    }
}

impl DraftPart for AskedDevice {
    fn check(&self, of: &CheckedDag<'_>) -> Option<Fault> {
        unknown_signal(of, self.0, self.1.server()?)
    }
}

impl<Q, A> sealed::Sealed for DeviceUse<Q, A> {}

impl<Q: Send + Sync + 'static, A: Send + Sync + 'static> Uses for DeviceUse<Q, A> {
    type Borrowed<'a> = Asker<Q, A>;
    type Held = Asker<Q, A>;
    type Guard<'a> = &'a Asker<Q, A>;

    fn hold(self, dag: &Dag, subtask: usize) -> Asker<Q, A> {
        let cell = self.0.0;
        let mut draft = dag.draft.borrow_mut();
        let id = SubtaskId(u32::try_from(subtask).unwrap_or(u32::MAX));
        // Like all faults a fault of the commit, and not a panic where the subtask is registered.
        if !cell.asking.set((Arc::clone(&draft.target), id)) {
            let name = cell.name.clone();
            draft.add(PartKind::SecondAsker, move |of: &CheckedDag<'_>| {
                let says = format_args!(
                    "asks device `{name}`, which another subtask asks; make a device for each"
                );
                Some(of.fault("device_asked_twice", subtask, says))
            });
        }
        let device: Arc<dyn AnyDevice> = Arc::<DeviceCell<Q, A>>::clone(&cell);
        draft.add(PartKind::Device, AskedDevice(subtask, device));
        let post = QuestionPost {
            cell: Arc::clone(&cell),
            rings: false,
            is_muted: false,
        };
        draft.act(subtask, Box::new(post));
        Asker(cell)
    }

    fn enter(held: &mut Asker<Q, A>) -> &Asker<Q, A> {
        held
    }

    fn borrow(guard: &mut &Asker<Q, A>) -> Asker<Q, A> {
        Asker(Arc::clone(&guard.0))
    }
}

impl<Q, A> Asker<Q, A> {
    /// Sends a question, and waits for the answer, or until the limit of the wait.
    ///
    /// The question goes out when the wait begins. An answer at the very instant of the limit still
    /// counts.
    ///
    /// # Panics
    ///
    /// When polled, with a [`WaitFault`], if the wait differs from the subtask's declared waits.
    pub fn ask(&self, question: Q) -> PendingAnswer<'_, Q, A> {
        self.ask_if(Some(question))
    }

    /// Panics outside a turn of the asking subtask.
    pub(in crate::api) async fn check_turn(&self) {
        core::future::poll_fn(|context| {
            self.0.check_turn(context);
            Poll::Ready(())
        })
        .await;
    }

    /// Sends the question, or, given none, waits until the limit in vain.
    pub(in crate::api) fn ask_if(&self, question: Option<Q>) -> PendingAnswer<'_, Q, A> {
        PendingAnswer {
            cell: &self.0,
            question,
            wait: WaitStep::new(WaitEnd::Limit),
            number: 0,
            recorded: None,
        }
    }
}

impl<Q, A> PendingAnswer<'_, Q, A> {
    /// Waits for a shorter time than the limit. When polled, a longer time is a [`WaitFault`].
    ///
    /// ```
    /// use core::time::Duration;
    /// use fass::shared::{Asker, TimedOut};
    ///
    /// async fn try_soon(sonar: Asker<(), u32>) -> Result<u32, TimedOut> {
    ///     sonar.ask(()).within(Duration::from_micros(200)).await
    /// }
    /// ```
    pub fn within(mut self, limit: Duration) -> Self {
        self.wait.end(WaitEnd::After(nanoseconds(limit)));
        self
    }
}

/// No part of the future is pinned.
impl<Q, A> Unpin for PendingAnswer<'_, Q, A> {}

impl<Q, A> Future for PendingAnswer<'_, Q, A> {
    type Output = Result<A, TimedOut>;

    fn poll(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Self::Output> {
        let this = self.get_mut();
        this.cell.check_turn(context);
        let answers = this.cell.answers.get();
        // In a replay no question leaves: its effects happened in the recorded run.
        if let Some(answers) = answers.filter(|answers| answers.replays()) {
            return this.replay(&**answers, context);
        }
        let polled = this.wait.poll(context);
        let Some(wait) = this.wait.id() else {
            return Poll::Pending;
        };
        // Only staged: the question goes out at the end of the turn, when the turn cannot fail any
        // more.
        if let Some(question) = this.question.take() {
            this.number = this.cell.stage(wait, question);
        }
        polled.map(|has_timed_out| {
            let cell = this.cell;
            // At the limit, too, an answer may be there: it was there when the wait began, or came
            // while the scheduler was ending the wait. A replay may post no question.
            let was_answered =
                || cell.latest.load(Ordering::Relaxed) == this.number && !cell.decide(this.number);
            let is_there = this.number > 0 && (!has_timed_out || was_answered());
            let answer = is_there.then(|| cell.take_answer(this.number));
            // A missing answer is recorded, too; otherwise a replay would differ.
            if let Some(answers) = answers.filter(|answers| answers.is_open()) {
                answers.keep(wait, cell.took_ns.load(Ordering::Relaxed), answer.as_ref());
            }
            answer.ok_or(TimedOut)
        })
    }
}

impl<Q, A> PendingAnswer<'_, Q, A> {
    /// Waits for the recorded answer, as long as the wait took in the recorded run.
    fn replay(
        &mut self,
        answers: &dyn AnyAnswers<A>,
        context: &Context<'_>,
    ) -> Poll<Result<A, TimedOut>> {
        // The lookup comes before the wait begins, since the wait's end depends on the recorded
        // time.
        let next = self.wait.next_id(context);
        // Without a recorded answer the wait goes on to its limit, as in the recorded run.
        if let Some((took_ns, Some(answer))) = next.and_then(|wait| answers.recorded(wait)) {
            self.recorded = Some(answer);
            self.wait.end(WaitEnd::AtMost(took_ns));
        }
        let polled = self.wait.poll(context);
        polled.map(|_| self.recorded.take().ok_or(TimedOut))
    }
}

/// A dropped future takes no answer any more.
impl<Q, A> Drop for PendingAnswer<'_, Q, A> {
    fn drop(&mut self) {
        if self.number > 0 {
            // A question still staged would go out for a wait already over.
            let staged = &self.cell.staged;
            if staged.load(Ordering::Relaxed) == self.number {
                staged.store(0, Ordering::Relaxed);
            }
            self.cell.decide(self.number);
        }
    }
}

shown_as!(Device<Q, A>, |of| of.0.name);
shown_as!(Asker<Q, A>, |of| of.0.name);

impl<Q, A> fmt::Debug for PendingAnswer<'_, Q, A> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("PendingAnswer")
            .field(&self.cell.name)
            .finish()
    }
}
