//! Requests of functions to a run as a whole, and how it comes about.
//!
//! A function may ask for more than values: that a sporadic DAG gets a signal, that a DAG rests
//! or goes on, that another set of DAGs runs (M1 to M7, below), that the run ends. As all that a
//! function does, a *request* takes effect with the completion of its instance (R3), never before.
//! The rules, whose scenarios in `tests/scenarios/lifecycle.txt` bear their numbers:
//!
//! - **L1, when.** A request takes effect at the instant of the completion, after all completions
//!   and faults of that instant and before its releases. An instance that fails has asked for
//!   nothing.
//! - **L2, in which order.** Requests of one instant are served in the order of their
//!   completions, those of one instance in the order in which its subtask states what it uses, each
//!   once.
//! - **L3, pausing.** A DAG that is paused or resumed follows P1 to P5: what is in flight goes
//!   on, due jobs are skipped, the grid stays. A DAG may pause itself: the job in hand goes on.
//! - **L4, the beginning.** A DAG may be paused from time 0 on, before its first release.
//! - **L5, the end.** A shutdown closes every DAG (C1 to C5) at one instant, so the run is over
//!   when nothing is in flight any more. Of what is asked for later nothing comes.
//! - **L6, replays.** What came of a request to a DAG whose inputs are recorded is in the
//!   recording: the jobs that were skipped. In a replay requests do not touch such a DAG.
//!
//! Where clusters have no instant in common, requests cross them as [`Mailboxes`].
//!
//! A driver has [`PendingRequests`], which keeps them from a completion to the scheduler's step, and
//! the plan's [`Lifecycle`], which serves all but signals. It is behind a trait so that an
//! image none of whose functions asks for such a thing has no code for it.
//!
//! # Modes: sets of DAGs, one of which runs
//!
//! A *mode* is a set of DAGs that run together, such as those of a flight, or of a landing. A
//! DAG that is in some mode is *on* in its modes and off, that is paused, in the others; a
//! DAG that is in none runs in all. The rules, whose scenarios in `tests/scenarios/modes.txt` bear
//! their numbers (M7 has its test in `tests/it/modes.rs`):
//!
//! - **M1, what is on.** A run begins in mode 0. When a mode is entered, its DAGs are resumed, and
//!   the others that are in some mode are paused (P1 to P5). DAGs that are on in the old
//!   mode and in the new one notice nothing.
//! - **M2, at once.** The mode is entered at the instant of the request. Jobs in flight of the
//!   DAGs that leave go on to their ends, next to the jobs of those that join.
//! - **M3, when idle.** The DAGs that leave are paused at the request. The mode is entered at the
//!   first instant at which no job of them is in flight: after the completions of that
//!   instant, before its releases; at the request itself, if none is then. Until then the DAGs that
//!   join stay paused.
//! - **M4, the last one counts.** A request takes the place of one that has not come about, in
//!   whichever way it asks to be entered. The mode that is there may be asked for, too.
//! - **M5, what a person does.** A DAG that was paused or resumed at the console stays so until a
//!   mode is entered.
//! - **M6, those that are gone.** An ended DAG stays so; it keeps no mode waiting but by what is in
//!   flight. After a shutdown no mode is entered.
//! - **M7, replays.** A DAG whose inputs are recorded is neither paused nor resumed, and none waits
//!   for it (L6).
//!
//! A change costs a pause or a resumption of each DAG that is in some mode, in one step of the
//! scheduler; one that waits costs a look at the DAGs that leave in each step until then.
//!
//! # Requests to other clusters, and from outside of all, on their way
//!
//! Each cluster serves the requests that concern its DAGs, with its own part of what the app has
//! stated. A request of a completion goes where it concerns something: a signal, a pause and a
//! resumption to the cluster of the DAG, a mode to that of the modes' DAGs, which are all in one,
//! and
//! a shutdown to all. To another cluster it is a *letter*, which counts in the step in which that
//! takes it, before its releases. Leaving one never waits, and the room is taken at commit:
//!
//! - Signals are counted, so each is one.
//! - Of a pause and a resumption of one DAG that wait, the later one counts, and so it is of modes;
//!   an end counts more than a closing.
//! - Of two answers to waits of one subtask the one to the later wait counts.
//! - What is taken in one step is served in this order: the mode; DAG by DAG its pause or
//!   resumption, its signals, its end; the end of the run. One sender's letters that it leaves in
//!   this order are served in it, also if they are taken in two steps. Of others the order is open.

