//! Plans, handed by a commit to the platform: the verified model and the bodies.
//!
//! The platform's scheduler decides *which* instance runs *where* and *when*, and then calls
//! [`SubtaskCode::run`] there. A body never decides anything.

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
/// A platform receives it in [`Platform::launch`](crate::platform::Platform::launch) and finds a
/// subtask's body by its ids:
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
    /// The plan's number, never 0 and different from that of every other plan of the program.
    /// Signals identify their plan by it ([`Platform::raise`](crate::platform::Platform::raise)).
    pub number: u64,
    /// The subtasks' bodies: `bodies[dag][subtask]`, in the order of the model.
    pub bodies: Vec<Vec<SubtaskCode>>,
    /// The response-time bounds proven by the commit
    /// ([`Commit::answers`](crate::commit::Commit::answers)).
    pub proven: ProvenBounds,
    /// The answers of the commit, for platforms keeping a record of the run.
    pub(crate) answers: Box<dyn CommitWords>,
    /// For each DAG, the DAG to be released by a signal when a fault ends the former
    /// ([`Dag::on_fault`](crate::Dag::on_fault)). The signal comes right after the fault, in the
    /// same step of the scheduler, or to another cluster as a letter.
    pub after_fault: Vec<Option<DagId>>,
    /// The server of requests other than signals, if a function may make one or a DAG begins
    /// paused. A platform without support for such requests refuses the plan.
    pub lifecycle: Option<Box<dyn Lifecycle>>,
    /// The samples of latest values ([`Commit::staleness`](crate::commit::Commit::staleness)), for
    /// platforms displaying the values passed between DAGs.
    pub staleness: Arc<Vec<Staleness>>,
    /// The paths of recorded values, indexed by channel.
    pub(crate) lines: Vec<LineOf>,
    /// The states restored before a replay, each with its bytes and the complaint if it cannot take
    /// them.
    pub(crate) begins: Vec<(Arc<KeptState>, Vec<u8>, String)>,
}

/// The answers of a commit, put into words on demand.
pub(crate) trait CommitWords: Send + Sync {
    /// Says for each DAG which test has proven a bound, or why none has.
    fn in_words(&self) -> Vec<String>;
}

/// Only the name: an image has no room for the text of whole answers.
impl fmt::Debug for dyn CommitWords {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("CommitWords")
    }
}

impl Plan {
    /// Sets each state to the recorded value with which a replay begins.
    ///
    /// A replaying platform calls this in its launch, where it holds no lock: reading a value and
    /// dropping the previous one run the app's code.
    ///
    /// # Errors
    ///
    /// Returns a message if a state cannot take the recorded value.
    pub fn restore(&mut self) -> Result<(), String> {
        for (kept, value, complaint) in self.begins.drain(..) {
            if !call_app(|| kept.state.restore(&value)) {
                return Err(complaint);
            }
        }
        Ok(())
    }

    /// Has recorded states written down at least twice in each span of `jobs` jobs, for a platform
    /// keeping only the values that enter the latest jobs.
    ///
    /// See [`LatestJobs`](crate::edge::LatestJobs).
    pub fn keep_states_of(&self, jobs: u32) {
        let states = self.lines.iter().filter_map(|of| of.state.as_ref());
        states.for_each(|state| state.keep_every(jobs / 2));
    }
}

/// The executable part of a subtask: the function with the subtask's ends of the topics.
///
/// A body may move between threads or processors from call to call; `&mut self` makes each call's
/// effects visible to the next call.
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
    /// The job in execution, or the job of a panic; otherwise [`NO_JOB`].
    job: u64,
    /// Effects of its completions beyond the DAG.
    effects: Effects,
    /// Whether there are any: asked where each instruction counts.
    has_effects: bool,
}

/// The effects of completions. Most subtasks have none or one, and a loop would take longer than
/// the effect. Comparing an explicit tag is short.
#[derive(Default)]
#[repr(u8)]
enum Effects {
    #[default]
    None,
    One(Box<dyn Effect>),
    Several(Vec<Box<dyn Effect>>),
    /// The effects of a waiting subtask, due when its instance has finished.
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

/// Stands for "no job": no run gets that far.
const NO_JOB: u64 = u64::MAX;

/// A subtask, as driven by the subtask's body.
pub(crate) trait PolledSubtask: Send {
    /// Grants a job, and takes its turn to the end.
    fn take_turn(&mut self, job: u64);

    /// Gives up the inputs of a job that the subtask will not run.
    fn discard(&mut self, job: u64);

    /// Returns the function to continue with, should a fault end the present function.
    fn replacement(&self) -> Option<ReplacementCode> {
        None
    }

