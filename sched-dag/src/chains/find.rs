//! Which chains there are.

use alloc::vec;
use alloc::vec::Vec;

use super::{Chain, Place, Sampling, Segment};
use crate::ids::{DagId, SubtaskId};
use crate::task_set::{Dag, TaskSet};

/// The most chains that are looked for: their number may double with each DAG.
const MOST: usize = 1000;

impl Chain {
    /// Finds the chains that cross DAGs and are part of no longer one: from a source that samples
    /// nothing to a sink that no DAG samples. At most 1000.
    #[must_use]
    pub fn all(task_set: &TaskSet, samplings: &[Sampling]) -> Vec<Chain> {
        let mut search = Search::new(task_set, samplings);
        for (dag, model) in (0..).map(DagId).zip(task_set.dags()) {
            for &source in model.sources() {
                let place = (dag, source);
                if samplings.iter().all(|sampling| sampling.reader != place) {
                    search.go_on_from(place, &|search, exit| {
                        !search.path.is_empty()
                            && model_of(search, exit).sinks().contains(&exit.1)
                            && samplings.iter().all(|sampling| sampling.writer != exit)
                    });
                }
            }
        }
        search.found
    }

    /// Finds the chains from a subtask to another one, of the same DAG or of another, at most
    /// 1000. None, if nothing leads there.
    #[must_use]
    pub fn between(
        task_set: &TaskSet,
        samplings: &[Sampling],
        from: Place,
        to: Place,
    ) -> Vec<Chain> {
        let mut search = Search::new(task_set, samplings);
        search.go_on_from(from, &|_, exit| exit == to);
        search.found
    }
}

fn model_of<'t>(search: &Search<'t>, (dag, _): Place) -> &'t Dag {
    search.task_set.dag(dag)
}

struct Search<'t> {
    task_set: &'t TaskSet,
    /// Each once: a subtask may sample a topic twice.
    samplings: Vec<Sampling>,
    /// The segments up to the one that is looked at.
    path: Vec<Segment>,
    found: Vec<Chain>,
}

impl<'t> Search<'t> {
    fn new(task_set: &'t TaskSet, samplings: &[Sampling]) -> Self {
        let mut samplings = samplings.to_vec();
        samplings.sort_unstable();
        samplings.dedup();
        Self {
            task_set,
            samplings,
            path: Vec::new(),
            found: Vec::new(),
        }
    }

    /// Finds the chains that go on from a subtask. It calls itself at most once for each DAG.
    fn go_on_from(&mut self, (dag, entry): Place, is_end: &dyn Fn(&Self, Place) -> bool) {
        for exit in self.reached_from((dag, entry)) {
            if self.found.len() >= MOST {
                return;
            }
            let segment = Segment { dag, entry, exit };
            if is_end(self, (dag, exit)) {
                let segments = [&self.path[..], &[segment]].concat();
                self.found.push(Chain { segments });
            }
            self.path.push(segment);
            for at in 0..self.samplings.len() {
                let Sampling { writer, reader } = self.samplings[at];
                let is_new = self.path.iter().all(|passed| passed.dag != reader.0);
                if writer == (dag, exit) && is_new {
                    self.go_on_from(reader, is_end);
                }
            }
            self.path.pop();
        }
    }

    /// Returns a subtask and all that follow it in its DAG.
    fn reached_from(&self, (dag, entry): Place) -> Vec<SubtaskId> {
        let model = self.task_set.dag(dag);
        let mut is_reached = vec![false; model.subtasks().len()];
        is_reached[entry.index()] = true;
        let mut reached = Vec::new();
        for &subtask in model.topological_order() {
            if is_reached[subtask.index()] {
                reached.push(subtask);
                for successor in model.successors(subtask) {
                    is_reached[successor.index()] = true;
                }
            }
        }
        reached
    }
}
