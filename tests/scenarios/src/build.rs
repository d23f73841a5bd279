//! Builds a scenario's DAGs, of real functions on real topics.
//!
//! Each subtask writes a topic named like itself. The value is the number of the call in which the
//! source began the job. A join of one source's values panics if the values are of different jobs,
//! so a platform mixing jobs fails by a fault no scenario expects.

use alloc::collections::BTreeMap;
use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::sync::atomic::{AtomicU64, Ordering::Relaxed};
use core::time::Duration;

use fass::commit::{Commit, CommitError, ConstructionPolicy, finish_create_dags_in_order};
use fass::shared::{Latest, Mode, Modes, Signal, State, Uses, shutting_down};
use fass::{Dag, Occupation, SubtaskAttributes, VecToPubs, VecToSubs, create_dag, execute_for};

use crate::dag::{DagText, Replaced, SubtaskText, Use, of_call};
use crate::waiting::{self, ScenarioDevice};
use crate::{Calls, Scenario};

/// Tuples of a subtask's inputs.
pub(crate) trait Inputs: VecToSubs + Send {
    /// Returns the first value, and whether the others are the same.
    fn first(self) -> Option<(u64, bool)>;
}

/// Tuples of a subtask's outputs.
pub(crate) trait Outputs: VecToPubs {
    fn of(value: u64) -> Self;
}

impl Outputs for () {
    fn of(_: u64) -> Self {}
}

impl Outputs for (Whole,) {
    fn of(value: u64) -> Self {
        (Whole([value; 16]),)
    }
}

/// A number of 16 equal words: a half-written value, or a value read during the write, shows.
#[derive(Clone, Copy)]
struct Whole([u64; 16]);

impl Whole {
    fn number(&self) -> u64 {
        let [first, rest @ ..] = self.0;
        assert!(rest.iter().all(|word| *word == first), "a half value");
        first
    }
}

macro_rules! inputs {
    ($(($($value:ident)*))*) => {$(
        impl Inputs for ($(inputs!(@ $value),)*) {
            fn first(self) -> Option<(u64, bool)> {
                let ($($value,)*) = self;
                let all: &[u64] = &[$($value.number()),*];
                let first = *all.first()?;
                Some((first, all.iter().all(|value| *value == first)))
            }
        }
    )*};
    (@ $value:ident) => { Whole };
}

inputs!(()(a)(a b)(a b c)(a b c d));

/// The steps of a subtask's functions in a call; after a fault the next function goes on with them.
pub(crate) struct Step {
    takes: Vec<Duration>,
    /// The kind of occupation: a budget limits processor time, so only computing exceeds it.
    how: Occupation,
    fails: Vec<u64>,
    when: Vec<u64>,
    /// The number of calls so far.
    calls: AtomicU64,
    /// Whether all inputs must stem from the same call: the DAG has a single source.
    joins: bool,
    of_all: Arc<Calls>,
}

impl Step {
    fn new(dag: &DagText, subtask: &SubtaskText, of_all: &Arc<Calls>) -> Arc<Self> {
        let sources = dag.subtasks.iter().filter(|of| of.after.is_empty());
        Arc::new(Self {
            takes: subtask.takes.clone(),
            how: match subtask.computes || subtask.budget.is_some() {
                true => Occupation::Spin,
                false => Occupation::Hold,
            },
            fails: subtask.fails.clone(),
            when: subtask.when.clone(),
            calls: AtomicU64::new(0),
            joins: sources.count() == 1,
            of_all: Arc::clone(of_all),
        })
    }

    /// Does the steps of a call; `act` does the rest, as the scenario asks.
    fn call<I: Inputs, O: Outputs>(&self, inputs: I, act: impl FnOnce(u64, bool)) -> O {
        let call = self.begin();
        act(call, self.when.contains(&call));
        self.end(call, inputs)
    }

