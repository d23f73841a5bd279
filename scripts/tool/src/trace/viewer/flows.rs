//! The arrows: which there are, and their numbers.
//!
//! There is one for each edge of the graph and each job in which the predecessor
//! has finished and the successor has started, and one for each sample, from the instance
//! whose value it is to the one that has sampled it. Each is drawn twice, between cores
//! and between subtasks, under two numbers.

use std::collections::BTreeMap;

use sched_dag::chains::SampledJobs;
use sched_dag::{DagId, Instance, SubtaskId};

use super::super::view::View;

/// An arrow, as it is drawn once.
#[derive(Clone, Copy, Debug)]
pub(super) struct Flow {
    pub(super) number: u64,
    /// Whether it is a sample, and no edge.
    pub(super) is_sample: bool,
}

/// The arrows of a run.
#[derive(Debug)]
pub(super) struct Flows {
    /// By instance, those that leave it.
    out: BTreeMap<Instance, Vec<u64>>,
    /// By instance, those that lead to it.
    into: BTreeMap<Instance, Vec<u64>>,
    count: u64,
    /// How many of them, the first ones, are edges.
    edges: u64,
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
            edges: 0,
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
                    flows.add(earlier, later);
                }
            }
        }
        flows.edges = flows.count;
        let samplings = &view.run.samplings;
        let sampled = SampledJobs::new(samplings, view.in_the_order_of_the_log());
        for (reader, writer) in sampled.all() {
            flows.add(writer, reader);
        }
        flows
    }

    fn add(&mut self, from: Instance, to: Instance) {
        self.out.entry(from).or_default().push(self.count);
        self.into.entry(to).or_default().push(self.count);
        self.count += 1;
    }

    /// Goes on with the second drawing of all arrows.
    pub(super) fn draw_again(&mut self) {
        self.shift = self.count;
    }

    /// Returns the arrows that leave an instance.
    pub(super) fn out(&self, instance: Instance) -> impl Iterator<Item = Flow> {
        self.drawn(self.out.get(&instance))
    }

    /// Returns the arrows that lead to an instance.
    pub(super) fn into(&self, instance: Instance) -> impl Iterator<Item = Flow> {
        self.drawn(self.into.get(&instance))
    }

    /// Returns the first number that no arrow has.
    pub(super) const fn next(&self) -> u64 {
        self.first + 2 * self.count
    }

    fn drawn<'f>(&'f self, of: Option<&'f Vec<u64>>) -> impl Iterator<Item = Flow> + 'f {
        of.into_iter().flatten().map(|arrow| Flow {
            number: arrow + self.first + self.shift,
            is_sample: *arrow >= self.edges,
        })
    }
}

fn predecessors<'v>(view: &'v View<'_>, dag: DagId, subtask: SubtaskId) -> &'v [SubtaskId] {
    view.run.task_set.dag(dag).predecessors(subtask)
}
