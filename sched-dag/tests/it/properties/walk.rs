//! A driver that does at each instant what it is told to, and whether the scheduler keeps the rules.
//!
//! Here happens what a driver in virtual time does not meet: several dispatches at one time, a
//! driver that comes late, ends of instances that have lost their core meanwhile, ends of several in
//! any order, faults, ends, pauses and closings at any time, answers to waits, in time or not. The
//! journal is judged by the law ([`Walk::judged`]); what that does not judge, by [`Releases`] and,
//! of waits, by [`Waits`], after each instant; and which instances run, by [`Eligible`].
//!
//! Each end that is the last thing of an instant is told by [`Scheduler::pass_on`], or
//! [`Scheduler::wait_shortly`], and the long way by a copy, too: both have to come to the same. So
//! have [`Scheduler::wake_shortly`] and a dispatch.

use std::collections::{BTreeSet, HashSet};
use std::hash::{DefaultHasher, Hash, Hasher};

use sched_dag::journal::EventKind;
use sched_dag::law::sweep::DispatchState;
use sched_dag::law::{
    JobRecord, JudgeOptions, RunRecord, Violation, dispatch_violations, violations,
};
use sched_dag::lifecycle::Request;
use sched_dag::{
    CoreId, DagId, DagPhase, Decision, HandOff, Instance, JobOutcome, Journal, Scheduler, TurnEnd,
};

use super::releases::{Releases, SAID};
use super::tables::{Eligible, cores_of, keeps_its_core};
use super::waits::Waits;
use crate::support::pass_on;
use crate::support::set::Set;

/// A step at an instant before its releases.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Step {
    /// It ends a turn: it waits, as often as its subtask states, and then completes.
    Complete(Instance),
    Fail(Instance),
    /// It fails, and another function is there.
    Replace(Instance),
    Ask(Request),
}

/// A run that has come so far.
#[derive(Clone)]
pub(crate) struct Walk<'s> {
    pub(crate) set: &'s Set,
    pub(crate) scheduler: Scheduler,
    pub(crate) now_ns: u64,
    /// The instance that each core executes.
    cores: Vec<Option<Instance>>,
    /// Instances that have lost their core.
    preempted: Vec<Instance>,
    /// The idle cores; the last one has to be taken first.
    idle: Vec<CoreId>,
    releases: Vec<Releases>,
    pub(crate) waits: Waits,
    eligible: Eligible,
    /// Whether it has come later than it should, or an end after a core was lost.
    is_late: bool,
}

impl<'s> Walk<'s> {
    pub(crate) fn new(set: &'s Set) -> Self {
        let mut scheduler = Scheduler::new(set.commit(), set.options);
        scheduler.log.journal = Journal::growing();
        scheduler.hear(SAID.into_iter().chain([EventKind::Cancelled]));
        let cores = set.options.cores;
        Self {
            set,
            scheduler,
            now_ns: 0,
            cores: vec![None; cores as usize],
            preempted: Vec::new(),
            idle: (0..cores).rev().map(CoreId).collect(),
            releases: set.specs.iter().map(Releases::new).collect(),
            waits: Waits::default(),
            eligible: Eligible::new(set),
            is_late: false,
        }
    }

    pub(crate) fn running(&self) -> impl Iterator<Item = Instance> {
        self.cores.iter().flatten().copied()
    }

    /// Returns what has started and not ended.
    pub(crate) fn started(&self) -> Vec<Instance> {
        self.running()
            .chain(self.preempted.iter().copied())
            .collect()
    }

    /// Reports whether nothing happens any more of itself, and no job is in flight.
    pub(crate) fn is_over(&self) -> bool {
        let mut dags = (0..).map(DagId).take(self.releases.len());
        let is_idle = dags.all(|dag| self.scheduler.in_flight(dag) == 0);
        is_idle && self.scheduler.next_event_ns().is_none()
    }

    pub(crate) fn is_paused(&self, dag: DagId) -> bool {
        self.scheduler.phase(dag) == DagPhase::Paused
    }

