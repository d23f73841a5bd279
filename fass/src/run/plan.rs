//! Plans, which a commit hands to the platform: the verified model and the bodies.
//!
//! The platform's scheduler decides *which* instance runs *where* and *when*;
//! it then calls [`SubtaskCode::run`] there. A body never decides anything.

use alloc::boxed::Box;
use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;
use core::fmt;
use core::mem;
use core::slice;
use core::sync::atomic::AtomicU32;

use sched_dag::engine::{Alternate, ProvenBounds};
use sched_dag::journal::EventSubject;
use sched_dag::lifecycle::{Lifecycle, Request, WaitLimit};
use sched_dag::{DagId, Instance, SubtaskId, TaskSet, Vertex, engine};

use super::effect::Effect;
use super::gate::call_app;
use super::latest::Staleness;
use super::line::{KeptState, LineOf};
use super::turn::TurnState;

/// A committed set of DAGs, ready to be scheduled.
///
/// # Examples
///
/// A platform receives it in [`Platform::launch`](crate::platform::Platform::launch) and
/// finds a subtask's body at its ids:
///
/// ```
/// use fass::platform::{Plan, SubtaskCode};
/// use sched_dag::Instance;
///
/// fn body_of(plan: &mut Plan, instance: Instance) -> &mut SubtaskCode {
///     &mut plan.bodies[instance.dag.index()][instance.subtask.index()]
/// }
/// ```
#[derive(Debug)]
pub struct Plan {
    /// The verified model, for the scheduler.
    pub task_set: Arc<TaskSet>,
    /// The plan's number, never 0, different from that of every other plan of the
    /// program. Signals know their plan by it
    /// ([`Platform::raise`](crate::platform::Platform::raise)).
    pub number: u64,
    /// The subtasks' bodies: `bodies[dag][subtask]`, in the order of the model.
    pub bodies: Vec<Vec<SubtaskCode>>,
    /// The response times that the commit has proven ([`Commit::answers`](crate::commit::Commit::answers)).
    pub proven: ProvenBounds,
    /// The answers of the commit, for those who keep the run.
    pub(crate) answers: Box<dyn CommitWords>,
    /// By DAG, the one that gets a signal when a fault ends it
    /// ([`Dag::on_fault`](crate::Dag::on_fault)): right after the fault, in the same step of the
    /// scheduler.
    pub after_fault: Vec<Option<DagId>>,
    /// The lifecycle that serves requests other than signals, if a function may make one or a DAG
    /// begins
    /// paused. A platform that takes no such requests refuses the plan.
    pub lifecycle: Option<Box<dyn Lifecycle>>,
    /// The samples of latest values ([`Commit::staleness`](crate::commit::Commit::staleness)): what
    /// passes between DAGs, for platforms that show it.
    pub staleness: Arc<Vec<Staleness>>,
    /// The ways of recorded values, by channel.
    pub(crate) lines: Vec<LineOf>,
    /// The states that a replay begins with, and what to say of one that cannot be that.
    pub(crate) begins: Vec<(Arc<KeptState>, Vec<u8>, String)>,
}

/// The answers of a commit, put in words where somebody wants them.
pub(crate) trait CommitWords: Send + Sync {
    /// Says by DAG which test has proven a bound, or why there is none.
    fn in_words(&self) -> Vec<String>;
}

/// An image has no room for all that answers consist of.
impl fmt::Debug for dyn CommitWords {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("CommitWords")
    }
}

impl Plan {
    /// Gives the states what a replay begins with. A platform that replays calls it in its launch,
    /// where it holds no lock: reading a value, and dropping the one before it, is the app's code.
    ///
    /// # Errors
    ///
    /// In words: a state cannot be what is recorded.
    pub fn restore(&mut self) -> Result<(), String> {
        for (kept, value, complaint) in self.begins.drain(..) {
            if !call_app(|| kept.state.restore(&value)) {
                return Err(complaint);
            }
        }
        Ok(())
    }