use alloc::boxed::Box;
use alloc::vec::Vec;
use core::fmt;
use core::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};

use crate::ids::{ClusterId, DagId, Instance, ModeId, SubtaskId};
use crate::order::sorted;
use crate::scheduler::Moment;
use crate::task_set::{Dag, TaskSet};

pub use crate::request::{ModeEntry, Request, WaitId, WaitLimit};

/// The change that a request makes in a scheduler.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LifecycleChange {
    /// A DAG is paused (P1 to P5).
    Pause(DagId),
    /// A DAG's pause ends.
    Resume(DagId),
    /// A DAG is closed (C1 to C5).
    Close(DagId),
    /// If the DAG has a job in flight, the changes that follow do not come about: in the next step
    /// the driver asks for [`Request::GoOn`].
    Await(DagId),
    /// A mode is entered, and nothing waits any more.
    Enter(ModeId),
}

/// Serves requests other than signals.
pub trait Lifecycle: fmt::Debug + Send {
    /// Says what a request comes to. There is [`room`](Self::room) for the changes.
    fn serve(&mut self, request: Request, changes: &mut Vec<LifecycleChange>);

    /// Leaves a DAG alone from now on (L6).
    fn leave_alone(&mut self, dag: DagId);

    /// Returns the DAGs that are in some mode.
    fn dags_of_modes(&self) -> Vec<DagId>;

    /// Returns the lifecycle of one cluster, which serves requests about its DAGs, before the run;
    /// the
    /// modes are left to one cluster.
    fn part(&self, is_here: &dyn Fn(DagId) -> bool, has_modes: bool) -> Box<dyn Lifecycle>;

    /// Reports whether a function may ask for the end of the run.
    fn may_shut_down(&self) -> bool;

    /// Returns how many different requests there can be, signals not counted, and how many changes
    /// one comes to at most.
    fn room(&self) -> (usize, usize);
}

/// The requests of a run that are on their way to its scheduler.
#[derive(Debug)]
pub struct PendingRequests {
    /// Each once; there is room for all.
    kept: Vec<Request>,
    lifecycle: Option<Box<dyn Lifecycle>>,
    changes: Vec<LifecycleChange>,
}

impl PendingRequests {
    /// Takes room for the requests of a plan of so many DAGs.
    pub fn new(dags: usize, lifecycle: Option<Box<dyn Lifecycle>>) -> Self {
        let room = lifecycle.as_ref().map(|lifecycle| lifecycle.room());
        let (others, changes) = room.unwrap_or_default();
        let mut kept = Vec::with_capacity(dags.saturating_add(others).saturating_add(1));
        // So that what is paused at first is paused in the very first step, before any release.
        kept.extend(lifecycle.as_ref().map(|_| Request::Begin));
        Self {
            kept,
            lifecycle,
            changes: Vec::with_capacity(changes),
        }
    }

    /// Keeps a request until the next step: that of a function, which answers no wait but by a
    /// letter.
    pub fn keep(&mut self, request: Request) {
        // Once is enough, and so the room is bounded: one place for each different request.
        if !self.kept.contains(&request) {
            self.kept.push(request);
        }
    }

    /// Reports whether none is on its way: then a completion may be all of a step.
    #[inline]
    pub const fn are_none(&self) -> bool {
        self.kept.is_empty()
    }

    /// Gives away the requests that `take` takes, which concern other schedulers only.
    pub fn give_away(&mut self, mut take: impl FnMut(Request) -> bool) {
        self.kept.retain(|&request| !take(request));
    }

    /// Takes what has come from other clusters and from outside. A letter that concerns one DAG
    /// only, and no [`Lifecycle`], is passed on at once.
    #[inline(always)]
    pub fn take_letters(
        &mut self,
        letters: &Mailboxes,
        cluster: ClusterId,
        moment: &mut Moment<'_>,
    ) {
        letters.take_all(cluster, |request| {
            // Of a person's pause, say, the lifecycle has to know; a signal is the scheduler's
            // alone. It finds the DAG as the letters before it have left it.
            if self.lifecycle.is_some() && request.is_of_lifecycle() {
                self.keep(request);
                self.serve(moment);
            } else {
                moment.serve(request);
            }
        });
    }