    /// Returns a hash of all that what follows depends on.
    pub(crate) fn hash(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        self.scheduler.hash(&mut hasher);
        (&self.releases, &self.cores, &self.preempted).hash(&mut hasher);
        self.waits.hash(&mut hasher);
        hasher.finish()
    }

    /// Goes through an instant.
    pub(crate) fn instant(&mut self, now_ns: u64, steps: &[Step]) -> Result<(), String> {
        let due_ns = self.scheduler.next_event_ns();
        self.is_late |= due_ns.is_some_and(|due_ns| due_ns < now_ns);
        self.now_ns = now_ns;
        let mut decisions = None;
        for (number, &step) in (1..).zip(steps) {
            match step {
                Step::Complete(instance) if number == steps.len() => {
                    decisions = Some(self.pass_on(instance)?);
                }
                step => self.take(step),
            }
            self.hear(decisions.is_some())?;
        }
        let decisions = match decisions {
            Some(decisions) => decisions,
            None => self.end()?,
        };
        self.hear(true)?;
        let kept = (0..).map(CoreId).zip(&self.cores);
        let kept = kept.filter_map(|(core, running)| Some(((*running)?, core)));
        let kept = kept
            .filter(|(of, _)| keeps_its_core(self.set, *of))
            .collect();
        self.carry_out(&decisions)?;
        self.eligible.read(self.scheduler.log.journal.events());
        let task_set = self.scheduler.task_set();
        let expected = self.eligible.should_run(self.set, task_set, &kept);
        if self.running().collect::<BTreeSet<_>>() != expected {
            return Err(format!("{:?} run, not {expected:?}", self.cores));
        }
        for (core, running) in (0..).map(CoreId).zip(&self.cores) {
            if self.scheduler.running(core) != *running {
                return Err(format!("{core:?} should run {running:?}"));
            }
        }
        for (id, dag) in (0..).map(DagId).zip(self.scheduler.task_set().dags()) {
            let suspended = self.preempted.iter().filter(|of| of.dag == id).count();
            if suspended > dag.most_suspended() {
                return Err(format!("{suspended} instances of {id:?} are suspended"));
            }
        }
        let is_cut = |it: Instance| self.releases[it.dag.index()].is_cut(it.job);
        if let Some(instance) = self.waits.overdue(now_ns, is_cut) {
            return Err(format!("{instance:?} still waits"));
        }
        let next_ns = self.scheduler.next_event_ns();
        if next_ns.is_some_and(|next_ns| next_ns <= now_ns) {
            return Err(format!("the instant is over before {next_ns:?}"));
        }
        let dags = (0..).map(DagId).zip(&self.set.specs).zip(&self.releases);
        let mut differences = dags
            .filter_map(|((id, spec), releases)| releases.difference(id, &self.scheduler, spec));
        differences.next().map_or(Ok(()), Err)
    }

    fn take(&mut self, step: Step) {
        let (specs, releases) = (&self.set.specs, &mut self.releases);
        match step {
            Step::Complete(_) => {}
            Step::Fail(Instance { dag, job, .. }) | Step::Replace(Instance { dag, job, .. }) => {
                let is_replaceable = matches!(step, Step::Replace(_));
                releases[dag.index()].fault(&specs[dag.index()], job, is_replaceable);
            }
            Step::Ask(request) => {
                let (dag, answer) = match request {
                    Request::Pause(dag) => (dag, EventKind::Off),
                    Request::Resume(dag) => (dag, EventKind::On),
                    Request::Close(dag) => (dag, EventKind::Closed),
                    Request::End(dag) => (dag, EventKind::DagEnded),
                    Request::Signal(dag) => (dag, EventKind::Signalled),
                    Request::Answer(wait) => {
                        self.waits.answer(wait);
                        self.scheduler.at(self.now_ns).serve(request);
                        return;
                    }
                    _ => unreachable!("it is not asked of a scheduler"),
                };
                releases[dag.index()].ask(answer);
            }
        }
        if let Step::Complete(instance) | Step::Fail(instance) | Step::Replace(instance) = step {
            self.scheduler.log.here = self.leave(instance);
        }
        let limit_ns = match step {
            Step::Complete(instance) => self.waits.begin(self.set, instance, self.now_ns),
            _ => None,
        };
        let mut moment = self.scheduler.at(self.now_ns);
        match step {
            Step::Complete(instance) => moment.end_turn(TurnEnd { instance, limit_ns }),
            Step::Fail(instance) => moment.fail(instance),
            Step::Replace(instance) => moment.fail_replaceable(instance),
            Step::Ask(request) => moment.serve(request),
        }
    }