    /// Has recorded states written down twice in so many jobs at least, for a platform that keeps
    /// no more than what enters these.
    ///
    /// See [`LatestJobs`](crate::edge::LatestJobs).
    pub fn keep_states_of(&self, jobs: u32) {
        let states = self.lines.iter().filter_map(|of| of.state.as_ref());
        states.for_each(|state| state.keep_every(jobs / 2));
    }
}

/// The executable part of a subtask: its function with its ends of the topics.
///
/// A body may move between threads or processors from one call to the next;
/// `&mut self` makes each call's effects visible to the next one.
///
/// # Examples
///
/// ```
/// use fass::platform::SubtaskCode;
///
/// /// A platform that runs one instance after another.
/// fn run_in_turn(bodies: &mut [SubtaskCode], job: u64) {
///     for body in bodies {
///         body.run(job);
///     }
/// }
/// # fn is_send<T: Send>() {}
/// # is_send::<SubtaskCode>();
/// ```
pub struct SubtaskCode {
    subtask: Box<dyn PolledSubtask>,
    /// The job that it runs, or has panicked in; [`NO_JOB`] else.
    job: u64,
    /// Effects of its completions beyond the DAG.
    effects: Effects,
    /// Whether there are any: asked where each instruction counts.
    has_effects: bool,
}

/// Effects of completions. Mostly there is none, or one, for which a loop would take longer than its
/// effect does. To compare a tag of its own is short.
#[derive(Default)]
#[repr(u8)]
enum Effects {
    #[default]
    None,
    One(Box<dyn Effect>),
    Several(Vec<Box<dyn Effect>>),
    /// Those of a subtask that waits, which happen when its instance has finished.
    OfTurns(Arc<TurnState>, Vec<Box<dyn Effect>>),
}

impl Effects {
    fn all(&mut self) -> &mut [Box<dyn Effect>] {
        match self {
            Self::None => &mut [],
            Self::One(only) => slice::from_mut(only),
            Self::Several(all) | Self::OfTurns(_, all) => all,
        }
    }
}

/// Stands where a job's number does, for none: no run gets so far.
const NO_JOB: u64 = u64::MAX;

/// A subtask, as its body drives it.
pub(crate) trait PolledSubtask: Send {
    /// Grants a job, and takes that turn to its end.
    fn take_turn(&mut self, job: u64);

    /// Gives up what has arrived for a job that the subtask will not run.
    fn discard(&mut self, job: u64);

    /// Returns the function that would go on where a fault ends this one.
    fn replacement(&self) -> Option<ReplacementCode> {
        None
    }

    /// Gives the function up, and the states that it used: the next turn is another one's.
    fn replace(&mut self) {}

    /// Returns the state of its turns, if it may wait.
    fn turn(&self) -> Option<&Arc<TurnState>> {
        None
    }

    /// Gives back what it has, after a fault: all but what the app's function owns, of which no
    /// destructor can be called.
    fn forget(self: Box<Self>);
}

/// A subtask whose jobs are looked at before their turns.
struct JobPreview<F> {
    subtask: Box<dyn PolledSubtask>,
    look: F,
    /// The job that was given up last.
    passed: u64,
}

impl<F: FnMut(u64) -> bool + Send> PolledSubtask for JobPreview<F> {
    fn take_turn(&mut self, job: u64) {
        // Once for each job, in the first turn of its instance.
        let goes_on = self.turn().is_some_and(|turn| turn.is_of(job));
        if self.passed != job && (goes_on || (self.look)(job)) {
            return self.subtask.take_turn(job);
        }
        self.passed = job;
        pass(&mut *self.subtask, job);
    }

    fn discard(&mut self, job: u64) {
        self.subtask.discard(job);
    }

    fn replacement(&self) -> Option<ReplacementCode> {
        self.subtask.replacement()
    }

    fn replace(&mut self) {
        self.subtask.replace();
    }

    fn turn(&self) -> Option<&Arc<TurnState>> {
        self.subtask.turn()
    }

    fn forget(self: Box<Self>) {
        self.subtask.forget();
    }
}

