//! Requests of functions to the run as a whole, and how the run carries them out.
//!
//! Besides passing values, a function may ask for other effects: that a sporadic DAG gets a signal,
//! that a DAG pauses or resumes, that another set of DAGs runs (M1 to M7, below), or that the run
//! ends. Like every effect of a function, a *request* takes effect with the completion of its
//! instance (R3), never before. The scenarios of the rules, in `tests/scenarios/lifecycle.txt`,
//! bear their numbers:
//!
//! - **L1, when.** A request takes effect at the instant of the completion, after all completions
//!   and faults of that instant and before its releases. A failing instance makes no requests.
//! - **L2, in which order.** Requests of one instant are served in the order of their completions.
//!   Requests of one instance are served in the order in which its subtask states what it uses,
//!   each once.
//! - **L3, pausing.** Pausing or resuming a DAG follows P1 to P5: jobs in flight go on, due jobs
//!   are skipped, the grid stays. A DAG may pause itself: the job in hand goes on.
//! - **L4, the beginning.** A DAG may be paused from time 0 on, before its first release.
//! - **L5, the end.** A shutdown closes every DAG (C1 to C5) at one instant, so the run is over
//!   when nothing is in flight any more. Later requests have no effect.
//! - **L6, replays.** The effect of a request on a DAG with recorded inputs is in the recording:
//!   the jobs that were skipped. In a replay requests do not touch such a DAG.
//!
//! Where clusters have no instant in common, requests cross them as [`Mailboxes`].
//!
//! A driver has [`PendingRequests`], which keeps requests from a completion to the scheduler's
//! step, and the plan's [`Lifecycle`], which serves all requests but signals. The lifecycle is
//! behind a trait, so an image without such requests contains no code for them.
//!
//! # Modes: sets of DAGs, of which a single set runs
//!
//! A *mode* is a set of DAGs that run together, such as the DAGs of a flight, or of a landing. A
//! DAG that belongs to some mode is *on* in its modes and off, meaning paused, in the others. A DAG
//! without a mode runs in all. The scenarios of the rules, in `tests/scenarios/modes.txt`, bear
//! their numbers (M7 has its test in `tests/it/modes.rs`):
//!
//! - **M1, what is on.** A run begins in mode 0. When a mode is entered, its DAGs are resumed, and
//!   all DAGs that are only in other modes are paused (P1 to P5). DAGs that are on in both the old
//!   and the new mode notice nothing.
//! - **M2, at once.** The mode is entered at the instant of the request. Jobs in flight of leaving
//!   DAGs go on to their ends, next to the jobs of joining DAGs.
//! - **M3, when idle.** The leaving DAGs are paused at the request. The mode is entered at the
//!   first instant at which none of their jobs is in flight: after the completions of that instant,
//!   before its releases, or at the request itself if no such job is in flight then. Until then the
//!   joining DAGs stay paused.
//! - **M4, the last one counts.** A new request replaces a request still waiting for its mode to be
//!   entered, whichever entry either asks for. A request for the present mode is allowed, too.
//! - **M5, what a person does.** A DAG that was paused or resumed at the console stays so until a
//!   mode is entered.
//! - **M6, those that are gone.** An ended DAG stays ended; only its instances in flight keep a
//!   mode waiting. After a shutdown no mode is entered.
//! - **M7, replays.** A DAG with recorded inputs is neither paused nor resumed, and no mode waits
//!   for the DAG (L6).
//!
//! A change of mode costs a pause or a resumption of each DAG that is in some mode, in one step of
//! the scheduler. While a change waits, each step looks at the leaving DAGs.
//!
//! # Requests to other clusters, and from outside of all clusters
//!
//! Each cluster serves the requests about its DAGs, with its own part of the app's lifecycle. A
//! completed instance's request goes to the cluster concerned: a signal, a pause and a resumption
//! to the cluster of the DAG; a mode to the cluster of the modes' DAGs, which are all in the same
//! cluster; and a shutdown to all clusters. A request to another cluster is a *letter*, effective
//! in the step in which the receiver takes the letter, before the releases of that step. Sending a
//! letter never waits, because the room for letters is allocated at commit:
//!
//! - Signals are counted, so none is lost.
//! - Of a pause and a resumption of one DAG waiting together, the later counts. The same holds for
//!   modes. An end counts more than a closing.
//! - Of two answers to waits of one subtask, the answer to the later wait counts.
//! - All letters taken in one step are served in this order: the mode; DAG by DAG its pause or
//!   resumption, its signals, its end; the end of the run. Letters that one sender leaves in this
//!   order are served in this order, even if they are taken in two steps. Between different
//!   senders, the order is open.

