//! Changes of a run by functions: pausing DAGs, changing modes, and ending the run.
//!
//! A subtask has to declare such changes at registration, as for raising a signal. A request by its
//! function takes effect when the instance is complete (R3), not if the instance fails, and in
//! another cluster possibly later. In a replay no request touches a DAG with recorded inputs. The
//! rules L1 to L6 are in `sched-dag/src/lifecycle/mod.rs`.
//!
//! Modes are named sets of DAGs, of which one set runs at a time;
//! `sched-dag/src/lifecycle/modes.rs` has the rules, M1 to M7.

use alloc::boxed::Box;
use alloc::format;
use alloc::rc::Rc;
use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::cell::RefCell;
use core::fmt;
use core::sync::atomic::{AtomicU8, Ordering};

use sched_dag::lifecycle::LifecyclePlan;
use sched_dag::{DagId, ModeId};

use super::dag::Dag;
use super::signal::FaultSignal;
use super::uses::{Uses, implement_asking, sealed};
use crate::draft::DagDraft;
use crate::draft::fault::Fault;
use crate::draft::part::{
    self, CheckedDag, CommitCheck, DraftPart, Drafts, PartKind, Planner, dag_of,
};
use crate::run::effect::{AT_ONCE, GO, RequestKind, RequestTarget, STOP, WHEN_IDLE, Wish};
use crate::run::plan::Plan;

/// The declaration that a subtask may pause and resume a DAG: the function gets a [`Switch`]. Made
/// by [`Dag::switching`].
///
/// See [`Switch`].
#[derive(Debug)]
pub struct SwitchUse {
    target: Arc<RequestTarget>,
}

/// The handle with which a function pauses and resumes a DAG.
///
/// A paused DAG releases no job: jobs due meanwhile are skipped, and keep their numbers and, in a
/// periodic DAG, their places on the grid. In a sporadic DAG the jobs of signals are skipped. Jobs
/// in flight at the pause run to their end.
///
/// # Examples
///
/// A camera that rests while nothing moves:
///
/// ```
/// use core::time::Duration;
/// use fass::shared::Switch;
/// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
/// use virtual_time::VirtualTime;
///
/// let machine = VirtualTime::new();
/// let (ms, named) = (Duration::from_millis, SubtaskAttributes::named);
///
/// let camera = create_dag();
/// camera.name("camera").jobs(10).relative_deadline(ms(10));
/// camera.register_periodic_subtask(|| (), [], ms(10), named("look"));
///
/// let motion = create_dag(); // every 50 ms
/// motion.name("motion").jobs(2).relative_deadline(ms(50));
/// let mut moves = [false, true].into_iter();
/// let feel = move |mut camera: Switch<'_>| match moves.next() {
///     Some(true) => camera.resume(),
///     _ => camera.pause(), // takes effect when this instance is complete
/// };
/// motion
///     .period(ms(50))
///     .using(camera.switching())
///     .source(feel)
///     .register(named("feel"));
/// finish_create_dags(&[camera, motion]).unwrap();
///
/// let report = machine.run();
/// assert_eq!(report.violations(), []);
/// assert_eq!(report.dag("camera").statistics().released, 5); // at 0, and from 60 ms on
/// assert_eq!(report.dag("camera").statistics().skips, 5);
/// ```
#[derive(Debug)]
pub struct Switch<'a> {
    wish: &'a AtomicU8,
}

impl Switch<'_> {
    /// Pauses the DAG when this instance is complete. The call replaces an earlier request of the
    /// same instance to resume.
    pub fn pause(&mut self) {
        self.wish.store(STOP, Ordering::Relaxed);
    }

    /// Resumes the DAG when this instance is complete. The call replaces an earlier request of the
    /// same instance to pause.
    pub fn resume(&mut self) {
        self.wish.store(GO, Ordering::Relaxed);
    }
}

/// The declaration that a subtask may end the run: the function gets a [`Shutdown`]. Made by
/// [`shutting_down`].
///
/// See [`Shutdown`].
#[derive(Debug)]
pub struct ShutdownUse(());