/// Takes a turn of a job whose function is not called.
fn pass(subtask: &mut dyn PolledSubtask, job: u64) {
    if subtask.turn().is_none_or(|turn| turn.pass(job)) {
        subtask.discard(job);
    }
}

/// The functions to replace one that a fault ends. They can be asked for at any time,
/// also while the body runs.
///
/// ```
/// use fass::platform::SubtaskCode;
/// use sched_dag::engine::{Alternate, ProvenBounds};
///
/// fn is_survived(body: &SubtaskCode) -> bool {
///     body.replacement().is_some_and(|next: fass::platform::ReplacementCode| next.is_there())
/// }
/// ```
#[derive(Clone)]
pub struct ReplacementCode(pub(crate) Arc<dyn Alternate + Send + Sync>);

/// One is there while it may be made, and no values are just being handed over.
impl Alternate for ReplacementCode {
    fn is_there(&self) -> bool {
        self.0.is_there()
    }

    fn is_fallback(&self) -> bool {
        self.0.is_fallback()
    }
}

impl SubtaskCode {
    pub(crate) fn new(subtask: Box<dyn PolledSubtask>) -> Self {
        let turn = subtask.turn().map(Arc::clone);
        Self {
            effects: turn.map_or(Effects::None, |turn| Effects::OfTurns(turn, Vec::new())),
            has_effects: subtask.turn().is_some(),
            subtask,
            job: NO_JOB,
        }
    }

    /// Adds what each completion does beyond the DAG.
    pub(crate) fn add_effects(&mut self, effects: impl IntoIterator<Item = Box<dyn Effect>>) {
        for mut effect in effects {
            self.has_effects = true;
            self.effects = match mem::take(&mut self.effects) {
                Effects::None => Effects::One(effect),
                Effects::One(first) => Effects::Several(vec![first, effect]),
                Effects::Several(mut all) => {
                    all.push(effect);
                    Effects::Several(all)
                }
                Effects::OfTurns(turn, mut all) => {
                    effect.bind(turn.address());
                    all.push(effect);
                    Effects::OfTurns(turn, all)
                }
            };
        }
    }

    /// Returns the state of its turns, if it may wait.
    fn turn(&self) -> Option<&Arc<TurnState>> {
        self.subtask.turn()
    }

    /// Reports whether its instances may wait.
    pub fn may_wait(&self) -> bool {
        self.turn().is_some()
    }

    /// Reports whether the instance of a job has begun and not finished: it has a further turn.
    pub fn goes_on(&self, job: u64) -> bool {
        self.turn().is_some_and(|turn| turn.is_of(job))
    }

    /// Takes note, before the next turn, of how the wait has ended in which its instance was.
    pub fn wake(&mut self, has_timed_out: bool) {
        if let Some(turn) = self.turn() {
            turn.wake(has_timed_out);
        }
    }

    /// Runs the subtask's part of job `job` to its end, or to its next wait.
    ///
    /// Returns after the function has returned and its outputs are in their
    /// slots, or when [`complete`](Self::complete) will ask for a wait. Polls the subtask's future exactly once. Does not allocate (the
    /// function itself may).
    ///
    /// The caller calls [`complete`](Self::complete) afterwards, reports the
    /// completion to the scheduler, and starts the successors only then.
    ///
    /// # Panics
    ///
    /// - If the function panics. The body cannot be run again.
    /// - If the body panicked before.
    /// - If an input of `job` is missing, because a predecessor is not complete.
    /// - If an output finds no free slot, because a cancelled instance's inputs
    ///   were not [discarded](Self::discard).
    pub fn run(&mut self, job: u64) {
        assert!(
            self.job == NO_JOB,
            "the subtask panicked in job {} and cannot continue",
            self.job
        );
        self.job = job;
        call_app(|| self.subtask.take_turn(job));
        self.job = NO_JOB;
    }

