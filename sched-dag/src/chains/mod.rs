//! Chains that cross DAGs by latest values: how long an effect takes from end to end.
//!
//! Within a DAG the response time says all. From the DAG of a sensor to that of a motor values
//! pass by *sampling*: a subtask takes the latest value that is complete when it starts. Such a
//! path of subtasks is what the literature calls a *cause-effect chain*, with *implicit
//! communication* (N. Feiertag et al., A Compositional Framework for End-to-End Path Delay
//! Calculation of Automotive Systems under Different Path Semantics, CRTS 2008; M. Günzel et al.,
//! Timing Analysis of Asynchronized Distributed Cause-Effect Chains, RTAS 2021,
//! doi:10.1109/RTAS52030.2021.00012).
//!
//! # Words
//!
//! - A chain has *segments*: in each DAG that it passes, the subtask at which it enters and the
//!   one at which it leaves. The last subtask of the last segment makes the *outputs*.
//! - An output *goes back* to one job of the first DAG: the one whose value was sampled by the
//!   job whose value was sampled ... by the job of the output. (An *immediate backward chain*.)
//! - *Age of an output*: from the nominal release of the job that it goes back to, to its finish.
//!   RTAS 2021 calls its maximum the *reduced* data age.
//! - *Data age*: the same to the finish of the next output, for so long the old one is in force.
//!   (*Last to last* of CRTS 2008.)
//! - *Reaction time* to what happens just after a job of the first DAG has been released, and is
//!   too late for it: from there to the finish of the first output that goes back to a later job.
//!   (*First to first.*) The longest reaction time is the longest data age, but for what the end
//!   of a run cuts off (M. Günzel et al., On the Equivalence of Maximum Reaction Time and Maximum
//!   Data Age for Cause-Effect Chains, ECRTS 2023, doi:10.4230/LIPIcs.ECRTS.2023.10).
//!
//! The first subtask counts as reading its sensor at the nominal release. It starts later, so
//! what it reads is younger, and none of the times is longer than stated here.
//!
//! # Parts
//!
//! [`Chain::all`] and [`Chain::between`] find chains, [`Chain::latencies`] measures one in the
//! events of a run, [`Chain::output_age_bound_ns`] and [`Chain::reaction_bound_ns`] bound it.
//!
//! # Bounds: how long the times of a chain can be, where each of its DAGs has a bound
//!
//! Let DAG i of the chain, counted from 0 to n, have period T(i) and a proven response time
//! R(i), both from nominal releases on. Then
//!
//! - the age of an output is at most T(0) + R(0) + ... + T(n-1) + R(n-1) + R(n);
//! - data age and reaction time are at most T(n) longer.
//!
//! *Proof of the first.* Let job j of DAG i sample, at time t, the value of job k of DAG i-1.
//! Job k+1 was not complete at t, and is so R(i-1) after its release, which is T(i-1) after that
//! of k; so t < r(k) + T(i-1) + R(i-1). And r(j) <= t, as nothing of job j starts before its
//! release. So from r(k) to r(j) it is less than T(i-1) + R(i-1). Summed up over the samplings,
//! this leads from the release of the job that the output goes back to, to that of its own job,
//! which takes R(n) more.
//!
//! *Of the second.* The next output is that of the next job, released T(n) later: that is the
//! data age. With the longest data age goes the longest reaction time, as the words above say.
//!
//! The sum of T + R over all DAGs is the bound of A. Davare et al., Period Optimization for Hard
//! Real-time Distributed Automotive Systems, DAC 2007 (doi:10.1145/1278480.1278553). It is safe
//! for any phases of the DAGs, so it is not tight for given ones.
//!
//! It holds for as long as jobs come: none is skipped, aborted or lost by a fault, and the DAGs
//! go on. A sporadic DAG has no longest distance of releases, so its T is none; as the last
//! DAG of a chain it still has an age of outputs.

mod find;
mod latencies;

use alloc::vec::Vec;
use core::fmt;

use crate::ids::{DagId, SubtaskId};
use crate::task_set::{Dag, Subtask, TaskSet};

pub use latencies::{Latencies, SampledJobs};

/// A subtask of a DAG.
pub type Place = (DagId, SubtaskId);

/// The sampling of a topic: the subtask that writes it, and the one that samples it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Sampling {
    /// The subtask that writes the topic.
    pub writer: Place,
    /// The subtask that samples it.
    pub reader: Place,
}

