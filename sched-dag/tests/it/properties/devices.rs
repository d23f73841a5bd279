//! Instances in virtual time that wait for devices, which answer at once, in time, late, or twice.
//!
//! The law judges each run. When each wait ends, and whether that is said to be its limit, follows
//! from what is drawn, and is judged here: W2 and W7.

use std::cell::Cell;
use std::collections::{BTreeMap, HashMap};

use common::random::Random;
use sched_dag::engine::SubtaskBody;
use sched_dag::journal::{Event, EventKind, EventSubject};
use sched_dag::law::{JudgeOptions, dispatch_violations, violations};
use sched_dag::lifecycle::{Request, WaitId};
use sched_dag::virtual_time::{RunOutcome, VirtualTime, Workload};
use sched_dag::{DagId, Instance, SubtaskId};

use crate::support::commit;
use crate::support::set::Set;

/// How often something has happened to waits.
#[derive(Debug, Default)]
pub(super) struct Counts {
    pub(super) jobs: u64,
    /// Ends by an answer before the limit, at the limit, by the limit, and by a cut.
    pub(super) ends: [u64; 4],
    /// Waits that ended at the instant at which they began.
    pub(super) of_no_length: u64,
}

/// Runs a set, judges the run, and counts.
pub(super) fn judge(set: &Set, random: &mut Random, counts: &mut Counts) -> Result<(), String> {
    let task_set = commit(&set.specs(), set.options);
    let wrongly_told = Cell::new(None);
    let subtasks = (0..).map(DagId).zip(&set.specs).flat_map(|(dag, spec)| {
        let subtasks = (0..).map(SubtaskId).take(spec.subtasks.len());
        subtasks.map(move |subtask| (dag, subtask))
    });
    let bodies = subtasks.map(|(dag, subtask)| Body {
        set,
        instance: Instance {
            dag,
            job: 0,
            subtask,
        },
        number: 0,
        wrongly_told: &wrongly_told,
    });
    let mut run = VirtualTime::of_bodies(&task_set, set.options, bodies, &[]).recording();
    let mut devices = Devices::new(set, random);
    if run.run(&mut devices) != RunOutcome::Finished {
        return Err("it does not end".into());
    }
    let events = run.events();
    let all = || events.iter().copied();
    let terms = JudgeOptions {
        is_complete: true,
        ..JudgeOptions::EXACT
    };
    let mut found = violations(&task_set, terms, all());
    found.extend(dispatch_violations(&task_set, &set.options, terms, all()));
    if let Some(first) = found.first() {
        return Err(first.to_string());
    }
    if let Some(wait) = wrongly_told.get() {
        return Err(format!(
            "{wait:?} ended otherwise than its instance was told"
        ));
    }
    counts.jobs += all().filter(|of| of.what == EventKind::Released).count() as u64;
    judge_ends(set, &events, counts)
}

/// Holds the end of each wait against its answer and its limit.
fn judge_ends(set: &Set, events: &[Event], counts: &mut Counts) -> Result<(), String> {
    let mut present: BTreeMap<Instance, (WaitId, u64)> = BTreeMap::new();
    let mut begun: HashMap<Instance, u32> = HashMap::new();
    for event in events {
        let Some(instance) = event.instance() else {
            continue;
        };
        if event.what == EventKind::Wait {
            let count = begun.entry(instance).or_default();
            let number = *count;
            *count += 1;
            present.insert(instance, (WaitId { instance, number }, event.time_ns));
            continue;
        }
        let Some((wait, since_ns)) = present.remove(&instance) else {
            continue;
        };
        let (limit_ns, answer_ns) = (set.limit_ns(wait).unwrap_or(0), set.answer_ns(wait));
        let end_ns = since_ns + limit_ns.min(answer_ns);
        let (way, is_right) = match event.what {
            EventKind::Wake if answer_ns < limit_ns => (0, event.time_ns == end_ns),
            EventKind::Wake if answer_ns == limit_ns => (1, event.time_ns == end_ns),
            EventKind::Wake => (2, event.time_ns == end_ns),
            EventKind::Cancelled => (3, event.time_ns <= end_ns),
            _ => (0, false),
        };
        if !is_right {
            return Err(format!(
                "{wait:?} since {since_ns} ends by {event:?}, not at {end_ns}"
            ));
        }
        counts.ends[way] += 1;
        counts.of_no_length += u64::from(way < 3 && end_ns == since_ns);
    }
    present.into_values().next().map_or(Ok(()), |(wait, _)| {
        Err(format!("{wait:?} has no end in the journal"))
    })
}