    /// Publishes the effects that the last [`run`](Self::run) prepared outside the DAG:
    /// its latest values show, and `ask` is called with each signal and each other request. Or, of an
    /// instance that has not finished, returns for how long it waits.
    ///
    /// The caller does so once the instance is complete for it, at `completed_ns` on
    /// the clock of [`crate::now_ns`], and not for an instance that failed. It passes
    /// the requests to the scheduler with the completion (`sched_dag::lifecycle` has what for).
    /// Does not wait, allocate or
    /// run code of the app; a body that has no such effects returns at once.
    #[inline]
    pub fn complete(
        &mut self,
        completed_ns: u64,
        ask: &mut dyn FnMut(Request),
    ) -> Option<WaitLimit> {
        match &mut self.effects {
            Effects::One(only) => only.happen(completed_ns, ask),
            Effects::None => {}
            _ => return self.end_turn(completed_ns, ask),
        }
        None
    }

    /// Apart, so that the way of one effect saves no registers for a loop.
    #[inline(never)]
    fn end_turn(&mut self, completed_ns: u64, ask: &mut dyn FnMut(Request)) -> Option<WaitLimit> {
        if let Effects::OfTurns(turn, all) = &mut self.effects
            && let Some((limit, limit_ns)) = turn.take_wait()
        {
            // All are asked, as each has something to post when a wait begins.
            let mut is_there = false;
            for effect in all {
                is_there |= effect.wait((completed_ns, limit_ns), ask);
            }
            // It is a wait all the same: the instance gives its core up.
            return Some(if is_there { WaitLimit::For(0) } else { limit });
        }
        let all = self.effects.all().iter_mut();
        all.for_each(|effect| effect.happen(completed_ns, ask));
        None
    }

    /// Gives the platform what an instance had sampled, if that is recorded, although it
    /// failed; else nobody could compute its fault again.
    pub fn failed(&mut self, failed_ns: u64) {
        let all = self.effects.all().iter_mut();
        all.for_each(|effect| effect.fail(failed_ns));
    }

    /// Has each job looked at before its turn: it is given up where `look` returns false.
    pub(crate) fn before(mut self, look: impl FnMut(u64) -> bool + Send + 'static) -> Self {
        let subtask = self.subtask;
        self.subtask = Box::new(JobPreview {
            subtask,
            look,
            passed: NO_JOB,
        });
        self
    }

    /// Has something done at each completion, after what the subtask itself prepared. As an
    /// effect it must be short: it keeps the platform from deciding anything meanwhile.
    pub fn on_completion(&mut self, act: Box<dyn FnMut() + Send>) {
        let effect: Box<dyn Effect> = Box::new(act);
        self.add_effects([effect]);
    }

    /// Keeps its signals from going anywhere.
    pub(crate) fn mute(&mut self) {
        self.effects
            .all()
            .iter_mut()
            .for_each(|effect| effect.mute());
    }

    /// Returns the word that a question of the latest turn has changed, if threads may sleep on it:
    /// once, for a platform that wakes them.
    ///
    /// See [`DeviceDriver::bell`](crate::shared::DeviceDriver::bell).
    #[must_use]
    pub fn bell(&mut self) -> Option<Arc<AtomicU32>> {
        self.effects
            .all()
            .iter_mut()
            .find_map(|effect| effect.bell())
    }

    /// Reports whether [`complete`](Self::complete) has anything to do, ever: a
    /// platform to which a clock is dear need not read it for the others.
    pub fn has_effects(&self) -> bool {
        self.has_effects
    }

    /// Takes a turn of job `job` without its function, in the place of [`run`](Self::run): the last
    /// one gives up its inputs, and those before it end in the stated waits, of no time.
    pub fn pass_over(&mut self, job: u64) {
        pass(&mut *self.subtask, job);
    }

    /// Gives up the inputs of job `job` that have arrived, instead of running it, and what it waits
    /// for.
    ///
    /// To be called for an instance that will not run, once no predecessor of
    /// it runs any more: a value that arrives later would stay in its slot.
    /// Calling it again, or for a job of which nothing arrived, does no harm.
    ///
    /// Takes a bounded time, little stack, and runs no code of the app, so that it
    /// may be called by a scheduler in mid-step: a value is not dropped here, but
    /// by the predecessor that next needs its slot, in [`run`](Self::run), or with
    /// the bodies.
    pub fn discard(&mut self, job: u64) {
        self.subtask.discard(job);
        // It was cancelled while it waited.
        if self.goes_on(job) {
            self.effects
                .all()
                .iter_mut()
                .for_each(|effect| effect.withdraw());
        }
    }