    /// Gives up the function, and the states it uses: another one takes the next turn.
    fn replace(&mut self) {}

    /// Returns the state of the subtask's turns, if the subtask may wait.
    fn turn(&self) -> Option<&Arc<TurnState>> {
        None
    }

    /// Frees the subtask's memory after a fault, except the values owned by the app's function:
    /// none of their destructors can be called.
    fn forget(self: Box<Self>);
}

/// A subtask whose jobs are inspected before their first turn.
struct JobPreview<F> {
    subtask: Box<dyn PolledSubtask>,
    look: F,
    /// The job given up last.
    passed: u64,
}

impl<F: FnMut(u64) -> bool + Send> PolledSubtask for JobPreview<F> {
    fn take_turn(&mut self, job: u64) {
        // Once for each job, in the first turn of its instance: the look decides about the whole
        // job, and a job given up at its first turn must be passed over at its later turns, too.
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

/// Takes a turn of a job without calling the function.
fn pass(subtask: &mut dyn PolledSubtask, job: u64) {
    if subtask.turn().is_none_or(|turn| turn.pass(job)) {
        subtask.discard(job);
    }
}

/// The functions to replace one ended by a fault. They can be asked for at any time, also while the
/// body runs.
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

/// A replacement is there while it may be made, unless values are just being handed over.
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
            // A wait is asked for by `complete`, so a subtask with waits needs that call, too.
            has_effects: subtask.turn().is_some(),
            subtask,
            job: NO_JOB,
        }
    }