    /// Passes the requests on, after the completions of the instant.
    pub fn serve(&mut self, moment: &mut Moment<'_>) {
        let mut waits = false;
        for request in self.kept.drain(..) {
            match &mut self.lifecycle {
                Some(lifecycle) if request.is_of_lifecycle() => {
                    lifecycle.serve(request, &mut self.changes);
                }
                _ => moment.serve(request),
            }
            for change in self.changes.drain(..) {
                match change {
                    LifecycleChange::Pause(dag) => moment.serve(Request::Pause(dag)),
                    LifecycleChange::Resume(dag) => moment.serve(Request::Resume(dag)),
                    LifecycleChange::Close(dag) => moment.serve(Request::Close(dag)),
                    LifecycleChange::Await(dag) if moment.in_flight(dag) == 0 => {}
                    LifecycleChange::Await(_) => {
                        // What stands behind it in the list may not happen before the DAG has
                        // ended its jobs.
                        waits = true;
                        break;
                    }
                    LifecycleChange::Enter(mode) => {
                        waits = false;
                        moment.entered(mode);
                    }
                }
            }
        }
        // Asked again in each step, until what it waits for has come.
        if waits {
            self.kept.push(Request::GoOn);
        }
    }
}

/// The modes of a run.
#[derive(Clone, Debug, Default)]
struct ModeTable {
    modes: Vec<ModeMembers>,
    /// The one that was asked for last. As long as it waits, it may be asked to go on.
    last: ModeId,
}

#[derive(Clone, Debug)]
struct ModeMembers {
    /// The DAGs that are in it.
    joining: Vec<DagId>,
    /// Those that are only in others.
    leaving: Vec<DagId>,
}

impl ModeTable {
    fn new(modes: Vec<Vec<DagId>>) -> Self {
        let mut all = sorted(&modes.concat());
        all.dedup();
        let of_dags = |joining: Vec<DagId>| ModeMembers {
            leaving: (all.iter().copied())
                .filter(|dag| !joining.contains(dag))
                .collect(),
            joining,
        };
        Self {
            modes: modes.into_iter().map(of_dags).collect(),
            last: ModeId(0),
        }
    }

    const fn count(&self) -> usize {
        self.modes.len()
    }

    /// Returns the DAGs that are in some mode.
    fn dags(&self) -> impl Iterator<Item = DagId> {
        // Each is in the first one, or leaves when that is entered.
        let first = self.modes.first().into_iter();
        first.flat_map(|mode| mode.joining.iter().chain(&mode.leaving).copied())
    }

    /// Takes the request for a mode.
    fn ask(&mut self, mode: ModeId, entry: ModeEntry, changes: &mut Vec<LifecycleChange>) {
        if let Some(asked) = self.modes.get(mode.index()) {
            let leaving = || asked.leaving.iter().copied();
            changes.extend(leaving().map(LifecycleChange::Pause));
            // Between pausing and resuming: the mode is entered when what leaves it has ended its
            // jobs.
            if entry == ModeEntry::WhenIdle {
                changes.extend(leaving().map(LifecycleChange::Await));
            }
            changes.extend(asked.joining.iter().copied().map(LifecycleChange::Resume));
            // Last, so that a journal shows the mode after all that led to it.
            changes.push(LifecycleChange::Enter(mode));
            self.last = mode;
        }
    }

    /// Asks once more for the mode that waits, and leaves paused DAGs to a person until it is
    /// there.
    fn go_on(&mut self, changes: &mut Vec<LifecycleChange>) {
        if let Some(asked) = self.modes.get(self.last.index()) {
            changes.extend(asked.leaving.iter().copied().map(LifecycleChange::Await));
            self.ask(self.last, ModeEntry::AtOnce, changes);
        }
    }

    fn leave_alone(&mut self, dag: DagId) {
        for mode in &mut self.modes {
            mode.joining.retain(|&other| other != dag);
            mode.leaving.retain(|&other| other != dag);
        }
    }
}

