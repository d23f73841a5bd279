//! The short ways compared with the long one, step by step.
//!
//! Two schedulers of one set are told the same, a random walk: one learns of an
//! instance's end by [`Scheduler::hand_off`] or [`Scheduler::hand_over`], the other by a
//! moment and a dispatch. Here happens what the definition has no words for, since it
//! knows no drivers: several dispatches at one time, a driver that comes late, ends of
//! instances that have lost their core meanwhile or were moved to another one. After
//! each step both have to be in the same state, core numbers apart.

use sched_dag::journal::{Event, What};
use sched_dag::{CoreId, DagId, Decision, HandOff, Instance, Journal, Scheduler};

use crate::random::Random;
use crate::set::Set;
use crate::support::scheduler;

/// Returns the first difference between the short ways and the long one.
pub(crate) fn difference(set: &Set) -> Option<String> {
    walk(set).err()
}

/// One scheduler, and what came of the present step.
struct Side {
    scheduler: Scheduler,
    decisions: Vec<Decision>,
    /// How many events of its journal were compared.
    compared: usize,
}

fn walk(set: &Set) -> Result<(), String> {
    let mut random = Random::new(set.choices);
    let side = || {
        let mut scheduler = scheduler(&set.specs(), set.options);
        // Of the short way a driver writes this itself.
        let kinds = (0..)
            .map_while(What::from_number)
            .filter(|what| *what != What::Ready);
        scheduler.hear(kinds);
        scheduler.log.journal = Journal::growing();
        Side {
            scheduler,
            decisions: Vec::new(),
            compared: 0,
        }
    };
    let (mut short, mut long) = (side(), side());
    let mut preempted: Vec<Instance> = Vec::new();
    let mut now_ns = 0;
    for step in 0..80 {
        now_ns = match random.between(0, 5) {
            0 | 1 => now_ns,
            2 | 3 => {
                (long.scheduler.next_event_ns()).map_or(now_ns, |event_ns| event_ns.max(now_ns))
            }
            4 => now_ns + random.between(1, 4),
            _ => now_ns + random.between(1, 20),
        };
        let running: Vec<_> = short.running().collect();
        let kind = random.between(0, 99);
        if kind < 60 && !running.is_empty() {
            let place = random.below(running.len());
            let (core, instance) = running[place];
            if random.chance(20) && running.len() > 1 {
                // An instant that is not over: a dispatch is owed.
                let (_, before) = running[(place + 1) % running.len()];
                for side in [&mut short, &mut long] {
                    side.scheduler.at(now_ns).complete(before);
                }
            }
            short.complete_shortly(now_ns, core, instance, &mut random);
            long.complete(now_ns, instance);
        } else if kind < 70 && !preempted.is_empty() {
            let instance = preempted.swap_remove(random.below(preempted.len()));
            let core = random.below(short.cores());
            let core = CoreId(u32::try_from(core).expect("few cores"));
            short.complete_shortly(now_ns, core, instance, &mut random);
            long.complete(now_ns, instance);
        } else {
            let dag = DagId(u32::try_from(random.below(set.dags.len())).expect("few DAGs"));
            let failing = running.iter().map(|&(_, instance)| instance).next();
            let is_sporadic = set.dags[dag.index()].signals_ns.is_some();
            for side in [&mut short, &mut long] {
                let mut moment = side.scheduler.at(now_ns);
                match (kind % 10, failing) {
                    (0, Some(instance)) if step > 20 => {
                        moment.fail_replaceable(instance);
                    }
                    (1, _) if step > 60 => moment.stop(dag),
                    (2, _) => moment.pause(dag),
                    (3 | 4, _) => moment.resume(dag),
                    (9, _) if step > 60 => moment.close(dag),
                    (5..9, _) if is_sporadic => moment.signal(dag),
                    _ => {}
                }
                side.end_instant(now_ns);
            }
        }
        for &decision in &long.decisions {
            match decision {
                Decision::Preempt { instance, .. } => preempted.push(instance),
                decision => preempted.retain(|&instance| instance != decision.instance()),
            }
        }
        compare(&mut short, &mut long, set.dags.len())
            .map_err(|what| format!("step {step} at {now_ns}: {what}"))?;
    }
    Ok(())
}

