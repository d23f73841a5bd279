//! Answers about some DAGs of a plan, among the answers about all.

use super::{Answers, Verdict};
use sched_dag::DagId;
use sched_dag::analysis::Reason;

impl Answers {
    /// Puts these answers, about the DAGs of these numbers, into the places of earlier ones; those of other
    /// DAGs remain.
    pub(crate) fn put_into(self, earlier: &Self, ids: &[DagId]) -> Self {
        let mut of_dags = earlier.of_dags.clone();
        for (mut answer, &id) in self.of_dags.into_iter().zip(ids) {
            answer.dag.id = id;
            if let Verdict::NotProven(unproven) = &mut answer.verdict {
                if let Some(other) = &mut unproven.other {
                    other.id = ids[other.id.index()];
                }
                if let Reason::DelayedBy { dag } = &mut unproven.reason {
                    *dag = ids[dag.index()];
                }
            }
            match of_dags.get_mut(id.index()) {
                Some(place) => *place = answer,
                None => of_dags.push(answer),
            }
        }
        Self {
            of_dags,
            first_unproven: self.first_unproven.map(|place| ids[place].index()),
            settings: self.settings,
        }
    }
}
