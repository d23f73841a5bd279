//! Rule R5: who runs, and for how long someone else should have.
//!
//! At every instant the rule says who *should* run: with m cores, the instances
//! that have started and keep their core, and of all others that are eligible
//! those with the smallest keys, until m are reached. An eligible instance that
//! should run and does not is *owed* a core. On a machine this is never 0: the
//! scheduler is told, decides, and interrupts a core. So a time of being owed is
//! a breach only if it is longer than the bound. It is an inversion if
//! meanwhile an instance of lower priority runs, or idleness if a core idles:
//! the blame is what was the case when the bound was exceeded.
//!
//! Beside that, at the start of an instance that will keep its core: those of
//! higher priority that have been waiting for longer than the bound must have
//! idle cores to go to. Without that, a wrong choice would show no longer than
//! it takes to make.
//!
//! If events were lost, a core takes part from its first known event on. An
//! ended DAG's waiting instances are owed nothing.

use std::collections::BTreeMap;

use sched_dag::{CoreId, DagId, Instance};

use super::breach::{Breach, Rule};
use super::history::Stage;
use super::model::What;
use super::view::View;

/// An instance's place in the order of dispatch.
type Key = (u64, Instance);

/// What R5 tells about a run beside breaches.
#[derive(Clone, Debug, Default)]
pub(super) struct Waits {
    /// The longest time for which an instance was owed a core.
    pub(super) longest_owed_ns: u64,
    /// From readiness to start, where a core was idle for the instance and no
    /// other one came first.
    pub(super) ready_to_start_ns: Vec<u64>,
}

enum Change {
    Stage(Key, Stage),
    CoreIsKnown,
    Stopped(DagId),
}

struct Owed {
    since_ns: u64,
    /// Whether it has just become ready and found an idle core for it.
    finds_idle_core: bool,
    blame: Option<String>,
}

struct Sweep<'v> {
    view: &'v View<'v>,
    bound_ns: u64,
    known_cores: usize,
    /// Since when each waits.
    waiting: BTreeMap<Key, u64>,
    running: BTreeMap<Key, CoreId>,
    stopped: Vec<DagId>,
    owed: BTreeMap<Key, Owed>,
    /// Became ready, or started, at this instant.
    fresh: Vec<Key>,
    started: Vec<Key>,
    waits: Waits,
}

/// Judges a run by R5.
pub(super) fn judge(view: &View<'_>, bound_ns: u64, breaches: &mut Vec<Breach>) -> Waits {
    let mut sweep = Sweep {
        view,
        bound_ns,
        known_cores: 0,
        waiting: BTreeMap::new(),
        running: BTreeMap::new(),
        stopped: Vec::new(),
        owed: BTreeMap::new(),
        fresh: Vec::new(),
        started: Vec::new(),
        waits: Waits::default(),
    };
    let mut changes = changes(view).into_iter().peekable();
    while let Some((now_ns, change)) = changes.next() {
        sweep.apply(now_ns, change);
        match changes.peek() {
            Some((next_ns, _)) if *next_ns == now_ns => {}
            next => {
                let until_ns = next.map_or(view.end_ns, |(next_ns, _)| *next_ns);
                sweep.settle(now_ns, until_ns, breaches);
            }
        }
    }
    let left = std::mem::take(&mut sweep.owed);
    for (key, owed) in left {
        sweep.close(key, &owed, view.end_ns, breaches);
    }
    sweep.waits
}

/// Returns all changes by time; those of one instance keep their order.
fn changes(view: &View<'_>) -> Vec<(u64, Change)> {
    let mut changes: Vec<(u64, Change)> = Vec::new();
    for core in (0..view.run.cores).map(CoreId) {
        let first = view
            .events
            .iter()
            .find(|(event, _)| event.core == core && event.what.is_of_machine());
        let known_ns = match first {
            _ if !view.is_lossy() => Some(0),
            Some((event, _)) => match event.what {
                What::Start | What::Resume => Some(event.time_ns),
                _ => Some(view.from_ns),
            },
            None => None,
        };
        changes.extend(known_ns.map(|known_ns| (known_ns, Change::CoreIsKnown)));
    }
    let stops = view.stopped.iter();
    changes.extend(stops.map(|(&dag, &time_ns)| (time_ns, Change::Stopped(dag))));
    for (&instance, history) in &view.histories {
        let key = view.run.key(instance);
        let stages = history.stages.iter();
        changes.extend(stages.map(|&(time_ns, stage)| (time_ns, Change::Stage(key, stage))));
    }
    changes.sort_by_key(|(time_ns, _)| *time_ns);
    changes
}

