//! The fit of a recording to a plan: the matching of channels, the first job of each DAG in the
//! replay, and the states known at that job.
//!
//! A recording may lack the first jobs of a run, or the user wants a later job. Then functions lack
//! all memory of earlier jobs, unless the DAG's states are recorded: the replay begins with a job
//! for which each of them is.

use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec::Vec;
use alloc::{format, vec};

use recording::{Channel, EntryKind, Header, Role};
use sched_dag::{DagId, SubtaskId, TaskSet};

use super::{Replay, SkippedInstances, guard, is_compared};
use crate::run::plan::Plan;

impl Replay {
    /// Finds the channels of the plan in the recording.
    ///
    /// # Errors
    ///
    /// Returns a message if the recording is of other DAGs, types or release times, or of other
    /// sources, has lost a source's value, has no inputs of the DAG to begin with, or has too many
    /// jobs.
    pub fn fit(&mut self, own: &Header, task_set: &TaskSet) -> Result<(), String> {
        for (number, recorded) in self.header.dags.iter().enumerate() {
            let remedy = "commit the DAGs that were recorded, in their order";
            let Some(dag) = own.dags.get(number) else {
                return Err(format!(
                    "the recording's dag {number} is `{}`, and here there is none; {remedy}",
                    recorded.name
                ));
            };
            // Compared by place, as recordings know DAGs by number.
            if recorded.name != dag.name {
                return Err(format!(
                    "the recording's dag {number} is `{}`, and here it is `{}`; {remedy}",
                    recorded.name, dag.name
                ));
            }
            // A DAG without recorded topics has no hash.
            if recorded.graph != 0 && dag.graph != 0 && recorded.graph != dag.graph {
                return Err(format!(
                    "the recording is of another graph of dag `{}`; record it again",
                    dag.name
                ));
            }
        }
        // Sources first: without them nothing can be computed.
        self.check_sources(own)?;
        self.own = own.clone();
        for channel in &own.channels {
            let (topic, schema) = (&channel.topic, &channel.schema);
            let others = (0..).zip(&self.header.channels);
            let mut others = others.filter(|(_, other)| is_same(other, channel));
            // A subtask may sample topics of the same name from several DAGs, so the n-th here is
            // the n-th there.
            let before = own.channels.iter().take(self.channels.len());
            let before = before.filter(|before| is_same(before, channel)).count();
            match others.nth(before) {
                Some((_, other)) if other.schema != *schema => {
                    let kind = match other.role {
                        Role::State => "state",
                        Role::Answer => "device",
                        Role::Source | Role::Result | Role::Sample => "topic",
                    };
                    return Err(format!(
                        "{kind} `{topic}` was recorded with values of type {}, and is of type \
                         {schema} now; record it again",
                        other.schema
                    ));
                }
                None if channel.role == Role::Source => {
                    return Err(format!(
                        "topic `{topic}` of a source is not in the recording; record it again"
                    ));
                }
                found => self.channels.push(found.map(|(number, _)| number)),
            }
        }
        // After all comparisons: the following steps trust the header.
        self.find_inputs(task_set);
        self.find_begins(task_set)?;
        self.check_releases(task_set)?;
        self.name_faults(task_set);
        let is_compared = |((place, _), _): &&((u16, u64), _)| {
            is_compared(self.header.channels[usize::from(*place)].role)
        };
        self.to_compare = self.values.iter().filter(is_compared).count() as u64;
        Ok(())
    }

    /// Finds the DAGs with recorded inputs, and their jobs with any: values returned by sources,
    /// or, without such values, samples taken by sources.
    fn find_inputs(&mut self, task_set: &TaskSet) {
        let is_source = |channel: &Channel| {
            let dag = task_set.dags().get(usize::from(channel.dag));
            dag.is_some_and(|dag| dag.sources().contains(&SubtaskId(channel.subtask.into())))
        };
        let channels = &self.header.channels;
        let with = |role| {
            let of_role = move |channel: &&Channel| {
                channel.role == role && (role == Role::Source || is_source(channel))
            };
            channels.iter().filter(of_role)
        };
        let is_input = |channel: &Channel| {
            let has_sources = || with(Role::Source).any(|source| source.dag == channel.dag);
            match channel.role {
                Role::Source => true,
                // A DAG whose sources only sample takes their samples as its inputs.
                Role::Sample => is_source(channel) && !has_sources(),
                Role::Result | Role::State | Role::Answer => false,
            }
        };
        let inputs: Vec<bool> = channels.iter().map(is_input).collect();
        let of_inputs = channels
            .iter()
            .zip(&inputs)
            .filter(|(_, is_input)| **is_input);
        let mut dags: Vec<u16> = of_inputs.map(|(channel, _)| channel.dag).collect();
        dags.sort_unstable();
        let of_inputs = self
            .values
            .iter()
            .filter(|((place, _), _)| inputs[usize::from(*place)]);
        let dag_of = |place: u16| channels[usize::from(place)].dag;
        let mut jobs: Vec<(u16, u64)> = of_inputs
            .map(|((place, job), _)| (dag_of(*place), *job))
            .collect();
        // Sorted for the binary searches of the run.
        jobs.sort_unstable();
        if self.is_cut {
            // A cut recording may have a value of one source for its last jobs, and none of
            // another.
            let all = |dag: u16| dags.iter().filter(|other| **other == dag).count();
            let of_jobs = jobs.chunk_by(|one, other| one == other);
            let whole = of_jobs.filter(|of_job| of_job.len() == all(of_job[0].0));
            jobs = whole.map(|of_job| of_job[0]).collect();
            // The replay does not compute jobs it passes over, so their values must not count as
            // missing.
            self.values.retain(|((place, job), _)| {
                let dag = dag_of(*place);
                dags.binary_search(&dag).is_err() || jobs.binary_search(&(dag, *job)).is_ok()
            });
        }
        jobs.dedup();
        dags.dedup();
        let cuts = self.passed.cuts.clone();
        self.passed = Arc::new(SkippedInstances { dags, jobs, cuts });
    }