/// The handle with which a function ends the run in an orderly way: no further job is released, and
/// jobs in flight run to their end.
///
/// # Examples
///
/// A robot that runs until its arrival:
///
/// ```
/// use core::time::Duration;
/// use fass::shared::{Shutdown, shutting_down};
/// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
/// use virtual_time::VirtualTime;
///
/// let machine = VirtualTime::new();
/// let drive = create_dag(); // without a last job
/// drive.name("drive");
/// let period = Duration::from_millis(10);
/// let mut distance = 5;
/// let step = move || {
///     distance -= 1;
///     (distance,)
/// };
/// let named = SubtaskAttributes::named;
/// drive.register_periodic_subtask(step, ["distance"], period, named("step"));
/// drive
///     .using(shutting_down())
///     .subtask(|mut shutdown: Shutdown<'_>, (distance,): (i32,)| {
///         if distance == 0 {
///             shutdown.request(); // takes effect when this instance is complete
///         }
///     })
///     .reads(&["distance"])
///     .due(period)
///     .register(named("arrive"));
/// finish_create_dags(&[drive]).unwrap();
/// assert_eq!(machine.run().dag("drive").statistics().completed, 5);
/// ```
#[derive(Debug)]
pub struct Shutdown<'a> {
    wish: &'a AtomicU8,
}

impl Shutdown<'_> {
    /// Ends the run when this instance is complete. The function cannot withdraw the request; only
    /// a failure of the instance makes it void.
    pub fn request(&mut self) {
        self.wish.store(STOP, Ordering::Relaxed);
    }
}

/// Returns the declaration that a subtask may end the run, for [`Dag::using`].
///
/// See [`Shutdown`].
#[must_use = "a use has no effect until a subtask is registered with it"]
pub const fn shutting_down() -> ShutdownUse {
    ShutdownUse(())
}

impl Dag {
    /// Returns the declaration that a subtask, of any DAG, may pause and resume this DAG, for
    /// [`using`](Self::using).
    ///
    /// The commit must have this DAG, too. See [`Switch`].
    #[track_caller]
    #[must_use = "a use has no effect until a subtask is registered with it"]
    pub fn switching(&self) -> SwitchUse {
        let draft = self.open();
        SwitchUse {
            target: Arc::clone(&draft.target),
        }
    }

    /// Starts the DAG in the paused state; it stays paused until a [`Switch`], or a person at the
    /// console, resumes it.
    ///
    /// ```
    /// use core::time::Duration;
    /// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
    ///
    /// let machine = virtual_time::VirtualTime::new();
    /// let (dag, period) = (create_dag(), Duration::from_millis(10));
    /// dag.jobs(3).period(period).relative_deadline(period).starts_paused();
    /// dag.register_untyped_subtask(|_job| (), SubtaskAttributes::named("tick"));
    /// finish_create_dags(&[dag.clone()]).unwrap();
    /// assert_eq!(machine.run().dag(&dag).statistics().skips, 3);
    /// ```
    #[track_caller]
    pub fn starts_paused(&self) -> &Self {
        let mut draft = self.open();
        draft.add(PartKind::Lifecycle, Paused);
        draft.add(PartKind::Lifecycle, plan_lifecycle as Planner);
        drop(draft);
        self
    }
}

/// Adds the code serving lifecycle requests to the plan. Only the declarations in this file refer
/// to the code, so an app that makes none of them does not contain it.
fn plan_lifecycle(drafts: &Drafts, plan: &mut Plan) {
    let dags = || (0..).map(DagId).zip(drafts);
    let paused = dags().filter(|(_, draft)| draft.borrow().has::<Paused>());
    let paused: Vec<DagId> = paused.map(|(dag, _)| dag).collect();
    let may_shut_down = dags().any(|(_, draft)| draft.borrow().has::<ShutdownUse>());
    let count = u32::try_from(drafts.len()).unwrap_or(u32::MAX);
    let changes = LifecyclePlan::new(count, may_shut_down).with_paused(paused);
    plan.lifecycle = Some(Box::new(changes.with_modes(dags_of_modes(drafts))));
}

/// Marks a DAG as paused at the start.
struct Paused;

impl DraftPart for Paused {}

/// A subtask may end the run.
impl DraftPart for ShutdownUse {}

implement_asking!(SwitchUse, Switch, |switching, draft, subtask| {
    let target = Arc::clone(&switching.target);
    draft.add(PartKind::Switch, move |of: &CheckedDag<'_>| {
        let says = "may pause a dag that is not in the commit; commit both dags in one call";
        let is_unknown = dag_of(of.drafts, &target).is_none();
        is_unknown.then(|| of.fault("switched_not_committed", subtask, says))
    });
    ask(draft, subtask, RequestKind::Dag(switching.target))
});

implement_asking!(ShutdownUse, Shutdown, |stated, draft, subtask| {
    draft.add(PartKind::Lifecycle, stated);
    ask(draft, subtask, RequestKind::Run)
});

/// Records that completions of a subtask may request a lifecycle change.
fn ask(draft: &mut DagDraft, subtask: usize, of: RequestKind) -> Wish {
    draft.add(PartKind::Lifecycle, plan_lifecycle as Planner);
    draft.ask(subtask, of)
}

