//! One cluster in virtual time: its engine, and when what its cores execute finishes.

use alloc::sync::Arc;

use super::Workload;
use crate::engine::{Body, Continuation, Engine, Port};
use crate::ids::{ClusterId, CoreId, DagId, Instance, SubtaskId};
use crate::journal::{Subject, What};
use crate::kept::Journal;
use crate::lifecycle::{Request, Requests};
use crate::placement::Next;
use crate::scheduler::heap::IndexedHeap;
use crate::scheduler::{Decision, Moment, Notice, Scheduler};
use crate::task_set::TaskSet;

/// What runs by itself.
#[derive(Debug)]
pub(super) struct Cluster {
    pub(super) engine: Engine<Token, u64>,
    /// How many cores other clusters have before.
    pub(super) first: u32,
    /// When the instance on each busy core finishes if nothing intervenes; at
    /// one instant the core with the smaller number comes first.
    finish_times: IndexedHeap<(u64, CoreId)>,
}

/// Stands for a body, which the workload has.
#[derive(Clone, Copy, Debug)]
pub(super) struct Token(Instance);

impl Body for Token {
    type Alternate = ();

    fn set_job(&mut self, job: u64) {
        self.0.job = job;
    }
    fn subject(&self) -> Subject {
        Subject::of(self.0)
    }
    fn discard(&mut self, _: u64) {}
    fn has_effects(&self) -> bool {
        false
    }
    fn complete(&mut self, _: u64, _: &mut dyn FnMut(Request)) {}
    fn alternate(&self) -> Option<()> {
        None
    }
    fn replace(&mut self) {}
}

/// An instant in virtual time.
struct Now<'a, W> {
    now_ns: u64,
    first: u32,
    finish_times: &'a mut IndexedHeap<(u64, CoreId)>,
    workload: &'a mut W,
    /// What would finish after the last time there is.
    overflow: Option<Instance>,
}

impl<W: Workload> Now<'_, W> {
    fn run(&mut self, core: CoreId, instance: Instance, left_ns: u64) {
        match self.now_ns.checked_add(left_ns) {
            Some(finish_ns) => self.finish_times.set(core.index(), (finish_ns, core)),
            None => self.overflow = self.overflow.or(Some(instance)),
        }
    }
}

impl<W: Workload> Port<Token> for Now<'_, W> {
    const SUSPENDS_LATER: bool = false;
    const HEARS_OF_HAND_OFFS: bool = true;

    fn now_ns(&self) -> u64 {
        self.now_ns
    }

    fn start(&mut self, core: CoreId, body: &mut Token) -> u64 {
        let number = CoreId(self.first + core.0);
        self.workload.started(body.0, number, self.now_ns);
        let execution_ns = self.workload.execute(body.0, self.now_ns);
        self.run(core, body.0, execution_ns);
        self.now_ns
    }

    fn hear(&mut self, notice: &Notice) {
        self.workload.hear(notice);
    }
}

fn tokens(task_set: &TaskSet) -> impl Iterator<Item = Token> {
    (0..)
        .map(DagId)
        .take(task_set.dags().len())
        .flat_map(|dag: DagId| {
            let subtasks = (0..)
                .map(SubtaskId)
                .take(task_set.dag(dag).subtasks().len());
            let job = 0;
            subtasks.map(move |subtask| Token(Instance { dag, job, subtask }))
        })
}