use alloc::boxed::Box;
use alloc::vec::Vec;
use core::fmt;
use core::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};

use crate::ids::{ClusterId, DagId, Instance, ModeId, SubtaskId};
use crate::order::sorted;
use crate::scheduler::Moment;
use crate::task_set::{Dag, TaskSet};

pub use crate::request::{ModeEntry, Request, WaitId, WaitLimit};

/// A change in a scheduler, made by a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LifecycleChange {
    /// A DAG is paused (P1 to P5).
    Pause(DagId),
    /// A DAG's pause ends.
    Resume(DagId),
    /// A DAG is closed (C1 to C5).
    Close(DagId),
    /// If the DAG has a job in flight, the following changes wait: in the next step the driver asks
    /// for [`Request::GoOn`].
    Await(DagId),
    /// A mode is entered, and nothing waits for a mode any more.
    Enter(ModeId),
}

/// Serves all requests except signals.
pub trait Lifecycle: fmt::Debug + Send {
    /// Turns a request into changes. There is [`room`](Self::room) for the changes.
    fn serve(&mut self, request: Request, changes: &mut Vec<LifecycleChange>);

    /// Leaves a DAG alone from now on (L6).
    fn leave_alone(&mut self, dag: DagId);

    /// Returns the DAGs that are in some mode.
    fn dags_of_modes(&self) -> Vec<DagId>;

    /// Returns the lifecycle of one cluster, before the run. The part serves requests about the
    /// cluster's DAGs; only one cluster keeps the modes.
    fn part(&self, is_here: &dyn Fn(DagId) -> bool, has_modes: bool) -> Box<dyn Lifecycle>;

    /// Reports whether a function may ask for the end of the run.
    fn may_shut_down(&self) -> bool;

    /// Returns the number of different requests possible, without signals, and the largest number
    /// of changes from one request.
    fn room(&self) -> (usize, usize);
}

/// The requests of a run on their way to the scheduler.
#[derive(Debug)]
pub struct PendingRequests {
    /// Each request once; there is room for all.
    kept: Vec<Request>,
    lifecycle: Option<Box<dyn Lifecycle>>,
    changes: Vec<LifecycleChange>,
}

impl PendingRequests {
    /// Allocates room for the requests of a plan of so many DAGs.
    pub fn new(dags: usize, lifecycle: Option<Box<dyn Lifecycle>>) -> Self {
        let room = lifecycle.as_ref().map(|lifecycle| lifecycle.room());
        let (others, changes) = room.unwrap_or_default();
        let mut kept = Vec::with_capacity(dags.saturating_add(others).saturating_add(1));
        // The first request: DAGs stated as paused are paused in the very first step, before any
        // release.
        kept.extend(lifecycle.as_ref().map(|_| Request::Begin));
        Self {
            kept,
            lifecycle,
            changes: Vec::with_capacity(changes),
        }
    }

    /// Keeps a request of a function until the next step. A function's request never answers a
    /// wait: answers come only as letters.
    pub fn keep(&mut self, request: Request) {
        // Keeping a request once is enough. This bounds the room: one place for each different
        // request.
        if !self.kept.contains(&request) {
            self.kept.push(request);
        }
    }

    /// Reports whether no request is on its way: then a completion may be the whole step.
    #[inline]
    pub const fn are_none(&self) -> bool {
        self.kept.is_empty()
    }

    /// Gives away the requests accepted by `take`, namely those concerning other schedulers only.
    pub fn give_away(&mut self, mut take: impl FnMut(Request) -> bool) {
        self.kept.retain(|&request| !take(request));
    }

