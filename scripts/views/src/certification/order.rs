//! Whether all instances that keep their cores began in the order of the policy.
//!
//! A decision takes effect late, so the law lets an instance wait for a while for the core of its
//! turn. The start of an instance with a core to keep ends such a wait, so there a wrong choice
//! would look like a slow dispatch. Here no time counts: events stand in the order in which the
//! scheduler learnt of them. The core was given at the request or, without a request, when the
//! instance was ready and the core free. More urgent instances, ready by that step, need other
//! cores: at some moment from then until the start, there must be idle cores, or cores with less
//! urgent, preemptible work.
//!
//! Preemptible instances are not judged: if chosen wrongly, they go on for no longer than the
//! inversion, and the inversion is measured. The law judges the order of table entries without
//! time, too; the start of a group's member on the core of a due entry is judged within the law's
//! tolerance.

use std::collections::BTreeMap;

use sched_dag::journal::{Event, EventKind};
use sched_dag::{ClusterId, CoreId, Instance, Preemption};

use super::named;
use crate::record::Run;
use crate::units::shown;
use crate::view::View;

/// The key of an instance; the smaller key goes first.
type Key = (u64, Instance);

/// The instances at hand between two events.
struct Dispatch<'v> {
    view: &'v View<'v>,
    /// The policy's numbers, by DAG.
    numbers: Vec<Vec<u64>>,
    /// The event since which each instance waits.
    waiting: BTreeMap<Key, usize>,
    running: BTreeMap<CoreId, Key>,
    /// The event that last freed each core.
    freed: BTreeMap<CoreId, usize>,
    /// The latest request for each core.
    requests: BTreeMap<CoreId, (Instance, usize)>,
}

/// A start, or an end of a wait, of an instance with a core to keep.
struct KeeperStart {
    key: Key,
    core: CoreId,
    /// The last event of the step from which on the instance may have been given the core.
    chosen: usize,
    /// The event of the start.
    at: usize,
}

/// Describes an instance that began out of order.
pub(super) fn broken(view: &View<'_>) -> Option<String> {
    let events: Vec<Event> = view.in_the_order_of_the_log().collect();
    let mut dispatch = Dispatch::new(view);
    let mut begins = Vec::new();
    for (at, event) in events.iter().enumerate() {
        begins.extend(dispatch.begin(&events, at));
        dispatch.take(at, event);
    }
    begins.sort_by_key(|begin| begin.chosen);
    let (mut dispatch, mut begins) = (Dispatch::new(view), begins.iter().peekable());
    let mut undecided: Vec<&KeeperStart> = Vec::new();
    for (at, event) in events.iter().enumerate() {
        dispatch.take(at, event);
        while let Some(begin) = begins.next_if(|begin| begin.chosen == at) {
            undecided.push(begin);
        }
        undecided.retain(|begin| dispatch.first(begin).is_some());
        if let Some(begin) = undecided.iter().find(|begin| begin.at == at + 1) {
            let [began, first] =
                [begin.key, dispatch.first(begin)?].map(|it| named(view.run, it.1));
            let (core, when) = (begin.core.0, shown(events[begin.at].time_ns));
            return Some(format!(
                "{began} began on core {core} at {when} and keeps it, although {first} was ready \
                 when it was given the core, and goes first"
            ));
        }
    }
    None
}

impl<'v> Dispatch<'v> {
    fn new(view: &'v View<'v>) -> Self {
        let dags = view.run.task_set.dags().iter();
        Self {
            view,
            numbers: dags
                .map(|dag| view.run.options.policy.numbers(dag))
                .collect(),
            waiting: BTreeMap::new(),
            running: BTreeMap::new(),
            freed: BTreeMap::new(),
            requests: BTreeMap::new(),
        }
    }

