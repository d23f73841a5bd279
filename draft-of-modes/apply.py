import shutil
def sub(path, old, new, count=1):
    s=open(path).read()
    assert s.count(old)>=1, (path, old)
    s=s.replace(old,new) if count==0 else s.replace(old,new,count)
    open(path,'w').write(s)
T='/tmp/life_modes/'
shutil.copy(T+'modes.rs','sched-dag/src/lifecycle/modes.rs')
shutil.copy(T+'answer_modes.rs','sched-dag/src/analysis/modes.rs')
shutil.copy(T+'draft_modes.rs','fass/src/draft/modes.rs')
shutil.copy(T+'api_modes.rs','fass/src/api/modes.rs')
shutil.copy(T+'test_modes.rs','sched-dag/tests/modes.rs')
# ids
I='sched-dag/src/ids.rs'
sub(I,'''/// One execution of a subtask:''','''/// A mode, by its position among those of one commit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ModeId(pub u32);

/// One execution of a subtask:''')
sub(I,'''impl SubtaskId {''','''impl ModeId {
    /// Returns the position as an index into a table of modes.
    #[must_use]
    pub const fn index(self) -> usize {
        self.0 as usize
    }
}

impl SubtaskId {''')
sub('sched-dag/src/lib.rs','pub use ids::{ClusterId, CoreId, DagId, Instance, SubtaskId, Vertex};','pub use ids::{ClusterId, CoreId, DagId, Instance, ModeId, SubtaskId, Vertex};')
# lifecycle
L='sched-dag/src/lifecycle/mod.rs'
sub(L,'mod changes;\n','mod changes;\nmod modes;\n')
sub(L,'use crate::ids::DagId;\n','use crate::ids::{DagId, ModeId};\n')
sub(L,'pub use changes::Changes;\n','pub use changes::Changes;\npub use modes::Entry;\n')
sub(L,'''    /// The run ends: no DAG''','''    /// A mode is entered.
    Enter(ModeId, Entry),
    /// The run ends: no DAG''')
sub(L,'''    /// Closes a DAG (C1 to C5).
    fn close(&mut self, dag: DagId);
}''','''    /// Closes a DAG (C1 to C5).
    fn close(&mut self, dag: DagId);

    /// Takes note that a mode is entered.
    fn entered(&mut self, mode: ModeId);
}''')
sub(L,'''    /// Reports whether a function may ask for the end of the run.
    fn may_shut_down(&self) -> bool;''','''    /// Reports whether a function may ask for the end of the run.
    fn may_shut_down(&self) -> bool;

    /// Returns how many different requests there can be, signals not counted.
    fn kinds(&self) -> usize;''')
sub(L,'''        // A signal, a pause and a resumption of each, and those that there are one of.
        let room = match lifecycle {
            None => dags,
            Some(_) => dags.saturating_mul(3).saturating_add(2),
        };
        let mut kept = Vec::with_capacity(room);''','''        let others = lifecycle.as_ref().map_or(0, |lifecycle| lifecycle.kinds());
        let mut kept = Vec::with_capacity(dags.saturating_add(others));''')
sub(L,'''    fn close(&mut self, dag: DagId) {
        self.moment.close(dag, self.observer);
    }''','''    fn close(&mut self, dag: DagId) {
        self.moment.close(dag, self.observer);
    }

    fn entered(&mut self, mode: ModeId) {
        self.observer.entered(mode);
    }''')
sub(L,'''that a DAG rests
//! or goes on, that the run ends.''','''that a DAG rests
//! or goes on, that another set of DAGs runs (the module `modes`), that the run ends.''')
C='sched-dag/src/lifecycle/changes.rs'
sub(C,'use super::{Lifecycle, Request, System};','use super::modes::Modes;\nuse super::{Lifecycle, Request, System};')
sub(C,'''    paused: Vec<DagId>,
    may_shut_down: bool,
}''','''    paused: Vec<DagId>,
    modes: Modes,
    has_begun: bool,
    may_shut_down: bool,
    /// How many DAGs the plan has.
    count: usize,
}''')
sub(C,'''            dags: (0..dags).map(DagId).collect(),
            paused: Vec::new(),
            may_shut_down,
        }''','''            dags: (0..dags).map(DagId).collect(),
            may_shut_down,
            count: dags as usize,
            ..Self::default()
        }''')