    /// Takes the letters from other clusters and from outside. A letter about a single DAG, without
    /// effect on the [`Lifecycle`], is passed on at once.
    #[inline(always)]
    pub fn take_letters(
        &mut self,
        letters: &Mailboxes,
        cluster: ClusterId,
        moment: &mut Moment<'_>,
    ) {
        letters.take_all(cluster, |request| {
            // The lifecycle has to know of a person's pause, for example; a signal concerns the
            // scheduler alone. Each letter finds the DAG as the letters before have left the DAG.
            if self.lifecycle.is_some() && request.is_of_lifecycle() {
                self.keep(request);
                self.serve(moment);
            } else {
                moment.serve(request);
            }
        });
    }

    /// Passes the requests on to the scheduler, after the completions of the instant.
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
                        // The changes behind it in the list must not happen before the DAG has
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
        // Asked again in each step, until the DAGs waited for are idle.
        if waits {
            self.kept.push(Request::GoOn);
        }
    }
}

/// The modes of a run.
#[derive(Clone, Debug, Default)]
struct ModeTable {
    modes: Vec<ModeMembers>,
    /// The mode requested last. While the mode waits to be entered, it may be asked to go on.
    last: ModeId,
}

#[derive(Clone, Debug)]
struct ModeMembers {
    /// The DAGs in the mode.
    joining: Vec<DagId>,
    /// The DAGs that are only in other modes.
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
        // Each DAG of a mode is in the first mode, or leaves when the first mode is entered.
        let first = self.modes.first().into_iter();
        first.flat_map(|mode| mode.joining.iter().chain(&mode.leaving).copied())
    }

    /// Takes the request for a mode.
    fn ask(&mut self, mode: ModeId, entry: ModeEntry, changes: &mut Vec<LifecycleChange>) {
        if let Some(asked) = self.modes.get(mode.index()) {
            let leaving = || asked.leaving.iter().copied();
            changes.extend(leaving().map(LifecycleChange::Pause));
            // Between pausing and resuming: the mode is entered when the leaving DAGs have ended
            // their jobs.
            if entry == ModeEntry::WhenIdle {
                changes.extend(leaving().map(LifecycleChange::Await));
            }
            changes.extend(asked.joining.iter().copied().map(LifecycleChange::Resume));
            // Last, so that a journal shows the mode after everything that led to it.
            changes.push(LifecycleChange::Enter(mode));
            self.last = mode;
        }
    }

    /// Asks once more for the waiting mode. Until the mode is entered, paused DAGs are left to a
    /// person.
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

/// The lifecycle that an app states for its run, and the progress of the run in it.
#[derive(Clone, Debug, Default)]
pub struct LifecyclePlan {
    /// The DAGs of the plan open to requests.
    dags: Vec<DagId>,
    /// The DAGs paused from the beginning on.
    paused: Vec<DagId>,
    modes: ModeTable,
    may_shut_down: bool,
    /// The number of DAGs in the plan.
    count: usize,
}

impl LifecyclePlan {
    /// Makes the lifecycle for a plan of so many DAGs.
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
                // From now on no mode resumes a closed DAG.
                self.modes = ModeTable::default();
                // Drained: later requests touch none of them.
                changes.extend(self.dags.drain(..).map(LifecycleChange::Close));
            }
            // Requests about one DAG without effect on the plan: `touches` was false, or the
            // scheduler serves them.
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
        // A pause and a resumption of each DAG, both ways into each mode, and three single
        // requests: the beginning, going on, the end.
        let kinds = 2 * self.count + 2 * self.modes.count() + 3;
        // At the beginning: the paused DAGs, the changes of the first mode, and its entry. A mode
        // pauses DAGs, awaits them, resumes others, and is entered.
        (kinds, 2 * self.count + 1)
    }
}

/// Letters on their way to each cluster.
#[derive(Debug)]
pub struct Mailboxes {
    dags: Box<[DagMailbox]>,
    clusters: Box<[ClusterMailbox]>,
    /// The cluster serving modes.
    of_modes: ClusterId,
}