/// The lifecycle that an app states for its run, and how far the run has come in it.
#[derive(Clone, Debug, Default)]
pub struct LifecyclePlan {
    /// The DAGs of the plan that requests may touch.
    dags: Vec<DagId>,
    /// Those that are paused from the beginning on.
    paused: Vec<DagId>,
    modes: ModeTable,
    may_shut_down: bool,
    /// How many DAGs the plan has.
    count: usize,
}

impl LifecyclePlan {
    /// Makes it for a plan of so many DAGs.
    pub fn new(dags: u32, may_shut_down: bool) -> Self {
        Self {
            dags: (0..dags).map(DagId).collect(),
            may_shut_down,
            count: dags as usize,
            ..Self::default()
        }
    }

    /// Lets DAGs be paused from the beginning on (L4).
    #[must_use]
    pub fn with_paused(self, paused: Vec<DagId>) -> Self {
        Self { paused, ..self }
    }

    /// States the DAGs of each mode, by their numbers; the run begins in the first one (M1).
    #[must_use]
    pub fn with_modes(self, modes: Vec<Vec<DagId>>) -> Self {
        Self {
            modes: ModeTable::new(modes),
            ..self
        }
    }

    fn touches(&self, dag: DagId) -> bool {
        self.dags.contains(&dag)
    }
}

impl Lifecycle for LifecyclePlan {
    fn serve(&mut self, request: Request, changes: &mut Vec<LifecycleChange>) {
        match request {
            Request::Begin => {
                changes.extend(self.paused.drain(..).map(LifecycleChange::Pause));
                self.modes.ask(ModeId(0), ModeEntry::AtOnce, changes);
            }
            Request::GoOn => self.modes.go_on(changes),
            Request::Enter(mode, entry) => self.modes.ask(mode, entry, changes),
            Request::Pause(dag) if self.touches(dag) => changes.push(LifecycleChange::Pause(dag)),
            Request::Resume(dag) if self.touches(dag) => changes.push(LifecycleChange::Resume(dag)),
            Request::ShutDown => {
                // From now on no mode resumes what is closed.
                self.modes = ModeTable::default();
                // Drained: later requests touch none of them.
                changes.extend(self.dags.drain(..).map(LifecycleChange::Close));
            }
            // Of one DAG, and touching none of its own.
            Request::Pause(_)
            | Request::Resume(_)
            | Request::Signal(_)
            | Request::Close(_)
            | Request::End(_)
            | Request::Answer(_)
            | Request::Step => {}
        }
    }

    fn leave_alone(&mut self, dag: DagId) {
        self.dags.retain(|&other| other != dag);
        self.paused.retain(|&other| other != dag);
        self.modes.leave_alone(dag);
    }

    fn dags_of_modes(&self) -> Vec<DagId> {
        self.modes.dags().collect()
    }

    fn part(&self, is_here: &dyn Fn(DagId) -> bool, has_modes: bool) -> Box<dyn Lifecycle> {
        let here = |dags: &[DagId]| dags.iter().copied().filter(|dag| is_here(*dag)).collect();
        Box::new(Self {
            dags: here(&self.dags),
            paused: here(&self.paused),
            modes: match has_modes {
                true => self.modes.clone(),
                false => ModeTable::default(),
            },
            ..*self
        })
    }

    fn may_shut_down(&self) -> bool {
        self.may_shut_down
    }

    fn room(&self) -> (usize, usize) {
        // A pause and a resumption of each DAG, both ways into each mode, and those that there are
        // one of: the beginning, going on, the end.
        let kinds = 2 * self.count + 2 * self.modes.count() + 3;
        // At the beginning: what is paused, what the first mode changes, and that it is entered. A
        // mode pauses DAGs, awaits them, resumes others, and is entered.
        (kinds, 2 * self.count + 1)
    }
}

/// Messages on their way to each cluster.
#[derive(Debug)]
pub struct Mailboxes {
    dags: Box<[DagMailbox]>,
    clusters: Box<[ClusterMailbox]>,
    /// The cluster that serves modes.
    of_modes: ClusterId,
}