sub(C,'''    fn touches(&self''','''    /// States the DAGs of each mode, by their numbers; the run begins in the first one (M1).
    #[must_use]
    pub fn with_modes(self, modes: Vec<Vec<DagId>>) -> Self {
        Self {
            modes: Modes::new(modes),
            ..self
        }
    }

    fn touches(&self''')
s=open(C).read()
a=s.index("        match request {\n            Request::GoOn"); b=s.index("    fn leave_alone")
s=s[:a]+'''        match request {
            Request::GoOn if !self.has_begun => {
                self.has_begun = true;
                self.paused.drain(..).for_each(|dag| system.pause(dag));
                self.modes.begin(system);
            }
            Request::GoOn => self.modes.go_on(system),
            Request::Pause(dag) if self.touches(dag) => system.pause(dag),
            Request::Resume(dag) if self.touches(dag) => system.resume(dag),
            Request::Enter(mode, entry) => self.modes.ask(mode, entry, system),
            Request::ShutDown => {
                self.modes.end();
                self.dags.drain(..).for_each(|dag| system.close(dag));
            }
            Request::Signal(_) | Request::Pause(_) | Request::Resume(_) => {}
        }
        self.modes.are_pending()
    }

'''+s[b:]
s=s.replace('''        self.paused.retain(|&other| other != dag);
    }''','''        self.paused.retain(|&other| other != dag);
        self.modes.leave_alone(dag);
    }''')
s=s.replace('''    fn may_shut_down(&self) -> bool {
        self.may_shut_down
    }''','''    fn may_shut_down(&self) -> bool {
        self.may_shut_down
    }

    fn kinds(&self) -> usize {
        // A pause and a resumption of each DAG, both ways into each mode, the end, and going on.
        2 * self.count + 2 * self.modes.count() + 2
    }''')
s=s.replace('//! Serves requests: which DAGs rest, and the end of the run.','//! Serves requests: which DAGs rest, which mode runs, and the end of the run.')
open(C,'w').write(s)
M='sched-dag/src/lifecycle/modes.rs'
s=open(M).read()
a=s.index("/// The modes of a run.\n"); b=s.index("/// Returns the DAGs that are in some mode and not")
s=s[:a]+'''/// The modes of a run.
#[derive(Clone, Debug, Default)]
pub(super) struct Modes {
    /// The DAGs of each.
    modes: Vec<Vec<DagId>>,
    /// The DAGs that are in some mode.
    dags: Vec<DagId>,
    /// The mode that is to be entered when what leaves is idle.
    pending: Option<ModeId>,
    /// Whether none is entered any more.
    are_over: bool,
}

impl Modes {
    pub(super) fn new(modes: Vec<Vec<DagId>>) -> Self {
        let mut dags: Vec<DagId> = modes.iter().flatten().copied().collect();
        dags.sort_unstable();
        dags.dedup();
        Self {
            modes,
            dags,
            ..Self::default()
        }
    }

    pub(super) const fn count(&self) -> usize {
        self.modes.len()
    }

    /// Reports whether a mode that was asked for is still to be entered.
    pub(super) const fn are_pending(&self) -> bool {
        self.pending.is_some()
    }

    /// Enters the first one, if there are any.
    pub(super) fn begin(&mut self, system: &mut dyn System) {
        if self.count() > 0 {
            self.ask(ModeId(0), Entry::AtOnce, system);
        }
    }

    /// Takes the request for a mode.
    pub(super) fn ask(&mut self, mode: ModeId, entry: Entry, system: &mut dyn System) {
        if self.are_over {
            return;
        }
        let leaving = leaving(&self.dags, &self.modes[mode.index()]);
        leaving.for_each(|dag| system.pause(dag));
        self.pending = Some(mode);
        match entry {
            Entry::AtOnce => self.enter(system),
            Entry::WhenIdle => self.go_on(system),
        }
    }

    /// Enters the mode that was asked for, if what leaves is idle.
    pub(super) fn go_on(&mut self, system: &mut dyn System) {
        let Some(mode) = self.pending else { return };
        let mut leaving = leaving(&self.dags, &self.modes[mode.index()]);
        if leaving.all(|dag| system.in_flight(dag) == 0) {
            self.enter(system);
        }
    }

    fn enter(&mut self, system: &mut dyn System) {
        if let Some(mode) = self.pending.take() {
            let dags = self.modes[mode.index()].iter();
            dags.for_each(|&dag| system.resume(dag));
            system.entered(mode);
        }
    }

    /// Enters no further mode.
    pub(super) const fn end(&mut self) {
        self.are_over = true;
        self.pending = None;
    }

    pub(super) fn leave_alone(&mut self, dag: DagId) {
        let dags = self.modes.iter_mut().chain([&mut self.dags]);
        dags.for_each(|dags| dags.retain(|&other| other != dag));
    }
}

'''+s[b:]
open(M,'w').write(s)
S='sched-dag/src/virtual_time/several.rs'
sub(S,'use crate::ids::DagId;','use crate::ids::{DagId, ModeId};')
sub(S,'''        self.with(dag, |moment, workload| moment.close(dag, workload));
    }''','''        self.with(dag, |moment, workload| moment.close(dag, workload));
    }

    fn entered(&mut self, mode: ModeId) {
        self.workload.entered(mode);
    }''')
