//! Devices: what takes its time to answer a subtask, and may be late, or never come to an end.
//!
//! A device has two ends. One subtask *asks*: it is async, sends a question and waits for the
//! answer, or until the limit of that wait. The other end is the *driver's*: it takes the question
//! and answers it, from a DAG of its own, a thread of Linux, a test. So all that a device can do to a
//! DAG is to end a wait before its limit.
//!
//! A driver that is a DAG is released by the questions themselves ([`Device::served_by`]): its time,
//! too, is a part of the wait, and its faults are its own.
//!
//! # What is guaranteed
//!
//! - A question is there for the driver when the wait for its answer has begun, not before (R3).
//! - An answer ends the wait that it is for, once. Another one, or one for a wait that has ended, or
//!   whose job is gone, is given back.
//! - Neither end waits for the other, or takes a lock; and nothing is allocated.
//!
//! # How the two ends meet
//!
//! Each question has a number, from 1 on, that no other one has of any device: so a ticket is of no
//! use to another device's driver. The word `posted` is that of the question that waits for its
//! answer; whoever exchanges it for 0 has decided: the driver, who then has answered, or the asking
//! end, which has given up, or whose instance is cancelled. The driver does not decide behind the
//! wait's last instant, when the asking end may not have had a core yet. There are two places for
//! questions, as the driver may be just taking one out that has been given up; the asking end writes
//! the next one to the other. The place of the answer is the driver's until it has answered, and then
//! the asking end's.
//!
//! A [wire](super::wire_waits) is a device, too: its driver says that an answer is there, and the
//! asking end takes it from the wire. It may be there before it is asked for.

use alloc::boxed::Box;
use alloc::string::String;
use alloc::sync::Arc;
use core::fmt;
use core::pin::Pin;
use core::sync::atomic::{AtomicU32, AtomicU64, AtomicUsize, Ordering, fence};
use core::task::{Context, Poll};
use core::time::Duration;

use recording::{Recordable, Schema};
use sched_dag::lifecycle::{Request, WaitId};
use sched_dag::{Instance, SubtaskId};

use super::dag::Dag;
use super::record::EDGE;
use super::signal::{Signal, unknown_signal};
use super::uses::{Uses, sealed};
use super::waiting::TimedOut;
use crate::draft::fault::Fault;
use crate::draft::part::{CheckedDag, DraftPart, PartKind};
use crate::platform;
use crate::run::answers::{AnyAnswers, AnyDevice, AskedDevice, RecordedAnswers};
use crate::run::cell::turn::turn_of;
use crate::run::cell::{SetOnce, SharedCell};
use crate::run::effect::{Effect, RequestTarget};
use crate::run::line::ChannelState;
use crate::run::turn::{TurnState, WaitEnd, WaitFault};
use crate::run::waiting::{WaitStep, nanoseconds};

/// Makes a device of that name: the end of the subtask that asks it, and the driver's.
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

/// A device, as the subtask has it that asks. Made by [`create_device`].
///
/// # Examples
///
/// A camera's DAG that asks an accelerator for what is in a frame, and goes on without if it is
/// late:
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

/// The use of a [`Device`]: the function gets an [`Asker`]. Made by [`Device::asking`].
///
/// See [`Device`].
#[derive(Debug)]
pub struct DeviceUse<Q, A>(Device<Q, A>);

/// The handle by which an async function asks a device.
///
/// See [`Device`].
pub struct Asker<Q, A>(Arc<DeviceCell<Q, A>>);

/// A question on its way to its answer. Made by [`Asker::ask`].
///
/// See [`Device`].
#[must_use = "the question is sent when this is awaited"]
pub struct PendingAnswer<'a, Q, A> {
    cell: &'a DeviceCell<Q, A>,
    question: Option<Q>,
    wait: WaitStep,
    /// Its number, 0 before it has one.
    number: u64,
    /// The answer of the recorded run, if this is a replay.
    recorded: Option<A>,
}