impl Sweep<'_> {
    fn apply(&mut self, now_ns: u64, change: Change) {
        match change {
            Change::CoreIsKnown => self.known_cores += 1,
            Change::Stopped(dag) => {
                self.waiting.retain(|(_, instance), _| instance.dag != dag);
                self.stopped.push(dag);
            }
            Change::Stage(key, stage) => {
                self.waiting.remove(&key);
                self.running.remove(&key);
                let is_owed_nothing = self.stopped.contains(&key.1.dag);
                match stage {
                    Stage::Ready | Stage::Suspended if is_owed_nothing => {}
                    Stage::Ready => {
                        self.waiting.insert(key, now_ns);
                        self.fresh.push(key);
                    }
                    Stage::Suspended => {
                        self.waiting.insert(key, now_ns);
                    }
                    Stage::Running(core) => {
                        self.running.insert(key, core);
                        self.started.push(key);
                    }
                    Stage::Absent | Stage::Over => {}
                }
            }
        }
    }

    /// Judges what is the case from now until the next change.
    fn settle(&mut self, now_ns: u64, until_ns: u64, breaches: &mut Vec<Breach>) {
        let idle = self.known_cores.saturating_sub(self.running.len());
        let started = std::mem::take(&mut self.started);
        for key in started {
            breaches.extend(self.out_of_turn(key, idle, now_ns));
        }
        let fresh = std::mem::take(&mut self.fresh);
        let should_run = self.should_run();
        let past = |key: &Key| !should_run.contains(key);
        let over: Vec<Key> = self.owed.keys().copied().filter(past).collect();
        for key in over {
            if let Some(owed) = self.owed.remove(&key) {
                self.close(key, &owed, now_ns, breaches);
            }
        }
        for (rank, key) in should_run.iter().enumerate() {
            let since_ns = self.owed.get(key).map_or(now_ns, |owed| owed.since_ns);
            let has_blame = self.owed.get(key).is_some_and(|owed| owed.blame.is_some());
            let exceeds = since_ns.saturating_add(self.bound_ns) < until_ns;
            let blame = (exceeds && !has_blame).then(|| self.blame(rank < idle));
            let owed = self.owed.entry(*key).or_insert(Owed {
                since_ns,
                finds_idle_core: rank < idle && fresh.contains(key),
                blame: None,
            });
            owed.blame = owed.blame.take().or(blame);
        }
    }

    /// Returns the waiting instances that should run, in the order of keys.
    fn should_run(&self) -> Vec<Key> {
        let run = self.view.run;
        let (mut free, mut owed) = (self.known_cores, Vec::new());
        let mut movable = Vec::new();
        for key in self.running.keys() {
            if run.keeps_its_core(key.1) {
                free = free.saturating_sub(1);
            } else {
                movable.push(*key);
            }
        }
        let mut movable = movable.into_iter().peekable();
        let mut waiting = self.waiting.keys().copied().peekable();
        for _ in 0..free {
            match (waiting.peek(), movable.peek()) {
                (Some(waits), Some(runs)) if runs < waits => {
                    movable.next();
                }
                (Some(waits), _) => {
                    owed.push(*waits);
                    waiting.next();
                }
                (None, _) => break,
            }
        }
        owed
    }

    /// Says what runs instead of an instance that is owed a core.
    fn blame(&self, is_idle: bool) -> String {
        let run = self.view.run;
        let movable = self
            .running
            .iter()
            .rev()
            .find(|(key, _)| !run.keeps_its_core(key.1));
        match movable {
            Some((key, core)) if !is_idle => {
                format!("core {} runs {}", core.0, run.name(key.1))
            }
            _ => {
                let is_busy = |core: &CoreId| self.running.values().any(|busy| busy == core);
                let idle = (0..run.cores).map(CoreId).find(|core| !is_busy(core));
                idle.map_or("a core is idle".into(), |core| {
                    format!("core {} is idle", core.0)
                })
            }
        }
    }

    /// Takes note that an instance is owed nothing any more.
    fn close(&mut self, key: Key, owed: &Owed, now_ns: u64, breaches: &mut Vec<Breach>) {
        let length_ns = now_ns.saturating_sub(owed.since_ns);
        self.waits.longest_owed_ns = self.waits.longest_owed_ns.max(length_ns);
        let start = self.view.histories.get(&key.1).and_then(|it| it.start);
        if owed.finds_idle_core && start.is_some_and(|start| start.time_ns == now_ns) {
            self.waits.ready_to_start_ns.push(length_ns);
        }
        if length_ns > self.bound_ns {
            let name = self.view.run.name(key.1);
            let blame = owed.blame.as_deref().unwrap_or("others run");
            breaches.push(Breach {
                rule: Rule::Dispatch,
                time_ns: owed.since_ns,
                text: format!("{name} should run and waits {length_ns} ns while {blame}"),
            });
        }
    }

    /// Judges the start of an instance that keeps its core from now on.
    fn out_of_turn(&self, key: Key, idle: usize, now_ns: u64) -> Option<Breach> {
        let run = self.view.run;
        let history = self.view.histories.get(&key.1)?;
        let start = history.start.filter(|start| start.time_ns == now_ns)?;
        if !run.keeps_its_core(key.1) {
            return None;
        }
        let mut before = self.waiting.range(..key).filter(|(_, since_ns)| {
            let longest_ns = now_ns.saturating_sub(**since_ns);
            longest_ns > self.bound_ns
        });
        let (first, since_ns) = before.nth(idle)?;
        Some(Breach {
            rule: Rule::Dispatch,
            time_ns: now_ns,
            text: format!(
                "{} starts on core {} and keeps it, although {} waits since {since_ns} ns and \
                 goes first",
                run.name(key.1),
                start.core.0,
                run.name(first.1)
            ),
        })
    }
}