    /// Takes an instance from its core, or from what has lost its core. Returns the core.
    fn leave(&mut self, instance: Instance) -> CoreId {
        let mut cores = (0..).map(CoreId).zip(&mut self.cores);
        let core = cores.find(|(_, runs)| **runs == Some(instance));
        let Some((core, runs)) = core else {
            self.is_late = true;
            self.preempted.retain(|preempted| *preempted != instance);
            return CoreId(cores_of(self.set, instance)[0]);
        };
        *runs = None;
        self.idle.push(core);
        core
    }

    /// Ends a turn of an instance, and the instant, by the short way; and, on copies, by the long
    /// one, and by the short one of a core that does not run it any more.
    fn pass_on(&mut self, instance: Instance) -> Result<Vec<Decision>, String> {
        let core = self.leave(instance);
        let limit_ns = self.waits.begin(self.set, instance, self.now_ns);
        let turn = TurnEnd { instance, limit_ns };
        let mut long = self.scheduler.clone();
        long.log.here = core;
        long.at(self.now_ns).end_turn(turn);
        let expected = long.at(self.now_ns).dispatch().to_vec();
        let mut elsewhere = self.scheduler.clone();
        let other = CoreId(instance.subtask.0 % self.set.options.cores);
        if end_shortly(&mut elsewhere, self.now_ns, other, turn).is_none() {
            let _ = elsewhere.at(self.now_ns).dispatch();
        }
        let decisions = match end_shortly(&mut self.scheduler, self.now_ns, core, turn) {
            Some((decisions, goes_on)) => {
                if goes_on {
                    let now_ns = (self.now_ns, false);
                    self.waits.takes(EventKind::Wake, instance, now_ns, false);
                }
                decisions
            }
            None => {
                self.hear(false)?;
                self.scheduler.at(self.now_ns).dispatch().to_vec()
            }
        };
        if seen(&elsewhere) != seen(&long) || seen(&self.scheduler) != seen(&long) {
            return Err(format!("the short way of {instance:?} is not the long one"));
        }
        match decisions == expected {
            true => Ok(decisions),
            false => Err(format!(
                "the short way comes to {decisions:?}, not {expected:?}"
            )),
        }
    }

    /// Ends the instant, and, on a copy, by the short way of a wait whose limit has come.
    fn end(&mut self) -> Result<Vec<Decision>, String> {
        let (now_ns, mut shortly) = (self.now_ns, self.scheduler.clone());
        let woken = shortly.wake_shortly(now_ns, shortly.log.here);
        let found = match woken {
            Some((core, vertex)) => {
                let instance = shortly.instance_of(vertex);
                vec![Decision::new(EventKind::Resume, core, instance)]
            }
            None => shortly.at(now_ns).dispatch().to_vec(),
        };
        let decisions = self.scheduler.at(now_ns).dispatch().to_vec();
        match found == decisions && seen(&shortly) == seen(&self.scheduler) {
            true => Ok(decisions),
            false => Err(format!("the short way wakes {found:?}, not {decisions:?}")),
        }
    }