    /// Makes sure that time releases each job of a periodic DAG with recorded inputs at its
    /// recorded time.
    fn check_releases(&self, task_set: &TaskSet) -> Result<(), String> {
        for ((place, job), value) in &self.values {
            let dag = self.header.channels[usize::from(*place)].dag;
            let model = task_set.dag(id(dag));
            let here_ns = model.grid_ns(*job);
            let then_ns = recording::release_ns_of(&self.bytes, value.start);
            if let Some(then_ns) = then_ns
                && then_ns != here_ns
                && !model.is_sporadic()
                && self.passed.is_of(dag)
            {
                return Err(format!(
                    "the recording's job {job} of dag `{}` was due at {then_ns} ns, and is due at \
                     {here_ns} ns here; commit the period and the offset that were recorded, or \
                     record it again",
                    self.name_of(dag)
                ));
            }
        }
        Ok(())
    }

    /// Makes sure that the replay calls no recorded source, and that no value of a source is lost.
    fn check_sources(&self, own: &Header) -> Result<(), String> {
        let mut sources = (self.header.channels.iter()).filter(|other| other.role == Role::Source);
        let is_here = |source: &Channel| own.channels.iter().any(|own| is_same(own, source));
        // Recorded then and not now: the source would be called, and compute something else.
        if let Some(Channel { topic, .. }) = sources.find(|source| !is_here(source)) {
            return Err(format!(
                "topic `{topic}` of a source is in the recording, and is not recorded here; add \
                 `dag.record::<T>(\"{topic}\")`"
            ));
        }
        match self.lost {
            None => Ok(()),
            Some((place, job)) => Err(format!(
                "the recording has lost topic `{}` of job {job}, without which later jobs may \
                 come out differently; record smaller values, see `Dag::record`",
                self.header.channels[usize::from(place)].topic
            )),
        }
    }
}

/// Reports whether two channels, of two runs, carry the same values.
fn is_same(one: &Channel, other: &Channel) -> bool {
    let same_subtask = one.role != Role::Sample || one.subtask == other.subtask;
    same_subtask && (one.dag, one.role, &one.topic) == (other.dag, other.role, &other.topic)
}

/// The greatest number of jobs of a DAG in a replay: all data of them is kept.
const MOST_JOBS: u64 = 10_000_000;

/// Reads the name of a job, in the form DAG/JOB.
///
/// ```
/// assert_eq!(fass::edge::job_of("gait/17"), Some(("gait", 17)));
/// ```
pub fn job_of(words: &str) -> Option<(&str, u64)> {
    let (dag, job) = words.rsplit_once('/')?;
    Some((dag, job.parse().ok()?))
}

impl Replay {
    /// Makes the replay begin as late as possible while computing this job from recorded values.
    pub fn begin_before(&mut self, dag: &str, job: u64) {
        self.from = Some((dag.into(), job));
    }

