//! One cluster in virtual time: its engine, and when what its cores execute finishes.

use alloc::boxed::Box;
use alloc::vec::Vec;

use super::{End, ExecutionTimes, Workload};
use crate::engine::{Body, Continuation, Engine, Port};
use crate::ids::{ClusterId, CoreId, DagId, Instance};
use crate::journal::What;
use crate::kept::Journal;
use crate::lifecycle::{Request, Requests};
use crate::placement::Next;
use crate::scheduler::heap::IndexedHeap;
use crate::scheduler::{Decision, Moment, Notice, Scheduler};

/// What runs by itself.
pub(super) struct Cluster<B: Body> {
    /// Parked is a body with the time that its instance has left.
    pub(super) engine: Engine<B, (B, u64)>,
    /// How many cores other clusters have before.
    pub(super) first: u32,
    /// The bodies of the instances on busy cores.
    running: Box<[Option<B>]>,
    /// When the instance on each busy core finishes if nothing intervenes; at
    /// one instant the core with the smaller number comes first.
    finish_times: IndexedHeap<(u64, CoreId)>,
}

/// An instant in virtual time.
struct Now<'a, W> {
    now_ns: u64,
    finish_times: &'a mut IndexedHeap<(u64, CoreId)>,
    workload: &'a mut W,
    /// Why nothing happens any more.
    end: Option<End>,
}

impl<W> Now<'_, W> {
    fn run(&mut self, core: CoreId, instance: Instance, left_ns: u64) {
        match self.now_ns.checked_add(left_ns) {
            Some(finish_ns) => self.finish_times.set(core.index(), (finish_ns, core)),
            None => self.end = self.end.or(Some(End::TimeOverflow(instance))),
        }
    }

    fn end(&self) -> Result<(), End> {
        self.end.map_or(Ok(()), Err)
    }
}

impl<B: Body, W: Workload<B>> Port<B> for Now<'_, W> {
    const HEARS: &'static [What] = &[
        What::Released,
        What::Skipped,
        What::Stopped,
        What::Completed,
    ];
    const SUSPENDS_LATER: bool = false;

    fn now_ns(&self) -> u64 {
        self.now_ns
    }

    fn start(&mut self, core: CoreId, body: &mut B) -> u64 {
        match self.workload.execute(body, self.now_ns) {
            Some(execution_ns) => self.run(core, body.subject().instance(), execution_ns),
            None => self.end = Some(End::Stopped),
        }
        self.now_ns
    }

    /// All requests of an instant are served after all its completions.
    fn forward(&mut self, request: Request) -> bool {
        self.workload.request(request, self.now_ns);
        true
    }

    fn hear(&mut self, notice: &Notice) {
        self.workload.hear(notice);
    }
}

/// An engine, what runs by core, and the instant.
type Parts<'s, B, W> = (&'s mut Engine<B, (B, u64)>, &'s mut [Option<B>], Now<'s, W>);

impl<B: Body> Cluster<B> {
    pub(super) fn new(
        scheduler: Scheduler,
        (cluster, first): (ClusterId, u32),
        after_fault: Vec<Option<DagId>>,
    ) -> Self {
        type Any<'a> = Now<'a, ExecutionTimes<fn(Instance) -> u64>>;
        let cores = scheduler.options().cores as usize;
        let (journal, none) = (Journal::none(), Requests::new(0, None));
        let engine = Engine::new::<Any<'_>>(cluster, scheduler, journal, none, after_fault);
        Self {
            engine,
            first,
            running: (0..cores).map(|_| None).collect(),
            finish_times: IndexedHeap::new(cores),
        }
    }

    pub(super) fn next_finish_ns(&self) -> Option<u64> {
        self.finish_times.peek().map(|((at_ns, _), _)| at_ns)
    }

    /// Returns a core whose instance finishes at `now_ns`, and that; the core is free then.
    pub(super) fn take_finished(&mut self, now_ns: u64) -> Option<(CoreId, Instance)> {
        let next = self.finish_times.peek();
        let ((_, core), index) = next.filter(|((at_ns, _), _)| *at_ns <= now_ns)?;
        self.finish_times.remove(index);
        let body = self.running[index].as_ref()?;
        Some((core, body.subject().instance()))
    }

