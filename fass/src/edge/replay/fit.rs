//! Whether a recording is one of a plan, and which channel is which.

use alloc::format;
use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec::Vec;

use recording::{Channel, Header, Role};
use sched_dag::{SubtaskId, TaskSet};

use super::{Replay, is_compared};
use crate::edge::guard::Passed;

impl Replay {
    /// Finds the channels of the plan.
    ///
    /// # Errors
    ///
    /// In words: the recording is of other DAGs or types, or lacks what a source has sent.
    pub fn fit(&mut self, own: &Header, task_set: &TaskSet) -> Result<(), String> {
        for (number, recorded) in self.header.dags.iter().enumerate() {
            let remedy = "commit the DAGs that were recorded, in their order";
            let Some(dag) = own.dags.get(number) else {
                return Err(format!(
                    "the recording's dag {number} is `{}`, and here there is none; {remedy}",
                    recorded.name
                ));
            };
            if recorded.name != dag.name {
                return Err(format!(
                    "the recording's dag {number} is `{}`, and here it is `{}`; {remedy}",
                    recorded.name, dag.name
                ));
            }
            // A DAG that records nothing has none.
            if recorded.graph != 0 && dag.graph != 0 && recorded.graph != dag.graph {
                return Err(format!(
                    "the recording is of another graph of dag `{}`; record it again",
                    dag.name
                ));
            }
        }
        self.check_sources(own)?;
        self.own = own.clone();
        for channel in &own.channels {
            let (topic, schema) = (&channel.topic, &channel.schema);
            let others = (0..).zip(&self.header.channels);
            let mut others = others.filter(|(_, other)| is_same(other, channel));
            // A subtask may sample topics of one name of several DAGs.
            let before = own.channels.iter().take(self.channels.len());
            let before = before.filter(|before| is_same(before, channel)).count();
            match others.nth(before) {
                Some((_, other)) if other.schema != *schema => {
                    let kind = if other.role == Role::State {
                        "state"
                    } else {
                        "topic"
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
        self.find_inputs(task_set);
        self.find_begins(task_set)?;
        self.name_faults(task_set);
        let is_compared = |((place, _), _): &&((u16, u64), _)| {
            is_compared(self.header.channels[usize::from(*place)].role)
        };
        self.to_compare = self.values.iter().filter(is_compared).count() as u64;
        Ok(())
    }

    /// Finds the DAGs whose inputs are recorded, and the jobs that have some: values that
    /// sources returned, or else what they have sampled.
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
                Role::Sample => is_source(channel) && !has_sources(),
                Role::Result | Role::State => false,
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
        jobs.sort_unstable();
        if self.is_cut {
            // Of its last jobs there may be a value of one source, and none of another one.
            let all = |dag: u16| dags.iter().filter(|other| **other == dag).count();
            let of_jobs = jobs.chunk_by(|one, other| one == other);
            let whole = of_jobs.filter(|of_job| of_job.len() == all(of_job[0].0));
            jobs = whole.map(|of_job| of_job[0]).collect();
            // What is passed over is not computed.
            self.values.retain(|((place, job), _)| {
                let dag = dag_of(*place);
                dags.binary_search(&dag).is_err() || jobs.binary_search(&(dag, *job)).is_ok()
            });
        }
        jobs.dedup();
        dags.dedup();
        let cuts = self.passed.cuts.clone();
        self.passed = Arc::new(Passed { dags, jobs, cuts });
    }

    /// Makes sure that no recorded source would be called, and that none of its values is lost.
    fn check_sources(&self, own: &Header) -> Result<(), String> {
        let mut sources = (self.header.channels.iter()).filter(|other| other.role == Role::Source);
        let is_here = |source: &Channel| own.channels.iter().any(|own| is_same(own, source));
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

/// Reports whether two channels have the same values, of two runs.
fn is_same(one: &Channel, other: &Channel) -> bool {
    let same_subtask = one.role != Role::Sample || one.subtask == other.subtask;
    same_subtask && (one.dag, one.role, &one.topic) == (other.dag, other.role, &other.topic)
}