    /// Finds the first job of each DAG, and forgets the jobs before.
    fn find_begins(&mut self, task_set: &TaskSet) -> Result<(), String> {
        self.begins = vec![0; task_set.dags().len()];
        let ids = (0_u16..).take(self.begins.len());
        for dag in ids.clone() {
            self.begins[usize::from(dag)] = self.earliest(task_set, dag);
        }
        if let Some((name, job)) = self.from.take() {
            let mut dags = ids.clone();
            let of = dags.find(|dag| self.is_of(id(*dag)) && self.name_of(*dag) == name);
            let of = of.ok_or_else(|| {
                format!("the recording has no inputs of a dag `{name}` to begin with")
            })?;
            // The latest job up to the wanted one at whose beginning all states are known.
            let begin = self.latest(of, |other| other <= job);
            let at_ns = self.release_ns(task_set, of, begin);
            for dag in ids.clone() {
                if !self.is_of(id(dag)) {
                    continue;
                }
                self.begins[usize::from(dag)] = match dag == of {
                    true => begin,
                    // The other DAGs begin with the job they were at then, so their samples of each
                    // other fit.
                    false => self.latest(dag, |job| self.release_ns(task_set, dag, job) <= at_ns),
                };
            }
        }
        self.check_jobs(task_set)?;
        self.lacking = ids.clone().find_map(|dag| {
            let begin = self.begins[usize::from(dag)];
            let is_lacking = self.is_of(id(dag)) && begin > 0 && !self.has_states(dag, begin);
            is_lacking.then(|| (self.name_of(dag).into(), begin))
        });
        self.forget_before(task_set);
        Ok(())
    }

    fn name_of(&self, dag: u16) -> &str {
        &self.own.dags[usize::from(dag)].name
    }

    /// Returns the jobs of a DAG with recorded inputs.
    fn jobs_with_inputs(&self, dag: u16) -> impl DoubleEndedIterator<Item = u64> + Clone {
        let jobs = &self.passed.jobs;
        let [first, end] = [dag.into(), u32::from(dag) + 1]
            .map(|dag: u32| jobs.partition_point(|(of, _)| u32::from(*of) < dag));
        jobs[first..end].iter().map(|(_, job)| *job)
    }

    /// Reports whether a DAG has states and all of them are recorded in a job. No recorded state
    /// covers an earlier restart or fallback of a subtask.
    fn has_states(&self, dag: u16, job: u64) -> bool {
        let events = self.events.iter();
        let mut restarts =
            events.filter(|event| (event.dag, event.what) == (dag, EntryKind::Restart));
        self.channels_of_states(dag).next().is_some()
            && self.is_whole(dag, job)
            // After a restart, a subtask's own memory is not that of the beginning.
            && restarts.all(|event| event.job >= job)
    }

    /// Reports whether no state of a DAG is lacking in a job.
    fn is_whole(&self, dag: u16, job: u64) -> bool {
        let mut channels = self.channels_of_states(dag);
        channels.all(|channel| self.find(channel, job).is_some())
    }

    fn channels_of_states(&self, dag: u16) -> impl Iterator<Item = u16> {
        let channels = (0..).zip(&self.own.channels);
        let of_states = channels.filter(move |(_, it)| (it.dag, it.role) == (dag, Role::State));
        of_states.map(|(channel, _)| channel)
    }

    /// Returns the first job that a DAG can begin with.
    fn earliest(&self, task_set: &TaskSet, dag: u16) -> u64 {
        let mut jobs = self.jobs_with_inputs(dag);
        let mut events = self.events.iter();
        // Job 0 may have been skipped or cut, and thus have no inputs.
        if events.any(|event| (event.dag, event.job) == (dag, 0)) {
            return 0;
        }
        match jobs.clone().next() {
            Some(0) => 0,
            Some(first) => jobs.find(|job| self.is_whole(dag, *job)).unwrap_or(first),
            None if !task_set.dag(id(dag)).is_sporadic() => 0,
            None => self.first_signals.get(&id(dag)).copied().unwrap_or(0),
        }
    }

    /// Returns the latest job with inputs and all states for which `is_early` holds.
    fn latest(&self, dag: u16, is_early: impl Fn(u64) -> bool) -> u64 {
        let mut jobs = self.jobs_with_inputs(dag).rev();
        let found = jobs.find(|job| is_early(*job) && self.is_whole(dag, *job));
        found.unwrap_or(0).max(self.begins[usize::from(dag)])
    }

    fn release_ns(&self, task_set: &TaskSet, dag: u16, job: u64) -> u64 {
        let model = task_set.dag(id(dag));
        let first = self.first_signals.get(&id(dag)).copied().unwrap_or(0);
        let place = usize::try_from(job.saturating_sub(first)).unwrap_or(usize::MAX);
        let signals = self.signals.get(&id(dag)).filter(|_| model.is_sporadic());
        let signal_ns = signals.and_then(|signals| signals.get(place)).copied();
        signal_ns.unwrap_or_else(|| model.grid_ns(job))
    }

