//! One cluster in virtual time: its engine, and what its cores execute until when.

use alloc::boxed::Box;
use alloc::vec::Vec;

use super::{End, ExecutionTimes, Workload};
use crate::engine::{Body, Continuation, Engine, Port};
use crate::ids::{ClusterId, CoreId, DagId, Instance};
use crate::journal::What;
use crate::kept::Journal;
use crate::lifecycle::{Request, Requests};
use crate::placement::Next;
use crate::scheduler::{Moment, Notice, Scheduler};

/// What runs by itself.
pub(super) struct Cluster<B: Body> {
    /// Parked is a body, behind the time that its instance has left.
    pub(super) engine: Engine<B, (u64, B)>,
    /// By core, the body of its instance, and when that finishes if nothing intervenes.
    running: Box<[Option<(u64, B)>]>,
}

/// An instant in virtual time.
pub(super) struct Now<'a, W> {
    pub(super) now_ns: u64,
    pub(super) workload: &'a mut W,
    /// How long the instance that has begun last executes.
    pub(super) begun_ns: Result<u64, End>,
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

    fn start(&mut self, _: CoreId, body: &mut B) -> u64 {
        let execution_ns = self.workload.execute(body, self.now_ns);
        self.begun_ns = execution_ns.ok_or(End::Stopped);
        self.now_ns
    }

    /// All requests of an instant are served after all its completions.
    fn forward(&mut self, request: Request) -> bool {
        let is_asked = request != Request::Step;
        if is_asked {
            self.workload.request(request, self.now_ns);
        }
        is_asked
    }

    fn hear(&mut self, notice: &Notice) {
        self.workload.hear(notice);
    }
}

impl<B: Body> Cluster<B> {
    pub(super) fn new(
        scheduler: Scheduler,
        cluster: ClusterId,
        after_fault: Vec<Option<DagId>>,
    ) -> Self {
        type Any<'a> = Now<'a, ExecutionTimes<fn(Instance) -> u64>>;
        let cores = scheduler.options().cores;
        let (journal, none) = (Journal::none(), Requests::new(0, None));
        Self {
            engine: Engine::new::<Any<'_>>(cluster, scheduler, journal, none, after_fault),
            running: (0..cores).map(|_| None).collect(),
        }
    }

    pub(super) fn next_finish_ns(&self) -> Option<u64> {
        let running = self.running.iter().flatten();
        running.map(|(finish_ns, _)| *finish_ns).min()
    }

    /// Takes what finishes by now from the first core that has such a thing.
    pub(super) fn take_finished(&mut self, now_ns: u64) -> Option<(CoreId, B)> {
        let mut cores = (0..).map(CoreId).zip(&mut self.running);
        cores.find_map(|(core, running)| {
            let (_, body) = running.take_if(|(finish_ns, _)| *finish_ns <= now_ns)?;
            Some((core, body))
        })
    }

    /// Makes a change at an instant, which stays open.
    pub(super) fn tell(
        &mut self,
        now: &mut Now<'_, impl Workload<B>>,
        change: impl FnOnce(&mut Moment<'_>),
    ) {
        let here = self.engine.scheduler.log.here;
        self.engine.tell((now.now_ns, here), now, change);
    }

    /// Completes what has finished on a core, and reports whether that is all of the instant.
    pub(super) fn complete(
        &mut self,
        core: CoreId,
        body: B,
        is_alone: bool,
        now: &mut Now<'_, impl Workload<B>>,
    ) -> Result<bool, End> {
        let (engine, now_ns) = (&mut self.engine, now.now_ns);
        let instance = body.subject().instance();
        let vertex = engine.task_set.vertex(instance);
        let done = engine.complete((core, vertex), body, now_ns, is_alone, now);
        now.workload.ended(instance, None);
        match done {
            Continuation::Run(body) => self.run(core, body, now_ns, now.begun_ns)?,
            Continuation::Look { .. } => self.go_on(core, now)?,
            Continuation::Step(ended) => {
                if let Some(instance) = ended {
                    engine.tell((now_ns, core), now, |moment| moment.complete(instance));
                }
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Ends what has failed on a core.
    pub(super) fn fail(&mut self, core: CoreId, body: B, now: &mut Now<'_, impl Workload<B>>) {
        let instance = body.subject().instance();
        if let Some(vertex) = self.engine.placement.lose(core.index()) {
            let body = Some(body).filter(|_| now.workload.is_replaceable(instance));
            let cost = (self.engine).tell_fault((now.now_ns, core), vertex, body, now);
            now.workload.ended(instance, Some(cost));
        }
    }

    /// Ends the instant, and has its cores follow.
    pub(super) fn decide(&mut self, now: &mut Now<'_, impl Workload<B>>) -> Result<(), End> {
        let now_ns = now.now_ns;
        self.engine.decide(now_ns, now);
        for place in 0..self.engine.decisions().len() {
            let decision = self.engine.decisions()[place];
            let core = decision.core;
            if decision.what == What::Suspend {
                if let Some((finish_ns, body)) = self.running[core.index()].take() {
                    let parked = (finish_ns - now_ns, body);
                    self.engine.suspend(core, now_ns, parked);
                }
            } else {
                self.go_on(core, now)?;
            }
        }
        Ok(())
    }

    /// Has a core without an instance begin or continue what it should.
    fn go_on(&mut self, core: CoreId, now: &mut Now<'_, impl Workload<B>>) -> Result<(), End> {
        let (engine, now_ns) = (&mut self.engine, now.now_ns);
        match engine.next(core, now) {
            Next::Nothing => Ok(()),
            Next::Start(_, body) => self.run(core, body, now_ns, now.begun_ns),
            Next::Continue((left_ns, body)) => {
                let vertex = engine.task_set.vertex(body.subject().instance());
                engine.note(What::Resume, core, vertex, now_ns);
                self.run(core, body, now_ns, Ok(left_ns))
            }
        }
    }

    fn run(
        &mut self,
        core: CoreId,
        body: B,
        now_ns: u64,
        left_ns: Result<u64, End>,
    ) -> Result<(), End> {
        let finish_ns = now_ns.checked_add(left_ns?);
        let finish_ns = finish_ns.ok_or(End::TimeOverflow(body.subject().instance()))?;
        self.running[core.index()] = Some((finish_ns, body));
        Ok(())
    }
}