/// The driver's end of a device. Made by [`create_device`].
///
/// There is one, so of what drives a device one acts at a time.
///
/// See [`Ticket`].
pub struct DeviceDriver<Q, A> {
    cell: Arc<DeviceCell<Q, A>>,
    /// The question that was taken last.
    taken: u64,
}

/// The question that an answer is for.
///
/// ```
/// use core::time::Duration;
/// use fass::shared::{Asker, create_device};
/// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
/// use virtual_time::VirtualTime;
///
/// let machine = VirtualTime::new();
/// let ms = Duration::from_millis;
/// let (sonar, mut driver) = create_device::<(), u32>("sonar");
/// let dag = create_dag();
/// dag.name("depth").jobs(1).period(ms(20)).relative_deadline(ms(20));
/// let ping = |sonar: Asker<(), u32>| async move {
///     assert_eq!(sonar.ask(()).await, Ok(7));
/// };
/// let ping = dag.using(sonar.asking()).async_source(ping);
/// ping.register(SubtaskAttributes::named("ping").wait(ms(9)));
/// finish_create_dags(&[dag]).unwrap();
///
/// assert!(driver.question().is_none());
/// machine.run_for(ms(4));
/// let (ticket, ()) = driver.question().unwrap();
/// assert_eq!(ticket.job(), 0);
/// assert_eq!(driver.answer(ticket, 7), Ok(()));
/// assert_eq!(driver.answer(ticket, 8), Err(8)); // it has its answer
/// assert_eq!(machine.run().jobs[0].response_time_ns(), Some(4_000_000));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ticket {
    number: u64,
    /// The plan.
    plan: u64,
    wait: WaitId,
}

impl Ticket {
    /// Returns the job that asks.
    pub const fn job(&self) -> u64 {
        self.wait.instance.job
    }
}

/// A question, with its number and the wait for its answer: of which job, and which one there.
struct Question<Q> {
    number: u64,
    wait: (u64, u32),
    question: Q,
}

/// The place of the answers of a device whose driver has none of its own.
pub(super) trait AnswerSource<A>: Send + Sync {
    /// Reports whether there is one.
    fn is_there(&self) -> bool;

    /// Takes it.
    fn take(&self) -> Option<A>;
}

/// The cell that both ends of a device share.
struct DeviceCell<Q, A> {
    name: String,
    /// The subtask that asks.
    asking: SetOnce<(Arc<RequestTarget>, SubtaskId)>,
    /// The turns of that subtask, by their address.
    turn: AtomicUsize,
    /// The DAG that a question releases.
    server: SetOnce<Arc<RequestTarget>>,
    /// The word that a question changes, where a driver's thread sleeps on it.
    bell: SetOnce<Arc<AtomicU32>>,
    questions: [SharedCell<Option<Question<Q>>>; 2],
    /// The answer, with the number of its question.
    answer: SharedCell<Option<(u64, A)>>,
    /// Where the answers are, if not there.
    source: SetOnce<Box<dyn AnswerSource<A>>>,
    /// How the answers are recorded, if they are.
    answers: SetOnce<Box<dyn AnyAnswers<A>>>,
    /// When the latest question was posted, and how long the answer took, if it is recorded.
    posted_ns: AtomicU64,
    took_ns: AtomicU64,
    /// The last instant at which it may be answered.
    last_ns: AtomicU64,
    /// The question to be posted at the end of the turn, or 0.
    staged: AtomicU64,
    /// The question that was posted last, or 0.
    latest: AtomicU64,
    /// The question that waits for its answer, or 0.
    posted: AtomicU64,
}

/// How many questions have a number, of all devices.
static QUESTIONS: AtomicU64 = AtomicU64::new(0);

impl<Q, A> DeviceCell<Q, A> {
    /// Writes a question down, which is not to be seen yet, and returns its number.
    fn stage(&self, wait: (u64, u32), question: Q) -> u64 {
        let number = QUESTIONS.fetch_add(1, Ordering::Relaxed) + 1;
        // The driver is at one of them at most.
        let place = self.questions.iter().find_map(SharedCell::change);
        let mut place = place.expect("the driver's end is used by one thread at a time");
        let question = Question {
            number,
            wait,
            question,
        };
        let older = place.replace(question);
        // What is dropped is the app's, and may panic: not in the place.
        drop(place);
        drop(older);
        self.staged.store(number, Ordering::Relaxed);
        number
    }