    fn key(&self, instance: Instance) -> Key {
        let Instance { dag, job, subtask } = instance;
        let number = self.numbers[dag.index()][subtask.index()];
        let release_ns = match self.view.run.options.policy.adds_release() {
            true => self.view.release_ns(dag, job),
            false => 0,
        };
        (release_ns.saturating_add(number), instance)
    }

    fn keeps(&self, Instance { dag, subtask, .. }: Instance) -> bool {
        let Run {
            task_set, options, ..
        } = self.view.run;
        let subtask = task_set.dag(dag).subtask(subtask);
        options.preemption == Preemption::Disabled || subtask.is_non_preemptive()
    }

    /// Returns the cluster and the affinity of an instance, unless a table has its DAG.
    fn group(&self, of: Instance) -> Option<(ClusterId, &'v [u32])> {
        let dag = self.view.run.task_set.dag(of.dag);
        let is_free = self.view.run.task_set.table_of(of.dag).is_none();
        is_free.then_some((dag.cluster(), dag.affinity()))
    }

    /// Returns the start made by an event at a position, before the event is taken.
    fn begin(&self, events: &[Event], at: usize) -> Option<KeeperStart> {
        let Event { what, core, .. } = events[at];
        let instance = events[at].instance()?;
        let begins = matches!(what, EventKind::Start | EventKind::Resume);
        let is_judged = begins && self.keeps(instance) && self.group(instance).is_some();
        let key = self.key(instance);
        let ready = *self.waiting.get(&key).filter(|_| is_judged)?;
        let request = self
            .requests
            .get(&core)
            .filter(|(of, at)| *of == instance && *at > ready);
        let free = self.freed.get(&core).copied().unwrap_or(0);
        let since = request.map_or(ready.max(free), |(_, at)| *at);
        // The events behind it may belong to the same step of the scheduler.
        let in_step = |event: &&Event| {
            let of = (event.core, event.time_ns) == (events[since].core, events[since].time_ns);
            of && !event.what.is_of_machine()
        };
        let chosen = since + events[since + 1..at].iter().take_while(in_step).count();
        Some(KeeperStart {
            key,
            core,
            chosen,
            at,
        })
    }

    /// Takes the event at a position.
    fn take(&mut self, at: usize, event: &Event) {
        if event.what == EventKind::DagEnded {
            // Unstarted instances never start now; started instances may go on, with nothing owed.
            self.waiting.retain(|(_, of), _| of.dag != event.dag);
        }
        let Some(instance) = event.instance() else {
            return;
        };
        if event.what == EventKind::Request {
            self.requests.insert(event.core, (instance, at));
            return;
        }
        let key = self.key(instance);
        self.waiting.remove(&key);
        let ran = self.running.iter().find(|(_, it)| **it == key);
        if let Some(core) = ran.map(|(core, _)| *core) {
            self.running.remove(&core);
            self.freed.insert(core, at);
        }
        match event.what {
            EventKind::Ready | EventKind::Suspend | EventKind::Wake => {
                self.waiting.insert(key, at);
            }
            EventKind::Start | EventKind::Resume => {
                self.running.insert(event.core, key);
            }
            _ => {}
        }
    }

    /// Returns the first instance that goes before a beginning instance and finds no other core.
    fn first(&self, begin: &KeeperStart) -> Option<Key> {
        let Run {
            task_set, options, ..
        } = self.view.run;
        let is_of_it = |key: &Key| self.group(key.1) == self.group(begin.key.1);
        let cores = task_set
            .cores_of_dag(begin.key.1.dag, options.cores)
            .into_iter();
        let others = cores.map(CoreId).filter(|core| *core != begin.core);
        let gives_way = |key: &Key| *key > begin.key && is_of_it(key) && !self.keeps(key.1);
        let left = others.filter(|core| self.running.get(core).is_none_or(gives_way));
        let before = self.waiting.range(..begin.key);
        let mut before = before.filter(|(key, since)| **since <= begin.chosen && is_of_it(key));
        before.nth(left.count()).map(|(key, _)| *key)
    }
}
