//! A set in the real scheduler, by a driver that takes every way that the scheduler
//! offers.
//!
//! It is free to choose, and chooses at random: how an instance's completion is told
//! (as a moment, or by [`Scheduler::pass_on`]), in which order those of one instant are, and
//! whether it calls when nothing has happened. What comes of it, core numbers apart, has
//! to be the same; and the core numbers have to be those that the docs state.

use std::collections::{HashMap, VecDeque};

use sched_dag::journal::{Event, What};
use sched_dag::law::{Terms, dispatch_violations, violations};
use sched_dag::{CoreId, DagId, Decision, HandOff, Instance, Journal, Notice, Scheduler};

use crate::random::Random;
use crate::rules::{Facts, SAID, place};
use crate::set::Set;
use crate::support::{pass_on, scheduler};

/// Runs a set and returns its journal, or in what that is not as the rules say.
pub(crate) fn drive(set: &Set) -> Result<Vec<Event>, String> {
    let mut scheduler = scheduler(&set.specs(), set.options);
    scheduler.log.journal = Journal::growing();
    scheduler.hear(SAID);
    let cores = scheduler.options().cores;
    let mut driver = Driver {
        set,
        scheduler,
        facts: Facts::new(set),
        random: Random::new(set.choices),
        signals: set.signals(),
        cores: vec![None; cores as usize],
        idle: (0..cores).rev().map(CoreId).collect(),
        left_ns: HashMap::new(),
        now_ns: 0,
        passed_on: None,
    };
    driver.instant(0)?;
    while let Some(next_ns) = driver.next_ns() {
        if driver.random.chance(10) && driver.now_ns < next_ns {
            let between_ns = driver.random.between(driver.now_ns, next_ns - 1);
            driver.instant(between_ns)?;
        }
        driver.instant(next_ns)?;
        driver.compare_cores()?;
        let event_ns = driver.scheduler.next_event_ns();
        if event_ns.is_some_and(|event_ns| event_ns <= next_ns) {
            return Err(format!(
                "at {next_ns} the instant is over before {event_ns:?}"
            ));
        }
    }
    let events: Vec<Event> = driver.scheduler.log.journal.events().collect();
    let task_set = driver.scheduler.task_set();
    let mut found = violations(task_set, Terms::EXACT, events.iter().copied());
    let of_dispatch =
        dispatch_violations(task_set, &set.options, Terms::EXACT, events.iter().copied());
    found.extend(of_dispatch);
    match &found[..] {
        [] => Ok(events),
        [first, ..] => Err(format!("the law finds: {first}")),
    }
}

struct Driver<'a> {
    set: &'a Set,
    scheduler: Scheduler,
    facts: Facts<'a>,
    random: Random,
    /// The signals that are to come, with their DAGs, in order.
    signals: VecDeque<(u64, DagId)>,
    /// What each core executes, and when that ends.
    cores: Vec<Option<(Instance, u64)>>,
    /// The idle cores; the last one has to be taken first.
    idle: Vec<CoreId>,
    /// What preempted instances have left to execute.
    left_ns: HashMap<Instance, u64>,
    now_ns: u64,
    /// What has become ready by the short way, of which there is no notice.
    passed_on: Option<Notice>,
}