/// Messages to one DAG's cluster about that DAG.
#[derive(Debug)]
struct DagMailbox {
    cluster: ClusterId,
    signals: AtomicU32,
    /// [`NOTHING`], [`PAUSE`] or [`RESUME`].
    change: AtomicU32,
    /// [`NOTHING`], [`CLOSE`] or [`END`].
    end: AtomicU32,
    /// By subtask that waits, the latest wait that has its answer, as [`wait_word`]; 0 for none.
    answers: Box<[(SubtaskId, AtomicU64)]>,
}

/// Messages to a cluster about all of its DAGs.
#[derive(Debug, Default)]
struct ClusterMailbox {
    /// [`NOTHING`], or a mode and how to enter it, as [`packed`].
    mode: AtomicU32,
    ends: AtomicBool,
}

const NOTHING: u32 = 0;
const PAUSE: u32 = 1;
const RESUME: u32 = 2;
const CLOSE: u32 = 1;
const END: u32 = 2;

/// The lifecycle of each cluster, which serves its requests.
pub type Parts = Vec<Option<Box<dyn Lifecycle>>>;

/// Makes room for the letters of a run, and divides what serves its requests among its clusters.
///
/// # Errors
///
/// Why it cannot be divided: fact and remedy.
pub fn divide(
    task_set: &TaskSet,
    lifecycle: Option<&dyn Lifecycle>,
) -> Result<(Mailboxes, Parts), &'static str> {
    let cluster_of = |dag: DagId| task_set.dag(dag).cluster();
    let in_modes = lifecycle.map_or_else(Vec::new, Lifecycle::dags_of_modes);
    let mut of_modes = in_modes.into_iter().map(cluster_of);
    // A change of modes pauses and resumes in one step, which is one cluster's.
    let first = of_modes.next().unwrap_or_default();
    if of_modes.any(|other| other != first) {
        return Err(
            "the cores are divided, and DAGs of several clusters are in modes; put all DAGs \
                    that are in a mode into one cluster",
        );
    }
    let part = |cluster| {
        let is_here = |dag| cluster_of(dag) == cluster;
        lifecycle.map(|whole| whole.part(&is_here, cluster == first))
    };
    let letters = Mailboxes::new(task_set, first);
    Ok((letters, task_set.clusters().map(part).collect()))
}

impl Mailboxes {
    /// Makes room for the letters of a run, of which one cluster serves modes.
    pub(crate) fn new(task_set: &TaskSet, of_modes: ClusterId) -> Self {
        let mailbox = |dag: &Dag| DagMailbox {
            cluster: dag.cluster(),
            signals: AtomicU32::new(0),
            change: AtomicU32::new(NOTHING),
            end: AtomicU32::new(NOTHING),
            answers: answers(dag),
        };
        let clusters = task_set.clusters();
        Self {
            dags: task_set.dags().iter().map(mailbox).collect(),
            clusters: clusters.map(|_| ClusterMailbox::default()).collect(),
            of_modes,
        }
    }

    /// Leaves a request for the clusters that it concerns, other than the one that it comes `from`,
    /// if any; calls `sent` for each of them, and reports whether it does not concern that one.
    pub fn send(
        &self,
        from: Option<ClusterId>,
        request: Request,
        mut sent: impl FnMut(ClusterId),
    ) -> bool {
        let to = match request {
            Request::Signal(dag)
            | Request::Pause(dag)
            | Request::Resume(dag)
            | Request::Close(dag)
            | Request::End(dag) => self.dags[dag.index()].cluster,
            Request::Answer(wait) => self.dags[wait.instance.dag.index()].cluster,
            Request::Enter(..) => self.of_modes,
            Request::ShutDown => {
                for (cluster, to) in (0..).map(ClusterId).zip(&self.clusters) {
                    if Some(cluster) != from {
                        to.ends.store(true, Ordering::Release);
                        sent(cluster);
                    }
                }
                return false;
            }
            Request::Begin | Request::GoOn | Request::Step => return false,
        };
        if Some(to) == from {
            return false;
        }
        let of = |dag: DagId| &self.dags[dag.index()];
        // Release: for the latest values that were shown before.
        match request {
            Request::Signal(dag) => _ = of(dag).signals.fetch_add(1, Ordering::Release),
            Request::Pause(dag) => of(dag).change.store(PAUSE, Ordering::Release),
            Request::Resume(dag) => of(dag).change.store(RESUME, Ordering::Release),
            Request::Close(dag) => _ = of(dag).end.fetch_max(CLOSE, Ordering::Release),
            Request::End(dag) => of(dag).end.store(END, Ordering::Release),
            Request::Enter(mode, entry) => {
                let place = &self.clusters[to.index()].mode;
                place.store(packed(mode, entry), Ordering::Release);
            }
            Request::Answer(wait) => {
                let answers = &of(wait.instance.dag).answers;
                let place = answers.iter().find(|of| of.0 == wait.instance.subtask);
                // Of two, the older one comes too late: its instance waits for the other by now.
                place.map(|of| of.1.fetch_max(wait_word(wait), Ordering::Release));
            }
            Request::ShutDown | Request::Begin | Request::GoOn | Request::Step => {}
        }
        sent(to);
        true
    }