    /// Hands what the scheduler tells to the judges of releases and of waits; `is_end`: the instant
    /// ends.
    fn hear(&mut self, is_end: bool) -> Result<(), String> {
        let mut notices = Vec::new();
        self.scheduler.log.exchange_notices(&mut notices);
        for notice in &notices {
            let dag = notice.event.dag.index();
            let is_right = match notice.event.instance() {
                Some(instance) if notice.event.what != EventKind::Restarted => {
                    let is_cut = self.releases[dag].is_cut(instance.job);
                    let now_ns = (self.now_ns, is_end);
                    self.waits
                        .takes(notice.event.what, instance, now_ns, is_cut)
                }
                _ => self.releases[dag].takes(&self.set.specs[dag], notice, self.now_ns),
            };
            if !is_right {
                return Err(format!("no rule allows {notice:?}"));
            }
        }
        Ok(())
    }

    /// Lets the cores do what was decided, on the cores that the docs state.
    fn carry_out(&mut self, decisions: &[Decision]) -> Result<(), String> {
        let mut freed = None;
        for &decision in decisions {
            let (core, instance) = (decision.core, decision.instance);
            let place = &mut self.cores[core.index()];
            let (what, is_right) = match decision.what {
                EventKind::Suspend => {
                    freed = Some(core);
                    self.preempted.push(instance);
                    (EventKind::Suspend, place.take() == Some(instance))
                }
                _ => {
                    let may_be = cores_of(self.set, instance);
                    // The last one that is idle of those that it may be on.
                    let mut idle = self.idle.iter();
                    let at = idle.rposition(|idle| may_be.contains(&idle.0));
                    let free = match freed.take() {
                        Some(freed) => Some(freed),
                        None => at.map(|at| self.idle.remove(at)),
                    };
                    let is_free = free == Some(core) && may_be.contains(&core.0);
                    let is_free = is_free && place.replace(instance).is_none();
                    let known = self.preempted.iter().position(|it| *it == instance);
                    let is_known = match known {
                        Some(at) => self.preempted.remove(at) == instance,
                        None => self.waits.go_on(instance),
                    };
                    let is_cut = self.releases[instance.dag.index()].is_cut(instance.job);
                    let what = match is_known {
                        true => EventKind::Resume,
                        false => EventKind::Start,
                    };
                    let is_right = decision.what == what && (is_known || !is_cut);
                    (what, is_free && is_right)
                }
            };
            if !is_right {
                return Err(format!("{decision:?} of {decisions:?}"));
            }
            (self.scheduler.log).on_core(core, what, self.now_ns, instance);
        }
        Ok(())
    }

    /// Returns what the law finds in all that has happened.
    pub(crate) fn judged(&self, is_complete: bool) -> Result<(), String> {
        let terms = JudgeOptions {
            is_complete,
            ..JudgeOptions::EXACT
        };
        let task_set = self.scheduler.task_set();
        let events = || self.scheduler.log.journal.events();
        let mut found = violations(task_set, terms, events());
        found.extend(dispatch_violations(
            task_set,
            &self.set.options,
            terms,
            events(),
        ));
        found.retain(|it| !(self.is_late && is_of_lateness(it)));
        match &found[..] {
            [] if is_complete && !self.is_late => self.counted_misses(),
            [] => Ok(()),
            [first, ..] => Err(format!("the law finds: {first}")),
        }
    }