    /// Makes sure that a replay can go through all jobs up to the last.
    fn check_jobs(&self, task_set: &TaskSet) -> Result<(), String> {
        let of_values = self.values.iter().map(|((place, job), _)| {
            let channel = &self.header.channels[usize::from(*place)];
            (channel.dag, *job)
        });
        let of_signals = self.first_signals.iter();
        let of_signals = of_signals.filter_map(|(dag, job)| Some((dag.0.try_into().ok()?, *job)));
        let begin = |dag: u16| self.begins[usize::from(dag)];
        let is_too_late = |(dag, job): &(u16, u64)| {
            let release_ns = task_set.dag(id(*dag)).grid_ns(*job);
            // A damaged file may name a job that a replay would take years to reach.
            job.saturating_sub(begin(*dag)) >= MOST_JOBS || release_ns > u64::MAX / 2
        };
        match of_values.chain(of_signals).find(is_too_late) {
            Some((dag, job)) => Err(format!(
                "the recording has job {job} of dag `{}`, and a replay goes through all jobs from {} \
                 on, which may be {MOST_JOBS} at most; record a shorter run",
                self.name_of(dag),
                begin(dag)
            )),
            None => Ok(()),
        }
    }

    /// Forgets everything before the first jobs, and provides a signal for each job from there on.
    /// Jobs without a recorded signal are placed at the distance stated by the DAG, so there is
    /// time for them.
    fn forget_before(&mut self, task_set: &TaskSet) {
        let (begins, channels) = (&self.begins, &self.header.channels);
        let is_kept = |dag: u16, job: u64| job >= begins[usize::from(dag)];
        self.values.retain(|((place, job), _)| {
            let dag = channels[usize::from(*place)].dag;
            is_kept(dag, *job)
        });
        self.events.retain(|event| is_kept(event.dag, event.job));
        self.faults
            .retain(|fault| fault.instance.job >= begins[fault.instance.dag.index()]);
        let jobs = &mut Arc::make_mut(&mut self.passed).jobs;
        jobs.retain(|(dag, job)| is_kept(*dag, *job));
        // Only signals release a sporadic DAG, and no other DAG takes any.
        self.signals
            .retain(|dag, _| task_set.dag(*dag).is_sporadic());
        for (dag, signals) in &mut self.signals {
            let (begin, model) = (begins[dag.index()], task_set.dag(*dag));
            let first = self.first_signals.get(dag).copied().unwrap_or(0);
            let before = usize::try_from(begin.saturating_sub(first)).unwrap_or(usize::MAX);
            // Signals of jobs before the beginning are spent.
            signals.drain(..before.min(signals.len()));
            for job in (begin..first).rev() {
                signals.push_front(model.grid_ns(job));
            }
        }
    }

    /// Makes the replayed DAGs release the recorded jobs, and lose none on the way. Adds the states
    /// at the beginning to the plan ([`Plan::restore`]).
    pub fn prepare(&self, plan: &mut Plan) {
        self.restore(plan);
        let task_set = Arc::make_mut(&mut plan.task_set);
        for dag in (0..).map(DagId).take(task_set.dags().len()) {
            // No other signals come. Without a last job, a periodic DAG would never end the run,
            // and a sporadic DAG would not keep it going.
            let begin = self.begins[dag.index()];
            let of_signals = || {
                let signals = self.signals.get(&dag);
                signals.map_or(begin, |signals| begin + signals.len() as u64)
            };
            let end = match task_set.dag(dag).is_sporadic() {
                true => Some(of_signals()),
                false => self.end_of(dag),
            };
            if let Some(end) = end {
                task_set.replay(dag, begin..end);
                if let Some(lifecycle) = &mut plan.lifecycle {
                    // Pauses and modes are in the recording, as skipped jobs.
                    lifecycle.leave_alone(dag);
                }
            }
        }
    }

    /// Returns the job after a DAG's last, if its inputs are recorded.
    fn end_of(&self, dag: DagId) -> Option<u64> {
        let dag = u16::try_from(dag.0).ok().filter(|_| self.is_of(dag))?;
        // The list is sorted, so the first from the end is the last job with inputs.
        let of_dag = self.passed.jobs.iter().rev().find(|(of, _)| *of == dag);
        Some(of_dag.map_or(1, |(_, last)| last.saturating_add(1)))
    }

    /// Makes the bodies of a plan pass over the skipped instances.
    pub(crate) fn guard(&self, plan: &mut Plan) {
        guard(plan, &self.passed);
    }

    /// Notes the recorded states at the beginning of the replay, and has states kept in each job:
    /// they are compared in every job with a recorded state.
    fn restore(&self, plan: &mut Plan) {
        for (channel, of) in (0..).zip(&plan.lines) {
            let begin = self.begins[of.dag.index()];
            let state = of.state.as_ref();
            let state = state.inspect(|state| state.keep_every(1));
            if let Some(kept) = state.filter(|_| begin > 0)
                && let Some(value) = self.value(channel, begin)
            {
                let topic = &self.own.channels[usize::from(channel)].topic;
                let complaint = format!(
                    "state `{topic}` cannot be what the recording has of job {begin}; record it \
                     again"
                );
                (plan.begins).push((Arc::clone(kept), value.to_vec(), complaint));
            }
        }
    }
}

fn id(dag: u16) -> DagId {
    DagId(dag.into())
}