/// The modes of a run: sets of DAGs, of which one runs at a time.
///
/// A DAG may be in several modes, and is paused in all modes without it; a DAG in no mode runs in
/// every mode. Where the cores are divided, all DAGs in modes are in one cluster. A run begins in
/// the mode made first. Functions enter modes through their completions. Clones are handles of the
/// same modes.
///
/// # Examples
///
/// A drone that flies, and then lands:
///
/// ```
/// use core::time::Duration;
/// use fass::shared::{ModeSwitch, Modes};
/// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
/// use virtual_time::VirtualTime;
///
/// let machine = VirtualTime::new();
/// let ms = Duration::from_millis;
/// let ticking = |name: &str| {
///     let dag = create_dag();
///     dag.name(name).jobs(6).period(ms(10)).relative_deadline(ms(10));
///     dag.register_untyped_subtask(|_job| (), SubtaskAttributes::named("step"));
///     dag
/// };
/// let (cruise, descend) = (ticking("cruise"), ticking("descend"));
/// let modes = Modes::new();
/// modes.mode("flight", &[&cruise]);
/// let landing = modes.mode("landing", &[&descend]);
///
/// let battery = create_dag(); // in no mode, so it runs in both
/// battery.name("battery").jobs(3).relative_deadline(ms(25));
/// let mut charge = 3;
/// let watch = move |mut landing: ModeSwitch<'_>| {
///     charge -= 1;
///     if charge == 1 {
///         landing.when_idle(); // asked for when this instance is complete
///     }
/// };
/// battery
///     .period(ms(25))
///     .using(landing.entering())
///     .source(watch)
///     .register(SubtaskAttributes::named("watch"));
///
/// finish_create_dags(&[cruise, descend, battery]).unwrap();
/// let report = machine.run();
/// assert_eq!(report.violations(), []);
/// assert_eq!(report.dag("cruise").statistics().released, 3); // at 0, 10 and 20 ms
/// assert_eq!(report.dag("descend").statistics().released, 3); // at 30, 40 and 50 ms
/// ```
#[derive(Clone, Default)]
pub struct Modes {
    modes: ModeSet,
}

/// A mode: a named set of DAGs running together. Clones are handles of the same mode. Made by
/// [`Modes::mode`].
///
/// See [`Modes`].
#[derive(Clone)]
pub struct Mode {
    modes: ModeSet,
    number: ModeId,
}

/// The declaration that a subtask may enter a mode: the function gets a [`ModeSwitch`]. Made by
/// [`Mode::entering`].
///
/// See [`Modes`].
#[derive(Debug)]
pub struct ModeUse(Mode);

/// The handle with which a function enters a mode.
///
/// See [`Modes`].
#[derive(Debug)]
pub struct ModeSwitch<'a> {
    wish: &'a AtomicU8,
}

impl ModeSwitch<'_> {
    /// Enters the mode when this instance is complete. Jobs of the old mode still in flight run to
    /// their end next to jobs of the new mode.
    ///
    /// See [`Modes`].
    pub fn at_once(&mut self) {
        self.wish.store(AT_ONCE, Ordering::Relaxed);
    }

    /// Requests the mode when this instance is complete. From then on the DAGs paused by the new
    /// mode release nothing, and the mode is entered when none of them has a job in flight, unless
    /// a later request for a mode replaces this request.
    ///
    /// See [`Modes`].
    pub fn when_idle(&mut self) {
        self.wish.store(WHEN_IDLE, Ordering::Relaxed);
    }
}

impl Modes {
    /// Makes a handle without modes. All modes of a commit belong to one handle.
    pub fn new() -> Self {
        Self::default()
    }

    /// Makes a mode in which the given DAGs run, and no other DAGs that are in some mode. The run
    /// begins in the mode made first.
    ///
    /// # Panics
    ///
    /// If one of the DAGs is committed.
    #[track_caller]
    pub fn mode(&self, name: &str, dags: &[&Dag]) -> Mode {
        let mut named = Vec::with_capacity(dags.len());
        for dag in dags {
            let mut draft = dag.open();
            state(&mut draft, &self.modes);
            draft.add(PartKind::Lifecycle, plan_lifecycle as Planner);
            named.push((Arc::clone(&draft.target), draft.spec.name.clone()));
        }
        let mut modes = self.modes.borrow_mut();
        let number = ModeId(u32::try_from(modes.len()).unwrap_or(u32::MAX));
        modes.push(ModeDraft {
            name: name.into(),
            dags: named,
        });
        Mode {
            modes: Rc::clone(&self.modes),
            number,
        }
    }
}

impl Mode {
    /// Returns the declaration that a subtask, of any DAG, may enter the mode, for [`Dag::using`].
    ///
    /// See [`Modes`].
    #[must_use = "a use has no effect until a subtask is registered with it"]
    pub fn entering(&self) -> ModeUse {
        ModeUse(self.clone())
    }
}

