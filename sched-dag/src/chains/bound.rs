//! How long the times of a chain can be, where each of its DAGs has a bound.
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
//! data age. With the longest data age goes the longest reaction time, as `latencies` shows.
//!
//! The sum of T + R over all DAGs is the bound of A. Davare et al., Period Optimization for Hard
//! Real-time Distributed Automotive Systems, DAC 2007 (doi:10.1145/1278480.1278553). It is safe
//! for any phases of the DAGs, so it is not tight for given ones.
//!
//! It holds for as long as jobs come: none is skipped, aborted or lost by a fault, and the DAGs
//! go on. A sporadic DAG has no longest distance of releases, so its T is none; as the last
//! DAG of a chain it still has an age of outputs.

use super::{Chain, Segment};
use crate::ids::DagId;
use crate::task_set::TaskSet;

impl Chain {
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