O='sched-dag/src/scheduler/observer.rs'
sub(O,'''    /// The deadline of job `job` has passed, and''','''    /// The run is in another mode. Told by the driver, as the scheduler knows none.
    fn entered(&mut self, mode: ModeId) {
        let _ = mode;
    }

    /// The deadline of job `job` has passed, and''')
sub(O,'    closed(dag: DagId);\n','    closed(dag: DagId);\n    entered(mode: ModeId);\n')
sub(O,'use crate::ids::{DagId, Instance};','use crate::ids::{DagId, Instance, ModeId};')
W='sched-dag/src/journal/what.rs'
sub(W,'''    /// A DAG is closed: it releases no further job.
    Closed,
''','''    /// A DAG is closed: it releases no further job.
    Closed,
    /// The run enters a mode, whose number stands where the job's does. The DAG is 0 and
    /// means nothing.
    Entered,
''')
sub(W,'[(What, &str); 22]','[(What, &str); 23]')
sub(W,'''    (What::Closed, "closed"),
];''','''    (What::Closed, "closed"),
    (What::Entered, "entered"),
];''')
sub(W,'from_number(22)','from_number(23)')
sub(W,'''    /// Reports whether it happens to a DAG as a whole, so that the job means nothing.
    #[must_use]
    pub const fn is_of_dag(self) -> bool {
        matches!(self, Self::Stopped | Self::Off | Self::On | Self::Closed)
    }''','''    /// Reports whether it happens to a DAG as a whole, or to the run, and to no job.
    #[must_use]
    pub const fn is_of_dag(self) -> bool {
        matches!(
            self,
            Self::Stopped | Self::Off | Self::On | Self::Closed | Self::Entered
        )
    }''')
R='sched-dag/src/recorder.rs'
sub(R,'''    fn closed(&mut self, dag: DagId) {
        self.of_job(What::Closed, dag, 0);
    }''','''    fn closed(&mut self, dag: DagId) {
        self.of_job(What::Closed, dag, 0);
    }

    fn entered(&mut self, mode: ModeId) {
        self.of_job(What::Entered, DagId(0), mode.0.into());
    }''')
sub(R,'use crate::ids::{CoreId, DagId, Instance};','use crate::ids::{CoreId, DagId, Instance, ModeId};')
sub('sched-dag/src/law/replay/mod.rs','What::Signalled | What::Dropped | What::Request => {}','What::Signalled | What::Dropped | What::Request | What::Entered => {}')
# analysis
A='sched-dag/src/analysis/'
sub(A+'mod.rs','mod judge;\n','mod judge;\nmod modes;\n')
sub(A+'mod.rs','pub use judge::answer;\n','pub use judge::answer;\npub use modes::answer_in_modes;\n')
sub(A+'mod.rs','''//! | `assign` | the commit's own clusters | Li 2014 |
''','''//! | `assign` | the commit's own clusters | Li 2014 |
//! | `modes` | sets of DAGs that never run together | Real 2004 |
''')
J=A+'judge/mod.rs'
sub(J,'''pub fn answer(task_set: &TaskSet, settings: &Settings) -> Answer {
    let dags''','''pub fn answer(task_set: &TaskSet, settings: &Settings) -> Answer {
    answer_among(task_set, settings, |_| true)
}

/// Does the same for some of the DAGs, as if there were no others. The others have no bound.
pub(super) fn answer_among(
    task_set: &TaskSet,
    settings: &Settings,
    is_there: impl Fn(DagId) -> bool,
) -> Answer {
    let dags''')
