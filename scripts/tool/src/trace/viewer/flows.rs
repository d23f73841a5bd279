//! The arrows: which there are, and their numbers.
//!
//! There is one for each edge of the graph and each job in which the predecessor
//! has finished and the successor has started. Each is drawn twice, between cores
//! and between subtasks, under two numbers.

use std::collections::BTreeMap;

use sched_dag::{DagId, Instance, SubtaskId};

use super::super::view::View;

/// The arrows of a run.
#[derive(Debug)]
pub(super) struct Flows {
    /// By instance, those that leave it.
    out: BTreeMap<Instance, Vec<u64>>,
    /// By instance, those that lead to it.
    into: BTreeMap<Instance, Vec<u64>>,
    count: u64,
    first: u64,
    /// What lies between the numbers of an arrow's two drawings, and the first.
    shift: u64,
}

impl Flows {
    /// Finds all arrows and numbers them from `first` on.
    pub(super) fn new(view: &View<'_>, first: u64) -> Flows {
        let mut flows = Flows {
            out: BTreeMap::new(),
            into: BTreeMap::new(),
            count: 0,
            first,
            shift: 0,
        };
        for (&later, history) in &view.histories {
            if history.start_ns.is_none() {
                continue;
            }
            for &subtask in predecessors(view, later.dag, later.subtask) {
                let earlier = Instance { subtask, ..later };
                let finish = view.histories.get(&earlier).and_then(|it| it.finish_ns);
                if finish.is_some() {
                    flows.out.entry(earlier).or_default().push(flows.count);
                    flows.into.entry(later).or_default().push(flows.count);
                    flows.count += 1;
                }
            }
        }
        flows
    }

    /// Goes on with the second drawing of all arrows.
    pub(super) fn draw_again(&mut self) {
        self.shift = self.count;
    }

    /// Returns the numbers of the arrows that leave an instance.
    pub(super) fn out(&self, instance: Instance) -> impl Iterator<Item = u64> {
        self.numbers(self.out.get(&instance))
    }

    /// Returns the numbers of the arrows that lead to an instance.
    pub(super) fn into(&self, instance: Instance) -> impl Iterator<Item = u64> {
        self.numbers(self.into.get(&instance))
    }

    /// Returns the first number that no arrow has.
    pub(super) const fn next(&self) -> u64 {
        self.first + 2 * self.count
    }

    fn numbers<'f>(&'f self, of: Option<&'f Vec<u64>>) -> impl Iterator<Item = u64> + 'f {
        let numbers = of.into_iter().flatten();
        numbers.map(|number| number + self.first + self.shift)
    }
}

fn predecessors<'v>(view: &'v View<'_>, dag: DagId, subtask: SubtaskId) -> &'v [SubtaskId] {
    view.run.task_set.dag(dag).predecessors(subtask)
}