    /// Takes all that waits for a cluster.
    pub fn take_all(&self, cluster: ClusterId, mut take: impl FnMut(Request)) {
        let of_all = &self.clusters[cluster.index()];
        // Each word is taken and emptied in one access: what comes afterwards is of the next step.
        // What is taken last is emptied first. Else one sender's letters, left between two of these
        // accesses, could be taken in the wrong order, in two steps.
        let ends = of_all.ends.swap(false, Ordering::Acquire);
        let mode = || {
            // Reading suffices in nearly all rounds.
            let is_there = of_all.mode.load(Ordering::Relaxed) != NOTHING;
            let word = is_there.then(|| of_all.mode.swap(NOTHING, Ordering::Acquire));
            let asked = word.and_then(unpacked);
            asked.map(|(mode, entry)| Request::Enter(mode, entry))
        };
        for (dag, to) in (0..).map(DagId).zip(&self.dags) {
            if to.cluster != cluster {
                continue;
            }
            let end = to.end.swap(NOTHING, Ordering::Acquire);
            let signals = to.signals.swap(0, Ordering::Acquire);
            let change = to.change.swap(NOTHING, Ordering::Acquire);
            mode().into_iter().for_each(&mut take);
            match change {
                PAUSE => take(Request::Pause(dag)),
                RESUME => take(Request::Resume(dag)),
                _ => {}
            }
            (0..signals).for_each(|_| take(Request::Signal(dag)));
            match end {
                CLOSE => take(Request::Close(dag)),
                END => take(Request::End(dag)),
                _ => {}
            }
            for (subtask, answer) in &to.answers {
                let word = answer.swap(0, Ordering::Acquire);
                let wait = wait_of(dag, *subtask, word);
                wait.into_iter()
                    .for_each(|wait| take(Request::Answer(wait)));
            }
        }
        mode().into_iter().for_each(&mut take);
        if ends {
            take(Request::ShutDown);
        }
    }
}

/// Returns room for answers to the subtasks that wait.
fn answers(dag: &Dag) -> Box<[(SubtaskId, AtomicU64)]> {
    let numbered = (0..).map(SubtaskId).zip(dag.subtasks());
    let waiting = numbered.filter(|(_, subtask)| !subtask.waits().is_empty());
    waiting.map(|(id, _)| (id, AtomicU64::new(0))).collect()
}

/// Returns a word for a wait of a subtask, the larger the later, never 0.
const fn wait_word(wait: WaitId) -> u64 {
    (wait.instance.job << 8) | (wait.number as u64 + 1)
}

fn wait_of(dag: DagId, subtask: SubtaskId, word: u64) -> Option<WaitId> {
    let job = word >> 8;
    let number = u32::try_from(word & 0xff).ok()?.checked_sub(1)?;
    let instance = Instance { dag, job, subtask };
    Some(WaitId { instance, number })
}

/// Returns a word for a mode and how to enter it, which is not [`NOTHING`].
const fn packed(mode: ModeId, entry: ModeEntry) -> u32 {
    let entry = match entry {
        ModeEntry::AtOnce => 1,
        ModeEntry::WhenIdle => 2,
    };
    mode.0 << 2 | entry
}