    /// Begins a call, up to its first wait, and returns the call's number.
    pub(crate) fn begin(&self) -> u64 {
        let call = self.calls.fetch_add(1, Relaxed);
        self.execute(&self.takes, call);
        call
    }

    pub(crate) fn execute(&self, takes: &[Duration], call: u64) {
        execute_for(of_call(takes, call).unwrap_or_default(), self.how);
    }

    pub(crate) fn end<I: Inputs, O: Outputs>(&self, call: u64, inputs: I) -> O {
        if self.fails.contains(&call) {
            self.of_all.failed.fetch_add(1, Relaxed);
            panic!("call {call} fails, as it is to");
        }
        let (first, are_same) = inputs.first().unwrap_or((call, true));
        assert!(
            are_same || !self.joins,
            "a join got values of different jobs"
        );
        self.of_all.returned.fetch_add(1, Relaxed);
        O::of(first)
    }
}

/// A DAG under construction, with everything its subtasks use.
struct Building<'a> {
    dag: &'a Dag,
    calls: &'a Arc<Calls>,
    text: &'a DagText,
    signals: &'a BTreeMap<String, Signal>,
    dags: &'a BTreeMap<String, Dag>,
    modes: &'a BTreeMap<String, Mode>,
    latest: &'a BTreeMap<String, Latest<Whole>>,
    states: BTreeMap<String, State<u64>>,
    /// The devices asked by the subtasks.
    devices: &'a mut Vec<ScenarioDevice>,
}

impl Building<'_> {
    #[allow(clippy::too_many_lines, reason = "one arm for each use")]
    fn register<I: Inputs, O: Outputs>(&mut self, subtask: &SubtaskText, writes: bool) {
        let step = Step::new(self.text, subtask, self.calls);
        let inputs: Vec<&str> = subtask.after.iter().map(String::as_str).collect();
        let outputs = Vec::from_iter(writes.then_some(subtask.name.as_str()));
        let attributes = attributes(subtask);
        let dag = self.dag;
        if subtask.replaced != Replaced::Never {
            let make = move || {
                let step = Arc::clone(&step);
                move |inputs: I| step.call::<I, O>(inputs, |_, _| ())
            };
            let anew = make.clone();
            let functions = match subtask.replaced {
                Replaced::ByFallback => dag.falling_back(make(), anew()),
                _ => dag.restarting(anew),
            };
            return functions
                .reads(&inputs)
                .writes(&outputs)
                .register(attributes);
        }
        let place = (inputs, outputs, attributes);
        if !subtask.waits.is_empty() {
            let device = waiting::register::<I, O>(dag, subtask, place, step);
            return self.devices.push(device);
        }
        match &subtask.uses {
            Use::Nothing if subtask.due.is_some() => {
                let due = subtask.due.unwrap_or_default();
                let call = move |inputs: I| step.call::<I, ()>(inputs, |_, _| ());
                dag.register_sink_subtask(call, place.0, due, place.2);
            }
            Use::Nothing => {
                let call = move |inputs: I| step.call::<I, O>(inputs, |_, _| ());
                dag.register_subtask(call, place.0, place.1, place.2);
            }
            Use::Updates(name) => {
                let state = self.state(name).update();
                using::<_, I, O>(dag, state, place, step, |value, _, _| **value += 1);
            }
            Use::Reads(name) => {
                let state = self.state(name).read();
                using::<_, I, O>(dag, state, place, step, |_, _, _| ());
            }
            Use::Samples(name) => {
                let latest = self.latest[name].sample();
                let last = AtomicU64::new(0);
                using::<_, I, O>(dag, latest, place, step, move |sample, _, _| {
                    let Some(sample) = sample else { return };
                    assert!(sample.completed_ns <= fass::now_ns(), "it is complete");
                    sample.value.number();
                    let before = last.fetch_max(sample.job, Relaxed);
                    assert!(before <= sample.job, "job {} after {before}", sample.job);
                });
            }
            Use::Raises(name) => {
                let raising = self.signals[name].raising();
                using::<_, I, O>(dag, raising, place, step, |raiser, _, acts| {
                    if acts {
                        raiser.raise();
                    }
                });
            }
            Use::Switches(name, resumes) => {
                let resumes = resumes.clone();
                let switching = self.dags[name].switching();
                using::<_, I, O>(dag, switching, place, step, move |switch, call, acts| {
                    if acts {
                        switch.pause();
                    }
                    if resumes.contains(&call) {
                        switch.resume();
                    }
                });
            }
            Use::Enters(name) | Use::EntersIdle(name) => {
                let at_once = matches!(subtask.uses, Use::Enters(_));
                let entering = self.modes[name].entering();
                using::<_, I, O>(dag, entering, place, step, move |entrance, _, acts| match (
                    acts, at_once,
                ) {
                    (false, _) => {}
                    (true, true) => entrance.at_once(),
                    (true, false) => entrance.when_idle(),
                });
            }
            Use::EndsRun => {
                using::<_, I, O>(dag, shutting_down(), place, step, |shutdown, _, acts| {
                    if acts {
                        shutdown.request();
                    }
                });
            }
        }
    }

    fn state(&mut self, name: &str) -> &State<u64> {
        let make = || self.dag.state(name, 0);
        self.states.entry(name.into()).or_insert_with(make)
    }
}