impl Cluster {
    pub(super) fn new(scheduler: Scheduler, cluster: ClusterId, first: u32) -> Self {
        let cores = scheduler.options().cores as usize;
        let (none, never) = (Requests::new(0, None), alloc::vec::Vec::new());
        let journal = Journal::none();
        let mut engine = Engine::new::<Now<'_, super::ExecutionTimes<fn(Instance) -> u64>>>(
            cluster, scheduler, journal, none, never,
        );
        let task_set = Arc::clone(&engine.task_set);
        tokens(&task_set)
            .for_each(|token| engine.placement.replace(task_set.vertex(token.0), token));
        Self {
            engine,
            first,
            finish_times: IndexedHeap::new(cores),
        }
    }

    /// Has the workload hear of what it wants to.
    pub(super) fn hear<W: Workload>(&mut self) {
        self.engine.scheduler.hear(W::HEARS.iter().copied());
    }

    pub(super) const fn number(&self, core: CoreId) -> CoreId {
        CoreId(self.first + core.0)
    }

    pub(super) fn next_finish_ns(&self) -> Option<u64> {
        self.finish_times.peek().map(|((at_ns, _), _)| at_ns)
    }

    /// Takes an instance that finishes at `now_ns` from its core.
    pub(super) fn take_finished(&mut self, now_ns: u64) -> Option<(Instance, CoreId)> {
        let next = self.finish_times.peek();
        let ((_, core), index) = next.filter(|((at_ns, _), _)| *at_ns <= now_ns)?;
        self.finish_times.remove(index);
        let vertex = self.engine.placement.current(index)?;
        Some((self.engine.scheduler.instance_of(vertex), core))
    }

    /// Makes a change at an instant, which stays open.
    pub(super) fn tell(
        &mut self,
        now_ns: u64,
        core: Option<CoreId>,
        workload: &mut impl Workload,
        event: impl FnOnce(&mut Moment<'_>),
    ) {
        let here = core.unwrap_or(self.engine.scheduler.log.here);
        let (engine, mut now) = self.parts(now_ns, workload);
        engine.tell((now_ns, here), &mut now, event);
    }

    /// Puts the body of what has ended on a core to rest.
    pub(super) fn rest(&mut self, instance: Instance, core: CoreId) {
        let vertex = self.engine.task_set.vertex(instance);
        (self.engine.placement).finish(core.index(), vertex, Token(instance));
    }

    /// Ends an instance that nothing else ends with, and reports whether that is all of the instant.
    pub(super) fn complete(
        &mut self,
        now_ns: u64,
        core: CoreId,
        instance: Instance,
        workload: &mut impl Workload,
    ) -> Result<bool, Instance> {
        let vertex = self.engine.task_set.vertex(instance);
        let (engine, mut now) = self.parts(now_ns, workload);
        let done = engine.complete((core, vertex), Token(instance), now_ns, true, &mut now);
        let overflow = now.overflow;
        match done {
            Continuation::Run(_) => {
                self.close_if_void(workload);
                overflow.map_or(Ok(true), Err)
            }
            Continuation::Look { .. } => self.go_on(now_ns, core, workload).map(|()| true),
            Continuation::Step(_) => Ok(false),
        }
    }

    /// Ends the instant, and has its cores follow.
    pub(super) fn decide(
        &mut self,
        now_ns: u64,
        workload: &mut impl Workload,
    ) -> Result<(), Instance> {
        let (engine, mut now) = self.parts(now_ns, workload);
        engine.decide(now_ns, &mut now);
        for place in 0..self.engine.decisions().len() {
            let decision = self.engine.decisions()[place];
            let core = decision.core();
            let Decision::Preempt { instance, .. } = decision else {
                self.go_on(now_ns, core, workload)?;
                continue;
            };
            let finish_ns = self.finish_times.key(core.index());
            let left_ns = finish_ns.map_or(now_ns, |(at_ns, _)| at_ns) - now_ns;
            self.engine.suspend(core, now_ns, left_ns);
            workload.preempted(instance, self.number(core), now_ns);
        }
        Ok(())
    }

    /// Has a core without an instance begin or continue what it should.
    fn go_on(
        &mut self,
        now_ns: u64,
        core: CoreId,
        workload: &mut impl Workload,
    ) -> Result<(), Instance> {
        let (engine, mut now) = self.parts(now_ns, workload);
        if let Next::Continue(left_ns) = engine.next(core, &mut now)
            && let Some(vertex) = engine.placement.current(core.index())
        {
            engine.note(What::Resume, core, vertex, now_ns);
            let instance = engine.scheduler.instance_of(vertex);
            (now.workload).resumed(instance, CoreId(now.first + core.0), now_ns);
            now.run(core, instance, left_ns);
        }
        let overflow = now.overflow;
        self.close_if_void(workload);
        overflow.map_or(Ok(()), Err)
    }

    fn close_if_void(&mut self, workload: &impl Workload) {
        if workload.is_void() {
            self.engine.scheduler.log.journal.close();
        }
    }

    fn parts<'s, W: Workload>(
        &'s mut self,
        now_ns: u64,
        workload: &'s mut W,
    ) -> (&'s mut Engine<Token, u64>, Now<'s, W>) {
        let now = Now {
            now_ns,
            first: self.first,
            finish_times: &mut self.finish_times,
            workload,
            overflow: None,
        };
        (&mut self.engine, now)
    }
}