sub(J,'''(0..dags.len()).filter(|&dag| dags[dag].cluster() == cluster);''','''(0..dags.len())
            .filter(|&dag| dags[dag].cluster() == cluster && is_there(dag_id(dag)));''')
# fass
F='fass/src/'
sub(F+'draft/mod.rs','pub(crate) mod flaw;\n','pub(crate) mod flaw;\npub(crate) mod modes;\n')
sub(F+'draft/mod.rs','''    /// What makes that which serves requests,''','''    /// The modes that it is in, and those that its subtasks may enter.
    pub(crate) modes: Vec<modes::Modes>,
    /// What the commit does with these.
    pub(crate) hooks: Option<&'static modes::Hooks>,
    /// What makes that which serves requests,''')
sub(F+'draft/modes.rs','''/// Something that is wrong with modes.
''','''/// What a commit does where there are modes.
pub(crate) struct Hooks {
    /// Returns all that is wrong with them.
    pub(crate) check: fn(&Drafts) -> Vec<ModeFault>,
    /// Bounds the response times in each of them.
    pub(crate) longest: fn(&TaskSet, &Settings, &Drafts) -> Vec<Option<DagBound>>,
}

/// Something that is wrong with modes.
''')
sub(F+'draft/modes.rs','type Drafts = ','pub(crate) type Drafts = ')
sub(F+'draft/modes.rs','''pub(crate) struct ModeDraft {
    pub(crate) name: String,
    pub(crate) dags: Vec<Named>,
}

/// A DAG that a mode names.
pub(crate) struct Named {
    pub(crate) draft: Weak<RefCell<Draft>>,
}
''','''pub(crate) struct ModeDraft {
    pub(crate) name: String,
    /// A draft names its modes, too.
    pub(crate) dags: Vec<Weak<RefCell<Draft>>>,
}
''')
s=open(F+'draft/modes.rs').read()
s=s.replace('named: &Named','named: &Weak<RefCell<Draft>>').replace('named.draft.as_ptr()','named.as_ptr()').replace('named.draft.upgrade()','named.upgrade()')
s=s.replace('use sched_dag::DagId;','use sched_dag::analysis::{DagBound, Settings};\nuse sched_dag::{DagId, TaskSet};')
open(F+'draft/modes.rs','w').write(s)
sub(F+'api/mod.rs','pub(crate) mod lifecycle;\n','pub(crate) mod lifecycle;\npub(crate) mod modes;\n')
sub(F+'lib.rs','pub use api::replaceable::Replaceable;\n','pub use api::modes::{Entering, Entrance, Mode, Modes};\npub use api::replaceable::Replaceable;\n')
sub(F+'lib.rs','pub use draft::attributes::SubtaskAttributes;\n','pub use draft::attributes::SubtaskAttributes;\npub use draft::modes::ModeFault;\n')
Q=F+'run/request.rs'
sub(Q,'''/// No wish.
const NOTHING: u8 = 0;
/// The wish that a DAG is paused, or the run ends.
pub(crate) const STOP: u8 = 1;
/// The wish that a DAG is resumed.
pub(crate) const GO: u8 = 2;
''','''/// No wish.
const NOTHING: u8 = 0;
/// The wish that a DAG is paused, that the run ends, or that a mode is entered at once.
pub(crate) const STOP: u8 = 1;
/// The wish that a DAG is resumed, or that a mode is entered when what leaves is idle.
pub(crate) const GO: u8 = 2;
''')
sub(Q,'''/// What an instance may ask for.
pub(crate) struct Asked {
    wish: Wish,
    /// The DAG that is meant; `None`: the run.
    target: Option<Arc<Target>>,
}

impl Asked {
    pub(crate) const fn new(wish: Wish, target: Option<Arc<Target>>) -> Self {
        Self { wish, target }
    }
}''','''/// What a wish is about.
pub(crate) enum Of {
    Run,
    Dag(Arc<Target>),
    Mode(ModeId),
}

/// What an instance may ask for.
pub(crate) struct Asked {
    wish: Wish,
    of: Of,
}

impl Asked {
    pub(crate) const fn new(wish: Wish, of: Of) -> Self {
        Self { wish, of }
    }
}''')
sub(Q,'''        ask(match &self.target {
            None => Request::ShutDown,
            Some(target) if wish == STOP => Request::Pause(target.dag()),
            Some(target) => Request::Resume(target.dag()),
        });''','''        ask(match &self.of {
            Of::Run => Request::ShutDown,
            Of::Dag(target) if wish == STOP => Request::Pause(target.dag()),
            Of::Dag(target) => Request::Resume(target.dag()),
            Of::Mode(mode) if wish == STOP => Request::Enter(*mode, Entry::AtOnce),
            Of::Mode(mode) => Request::Enter(*mode, Entry::WhenIdle),
        });''')