implement_asking!(ModeUse, ModeSwitch, |entering, draft, subtask| {
    state(draft, &entering.0.modes);
    ask(draft, subtask, RequestKind::Mode(entering.0.number))
});

/// A mode as declared so far.
struct ModeDraft {
    name: String,
    /// The DAGs, with the names they had when the mode was made.
    dags: Vec<(Arc<RequestTarget>, String)>,
}

/// The modes of one handle.
type ModeSet = Rc<RefCell<Vec<ModeDraft>>>;

impl DraftPart for ModeSet {}

/// Records that a DAG is in modes, or has a subtask that may enter one.
fn state(draft: &mut DagDraft, modes: &ModeSet) {
    draft.add(PartKind::Modes, Rc::clone(modes));
    draft.add(PartKind::Modes, check_modes as CommitCheck);
}

/// Returns the DAGs of each mode of a commit.
pub(crate) fn dags_of_modes(drafts: &Drafts) -> Vec<Vec<DagId>> {
    let found = of_commit(drafts);
    let modes = found.first().map(|modes| modes.borrow());
    let id = |(dag, _): &(_, _)| dag_of(drafts, dag);
    let dags = |mode: &ModeDraft| mode.dags.iter().filter_map(id).collect();
    modes.map_or(Vec::new(), |modes| modes.iter().map(dags).collect())
}

/// Adds all faults of the modes of a commit.
fn check_modes(drafts: &Drafts, faults: &mut Vec<Fault>) {
    let mut add = |code, text| faults.push(Fault::Worded { code, text });
    let found = of_commit(drafts);
    // Two sets of modes would switch the same DAGs without knowing of each other.
    if found.len() > 1 {
        let text = "the commit has modes of more than one `Modes`; make all of them by one";
        add("several_sets_of_modes", text.into());
    }
    for modes in &found {
        let modes = modes.borrow();
        for (number, mode) in modes.iter().enumerate() {
            let name = &mode.name;
            if modes[..number].iter().any(|other| other.name == *name) {
                let text = format!("two modes are called `{name}`; give each a name of its own");
                add("duplicate_mode", text);
            }
            let unknown = (mode.dags.iter()).filter(|(dag, _)| dag_of(drafts, dag).is_none());
            for (_, dag) in unknown {
                let text = format!(
                    "mode `{name}` has dag `{dag}`, which is not in the commit; commit all dags of \
                     its modes in one call"
                );
                add("mode_not_committed", text);
            }
        }
    }
    let modes = dags_of_modes(drafts);
    let in_some = |dag: DagId| modes.iter().any(|mode| mode.contains(&dag));
    for dag in (0..).map(DagId).take(drafts.len()) {
        let draft = drafts[dag.index()].borrow();
        if draft.has::<Paused>() && in_some(dag) {
            let text = format!(
                "{} starts paused and is in a mode, and the first mode says what is paused at the \
                 start; drop `starts_paused`",
                part::label(drafts, dag)
            );
            add("mode_starts_paused", text);
        }
        // The handler brings about a safe state, so it has to be on in every mode in which the DAG
        // runs whose faults it handles.
        let handler = draft.all().next();
        let handler = handler.and_then(|FaultSignal(target)| dag_of(drafts, target));
        // No mode ever pauses a handler outside all modes.
        let Some(handler) = handler.filter(|&handler| in_some(handler)) else {
            continue;
        };
        let lacks =
            |mode: &Vec<DagId>| (mode.contains(&dag) || !in_some(dag)) && !mode.contains(&handler);
        if let Some(number) = modes.iter().position(lacks) {
            let text = format!(
                "a fault of {} releases {}, which is off in mode `{}`; add it to that mode, or to \
                 none",
                part::label(drafts, dag),
                part::label(drafts, handler),
                found[0].borrow()[number].name
            );
            add("mode_without_handler", text);
        }
    }
}

/// Returns the modes named in a commit, each handle once.
fn of_commit(drafts: &Drafts) -> Vec<ModeSet> {
    let mut found: Vec<ModeSet> = Vec::new();
    for draft in drafts {
        for modes in draft.borrow().all() {
            // Each set once, however many DAGs name it.
            if !found.iter().any(|other| Rc::ptr_eq(other, modes)) {
                found.push(Rc::clone(modes));
            }
        }
    }
    found
}

impl fmt::Debug for Modes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let modes = self.modes.borrow();
        f.debug_set()
            .entries(modes.iter().map(|mode| &mode.name))
            .finish()
    }
}

shown_as!(Mode, |of| of.number.0);