    /// Returns the replacement of the function after a fault; `None`: its faults end the DAG.
    ///
    /// See [`ReplacementCode`].
    pub fn replacement(&self) -> Option<ReplacementCode> {
        self.subtask.replacement()
    }

    /// Makes it go on with another function, where a fault has ended the present one: that is
    /// given up without a destructor, and the states that it used are reset. The next
    /// [`run`](Self::run) makes the other function, if it has to be made.
    ///
    /// To be called once for a fault, before anything else of the DAG starts that was not started
    /// then, and if the [`ReplacementCode`] is there. Takes a bounded time and runs no code of the
    /// app.
    pub fn replace(&mut self) {
        self.subtask.replace();
        self.job = NO_JOB;
    }

    /// Gives back the memory of a body that a fault has ended in mid-function, without
    /// unwinding: all but what the app's function owns.
    pub fn forget(self) {
        self.subtask.forget();
    }
}

impl core::fmt::Debug for SubtaskCode {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Body")
            .field("has_effects", &self.has_effects())
            .finish_non_exhaustive()
    }
}

/// The runner of one subtask's instances, one after another (R2): the
/// [body](engine::SubtaskBody) in a platform's `Engine`.
///
/// ```
/// use fass::platform::{Plan, SubtaskRunner};
///
/// /// A platform that runs the first job of all DAGs.
/// fn run_once(plan: Plan) {
///     for mut runner in SubtaskRunner::all(&plan.task_set, plan.bodies) {
///         runner.run();
///     }
/// }
/// ```
#[derive(Debug)]
pub struct SubtaskRunner {
    /// Its function, with its ends of the topics.
    pub body: SubtaskCode,
    /// The subtask.
    pub vertex: Vertex,
    /// The instance that it runs, or ran last.
    pub instance: Instance,
    /// The part of the subject of events that is the same for all.
    ids: u64,
}

impl SubtaskRunner {
    /// Makes one of each body of a plan, in the order of the vertices.
    pub fn all(task_set: &TaskSet, bodies: Vec<Vec<SubtaskCode>>) -> impl Iterator<Item = Self> {
        let of_dags = (0..).map(DagId).zip(bodies);
        of_dags.flat_map(move |(dag, of_dag)| {
            let of_subtasks = (0..).map(SubtaskId).zip(of_dag);
            of_subtasks.map(move |(subtask, body)| {
                let job = 0;
                let instance = Instance { dag, job, subtask };
                Self {
                    body,
                    vertex: task_set.vertex(instance),
                    instance,
                    ids: EventSubject::of(instance).ids,
                }
            })
        })
    }

    /// Calls the function for the instance. It panics where [`SubtaskCode::run`] does.
    #[inline]
    pub fn run(&mut self) {
        self.body.run(self.instance.job);
    }
}

impl engine::SubtaskBody for SubtaskRunner {
    type Alternate = ReplacementCode;

    #[inline]
    fn set_job(&mut self, job: u64) {
        self.instance.job = job;
    }

    #[inline]
    fn subject(&self) -> EventSubject {
        let (ids, job) = (self.ids, self.instance.job);
        EventSubject { ids, job }
    }

    fn discard(&mut self, job: u64) {
        self.body.discard(job);
    }

    fn wake(&mut self, has_timed_out: bool) {
        self.body.wake(has_timed_out);
    }

    #[inline]
    fn has_effects(&self) -> bool {
        self.body.has_effects()
    }

    #[inline]
    fn complete(&mut self, finish_ns: u64, ask: &mut dyn FnMut(Request)) -> Option<WaitLimit> {
        self.body.complete(finish_ns, ask)
    }

    fn alternate(&self) -> Option<ReplacementCode> {
        self.body.replacement()
    }

    fn replace(&mut self) {
        self.body.replace();
    }
}