/// Letters to one DAG's cluster about that DAG.
#[derive(Debug)]
struct DagMailbox {
    cluster: ClusterId,
    signals: AtomicU32,
    /// [`NOTHING`], [`PAUSE`] or [`RESUME`].
    change: AtomicU32,
    /// [`NOTHING`], [`CLOSE`] or [`END`].
    end: AtomicU32,
    /// For each waiting subtask, the latest wait with an answer, as [`wait_word`]; 0 for none.
    answers: Box<[(SubtaskId, AtomicU64)]>,
}

/// Letters to a cluster about all of its DAGs.
#[derive(Debug, Default)]
struct ClusterMailbox {
    /// [`NOTHING`], or a mode with its way of entry, as [`packed`].
    mode: AtomicU32,
    ends: AtomicBool,
}

const NOTHING: u32 = 0;
const PAUSE: u32 = 1;
const RESUME: u32 = 2;
const CLOSE: u32 = 1;
const END: u32 = 2;

/// The lifecycle of each cluster, serving the requests to the cluster.
pub type Parts = Vec<Option<Box<dyn Lifecycle>>>;

/// Makes room for the letters of a run, and divides the lifecycle among the run's clusters.
///
/// # Errors
///
/// The reason why the lifecycle cannot be divided: fact and remedy.
pub fn divide(
    task_set: &TaskSet,
    lifecycle: Option<&dyn Lifecycle>,
) -> Result<(Mailboxes, Parts), &'static str> {
    let cluster_of = |dag: DagId| task_set.dag(dag).cluster();
    let in_modes = lifecycle.map_or_else(Vec::new, Lifecycle::dags_of_modes);
    let mut of_modes = in_modes.into_iter().map(cluster_of);
    // A change of modes pauses and resumes in one step, and a step belongs to one cluster.
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
    /// Makes room for the letters of a run; cluster `of_modes` serves modes.
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

    /// Leaves a request for the clusters concerned, except the sender's own cluster `from`, if any,
    /// and calls `sent` for each receiver. Reports whether the request does not concern `from`.
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
        // Release: so that the receiver sees the latest values shown before the letter.
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
                // Of two answers, the older comes too late: its instance waits for the other by
                // now.
                place.map(|of| of.1.fetch_max(wait_word(wait), Ordering::Release));
            }
            Request::ShutDown | Request::Begin | Request::GoOn | Request::Step => {}
        }
        sent(to);
        true
    }

    /// Takes all letters to a cluster.
    pub fn take_all(&self, cluster: ClusterId, mut take: impl FnMut(Request)) {
        let of_all = &self.clusters[cluster.index()];
        // Each word is taken and emptied in one access: later letters belong to the next step. The
        // letters served last are emptied first. Otherwise one sender's letters, left between two
        // of these accesses, could be taken in the wrong order, in two steps.
        let ends = of_all.ends.swap(false, Ordering::Acquire);
        let mode = || {
            // A plain load suffices in nearly all rounds.
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

/// Returns room for answers to the waiting subtasks.
fn answers(dag: &Dag) -> Box<[(SubtaskId, AtomicU64)]> {
    let numbered = (0..).map(SubtaskId).zip(dag.subtasks());
    let waiting = numbered.filter(|(_, subtask)| !subtask.waits().is_empty());
    waiting.map(|(id, _)| (id, AtomicU64::new(0))).collect()
}

/// Returns a word for a wait of a subtask: larger for a later wait, never 0.
const fn wait_word(wait: WaitId) -> u64 {
    (wait.instance.job << 8) | (wait.number as u64 + 1)
}

fn wait_of(dag: DagId, subtask: SubtaskId, word: u64) -> Option<WaitId> {
    let job = word >> 8;
    let number = u32::try_from(word & 0xff).ok()?.checked_sub(1)?;
    let instance = Instance { dag, job, subtask };
    Some(WaitId { instance, number })
}

/// Returns a word for a mode with its way of entry, never [`NOTHING`].
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