    /// Makes a change at an instant, which stays open.
    pub(super) fn tell(
        &mut self,
        now_ns: u64,
        workload: &mut impl Workload<B>,
        change: impl FnOnce(&mut Moment<'_>),
    ) {
        let (engine, _, mut now) = self.parts(now_ns, workload);
        engine.tell((now_ns, engine.scheduler.log.here), &mut now, change);
    }

    /// Completes what has finished on a core, and reports whether that is all of the instant.
    pub(super) fn complete(
        &mut self,
        now_ns: u64,
        core: CoreId,
        is_alone: bool,
        workload: &mut impl Workload<B>,
    ) -> Result<bool, End> {
        let (engine, running, mut now) = self.parts(now_ns, workload);
        let Some(body) = running[core.index()].take() else {
            return Ok(false);
        };
        let instance = body.subject().instance();
        let vertex = engine.task_set.vertex(instance);
        let done = engine.complete((core, vertex), body, now_ns, is_alone, &mut now);
        now.workload.ended(instance, None);
        match done {
            Continuation::Run(body) => {
                running[core.index()] = Some(body);
                now.end().map(|()| true)
            }
            Continuation::Look { .. } => self.go_on(now_ns, core, workload).map(|()| true),
            Continuation::Step(ended) => {
                if let Some(instance) = ended {
                    let complete = |moment: &mut Moment<'_>| moment.complete(instance);
                    engine.tell((now_ns, core), &mut now, complete);
                }
                Ok(false)
            }
        }
    }

    /// Frees a core whose instance has failed.
    pub(super) fn lose(&mut self, core: CoreId) {
        self.engine.placement.lose(core.index());
    }

    /// Ends that instance.
    pub(super) fn fail(&mut self, now_ns: u64, core: CoreId, workload: &mut impl Workload<B>) {
        let (engine, running, mut now) = self.parts(now_ns, workload);
        if let Some(body) = running[core.index()].take() {
            let instance = body.subject().instance();
            let vertex = engine.task_set.vertex(instance);
            let body = Some(body).filter(|_| now.workload.is_replaceable(instance));
            let cost = engine.tell_fault((now_ns, core), vertex, body, &mut now);
            now.workload.ended(instance, Some(cost));
        }
    }

    /// Ends the instant, and has its cores follow.
    pub(super) fn decide(
        &mut self,
        now_ns: u64,
        workload: &mut impl Workload<B>,
    ) -> Result<(), End> {
        let (engine, _, mut now) = self.parts(now_ns, workload);
        engine.decide(now_ns, &mut now);
        for place in 0..self.engine.decisions().len() {
            let decision = self.engine.decisions()[place];
            let core = decision.core();
            let Decision::Preempt { .. } = decision else {
                self.go_on(now_ns, core, workload)?;
                continue;
            };
            let finish_ns = self.finish_times.key(core.index());
            let left_ns = finish_ns.map_or(now_ns, |(at_ns, _)| at_ns) - now_ns;
            if let Some(body) = self.running[core.index()].take() {
                self.engine.suspend(core, now_ns, (body, left_ns));
            }
        }
        Ok(())
    }

    /// Has a core without an instance begin or continue what it should.
    fn go_on(
        &mut self,
        now_ns: u64,
        core: CoreId,
        workload: &mut impl Workload<B>,
    ) -> Result<(), End> {
        let (engine, running, mut now) = self.parts(now_ns, workload);
        running[core.index()] = match engine.next(core, &mut now) {
            Next::Nothing => return Ok(()),
            Next::Start(_, body) => Some(body),
            Next::Continue((body, left_ns)) => {
                let instance = body.subject().instance();
                engine.note(What::Resume, core, engine.task_set.vertex(instance), now_ns);
                now.run(core, instance, left_ns);
                Some(body)
            }
        };
        now.end()
    }

    fn parts<'s, W: Workload<B>>(
        &'s mut self,
        now_ns: u64,
        workload: &'s mut W,
    ) -> Parts<'s, B, W> {
        let now = Now {
            now_ns,
            finish_times: &mut self.finish_times,
            workload,
            end: None,
        };
        (&mut self.engine, &mut self.running, now)
    }
}