/// The function of a subtask: it takes the waits that are drawn for its instance.
struct Body<'s> {
    set: &'s Set,
    instance: Instance,
    /// How many waits it has begun.
    number: u32,
    /// The first wait of which an instance was told an end that it did not have.
    wrongly_told: &'s Cell<Option<WaitId>>,
}

impl SubtaskBody for Body<'_> {
    type Alternate = ();

    fn set_job(&mut self, job: u64) {
        (self.instance.job, self.number) = (job, 0);
    }

    fn subject(&self) -> EventSubject {
        EventSubject::of(self.instance)
    }

    fn discard(&mut self, _: u64) {}

    fn wake(&mut self, has_timed_out: bool) {
        let (instance, number) = (self.instance, self.number - 1);
        let wait = WaitId { instance, number };
        let is_beyond = Some(self.set.answer_ns(wait)) > self.set.limit_ns(wait);
        if has_timed_out != is_beyond {
            self.wrongly_told.set(Some(wait));
        }
    }

    fn has_effects(&self) -> bool {
        true
    }

    fn complete(&mut self, _: u64, ask: &mut dyn FnMut(Request)) {
        let (instance, number) = (self.instance, self.number);
        if let Some(limit_ns) = self.set.limit_ns(WaitId { instance, number }) {
            self.number += 1;
            ask(Request::Wait(limit_ns));
        }
    }

    fn alternate(&self) -> Option<()> {
        Some(())
    }

    fn replace(&mut self) {}
}

/// The world of a run: execution times, faults, signals, and devices that answer.
struct Devices<'s> {
    set: &'s Set,
    /// By time, and in the order in which they were asked.
    requests: BTreeMap<(u64, u64), Request>,
    asked: u64,
    /// How many waits each instance has begun.
    begun: HashMap<Instance, u32>,
}

impl<'s> Devices<'s> {
    fn new(set: &'s Set, random: &mut Random) -> Self {
        let mut this = Self {
            set,
            requests: BTreeMap::new(),
            asked: 0,
            begun: HashMap::new(),
        };
        let dags = (0..).map(DagId).take(set.specs.len());
        for dag in dags.filter(|&dag| set.is_sporadic(dag)) {
            for _ in 0..random.within(0..=10) {
                this.ask(random.within(0..=60), Request::Signal(dag));
            }
        }
        this
    }

    fn ask(&mut self, at_ns: u64, request: Request) {
        self.requests.insert((at_ns, self.asked), request);
        self.asked += 1;
    }

    fn begun(&self, instance: Instance) -> u32 {
        self.begun.get(&instance).copied().unwrap_or(0)
    }
}

impl<'s> Workload<Body<'s>> for Devices<'s> {
    fn execute(&mut self, body: &mut Body<'s>, _: u64) -> Option<u64> {
        // Each segment has a time of its own; no job has a number that large.
        let turn = Instance {
            job: body.instance.job + 1_000 * u64::from(body.number),
            ..body.instance
        };
        Some(self.set.execution_ns(turn))
    }

    fn fails(&mut self, instance: Instance) -> bool {
        // Some in their first segment, others in a later one.
        self.set.fails(instance) && u64::from(self.begun(instance)) == instance.job % 3
    }

    fn is_replaceable(&mut self, instance: Instance) -> bool {
        instance.subtask.0 != 1
    }

    fn waits(&mut self, wait: WaitId, now_ns: u64) {
        *self.begun.entry(wait.instance).or_default() += 1;
        let answer_ns = now_ns + self.set.answer_ns(wait);
        self.ask(answer_ns, Request::Answer(wait));
        if self.set.answers_twice(wait) {
            self.ask(answer_ns + wait.instance.job, Request::Answer(wait));
        }
    }

    fn next_request_ns(&self) -> Option<u64> {
        self.requests
            .first_key_value()
            .map(|((at_ns, _), _)| *at_ns)
    }

    fn take_request(&mut self, now_ns: u64) -> Option<Request> {
        let first = self.requests.first_entry()?;
        (first.key().0 <= now_ns).then(|| first.remove())
    }
}