/// The part of a chain that lies in one DAG.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Segment {
    dag: DagId,
    /// Where the chain enters: a sampling subtask, or where it begins.
    entry: SubtaskId,
    /// Where it leaves: the writer of what is sampled next, or of the outputs.
    exit: SubtaskId,
}

/// A path from a subtask to another one, along edges within DAGs and samplings between them. It
/// passes no DAG twice.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Chain {
    /// One for each DAG, at least one.
    segments: Vec<Segment>,
}

impl Chain {
    /// Finds a subtask that is named as `dag/subtask`, each part by its name or its number.
    #[must_use]
    pub fn place(task_set: &TaskSet, name: &str) -> Option<Place> {
        // Names may have a `/` in them.
        let splits = name
            .match_indices('/')
            .map(|(at, _)| (&name[..at], &name[at + 1..]));
        splits.into_iter().find_map(|(dag, subtask)| {
            let dags = task_set.dags().iter().map(Dag::name);
            let dag = DagId(number_of(dags, dag)?);
            let subtasks = task_set.dag(dag).subtasks().iter().map(Subtask::name);
            Some((dag, SubtaskId(number_of(subtasks, subtask)?)))
        })
    }

    /// Returns the names of the subtasks at which it enters and leaves DAGs, in its order, as
    /// `dag/subtask`.
    pub fn names<'t>(&'t self, task_set: &'t TaskSet) -> impl Iterator<Item = impl fmt::Display> {
        self.segments.iter().flat_map(move |segment| {
            let Segment { dag, entry, exit } = *segment;
            let exit = (exit != entry).then_some(exit);
            let of_segment = [Some(entry), exit].into_iter().flatten();
            of_segment.map(move |subtask| Named(task_set, (dag, subtask)))
        })
    }

    /// Returns how old an output can be at its finish; or else the first DAG that has no bound of
    /// its own in `responses_ns`, which are in the order of the DAGs, or is sporadic and not the
    /// last one.
    ///
    /// # Errors
    ///
    /// That DAG.
    pub fn output_age_bound_ns(
        &self,
        task_set: &TaskSet,
        responses_ns: &[Option<u64>],
    ) -> Result<u64, DagId> {
        let last = self.segments.len() - 1;
        let before = sum(&self.segments[..last], task_set, responses_ns)?;
        let dag = self.segments[last].dag;
        let response_ns = responses_ns.get(dag.index()).copied().flatten();
        Ok(before.saturating_add(response_ns.ok_or(dag)?))
    }

    /// Returns the longest reaction time, which is the longest data age; or else the first DAG
    /// that has no bound of its own, or is sporadic.
    ///
    /// # Errors
    ///
    /// That DAG.
    pub fn reaction_bound_ns(
        &self,
        task_set: &TaskSet,
        responses_ns: &[Option<u64>],
    ) -> Result<u64, DagId> {
        sum(&self.segments, task_set, responses_ns)
    }
}

/// Returns the sum of period and response time over DAGs.
fn sum(
    segments: &[Segment],
    task_set: &TaskSet,
    responses_ns: &[Option<u64>],
) -> Result<u64, DagId> {
    segments.iter().try_fold(0, |sum: u64, segment| {
        let model = task_set.dag(segment.dag);
        let response_ns = responses_ns.get(segment.dag.index()).copied().flatten();
        let response_ns = response_ns.filter(|_| !model.is_sporadic());
        let of_dag = model
            .period_ns()
            .saturating_add(response_ns.ok_or(segment.dag)?);
        Ok(sum.saturating_add(of_dag))
    })
}

/// Returns the position of what has this name, or else the number that is written there.
fn number_of<'n>(names: impl Iterator<Item = &'n str> + Clone, wanted: &str) -> Option<u32> {
    let named = (0..).zip(names.clone()).find(|(_, name)| *name == wanted);
    let number = || {
        wanted
            .parse()
            .ok()
            .filter(|number| (0..).zip(names).any(|(at, _)| at == *number))
    };
    named.map(|(at, _)| at).or_else(number)
}

/// A subtask as `dag/subtask`; what has no name has its number.
struct Named<'t>(&'t TaskSet, Place);

impl fmt::Display for Named<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(task_set, (dag, subtask)) = self;
        let model = task_set.dag(*dag);
        match model.name() {
            "" => write!(f, "{}/", dag.0)?,
            name => write!(f, "{name}/")?,
        }
        match model.subtask(*subtask).name() {
            "" => write!(f, "{}", subtask.0),
            name => f.write_str(name),
        }
    }
}