sub(Q,'use sched_dag::lifecycle::Request;','use sched_dag::ModeId;\nuse sched_dag::lifecycle::{Entry, Request};')
P=F+'api/lifecycle.rs'
sub(P,'use crate::run::request::{Asked, GO, STOP, Wish, wish};','use crate::draft::modes::dags_of_modes;\nuse crate::run::request::{Asked, GO, Of, STOP, Wish, wish};')
sub(P,'''fn lifecycle(dags: &[Rc''','''pub(super) fn lifecycle(dags: &[Rc''')
sub(P,'''    Box::new(Changes::new(count, may_shut_down).with_paused(paused))''','''    let changes = Changes::new(count, may_shut_down).with_paused(paused);
    Box::new(changes.with_modes(dags_of_modes(dags)))''')
sub(P,'ask(&mut draft, subtask, Some(self.target))','ask(&mut draft, subtask, Of::Dag(self.target))')
sub(P,'ask(&mut draft, subtask, None)','ask(&mut draft, subtask, Of::Run)')
sub(P,'''fn ask(draft: &mut Draft, subtask: usize, target: Option<Arc<Target>>) -> Wish {''','''pub(super) fn ask(draft: &mut Draft, subtask: usize, of: Of) -> Wish {''')
sub(P,'Asked::new(Arc::clone(&wish), target)','Asked::new(Arc::clone(&wish), of)')
U=F+'api/uses.rs'
sub(U,'''//! | [`shutting_down`](crate::shutting_down)''','''//! | [`Mode::entering`](crate::Mode::entering) | `Entrance` | modes (M1 to M7) |
//! | [`shutting_down`](crate::shutting_down)''')
sub(U,'`dag.switching()`, `shutting_down()`','`dag.switching()`, `mode.entering()`, `shutting_down()`')
sub(U,'it may [pause](crate::Switch), the','it may [pause](crate::Switch), a [mode](crate::Modes) that it may enter, the')
X=F+'commit/fault.rs'
sub(X,'''    /// A subtask has a function for after a fault, and a fault ends its DAG.''','''    /// Something is wrong with the modes.
    Modes(ModeFault),
    /// A subtask has a function for after a fault, and a fault ends its DAG.''')
sub(X,'''            Self::ReplacedInVain { .. } => "replaced_in_vain",''','''            Self::Modes(fault) => fault.code(),
            Self::ReplacedInVain { .. } => "replaced_in_vain",''')
sub(X,'''            Self::ReplacedInVain { dag, subtask } => write!(''','''            Self::Modes(fault) => fault.fmt(f),
            Self::ReplacedInVain { dag, subtask } => write!(''')
sub(X,'use crate::draft::flaw::Flaw;\n','use crate::draft::flaw::Flaw;\nuse crate::draft::modes::ModeFault;\n')
K=F+'commit/mod.rs'
sub(K,'''    let answers = Answers::new(&task_set, platform);
''','''    let answers = Answers::new(&task_set, platform, modes::longest(dags));
''')
sub(K,'mod missing;\n','mod missing;\nmod modes;\n')
sub(K,'''    // A commit of nothing but repeated DAGs has been told what is wrong.''','''    faults.extend(modes::faults(dags));
    // A commit of nothing but repeated DAGs has been told what is wrong.''')
sub(K,'''    let lacking = demanding.filter_map(|(_, answer)| {
        Some(''','''    // Where a DAG has modes, it is their proofs that are demanded.
    let in_no_mode = demanding.filter(|(_, answer)| answer.in_modes.is_none());
    let lacking = in_no_mode.filter_map(|(_, answer)| {
        Some(''')
