//! Drawing what befalls a set: faults, pauses, and a division of the cores.
//!
//! It has a random sequence of its own, so a round's DAGs are the same with and without it.
//! Every third round has none of it but the division.

use alloc::vec;
use alloc::vec::Vec;

use common::random::{Random, nth};

use crate::set::DagPlan;

/// What befalls the DAGs of one round.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Trouble {
    /// The cores of each cluster; none: they are not divided.
    pub clusters: Vec<u32>,
    /// What befalls each DAG, in their order; those beyond the end have no trouble.
    pub dags: Vec<DagTrouble>,
}

/// What befalls one DAG.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DagTrouble {
    /// Its cluster, where cores are divided.
    pub cluster: u32,
    /// The fault of a subtask of its own, besides the drawn ones.
    pub fault: Option<FaultPlan>,
    /// The DAG, by number, that it pauses and resumes, over and over.
    pub pauses: Option<usize>,
}

/// A fault that a DAG is to have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FaultPlan {
    /// What follows it.
    pub then: Then,
    /// Which call of the subtask's function panics: of as many as half of its DAG's jobs, what
    /// this number makes of it.
    pub call: u64,
}

/// What follows a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Then {
    /// The DAG is ended.
    End,
    /// The job is cut, and the subtask is made anew.
    Restart,
    /// The job is cut, and the subtask falls back on another function.
    FallBack,
}

impl Then {
    /// All there are.
    pub const ALL: [Self; 3] = [Self::End, Self::Restart, Self::FallBack];
}

impl Trouble {
    /// Draws what befalls a round's set.
    #[must_use]
    pub fn draw(seed: u64, round: u64, plans: &[DagPlan], cores: u32) -> Self {
        // Not the sequence that the set is drawn from.
        let mut random = Random::new(nth(!seed, round));
        let is_divided = random.once_in(2);
        let is_quiet = random.once_in(3);
        let mut dags = vec![DagTrouble::default(); plans.len()];
        for (number, dag) in dags.iter_mut().enumerate().filter(|_| !is_quiet) {
            dag.fault = random.once_in(2).then(|| FaultPlan {
                then: Then::ALL[random.index(Then::ALL.len())],
                call: random.number(),
            });
            let others = plans.len() - 1;
            let other = random.once_in(2) && others > 0;
            dag.pauses = other.then(|| (number + 1 + random.index(others)) % plans.len());
        }
        let trouble = Self {
            clusters: Vec::new(),
            dags,
        };
        match is_divided {
            true => trouble.divided(plans, cores),
            false => trouble,
        }
    }

    /// Divides the cores, if there are several, into two clusters; the DAGs with the most work
    /// choose theirs first, the one with the least work for a core.
    #[must_use]
    pub fn divided(mut self, plans: &[DagPlan], cores: u32) -> Self {
        if cores < 2 {
            return self;
        }
        self.dags.resize(plans.len(), DagTrouble::default());
        let sizes = [cores / 2, cores - cores / 2];
        let mut order: Vec<_> = (plans.iter().enumerate())
            .map(|(number, plan)| {
                let work_ns: u64 = plan.subtasks.iter().map(|subtask| subtask.wcet_ns).sum();
                (work_ns * 1000 / plan.period_ns, number)
            })
            .collect();
        order.sort_unstable_by(|one, other| other.cmp(one));
        let mut loads = [0; 2];
        for (load, number) in order {
            let first = loads[0] * u64::from(sizes[1]) <= loads[1] * u64::from(sizes[0]);
            let cluster = usize::from(!first);
            loads[cluster] += load;
            self.dags[number].cluster = u32::from(!first);
        }
        self.clusters = sizes.to_vec();
        self
    }

    /// Returns what befalls a DAG.
    #[must_use]
    pub fn of(&self, number: usize) -> DagTrouble {
        self.dags.get(number).copied().unwrap_or_default()
    }

    /// Reports whether a DAG is paused by any.
    #[must_use]
    pub fn pauses(&self, number: usize) -> bool {
        self.dags.iter().any(|dag| dag.pauses == Some(number))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::set::draw_set;

    #[test]
    fn a_seed_and_a_round_are_one_trouble() {
        let draw = |seed, round| {
            let plans = draw_set(seed, round, 90, 4);
            Trouble::draw(seed, round, &plans, 4)
        };
        assert_eq!(draw(1, 7), draw(1, 7));
        let all: Vec<_> = (0..60).map(|round| draw(1, round)).collect();
        let count = |of: fn(&Trouble) -> bool| all.iter().filter(|it| of(it)).count();
        assert!((15..45).contains(&count(|it| it.clusters == [2, 2])));
        assert!((10..30).contains(&count(|it| it.dags.iter().all(|dag| dag.fault.is_none()))));
        for then in Then::ALL {
            let faults = all.iter().flat_map(|it| &it.dags).filter_map(|it| it.fault);
            assert!(faults.filter(|it| it.then == then).count() > 10);
        }
    }

    #[test]
    fn no_dag_pauses_itself_and_one_core_is_not_divided() {
        for round in 0..100 {
            let plans = draw_set(3, round, 90, 1);
            let trouble = Trouble::draw(3, round, &plans, 1);
            assert!(trouble.clusters.is_empty());
            for (number, dag) in trouble.dags.iter().enumerate() {
                assert!(dag.pauses.is_none_or(|it| it != number && it < plans.len()));
            }
        }
    }
}
