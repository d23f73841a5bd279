//! The exploration: each state's steps, each state once.

use std::collections::HashSet;
use std::fmt;
use std::hash::{Hash, Hasher};
use std::sync::Arc;

use sched_dag::{CommitOptions, ConstructionPolicy, DagId, Scheduler, verify};

use crate::rules::{Facts, Place, SAID, instance};
use crate::set::Set;
use crate::world::{disturbances, horizon_ns};

/// By so much a late driver comes later: a release and its deadline may both have passed.
const LATE_NS: u64 = 3;

/// What was explored.
#[derive(Default)]
pub(crate) struct Counts {
    worlds: usize,
    states: usize,
    steps: usize,
    pub(crate) kinds: std::collections::BTreeMap<&'static str, usize>,
}

impl fmt::Display for Counts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            worlds,
            states,
            steps,
            kinds,
        } = self;
        write!(
            f,
            "{states} states by {steps} steps ({kinds:?}) in {worlds} worlds"
        )
    }
}

/// What happens at an instant before its releases.
#[derive(Clone, Copy, Debug)]
enum Step {
    Nothing,
    Complete(Place),
    Both(Place, Place),
    Fail(Place),
    /// Another function is there.
    Drop(Place),
    Stop(usize),
    Pause(usize),
    Resume(usize),
    Close(usize),
    Signal(usize),
}

impl Step {
    const fn kind(self) -> &'static str {
        match self {
            Self::Nothing => "time",
            Self::Complete(_) | Self::Both(..) => "complete",
            Self::Fail(_) => "fail",
            Self::Drop(_) => "drop",
            Self::Stop(_) => "stop",
            Self::Pause(_) => "pause",
            Self::Resume(_) => "resume",
            Self::Close(_) => "close",
            Self::Signal(_) => "signal",
        }
    }

    const fn is_disturbance(self) -> bool {
        !matches!(self, Self::Nothing | Self::Complete(_) | Self::Both(..))
    }
}

struct Node<'w> {
    scheduler: Scheduler,
    facts: Facts<'w>,
    disturbances: u8,
    /// The number of its last step.
    step: Option<usize>,
}

/// The steps that led to new states: when, what, and the number of the step before.
type Ways = Vec<(u64, Step, Option<usize>)>;

/// Explores a world; the error is the way to the first difference.
pub(crate) fn explore(world: &Set, counts: &mut Counts) -> Result<(), String> {
    let options = CommitOptions::new(world.options.policy, world.options.cores)
        .with_construction(ConstructionPolicy::any_graph());
    let verified = verify(&world.specs(), &options).expect("the world is right");
    let mut scheduler = Scheduler::new(Arc::new(verified.task_set), world.options);
    scheduler.hear(SAID);
    let mut known = HashSet::new();
    let mut open = vec![Node {
        scheduler,
        facts: Facts::new(world),
        disturbances: 0,
        step: None,
    }];
    let mut ways = Ways::new();
    counts.worlds += 1;
    while let Some(node) = open.pop() {
        for (time_ns, what) in steps(world, &node) {
            let mut next = Node {
                scheduler: node.scheduler.clone(),
                facts: node.facts.clone(),
                disturbances: node.disturbances + u8::from(what.is_disturbance()),
                step: Some(ways.len()),
            };
            let taken = take(&mut next, time_ns, what);
            *counts.kinds.entry(what.kind()).or_default() += 1;
            counts.steps += 1;
            let is_new = known.insert(hash(&next));
            if is_new {
                ways.push((time_ns, what, node.step));
            }
            taken.map_err(|found| {
                let way = way(&ways, node.step);
                format!("{found}\nafter {way:?} and, at {time_ns}, {what:?}")
            })?;
            if is_new {
                open.push(next);
            }
        }
    }
    counts.states += known.len();
    Ok(())
}

/// Returns the steps up to one, the first one first.
fn way(ways: &Ways, mut step: Option<usize>) -> Vec<(u64, Step)> {
    let mut way = Vec::new();
    while let Some(number) = step {
        let (time_ns, what, before) = ways[number];
        way.push((time_ns, what));
        step = before;
    }
    way.reverse();
    way
}