    /// Takes the answer to a question, which has come.
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

    /// Panics where this is no turn of the subtask that asks: its question would wait in another's.
    fn check_turn(&self, context: &Context<'_>) {
        let turn = turn_of(context.waker()).map_or(0, TurnState::address);
        if turn != self.turn.load(Ordering::Relaxed) {
            WaitFault::Outside.raise()
        }
    }

    /// Decides on a question that waits for its answer, and reports whether it did.
    fn decide(&self, number: u64) -> bool {
        let posted = &self.posted;
        // Acquire: if the driver has, the answer is in its place.
        let decided = posted.compare_exchange(number, 0, Ordering::AcqRel, Ordering::Acquire);
        decided.is_ok()
    }
}

/// Posts the question that an instance has staged, once its turn has ended in the wait for the
/// answer.
struct QuestionPost<Q, A> {
    cell: Arc<DeviceCell<Q, A>>,
    /// Whether a thread sleeps that is to be woken for it.
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
        cell.posted_ns.store(ended_ns, Ordering::Relaxed);
        cell.took_ns.store(0, Ordering::Relaxed);
        let last_ns = ended_ns.saturating_add(limit_ns);
        cell.last_ns.store(last_ns, Ordering::Relaxed);
        cell.latest.store(number, Ordering::Relaxed);
        // Release: the question is in its place.
        cell.posted.store(number, Ordering::Release);
        if let Some(server) = cell.server.get().filter(|_| !self.is_muted) {
            ask(Request::Signal(server.dag()));
        }
        if let Some(bell) = cell.bell.get() {
            bell.fetch_add(1, Ordering::Release);
            self.rings = true;
        }
        cell.source.get().is_some_and(|source| {
            // With the driver's: an answer that comes now is seen here, or the question there.
            fence(Ordering::SeqCst);
            source.is_there() && cell.decide(number)
        })
    }

    fn bell(&mut self) -> Option<Arc<AtomicU32>> {
        let rings = core::mem::take(&mut self.rings);
        rings.then(|| self.cell.bell.get().cloned()).flatten()
    }

    fn withdraw(&mut self) {
        self.cell.posted.store(0, Ordering::Release);
    }

    fn mute(&mut self) {
        self.is_muted = true;
    }
}

impl<Q, A> Device<Q, A> {
    /// Returns the use of the subtask that asks it, of which there is one.
    #[must_use = "a use has no effect until a subtask is registered with it"]
    pub fn asking(&self) -> DeviceUse<Q, A> {
        DeviceUse(Self(Arc::clone(&self.0)))
    }

    /// Has each question raise a signal, in the step in which the wait for the answer begins: the
    /// sporadic DAG that it releases has the driver. It answers at once, or starts what answers
    /// later. Reports whether it is the first signal of the device, which alone counts.
    ///
    /// To be called before the commit, which must have the signal's DAG, too; after it no signal
    /// counts.
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
        // Behind the commit nobody checks whether the signal is one of the plan's.
        let asking = self.0.asking.get();
        let is_committed = asking.is_some_and(|(dag, _)| dag.get().is_some());
        !is_committed && self.0.server.set(Arc::clone(&signal.target))
    }
}

impl<Q, A: Recordable + Send + Sync + 'static> Device<Q, A> {
    /// Records the answers, where the platform records: each with how long it took, when the
    /// instance that got it is complete. A replay takes them, in place of asking: its waits are as
    /// long as they were.
    ///
    /// They are recorded if topics of the DAG are ([`Dag::record`]), too; if one of a source is, the
    /// answers have to be. Those of a job that take more than 4 KiB together are lost. To be called
    /// before the commit.
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
        // Once is enough.
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
        // A fault of the commit, as all are, and not a panic where the subtask is registered.
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
    /// The question goes out when the wait begins. An answer at the very instant of the limit counts.
    ///
    /// # Panics
    ///
    /// When polled, with a [`WaitFault`], if the wait is not as stated.
    pub fn ask(&self, question: Q) -> PendingAnswer<'_, Q, A> {
        self.ask_if(Some(question))
    }

    /// Panics where this is no turn of the subtask that asks.
    pub(super) async fn check_turn(&self) {
        core::future::poll_fn(|context| {
            self.0.check_turn(context);
            Poll::Ready(())
        })
        .await;
    }

    /// Asks, or waits until the limit for nothing.
    pub(super) fn ask_if(&self, question: Option<Q>) -> PendingAnswer<'_, Q, A> {
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
    /// Waits for a shorter time than the limit.
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

