//! The short ways compared with the long one, step by step.
//!
//! Two schedulers of one set are told the same, a random walk: one learns of an
//! instance's end by [`Scheduler::hand_off`] or [`Scheduler::hand_over`], the other by a
//! moment and a dispatch. Here happens what the definition has no words for, since it
//! knows no drivers: several dispatches at one time, a driver that comes late, ends of
//! instances that have lost their core meanwhile or were moved to another one. After
//! each step both have to be in the same state, core numbers apart.

use sched_dag::Told as _;
use sched_dag::{CoreId, DagId, Decision, HandOff, Instance, JobOutcome, Observer, Scheduler};

use crate::random::Random;
use crate::replay::scheduler;
use crate::set::Set;

/// Returns the first difference between the short ways and the long one.
pub(crate) fn difference(set: &Set) -> Option<String> {
    walk(set).err()
}

/// One scheduler, and what came of the present step.
struct Side {
    scheduler: Scheduler,
    log: Log,
    decisions: Vec<Decision>,
}

fn walk(set: &Set) -> Result<(), String> {
    let mut random = Random::new(set.choices);
    let side = || {
        scheduler(set).map(|scheduler| Side {
            scheduler,
            log: Log::default(),
            decisions: Vec::new(),
        })
    };
    let (mut short, mut long) = (side()?, side()?);
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
                    side.scheduler.told(now_ns).complete(before, &mut side.log);
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
                let mut moment = side.scheduler.told(now_ns);
                match (kind % 10, failing) {
                    (0, Some(instance)) if step > 20 => {
                        moment.fail_replaceable(instance, &mut side.log);
                    }
                    (1, _) if step > 60 => moment.stop(dag, &mut side.log),
                    (2, _) => moment.pause(dag, &mut side.log),
                    (3 | 4, _) => moment.resume(dag, &mut side.log),
                    (9, _) if step > 60 => moment.close(dag, &mut side.log),
                    (5..9, _) if is_sporadic => moment.signal(dag, &mut side.log),
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
        let released = self.scheduler.told(now_ns).release_due(&mut self.log);
        self.decisions.extend_from_slice(released.dispatch());
    }

    fn complete(&mut self, now_ns: u64, instance: Instance) {
        let mut moment = self.scheduler.told(now_ns);
        moment.complete(instance, &mut self.log);
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
        let (scheduler, log) = (&mut self.scheduler, &mut self.log);
        let done = if idle.is_empty() || random.chance(30) {
            let (done, is_untold) = scheduler.told_pass_on(now_ns, core, vertex, log);
            if is_untold && let HandOff::To(_, decision) = done {
                log.ready(decision.instance());
            }
            done
        } else {
            let idle = idle[random.below(idle.len())];
            scheduler.anticipate(core);
            scheduler.told_hand_over(now_ns, core, vertex, idle, log)
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
        let scheduler = &side.scheduler;
        let per_dag = (0..).map(DagId).take(dags).map(|dag| {
            let statistics = scheduler.statistics(dag);
            let counts = [scheduler.waiting(dag), scheduler.in_flight(dag)];
            format!("{statistics:?} {counts:?} {}", scheduler.is_over(dag))
        });
        format!(
            "{:?}\n{decisions:?}\n{running:?}\n{:?}\n{:?}",
            std::mem::take(&mut side.log.0),
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

/// All reports since the last step, in order.
#[derive(Default)]
struct Log(Vec<String>);

impl Log {
    fn note(&mut self, what: &str, dag: DagId, rest: impl std::fmt::Debug) {
        self.0.push(format!("{what} {} {rest:?}", dag.0));
    }
}

impl Observer for Log {
    fn released(&mut self, dag: DagId, job: u64, release_ns: u64) {
        self.note("released", dag, (job, release_ns));
    }

    fn queued(&mut self, dag: DagId, job: u64, release_ns: u64) {
        self.note("queued", dag, (job, release_ns));
    }

    fn skipped(&mut self, dag: DagId, job: u64, release_ns: u64) {
        self.note("skipped", dag, (job, release_ns));
    }

    fn signalled(&mut self, dag: DagId, job: u64, release_ns: Option<u64>) {
        self.note("signalled", dag, (job, release_ns));
    }

    fn ready(&mut self, instance: Instance) {
        self.note("ready", instance.dag, instance);
    }

    fn cancelled(&mut self, instance: Instance) {
        self.note("cancelled", instance.dag, instance);
    }

    fn aborted(&mut self, dag: DagId, job: u64) {
        self.note("aborted", dag, job);
    }

    fn restarted(&mut self, instance: Instance) {
        self.note("restarted", instance.dag, instance);
    }

    fn ended(&mut self, dag: DagId) {
        self.note("ended", dag, ());
    }

    fn deadline_missed(&mut self, dag: DagId, job: u64, deadline_ns: u64) {
        self.note("missed", dag, (job, deadline_ns));
    }

    fn job_completed(&mut self, dag: DagId, job: u64, outcome: JobOutcome) {
        self.note("completed", dag, (job, outcome));
    }
}