/// Returns every step of a driver: at this instant, at the next, or one later still.
fn steps(world: &Set, node: &Node<'_>) -> Vec<(u64, Step)> {
    let started = node.facts.started();
    let mut whats = vec![Step::Nothing];
    for &one in &started {
        whats.push(Step::Complete(one));
        let others = started.iter().filter(|&&other| other != one);
        whats.extend(others.map(|&other| Step::Both(one, other)));
    }
    if node.disturbances < disturbances(world) {
        whats.extend(started.iter().map(|&place| Step::Fail(place)));
        let may_survive = |place: &&Place| world.dags[place.0].fault_limit.is_some();
        whats.extend(
            started
                .iter()
                .filter(may_survive)
                .map(|&place| Step::Drop(place)),
        );
        for (dag, model) in world.dags.iter().enumerate() {
            whats.extend([Step::Stop(dag), Step::Close(dag)]);
            whats.push(match node.facts.dags[dag].is_paused {
                true => Step::Resume(dag),
                false => Step::Pause(dag),
            });
            whats.extend(model.signals_ns.is_some().then_some(Step::Signal(dag)));
        }
    }
    let now_ns = node.facts.now_ns;
    let last_ns = now_ns.max(horizon_ns(world));
    let times_ns = [0, 1, LATE_NS].map(|later_ns| now_ns + later_ns);
    let times_ns = times_ns.into_iter().filter(|&time_ns| time_ns <= last_ns);
    let steps = times_ns.flat_map(|time_ns| whats.iter().map(move |&what| (time_ns, what)));
    // The first instant is one without anything.
    let is_first = node.step.is_none();
    let is_step = |&(time_ns, what): &(u64, Step)| {
        let is_nothing = matches!(what, Step::Nothing);
        if is_first {
            is_nothing
        } else {
            !is_nothing || time_ns > now_ns
        }
    };
    steps.filter(is_step).collect()
}

/// Tells both what happens, and compares what comes of it.
fn take(node: &mut Node<'_>, time_ns: u64, what: Step) -> Result<(), String> {
    let Node {
        scheduler, facts, ..
    } = node;
    let mut moment = scheduler.at(time_ns);
    facts.at(time_ns);
    match what {
        Step::Nothing => {}
        Step::Complete(place) => {
            moment.complete(instance(place));
            facts.complete(place);
        }
        Step::Both(one, other) => {
            for place in [one, other] {
                moment.complete(instance(place));
                facts.complete(place);
            }
        }
        Step::Fail(place) => {
            moment.fail(instance(place));
            facts.fail(place);
        }
        Step::Drop(place) => {
            moment.fail_replaceable(instance(place));
            facts.fail_replaceable(place);
        }
        Step::Stop(dag) => {
            moment.stop(id(dag));
            facts.stop(dag);
        }
        Step::Pause(dag) => {
            moment.pause(id(dag));
            facts.pause(dag);
        }
        Step::Resume(dag) => {
            moment.resume(id(dag));
            facts.resume(dag);
        }
        Step::Close(dag) => {
            moment.close(id(dag));
            facts.close(dag);
        }
        Step::Signal(dag) => {
            moment.signal(id(dag));
            facts.signal(dag);
        }
    }
    let _decisions = moment.release_due().dispatch();
    facts.end_instant();
    let mut notices = Vec::new();
    scheduler.log.exchange_notices(&mut notices);
    facts.compare(scheduler, &notices)
}

fn hash(node: &Node<'_>) -> u128 {
    let mut mixed = Mixed(1);
    (node.disturbances, &node.facts.dags, &node.facts.running).hash(&mut mixed);
    node.scheduler.hash(&mut mixed);
    mixed.0
}

/// A hash of 128 bits, quick and good enough for some millions of states.
struct Mixed(u128);

impl Hasher for Mixed {
    fn write(&mut self, bytes: &[u8]) {
        for chunk in bytes.chunks(8) {
            let mut word = [0; 8];
            word[..chunk.len()].copy_from_slice(chunk);
            let mixed = self.0 ^ u128::from(u64::from_le_bytes(word));
            // An odd factor without pattern (of the PCG generators), and its upper half back.
            let mixed = mixed.wrapping_mul(0x2360_ed05_1fc6_5da4_4385_df64_9fcc_f645);
            self.0 = mixed ^ (mixed >> 67);
        }
    }

    fn finish(&self) -> u64 {
        unreachable!("all 128 bits are taken")
    }
}

fn id(dag: usize) -> DagId {
    DagId(u32::try_from(dag).expect("few DAGs"))
}