/// Nothing in it is pinned.
impl<Q, A> Unpin for PendingAnswer<'_, Q, A> {}

impl<Q, A> Future for PendingAnswer<'_, Q, A> {
    type Output = Result<A, TimedOut>;

    fn poll(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Self::Output> {
        let this = self.get_mut();
        this.cell.check_turn(context);
        let answers = this.cell.answers.get();
        // No question leaves in a replay: what it may set off happened in the recorded run.
        if let Some(answers) = answers.filter(|answers| answers.replays()) {
            return this.replay(&**answers, context);
        }
        let polled = this.wait.poll(context);
        let Some(wait) = this.wait.id() else {
            return Poll::Pending;
        };
        // Staged only: it goes out at the end of this turn, when nothing of it can fail any more.
        if let Some(question) = this.question.take() {
            this.number = this.cell.stage(wait, question);
        }
        polled.map(|has_timed_out| {
            let cell = this.cell;
            // At the limit, too, an answer may be there: since the wait began, or since the driver gave
            // it while the scheduler ended the wait. A replay may post no question.
            let was_answered =
                || cell.latest.load(Ordering::Relaxed) == this.number && !cell.decide(this.number);
            let is_there = this.number > 0 && (!has_timed_out || was_answered());
            let answer = is_there.then(|| cell.take_answer(this.number));
            // That there was none in time is an answer, too, without which a replay would differ.
            if let Some(answers) = answers.filter(|answers| answers.is_open()) {
                answers.keep(wait, cell.took_ns.load(Ordering::Relaxed), answer.as_ref());
            }
            answer.ok_or(TimedOut)
        })
    }
}

impl<Q, A> PendingAnswer<'_, Q, A> {
    /// Waits as long as it took in the recorded run, for the answer that there was.
    fn replay(
        &mut self,
        answers: &dyn AnyAnswers<A>,
        context: &Context<'_>,
    ) -> Poll<Result<A, TimedOut>> {
        // It is looked up before the wait begins, whose end depends on it.
        let next = self.wait.next_id(context);
        if let Some((took_ns, Some(answer))) = next.and_then(|wait| answers.recorded(wait)) {
            self.recorded = Some(answer);
            self.wait.end(WaitEnd::AtMost(took_ns));
        }
        let polled = self.wait.poll(context);
        polled.map(|_| self.recorded.take().ok_or(TimedOut))
    }
}

/// From now on no answer is taken.
impl<Q, A> Drop for PendingAnswer<'_, Q, A> {
    fn drop(&mut self) {
        if self.number > 0 {
            let staged = &self.cell.staged;
            if staged.load(Ordering::Relaxed) == self.number {
                staged.store(0, Ordering::Relaxed);
            }
            self.cell.decide(self.number);
        }
    }
}

impl<Q, A> DeviceDriver<Q, A> {
    /// Takes the question that waits for its answer, if there is one that was not taken before.
    ///
    /// See [`Ticket`].
    pub fn question(&mut self) -> Option<(Ticket, Q)> {
        let number = self.cell.posted.load(Ordering::Acquire);
        if number == 0 || number == self.taken {
            return None;
        }
        let is_it = |question: &mut Question<Q>| question.number == number;
        // The other place is of a question that is staged, or was given up.
        let mut places = self.cell.questions.iter();
        let found = places.find_map(|place| place.change()?.take_if(is_it))?;
        self.taken = number;
        let (target, subtask) = self.cell.asking.get()?;
        let ((plan, dag), (job, number)) = (target.get()?, found.wait);
        let (subtask, count) = (*subtask, found.number);
        let ticket = Ticket {
            number: count,
            plan,
            wait: WaitId {
                instance: Instance { dag, job, subtask },
                number,
            },
        };
        Some((ticket, found.question))
    }