impl Driver<'_> {
    fn next_ns(&self) -> Option<u64> {
        let ends = self.cores.iter().flatten().map(|&(_, end_ns)| end_ns);
        let commands = self.set.dags.iter().flat_map(|dag| {
            let pauses_ns = dag.pauses_ns.iter().flat_map(|&(from, to)| [from, to]);
            pauses_ns.chain(dag.stop_ns)
        });
        let commands = commands.filter(|&at_ns| at_ns > self.now_ns);
        ends.chain(commands)
            .chain(self.scheduler.next_event_ns())
            .chain(self.next_signal_ns())
            .min()
    }

    fn next_signal_ns(&self) -> Option<u64> {
        self.signals.front().map(|&(at_ns, _)| at_ns)
    }

    fn instant(&mut self, now_ns: u64) -> Result<(), String> {
        self.facts.at(now_ns);
        self.take(now_ns)?;
        self.facts.end_instant();
        let mut notices = Vec::new();
        self.scheduler.log.exchange_notices(&mut notices);
        notices.extend(self.passed_on.take());
        let compared = self.facts.compare(&self.scheduler, &notices);
        compared.map_err(|found| format!("at {now_ns} {found}"))
    }

    fn take(&mut self, now_ns: u64) -> Result<(), String> {
        self.now_ns = now_ns;
        let mut ended = self.take_ended();
        let mut failed: Vec<_> = ended
            .extract_if(.., |&mut (_, instance)| self.set.fails(instance))
            .collect();
        failed.sort_unstable_by_key(|&(_, instance)| instance);
        let is_quiet = failed.is_empty()
            && !self.has_commands()
            && self.next_signal_ns().is_none_or(|at_ns| at_ns > now_ns);
        let last = if is_quiet { ended.pop() } else { None };
        for (core, instance) in ended {
            self.idle.push(core);
            self.scheduler.log.here = core;
            self.scheduler.at(now_ns).complete(instance);
            self.facts.complete(place(instance));
        }
        if let Some((core, instance)) = last
            && self.complete_last(core, instance)?
        {
            return Ok(());
        }
        for (core, instance) in failed {
            self.idle.push(core);
            self.scheduler.log.here = core;
            let mut moment = self.scheduler.at(now_ns);
            if self.set.is_replaceable(instance) {
                moment.fail_replaceable(instance);
                self.facts.fail_replaceable(place(instance));
            } else {
                moment.fail(instance);
                self.facts.fail(place(instance));
            }
        }
        self.command();
        let decisions = self.scheduler.at(now_ns).release_due();
        let decisions = decisions.dispatch().to_vec();
        self.carry_out(&decisions)
    }

    /// Takes what ends now from its cores, in any order.
    fn take_ended(&mut self) -> Vec<(CoreId, Instance)> {
        let mut ended = Vec::new();
        for (core, place) in (0..).map(CoreId).zip(&mut self.cores) {
            if let Some((instance, _)) = place.take_if(|(_, end_ns)| *end_ns == self.now_ns) {
                ended.insert(self.random.below(ended.len() + 1), (core, instance));
            }
        }
        ended
    }

    /// Tells that the last instance of this instant has finished, in one of the ways
    /// that there are. Reports whether that was the whole instant.
    fn complete_last(&mut self, core: CoreId, instance: Instance) -> Result<bool, String> {
        let now_ns = self.now_ns;
        self.facts.complete(place(instance));
        self.scheduler.log.here = core;
        let vertex = self.scheduler.vertex(instance);
        if self.random.between(0, 4) == 0 {
            self.scheduler.at(now_ns).complete(instance);
            self.idle.push(core);
            return Ok(false);
        }
        let (done, ready) = pass_on(&mut self.scheduler, now_ns, core, vertex);
        self.passed_on = ready;
        self.idle.push(core);
        if let HandOff::Open = done {
            return Ok(false);
        }
        if let HandOff::To(next, decision) = done {
            if self.scheduler.vertex(decision.instance()) != next {
                return Err(format!("{decision:?} is not of {next:?}"));
            }
            self.carry_out(&[decision])?;
        }
        Ok(true)
    }

    fn has_commands(&self) -> bool {
        let now_ns = self.now_ns;
        self.set.dags.iter().any(|dag| {
            let mut pauses_ns = dag.pauses_ns.iter();
            pauses_ns.any(|&(from_ns, to_ns)| from_ns == now_ns || to_ns == now_ns)
                || dag.stop_ns == Some(now_ns)
        })
    }

    /// Stops, pauses, resumes and signals DAGs.
    fn command(&mut self) {
        let now_ns = self.now_ns;
        let mut moment = self.scheduler.at(now_ns);
        for (id, dag) in (0..).map(DagId).zip(&self.set.dags) {
            if dag.stop_ns == Some(now_ns) {
                moment.stop(id);
                self.facts.stop(id.index());
            }
            for &(from_ns, to_ns) in &dag.pauses_ns {
                if from_ns == now_ns {
                    moment.pause(id);
                    self.facts.pause(id.index());
                }
                if to_ns == now_ns {
                    moment.resume(id);
                    self.facts.resume(id.index());
                }
            }
        }
        while let Some((_, dag)) = self.signals.pop_front_if(|(at_ns, _)| *at_ns <= now_ns) {
            moment.signal(dag);
            self.facts.signal(dag.index());
        }
    }

    fn carry_out(&mut self, decisions: &[Decision]) -> Result<(), String> {
        let now_ns = self.now_ns;
        let mut preempted = None;
        for &decision in decisions {
            let (core, instance) = (decision.core(), decision.instance());
            let place = &mut self.cores[core.index()];
            if let Decision::Preempt { .. } = decision {
                let Some((_, end_ns)) = place.take_if(|(running, _)| *running == instance) else {
                    return Err(format!("at {now_ns} {decision:?} and it does not run"));
                };
                self.left_ns.insert(instance, end_ns - now_ns);
                let log = &mut self.scheduler.log;
                log.on_core(core, What::Suspend, now_ns, instance);
                preempted = Some(core);
                continue;
            }
            let free = preempted.take().or_else(|| self.idle.pop());
            if free != Some(core) || place.is_some() {
                return Err(format!(
                    "at {now_ns} {decision:?} and {free:?} is to be taken"
                ));
            }
            let left_ns = self.left_ns.remove(&instance);
            let (what, left_ns) = match (decision, left_ns) {
                (Decision::Resume { .. }, Some(left_ns)) => (What::Resume, left_ns),
                (Decision::Start { .. }, None) => (What::Start, self.set.execution_ns(instance)),
                _ => return Err(format!("at {now_ns} {decision:?}, {left_ns:?} ns are left")),
            };
            (self.scheduler.log).on_core(core, what, now_ns, instance);
            *place = Some((instance, now_ns + left_ns));
        }
        Ok(())
    }

    fn compare_cores(&self) -> Result<(), String> {
        let dags = self.scheduler.task_set().dags();
        for (id, dag) in (0..).map(DagId).zip(dags) {
            let suspended = self.left_ns.keys().filter(|of| of.dag == id).count();
            if suspended > dag.most_suspended() {
                return Err(format!("{suspended} instances of {id:?} are suspended"));
            }
        }
        for (core, place) in (0..).map(CoreId).zip(&self.cores) {
            let running = self.scheduler.running(core);
            if running != place.map(|(instance, _)| instance) {
                return Err(format!("{core:?} runs {place:?}, not {running:?}"));
            }
        }
        Ok(())
    }
}
