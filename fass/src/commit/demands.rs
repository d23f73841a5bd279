//! Proofs that are demanded, and lacking.

use alloc::vec::Vec;

use super::answer::Answers;
use super::fault::Fault;
use crate::api::dag::Dag;

/// Returns which DAGs demand a proof.
pub(super) fn demands_of(dags: &[Dag]) -> Vec<bool> {
    let demands = dags.iter().map(|dag| dag.draft.borrow().demands_proof);
    demands.collect()
}

/// Returns a fault for each DAG that demands a proof and has none.
pub(super) fn lacking_proofs(demands: &[bool], answers: &Answers) -> Vec<Fault> {
    let demanding = (demands.iter().zip(&answers.of_dags)).filter(|(demands, _)| **demands);
    let lacking = demanding.filter_map(|(_, answer)| {
        Some(Fault::NotProven {
            dag: answer.dag.clone(),
            unproven: answer.verdict.unproven()?.clone(),
        })
    });
    lacking.collect()
}