    /// Adds effects to each completion, beyond the DAG.
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
                    // By the address a device refuses questions in the turn of another subtask.
                    effect.bind(turn.address());
                    all.push(effect);
                    Effects::OfTurns(turn, all)
                }
            };
        }
    }

    /// Returns the state of the subtask's turns, if the subtask may wait.
    fn turn(&self) -> Option<&Arc<TurnState>> {
        self.subtask.turn()
    }

    /// Reports whether instances of the subtask may wait.
    pub fn may_wait(&self) -> bool {
        self.turn().is_some()
    }

    /// Reports whether the job's instance has begun and not finished: it has a further turn.
    pub fn goes_on(&self, job: u64) -> bool {
        self.turn().is_some_and(|turn| turn.is_of(job))
    }

    /// Notes, before the next turn, how the instance's wait has ended.
    pub fn wake(&mut self, has_timed_out: bool) {
        if let Some(turn) = self.turn() {
            turn.wake(has_timed_out);
        }
    }

    /// Runs the subtask's part of job `job` to the end, or to the next wait.
    ///
    /// Returns once the function has returned and its outputs are in their slots, or when
    /// [`complete`](Self::complete) will ask for a wait. Polls the subtask's future exactly once.
    /// Does not allocate (the function itself may).
    ///
    /// The caller then calls [`complete`](Self::complete), reports the completion to the scheduler,
    /// and starts the successors only afterwards.
    ///
    /// # Panics
    ///
    /// - If the function panics. The body cannot be run again, unless it is
    ///   [replaced](Self::replace).
    /// - If the body panicked before, and was not replaced.
    /// - If an input of `job` is missing, because a predecessor is not complete.
    /// - If an output finds no free slot, because the inputs of a cancelled instance were not
    ///   [discarded](Self::discard).
    pub fn run(&mut self, job: u64) {
        // After a panic the job stays set, and the future must not be polled again.
        assert!(
            self.job == NO_JOB,
            "the subtask panicked in job {} and cannot continue",
            self.job
        );
        self.job = job;
        call_app(|| self.subtask.take_turn(job));
        self.job = NO_JOB;
    }

    /// Publishes the effects prepared outside the DAG by the last [`run`](Self::run): shows latest
    /// values, and calls `ask` with each signal and each other request. For an unfinished instance,
    /// returns instead how long it waits.
    ///
    /// The platform calls this once it regards the instance as complete, at `completed_ns` on the
    /// clock of [`crate::now_ns`], but not for a failed instance. It passes the requests to the
    /// scheduler with the completion (`sched_dag::lifecycle` explains their use). Does not wait,
    /// allocate or run code of the app; without such effects it returns at once.
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

    /// Ends a turn of a subtask with several effects, or with waits. A separate function, so the
    /// path of a single effect saves no registers for a loop.
    #[inline(never)]
    fn end_turn(&mut self, completed_ns: u64, ask: &mut dyn FnMut(Request)) -> Option<WaitLimit> {
        if let Effects::OfTurns(turn, all) = &mut self.effects
            && let Some((limit, limit_ns)) = turn.take_wait()
        {
            // All effects are asked, without a stop at the first: each may have something to post
            // when a wait begins.
            let mut is_there = false;
            for effect in all {
                is_there |= effect.wait((completed_ns, limit_ns), ask);
            }
            // A wait even if the awaited value is there: the instance gives its core up in any
            // case.
            return Some(if is_there { WaitLimit::For(0) } else { limit });
        }
        let all = self.effects.all().iter_mut();
        all.for_each(|effect| effect.happen(completed_ns, ask));
        None
    }

    /// Gives the platform the samples, answers and states found by a failed instance, if they are
    /// recorded: without them, nobody could reproduce the fault.
    pub fn failed(&mut self, failed_ns: u64) {
        let all = self.effects.all().iter_mut();
        all.for_each(|effect| effect.fail(failed_ns));
    }

    /// Calls `look` for each job before its first turn, and gives the job up if `look` returns
    /// false.
    pub(crate) fn before(mut self, look: impl FnMut(u64) -> bool + Send + 'static) -> Self {
        let subtask = self.subtask;
        self.subtask = Box::new(JobPreview {
            subtask,
            look,
            passed: NO_JOB,
        });
        self
    }

    /// Calls `act` at each completion, after the effects of the subtask itself. Like every effect
    /// it must be short: the platform cannot decide anything meanwhile.
    pub fn on_completion(&mut self, act: Box<dyn FnMut() + Send>) {
        let effect: Box<dyn Effect> = Box::new(act);
        self.add_effects([effect]);
    }

    /// Discards its signals from now on.
    pub(crate) fn mute(&mut self) {
        self.effects
            .all()
            .iter_mut()
            .for_each(|effect| effect.mute());
    }

    /// Returns the word changed by a question of the latest turn, if threads may sleep on it: once,
    /// for a platform to wake them.
    ///
    /// See [`DeviceDriver::bell`](crate::shared::DeviceDriver::bell).
    #[must_use]
    pub fn bell(&mut self) -> Option<Arc<AtomicU32>> {
        self.effects
            .all()
            .iter_mut()
            .find_map(|effect| effect.bell())
    }

    /// Reports whether [`complete`](Self::complete) ever has anything to do: if not, a platform
    /// with an expensive clock need not read it.
    pub fn has_effects(&self) -> bool {
        self.has_effects
    }

    /// Takes a turn of job `job` without its function, in place of [`run`](Self::run). The last
    /// turn gives up the inputs; each earlier one ends in the stated wait, of no time.
    pub fn pass_over(&mut self, job: u64) {
        pass(&mut *self.subtask, job);
    }

    /// Gives up the arrived inputs of job `job`, and its wait, instead of running the job.
    ///
    /// To be called for an instance that will not run, once none of its predecessors runs any more:
    /// a value arriving later would stay in its slot. Calling it again, or for a job without
    /// arrived inputs, does no harm.
    ///
    /// Takes a bounded time and little stack, and runs no code of the app, so a scheduler may call
    /// it in mid-step: a value is not dropped here, but by the predecessor that next needs its
    /// slot, in [`run`](Self::run), or with the bodies.
    pub fn discard(&mut self, job: u64) {
        self.subtask.discard(job);
        // The instance was cancelled while waiting, so a device may still hold its question.
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

    /// Continues with another function after a fault has ended the present one. The present
    /// function is given up without a destructor, and its states are reset. The next
    /// [`run`](Self::run) makes the new function, if necessary.
    ///
    /// To be called once for each fault, if the [`ReplacementCode`] is there, and before the DAG
    /// starts anything not yet started at the fault. Takes a bounded time and runs no code of the
    /// app.
    pub fn replace(&mut self) {
        self.subtask.replace();
        // The fault has left the failed job here, and `run` would refuse the next one.
        self.job = NO_JOB;
    }

    /// Frees the memory of a body ended by a fault in mid-function, without unwinding: all but what
    /// the app's function owns.
    pub fn forget(self) {
        self.subtask.forget();
    }
}

impl core::fmt::Debug for SubtaskCode {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("SubtaskCode")
            .field("has_effects", &self.has_effects())
            .finish_non_exhaustive()
    }
}

/// The runner of a subtask's instances, strictly in sequence (R2): the [body](engine::SubtaskBody)
/// in a platform's `Engine`.
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
    /// The subtask's function, with its ends of the topics.
    pub body: SubtaskCode,
    /// The subtask.
    pub vertex: Vertex,
    /// The instance in execution, or the last one.
    pub instance: Instance,
    /// The part of an event's subject shared by all instances.
    ids: u64,
}

impl SubtaskRunner {
    /// Makes a runner for each body of a plan, in the order of the vertices.
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
