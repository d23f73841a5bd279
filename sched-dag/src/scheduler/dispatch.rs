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
//!
//! What this leaves is *settled*: no ready key is smaller than one that runs and
//! may be preempted. Ends leave it so, since they only make cores idle; nothing
//! but a newly ready instance can unsettle it. So without one the second step is
//! not even looked at.

use super::key::Key;
use super::vertices::Phase;
use super::{OWED, Scheduler};
use crate::ids::{CoreId, Instance};
use crate::journal::What;

/// One change of what a core executes.
///
/// A dispatch lists only changes: a core that it does not name goes on with
/// what it does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[must_use]
pub struct Decision {
    /// [`Start`](What::Start) or [`Resume`](What::Resume): the core, idle or just preempted,
    /// begins or continues the instance, perhaps one that ran on another core before.
    /// [`Suspend`](What::Suspend): it gives up the instance, which keeps its progress; the next
    /// decision of the dispatch gives it another one.
    pub what: What,
    /// The core.
    pub core: CoreId,
    /// The instance.
    pub instance: Instance,
}

impl Scheduler {
    /// Fills `decisions`.
    #[inline]
    pub(super) fn decide(&mut self) {
        self.decisions.clear();
        while self.cores.any_idle()
            && let Some(key) = self.ready.pop()
            && let Some(core) = self.cores.take_idle()
        {
            let decision = self.give(core, key);
            self.decisions.push(decision);
        }
        if core::mem::take(&mut self.fresh) & !OWED == 0 {
            return;
        }
        while let Some(ready) = self.ready.peek()
            && let Some((core, running)) = self.cores.largest_preemptible()
            && ready < running
            && let Some(key) = self.ready.pop()
        {
            self.preempt(core, running);
            let decision = self.give(core, key);
            self.decisions.push(decision);
        }
    }

    /// Gives a core an instance that is ready.
    #[inline]
    pub(super) fn give(&mut self, core: CoreId, key: Key) -> Decision {
        let vertex = self.vertices.get_mut(key.vertex());
        let instance = vertex.present_instance();
        let what = match vertex.phase {
            Phase::Preempted => What::Resume,
            _ => What::Start,
        };
        vertex.phase = Phase::Running(core);
        self.cores.run(core, key, vertex.is_preemptible);
        Decision {
            what,
            core,
            instance,
        }
    }

    /// Puts the instance that runs on a core back in line.
    #[inline]
    fn preempt(&mut self, core: CoreId, running: Key) {
        let vertex = self.vertices.get_mut(running.vertex());
        vertex.phase = Phase::Preempted;
        let instance = vertex.present_instance();
        self.decisions.push(Decision {
            what: What::Suspend,
            core,
            instance,
        });
        self.ready.insert(running);
    }
}