    /// Gives the answer to a question, which ends the wait for it.
    ///
    /// See [`Ticket`].
    ///
    /// # Errors
    ///
    /// The answer is given back if the question has one, or nobody waits for it any more.
    pub fn answer(&mut self, ticket: Ticket, answer: A) -> Result<(), A> {
        let (cell, number) = (&self.cell, ticket.number);
        // Until then the place is the asking end's, which may not have taken its answer yet.
        if cell.posted.load(Ordering::Acquire) != number {
            return Err(answer);
        }
        let Some(mut place) = cell.answer.change() else {
            return Err(answer);
        };
        let older = place.replace((number, answer));
        drop(place);
        drop(older);
        if self.end_wait(ticket) {
            return Ok(());
        }
        // It comes too late, or has been given up just now; nobody else writes to the place.
        let mut place = self.cell.answer.change();
        let taken = place.as_mut().and_then(|place| place.take());
        taken.map_or(Ok(()), |(_, taken)| Err(taken))
    }

    /// Ends the wait for an answer, which is there. Reports whether somebody waits for it.
    fn end_wait(&self, ticket: Ticket) -> bool {
        let (cell, platform) = (&self.cell, platform::expect_installed());
        let now_ns = platform.now_ns();
        // The asking end may get to know only later that its wait has ended: it has no core yet.
        if now_ns > cell.last_ns.load(Ordering::Relaxed) {
            return false;
        }
        if cell.answers.get().is_some_and(|answers| answers.is_open()) {
            let posted_ns = cell.posted_ns.load(Ordering::Relaxed);
            let took_ns = now_ns.saturating_sub(posted_ns);
            cell.took_ns.store(took_ns, Ordering::Relaxed);
        }
        let decided = cell.decide(ticket.number);
        // Once for each question: whoever decides it first tells the scheduler, or nobody does.
        if decided {
            platform.answer(ticket.plan, ticket.wait);
        }
        decided
    }

    /// Has the asking end take its answers from there.
    pub(super) fn answer_from(&self, source: impl AnswerSource<A> + 'static) {
        self.cell.source.set(Box::new(source));
    }

    /// Ends the wait for an answer, if there is one, that is where the asking end takes it.
    pub(super) fn tell(&mut self) {
        // With that of the post: a question that comes now is seen here, or the answer there.
        fence(Ordering::SeqCst);
        if let Some((ticket, _)) = self.question() {
            self.end_wait(ticket);
        }
    }

    /// Returns a word that changes when there is a question, for a platform that has threads: one
    /// may sleep on it.
    ///
    /// ```
    /// let (_sonar, driver) = fass::shared::create_device::<(), u32>("sonar");
    /// assert!(std::sync::Arc::ptr_eq(&driver.bell(), &driver.bell()));
    /// ```
    #[must_use]
    pub fn bell(&self) -> Arc<AtomicU32> {
        let bell = &self.cell.bell;
        let _ = bell.get().is_some() || bell.set(Arc::default());
        bell.get().cloned().unwrap_or_default()
    }

    /// Reports whether there is still something that may ask.
    ///
    /// ```
    /// let (sonar, driver) = fass::shared::create_device::<(), u32>("sonar");
    /// assert!(driver.is_used());
    /// drop(sonar);
    /// assert!(!driver.is_used());
    /// ```
    pub fn is_used(&self) -> bool {
        Arc::strong_count(&self.cell) > 1
    }
}

shown_as!(Device<Q, A>, |of| of.0.name);
shown_as!(Asker<Q, A>, |of| of.0.name);
shown_as!(DeviceDriver<Q, A>, |of| of.cell.name);

impl<Q, A> fmt::Debug for PendingAnswer<'_, Q, A> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("PendingAnswer")
            .field(&self.cell.name)
            .finish()
    }
}