impl Side {
    fn cores(&self) -> usize {
        self.scheduler.options().cores as usize
    }

    fn running(&self) -> impl Iterator<Item = (CoreId, Instance)> {
        let cores = (0..).map(CoreId).take(self.cores());
        cores.filter_map(|core| Some((core, self.scheduler.running(core)?)))
    }

    fn end_instant(&mut self, now_ns: u64) {
        let released = self.scheduler.at(now_ns).release_due();
        self.decisions.extend_from_slice(released.dispatch());
    }

    fn complete(&mut self, now_ns: u64, instance: Instance) {
        let mut moment = self.scheduler.at(now_ns);
        moment.complete(instance);
        self.end_instant(now_ns);
    }

    fn complete_shortly(
        &mut self,
        now_ns: u64,
        mut core: CoreId,
        instance: Instance,
        random: &mut Random,
    ) {
        let vertex = self.scheduler.vertex(instance);
        if random.chance(5) {
            // It was moved, and has finished before it knew.
            core = CoreId(u32::try_from(random.below(self.cores())).expect("few cores"));
        }
        let cores = (0..).map(CoreId).take(self.cores());
        let idle: Vec<_> = cores
            .filter(|&other| other != core && self.scheduler.running(other).is_none())
            .collect();
        let scheduler = &mut self.scheduler;
        let done = if idle.is_empty() || random.chance(30) {
            let (done, is_untold) = scheduler.pass_on(now_ns, core, vertex);
            if is_untold && let HandOff::To(_, decision) = done {
                let ready_ns = scheduler.now_ns();
                let log = &mut scheduler.log;
                log.on_core(core, What::Finish, now_ns, instance);
                log.on_core(core, What::Ready, ready_ns, decision.instance());
            }
            done
        } else {
            let idle = idle[random.below(idle.len())];
            scheduler.anticipate(core);
            scheduler.hand_over(now_ns, core, vertex, idle)
        };
        match done {
            HandOff::To(_, decision) => self.decisions.push(decision),
            HandOff::Idle => {}
            HandOff::Open => self.end_instant(now_ns),
        }
    }
}

fn compare(short: &mut Side, long: &mut Side, dags: usize) -> Result<(), String> {
    let state = |side: &mut Side| {
        let kinds = side.decisions.drain(..).map(without_core);
        let decisions: Vec<_> = kinds.collect();
        let mut running: Vec<_> = side.running().map(|(_, instance)| instance).collect();
        running.sort_by_key(|instance| (instance.dag, instance.subtask));
        let events = side.scheduler.log.journal.events().skip(side.compared);
        let subject = |event: Event| (event.dag, event.job, event.subtask);
        let events = events.map(|event| (event.time_ns, event.what, subject(event)));
        let events: Vec<_> = events.collect();
        side.compared += events.len();
        let mut notices = Vec::new();
        side.scheduler.log.exchange_notices(&mut notices);
        let notices = notices.iter();
        let notices = notices.map(|told| (told.event.what, told.at_ns, told.outcome));
        let scheduler = &side.scheduler;
        let per_dag = (0..).map(DagId).take(dags).map(|dag| {
            let statistics = scheduler.statistics(dag);
            let counts = [scheduler.waiting(dag), scheduler.in_flight(dag)];
            format!("{statistics:?} {counts:?} {}", scheduler.is_over(dag))
        });
        format!(
            "{:?}\n{decisions:?}\n{running:?}\n{:?}\n{:?}",
            (events, notices.collect::<Vec<_>>()),
            scheduler.next_event_ns(),
            per_dag.collect::<Vec<_>>()
        )
    };
    let (short, long) = (state(short), state(long));
    if short == long {
        return Ok(());
    }
    Err(format!(
        "\nby the short way\n{short}\nby the long way\n{long}"
    ))
}

fn without_core(decision: Decision) -> (&'static str, Instance) {
    match decision {
        Decision::Start { instance, .. } => ("start", instance),
        Decision::Resume { instance, .. } => ("resume", instance),
        Decision::Preempt { instance, .. } => ("preempt", instance),
    }
}