/// Registers a subtask with a use besides its inputs. Each call of `act` gets the used thing, the
/// call's number, and whether the scenario has the subtask act in this call.
fn using<U: Uses + 'static, I: Inputs, O: Outputs>(
    dag: &Dag,
    uses: U,
    (inputs, outputs, attributes): (Vec<&str>, Vec<&str>, SubtaskAttributes),
    step: Arc<Step>,
    act: impl for<'a> Fn(&mut U::Borrowed<'a>, u64, bool) + Send + 'static,
) {
    let call = move |mut used: U::Borrowed<'_>, inputs: I| -> O {
        step.call(inputs, |call, acts| act(&mut used, call, acts))
    };
    dag.using(uses)
        .subtask(call)
        .reads(&inputs)
        .writes(&outputs)
        .register(attributes);
}

fn attributes(subtask: &SubtaskText) -> SubtaskAttributes {
    let mut attributes = SubtaskAttributes::named(&subtask.name);
    if let Some(priority) = subtask.priority {
        attributes = attributes.priority(priority);
    }
    if let Some(wcet) = subtask.wcet {
        attributes = attributes.wcet(wcet);
    }
    if let Some(budget) = subtask.budget {
        attributes = attributes.budget(budget);
    }
    for wait in &subtask.waits {
        attributes = attributes.wait(wait.limit);
        if let Some(wcet) = wait.wcet {
            attributes = attributes.wcet(wcet);
        }
    }
    if subtask.is_non_preemptive {
        attributes = attributes.non_preemptive();
    }
    attributes
}

impl DagText {
    /// Begins the DAG. Returns its signal, too, if the DAG is sporadic.
    fn begin(&self) -> (Dag, Option<Signal>) {
        let dag = create_dag();
        dag.name(&self.name).overrun(self.overrun);
        dag.offset(self.offset).affinity(&self.affinity);
        dag.relative_deadline(self.deadline.unwrap_or(self.period));
        if self.jobs > 0 {
            let all = u32::try_from(self.jobs).unwrap_or(u32::MAX);
            dag.jobs(self.jobs).in_flight(self.in_flight.unwrap_or(all));
        } else if let Some(in_flight) = self.in_flight {
            dag.in_flight(in_flight);
        }
        if let Some(limit) = self.survives {
            dag.survive_faults(limit);
        }
        if let Some(cluster) = self.cluster {
            dag.cluster(cluster);
        }
        if self.is_paused {
            dag.starts_paused();
        }
        let signal = self.is_sporadic.then(|| dag.sporadic(self.period));
        if signal.is_none() {
            dag.period(self.period);
        }
        (dag, signal)
    }
}