open(F+'commit/modes.rs','w').write('''//! What a commit does where there are modes. Else there is no code for it.

use alloc::rc::Rc;
use alloc::vec::Vec;

use sched_dag::TaskSet;
use sched_dag::analysis::{DagBound, Settings};

use super::fault::Fault;
use crate::api::dag::Dag;
use crate::draft::modes::Hooks;

fn hooks(dags: &[Dag]) -> Option<&'static Hooks> {
    dags.iter().find_map(|dag| dag.draft.borrow().hooks)
}

/// Returns what is wrong with the modes of a commit.
pub(super) fn faults(dags: &[Dag]) -> Vec<Fault> {
    let faults = hooks(dags).map(|hooks| (hooks.check)(&drafts(dags)));
    let faults = faults.into_iter().flatten();
    faults.map(Fault::Modes).collect()
}

/// Returns what bounds the response times of DAGs in their modes, if there are modes.
pub(super) fn longest(
    dags: &[Dag],
) -> impl Fn(&TaskSet, &Settings) -> Option<Vec<Option<DagBound>>> {
    let hooks = hooks(dags);
    move |task_set, settings| Some((hooks?.longest)(task_set, settings, &drafts(dags)))
}

fn drafts(dags: &[Dag]) -> Vec<Rc<core::cell::RefCell<crate::draft::Draft>>> {
    dags.iter().map(|dag| Rc::clone(&dag.draft)).collect()
}
''')
N=F+'commit/answer/mod.rs'
sub(N,'''    /// What is known of each sink, in the order of registration.
    pub sinks''','''    /// The most time that a job takes in a mode, each of the DAG's modes by itself: as long as
    /// no mode changes, and again from the first instant after a change at which nothing is in
    /// flight. `None` if the commit has no [modes](crate::Modes), or in one of them no test gives
    /// a bound. (The verdict is of all DAGs together, and holds while modes change, too.)
    pub in_modes: Option<Duration>,
    /// What is known of each sink, in the order of registration.
    pub sinks''')
sub(N,'''    pub(crate) fn new(task_set: &TaskSet, platform: &dyn Platform) -> Self {''','''    pub(crate) fn new(
        task_set: &TaskSet,
        platform: &dyn Platform,
        longest_in_modes: impl Fn(&TaskSet, &Settings) -> Option<Vec<Option<DagBound>>>,
    ) -> Self {''')
sub(N,'''        let answer = analysis::answer(task_set, &settings);
''','''        let answer = analysis::answer(task_set, &settings);
        let in_modes = longest_in_modes(task_set, &settings).unwrap_or_default();
''')
sub(N,'''                sinks: sinks(task_set''','''                in_modes: (in_modes.get(dag.index()).copied().flatten())
                    .map(|bound| Duration::from_nanos(bound.bound_ns)),
                sinks: sinks(task_set''')
sub(N,'''            let certain = unproven.is_certain();
            certain.then''','''            let certain = unproven.is_certain() && answer.in_modes.is_none();
            certain.then''')
sub(N,'use sched_dag::analysis::{self, Reason, Settings, TaskError, Test};','use sched_dag::analysis::{self, DagBound, Reason, Settings, TaskError, Test};')
TT=F+'commit/answer/text.rs'
sub(TT,'''        if let Some(placement) = &self.cluster {''','''        if let Some(bound) = self.in_modes {
            write!(f, "; while no mode changes it takes at most {bound:?}")?;
        }
        if let Some(placement) = &self.cluster {''')
V='fass/virtual-time/src/'
sub(V+'session/runner.rs','''    fn aborted(&mut self, dag: DagId, job: u64) {''','''    fn entered(&mut self, mode: ModeId) {
        self.recording.journal.entered(mode);
    }

    fn aborted(&mut self, dag: DagId, job: u64) {''')
sub(V+'session/runner.rs','use sched_dag::{CoreId, DagId, Instance, JobOutcome, Observer, TaskSet};','use sched_dag::{CoreId, DagId, Instance, JobOutcome, ModeId, Observer, TaskSet};')
sub(V+'report.rs','''            None if what.is_of_dag() =>''','''            None if *what == What::Entered => return format!("{time_ns} entered mode {job}"),
            None if what.is_of_dag() =>''')
E='kernel/executive/src/run/execution/watcher.rs'
sub(E,'''    fn deadline_missed(&mut self, dag: DagId, job: u64, _: u64) {''','''    fn entered(&mut self, mode: ModeId) {
        self.of_job(What::Entered, DagId(0), mode.0.into());
    }

    fn deadline_missed(&mut self, dag: DagId, job: u64, _: u64) {''')
sub(E,'JobOutcome, Journal, Observer, TaskSet, Vertex};','JobOutcome, Journal, ModeId, Observer, TaskSet, Vertex};')