    /// R4: holds the misses that are counted of each sink against the times of a punctual run. Those
    /// of jobs that were not released are in no record.
    fn counted_misses(&self) -> Result<(), String> {
        let task_set = self.scheduler.task_set();
        let events = self.scheduler.log.journal.events();
        // A call for the instant of an abort may tell of the finish after it.
        let (mut aborted, mut late_ends) = (HashSet::new(), HashSet::new());
        for event in self.scheduler.log.journal.events() {
            let of = (event.dag, event.job);
            match (event.what, event.instance()) {
                (EventKind::Aborted, _) => _ = aborted.insert(of),
                (EventKind::Finish, Some(end)) if aborted.contains(&of) => {
                    _ = late_ends.insert(end)
                }
                _ => {}
            }
        }
        let record = RunRecord::of_events(task_set, true, events).expect("it is short");
        for (dag, model) in (0..).map(DagId).zip(task_set.dags()) {
            let statistics = self.scheduler.statistics(dag);
            if statistics.skips + statistics.dropped > 0 {
                continue;
            }
            for &sink in model.sinks() {
                let relative_ns = model.subtask(sink).relative_deadline_ns();
                let is_late = |&(number, job): &(u64, &JobRecord)| {
                    let instance = Instance::new(dag, number, sink);
                    let finish_ns = record.instances(dag, number)[sink.index()].finish_ns;
                    let is_late_end = u64::from(late_ends.contains(&instance));
                    let finish_ns = finish_ns.map(|ns| ns + is_late_end);
                    // What is aborted at its deadline has missed it.
                    let is_aborted = job.outcome == Some(JobOutcome::Aborted);
                    let cut_ns = job.cut_ns.map(|ns| ns + u64::from(is_aborted));
                    let is_late = |release_ns: u64| {
                        let is_after = |ns: u64| ns > release_ns + relative_ns;
                        finish_ns.is_none_or(is_after) && cut_ns.is_none_or(is_after)
                    };
                    job.release_ns.is_some_and(is_late)
                };
                let late = record.numbered(dag).filter(is_late).count() as u64;
                let counted = self.scheduler.sink_misses(dag, sink);
                if late != counted {
                    return Err(format!(
                        "{sink:?} of {dag:?} was late {late} times, not {counted}"
                    ));
                }
            }
        }
        Ok(())
    }
}

/// Reports whether that is right if a driver comes late, or ends what has lost its core.
fn is_of_lateness(violation: &Violation) -> bool {
    match violation {
        Violation::Unpunctual { .. }
        | Violation::StillQueued { .. }
        | Violation::MissedLate { .. }
        | Violation::WaitBeyondLimit { .. } => true,
        Violation::OutOfTurn { event, stage } => {
            matches!(event.what, EventKind::Finish | EventKind::Wait)
                && *stage == DispatchState::Suspended
        }
        _ => false,
    }
}

/// Ends a turn by the short way, and the instant if that is all of it. Reports also whether the core
/// goes on with the instance after a wait of which the scheduler has written nothing down.
fn end_shortly(
    scheduler: &mut Scheduler,
    now_ns: u64,
    core: CoreId,
    turn: TurnEnd,
) -> Option<(Vec<Decision>, bool)> {
    let vertex = scheduler.vertex(turn.instance);
    let done = match turn.limit_ns {
        None => pass_on(scheduler, now_ns, core, vertex),
        Some(limit_ns) => match scheduler.wait_shortly(now_ns, core, vertex, limit_ns) {
            Some(done) => done,
            None => {
                scheduler.log.here = core;
                scheduler.at(now_ns).end_turn(turn);
                HandOff::Open
            }
        },
    };
    match done {
        HandOff::To(next, decision) => {
            assert_eq!(scheduler.vertex(decision.instance), next);
            let goes_on = next == vertex && turn.limit_ns.is_some();
            for what in [EventKind::Wait, EventKind::Wake] {
                if goes_on {
                    let log = &mut scheduler.log;
                    log.on_core(core, what, now_ns, turn.instance);
                }
            }
            Some((vec![decision], goes_on))
        }
        HandOff::Idle => Some((Vec::new(), false)),
        HandOff::Open => None,
    }
}

/// Returns all that a driver sees of a scheduler.
fn seen(of: &Scheduler) -> String {
    let cores = (0..of.options().cores).map(|core| of.running(CoreId(core)));
    let dags = (0..).map(DagId).take(of.task_set().dags().len());
    let dags: Vec<_> = dags.map(|dag| of.snapshot(dag)).collect();
    format!(
        "{:?} {dags:?} {:?}",
        cores.collect::<Vec<_>>(),
        of.next_event_ns()
    )
}