impl Scenario {
    /// Builds the DAGs and commits them, in the order of the text. No device answers.
    ///
    /// # Errors
    ///
    /// The faults of a refused commit.
    ///
    /// # Panics
    ///
    /// If the text uses a name without stating it.
    pub fn commit(&self) -> Result<Commit, CommitError> {
        self.commit_with(drop)
    }

    /// Builds and commits likewise, and hands each asked device to `connect`.
    ///
    /// # Errors
    ///
    /// As [`commit`](Self::commit).
    ///
    /// # Panics
    ///
    /// As [`commit`](Self::commit).
    pub fn commit_with(&self, connect: impl FnMut(ScenarioDevice)) -> Result<Commit, CommitError> {
        let mut devices = Vec::new();
        let (mut dags, mut signals) = (BTreeMap::new(), BTreeMap::new());
        self.calls.returned.store(0, Relaxed);
        self.calls.failed.store(0, Relaxed);
        for text in &self.dags {
            let (dag, signal) = text.begin();
            dags.insert(text.name.clone(), dag);
            signals.extend(signal.map(|signal| (text.name.clone(), signal)));
        }
        let set = Modes::new();
        let mode = |(name, names): &(String, Vec<String>)| {
            let named: Vec<&Dag> = names.iter().map(|name| &dags[name]).collect();
            (name.clone(), set.mode(name, &named))
        };
        let modes = self.modes.iter().map(mode).collect();
        let sampled: Vec<&str> = self.dags.iter().flat_map(DagText::samples).collect();
        let mut latest = BTreeMap::new();
        for text in &self.dags {
            for subtask in &text.subtasks {
                if sampled.contains(&subtask.name.as_str()) {
                    latest.insert(subtask.name.clone(), dags[&text.name].latest(&subtask.name));
                }
            }
        }
        for text in &self.dags {
            let dag = &dags[&text.name];
            if let Some(handler) = &text.on_fault {
                dag.on_fault(&signals[handler]);
            }
            let mut building = Building {
                dag,
                calls: &self.calls,
                text,
                signals: &signals,
                dags: &dags,
                modes: &modes,
                latest: &latest,
                states: BTreeMap::new(),
                devices: &mut devices,
            };
            for subtask in &text.subtasks {
                let (inputs, is_read) = text.shape(subtask);
                let writes = is_read || latest.contains_key(&subtask.name);
                building.register_shaped(subtask, inputs, writes);
            }
        }
        devices.into_iter().for_each(connect);
        let all = (self.dags.iter()).map(|text| dags[&text.name].clone());
        let all: Vec<Dag> = all.collect();
        let lists: Vec<&str> = self.lists.iter().map(String::as_str).collect();
        finish_create_dags_in_order(&all, ConstructionPolicy::any_graph(), &lists)
    }
}

impl Building<'_> {
    fn register_shaped(&mut self, subtask: &SubtaskText, inputs: usize, writes: bool) {
        type One = Whole;
        match (inputs, writes) {
            (0, false) => self.register::<(), ()>(subtask, false),
            (0, true) => self.register::<(), (One,)>(subtask, true),
            (1, false) => self.register::<(One,), ()>(subtask, false),
            (1, true) => self.register::<(One,), (One,)>(subtask, true),
            (2, false) => self.register::<(One, One), ()>(subtask, false),
            (2, true) => self.register::<(One, One), (One,)>(subtask, true),
            (3, false) => self.register::<(One, One, One), ()>(subtask, false),
            (3, true) => self.register::<(One, One, One), (One,)>(subtask, true),
            (4, false) => self.register::<(One, One, One, One), ()>(subtask, false),
            (4, true) => self.register::<(One, One, One, One), (One,)>(subtask, true),
            (more, _) => panic!(
                "subtask `{}` has {more} inputs; 4 are the most",
                subtask.name
            ),
        }
    }
}