const fn unpacked(word: u32) -> Option<(ModeId, ModeEntry)> {
    let entry = match word & 3 {
        1 => ModeEntry::AtOnce,
        2 => ModeEntry::WhenIdle,
        _ => return None,
    };
    Some((ModeId(word >> 2), entry))
}

#[cfg(test)]
mod tests {
    use alloc::vec;

    use super::{LifecyclePlan, *};
    use crate::{CommitOptions, CoreDivision, DagSpec, Policy, SubtaskSpec, verify};

    /// Three DAGs, in clusters 0, 1 and 1.
    fn task_set() -> TaskSet {
        let spec = |cluster| DagSpec {
            cluster: Some(ClusterId(cluster)),
            period_ns: Some(10),
            relative_deadline_ns: Some(10),
            subtasks: vec![SubtaskSpec::default()],
            ..DagSpec::default()
        };
        let options =
            CommitOptions::new(Policy::Edf, 2).with_clusters(CoreDivision::Of(vec![1, 1]));
        let verified = verify(&[spec(0), spec(1), spec(1)], &options);
        verified.expect("it is right").task_set
    }

    #[test]
    fn requests_go_where_they_concern_something_and_the_later_one_counts() {
        let changes = LifecyclePlan::new(3, true).with_modes(vec![vec![DagId(1)], vec![DagId(2)]]);
        let (letters, _) = divide(&task_set(), Some(&changes)).expect("modes are in one cluster");
        let [here, there] = [0, 1].map(ClusterId);
        let modes =
            [ModeEntry::AtOnce, ModeEntry::WhenIdle].map(|entry| Request::Enter(ModeId(1), entry));
        for (request, is_away) in [
            (Request::Signal(DagId(0)), false),
            (Request::Signal(DagId(1)), true),
            (Request::Signal(DagId(1)), true),
            (Request::Pause(DagId(2)), true),
            (Request::Resume(DagId(2)), true),
            (modes[0], true),
            (modes[1], true),
            (Request::ShutDown, false),
            (Request::Begin, false),
        ] {
            let mut sent = Vec::new();
            let away = letters.send(Some(here), request, |cluster| sent.push(cluster));
            assert_eq!(away, is_away, "{request:?}");
            let leaves = is_away || request == Request::ShutDown;
            assert_eq!(sent, vec![there; usize::from(leaves)], "{request:?}");
        }
        for request in [Request::End(DagId(2)), Request::Close(DagId(2))] {
            assert!(letters.send(None, request, |cluster| assert_eq!(cluster, there)));
        }
        let mut taken = Vec::new();
        letters.take_all(there, |request| taken.push(request));
        let expected = [
            modes[1],
            Request::Signal(DagId(1)),
            Request::Signal(DagId(1)),
            Request::Resume(DagId(2)),
            Request::End(DagId(2)),
            Request::ShutDown,
        ];
        assert_eq!(taken, expected);
        letters.take_all(there, |request| panic!("{request:?} was taken"));
        letters.take_all(here, |request| panic!("{request:?} is of another cluster"));
    }

    #[test]
    fn each_cluster_serves_what_concerns_its_own_dags() {
        let changes = LifecyclePlan::new(3, true).with_paused(vec![DagId(0), DagId(2)]);
        let (_, mut parts) = divide(&task_set(), Some(&changes)).expect("there are no modes");
        let mut served = |cluster: usize, request| {
            let mut changes = Vec::new();
            let part = parts[cluster].as_mut().expect("each has one");
            part.serve(request, &mut changes);
            changes
        };
        use crate::lifecycle::LifecycleChange::{Close, Pause};
        assert_eq!(served(0, Request::Begin), [Pause(DagId(0))]);
        assert_eq!(served(1, Request::Begin), [Pause(DagId(2))]);
        assert_eq!(
            served(1, Request::ShutDown),
            [Close(DagId(1)), Close(DagId(2))]
        );
        assert_eq!(served(0, Request::ShutDown), [Close(DagId(0))]);
    }

    #[test]
    fn modes_of_several_clusters_are_refused() {
        let changes = LifecyclePlan::new(3, false).with_modes(vec![vec![DagId(0)], vec![DagId(2)]]);
        let why = divide(&task_set(), Some(&changes)).expect_err("DAG 0 is elsewhere");
        assert!(why.contains("into one cluster"), "{why}");
    }
}
