//! The dispatch (R5): which instances run from this instant on.
//!
//! Idle cores first take ready instances in the order of their keys, so that no
//! instance is preempted while a core is idle. Then, as long as the smallest
//! ready key is smaller than the largest one that runs and may be preempted,
//! both change places.
//!
//! Afterwards the running instances are those that R5 asks for: the ones that
//! may not be preempted, and of all others those with the smallest keys. No
//! core is named in more than one exchange, since each one brings in a larger
//! key than the exchange before and a smaller one than it takes out.

use super::instances::Phase;
use super::key::Key;
use super::{Decision, Scheduler};
use crate::ids::{CoreId, Instance};

impl Scheduler {
    /// Fills `decisions`.
    pub(super) fn decide(&mut self) {
        self.decisions.clear();
        while self.ready.peek().is_some()
            && let Some(core) = self.cores.take_idle()
        {
            self.take_next(core);
        }
        while let Some((ready, _)) = self.ready.peek()
            && let Some((core, running)) = self.cores.largest_preemptible()
            && ready < running
        {
            self.preempt(core, running);
        }
    }

    /// Gives a core the first instance in line.
    fn take_next(&mut self, core: CoreId) {
        let Some((key, index)) = self.ready.pop() else {
            return;
        };
        let instance = key.instance();
        let Instance { dag, subtask, .. } = instance;
        self.cores
            .run(core, key, self.may_be_preempted(dag, subtask));
        let decision = match self.phases[index] {
            Phase::Preempted => Decision::Resume { core, instance },
            _ => Decision::Start { core, instance },
        };
        self.phases[index] = Phase::Running(core);
        self.decisions.push(decision);
    }

    /// Lets the first instance in line take the place of one that runs.
    fn preempt(&mut self, core: CoreId, running: Key) {
        let instance = running.instance();
        let index = self.subtask_index(instance.dag, instance.subtask);
        self.decisions.push(Decision::Preempt { core, instance });
        self.take_next(core);
        self.phases[index] = Phase::Preempted;
        self.ready.set(index, running);
    }
}
