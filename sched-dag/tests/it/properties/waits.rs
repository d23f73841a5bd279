//! Waits, held against the rules W1, W2, W4, W6 and W7: which instances wait, and when each ends.
//!
//! All of it follows from the turns that end, the answers and the limits. That an instance does not
//! run meanwhile, keeps its key and releases no edge, the law judges.

use std::collections::BTreeMap;

use sched_dag::Instance;
use sched_dag::journal::EventKind;
use sched_dag::lifecycle::WaitId;

use crate::support::set::Set;

/// A wait that has begun and not ended.
#[derive(Clone, Copy, Debug, Hash)]
struct PresentWait {
    instance: Instance,
    number: u32,
    /// When it ends at the latest.
    end_ns: u64,
    has_answer: bool,
}

/// The waits of all instances.
#[derive(Clone, Debug, Default, Hash)]
pub(crate) struct Waits {
    present: Vec<PresentWait>,
    /// How many each instance has begun.
    begun: BTreeMap<Instance, u32>,
    /// Instances whose wait has ended, and that no core has had since.
    awake: Vec<Instance>,
}

impl Waits {
    /// Returns the limit of an instance's next wait; `None`: it has taken all.
    pub(crate) fn next_limit_ns(&self, set: &Set, instance: Instance) -> Option<u64> {
        let number = self.begun.get(&instance).copied().unwrap_or(0);
        set.limit_ns(WaitId { instance, number })
    }

    /// Takes note that a turn of an instance ends. Returns the limit of the wait that it begins;
    /// `None`: it has taken all.
    pub(crate) fn begin(&mut self, set: &Set, instance: Instance, now_ns: u64) -> Option<u64> {
        let limit_ns = self.next_limit_ns(set, instance)?;
        let begun = self.begun.entry(instance).or_default();
        self.present.push(PresentWait {
            instance,
            number: *begun,
            end_ns: now_ns + limit_ns,
            has_answer: false,
        });
        *begun += 1;
        Some(limit_ns)
    }

    /// Returns the waits that have not ended.
    pub(crate) fn present(&self) -> impl Iterator<Item = WaitId> {
        self.present.iter().map(|of| WaitId {
            instance: of.instance,
            number: of.number,
        })
    }

    /// W7: takes note of an answer, which ends the wait that it names and no other.
    pub(crate) fn answer(&mut self, named: WaitId) {
        let mut present = self.present.iter_mut();
        let is_it =
            |of: &&mut PresentWait| (of.instance, of.number) == (named.instance, named.number);
        if let Some(found) = present.find(is_it) {
            found.has_answer = true;
        }
    }

    /// Reports whether the rules allow what the scheduler tells of an instance at an instant, at
    /// whose end releases have happened, too.
    pub(crate) fn takes(
        &mut self,
        what: EventKind,
        instance: Instance,
        (now_ns, is_end): (u64, bool),
        is_cut: bool,
    ) -> bool {
        let at = (self.present.iter()).position(|of| of.instance == instance);
        let ended = at.map(|at| self.present.remove(at));
        match (what, ended) {
            // W2.
            (EventKind::Wake, Some(ended)) => {
                self.awake.push(instance);
                ended.has_answer || ended.end_ns <= now_ns
            }
            // W6; and W4: waits that end come before the releases, one of which may cut the job.
            (EventKind::Cancelled, Some(ended)) => is_cut && !(is_end && ended.end_ns <= now_ns),
            (EventKind::Cancelled, None) => is_cut,
            _ => false,
        }
    }

    /// Returns an instance that waits although its wait has ended, or its job is cut.
    pub(crate) fn overdue(
        &self,
        now_ns: u64,
        is_cut: impl Fn(Instance) -> bool,
    ) -> Option<Instance> {
        let is_over = |of: &PresentWait| of.has_answer || of.end_ns <= now_ns;
        let mut present = self.present.iter();
        let found = present.find(|of| is_over(of) || is_cut(of.instance));
        found.map(|of| of.instance)
    }

    /// Takes note that a core has an instance. Reports whether its wait has ended before.
    pub(crate) fn go_on(&mut self, instance: Instance) -> bool {
        let at = self.awake.iter().position(|of| *of == instance);
        at.map(|at| self.awake.remove(at)).is_some()
    }
}
