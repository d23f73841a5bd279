//! The machine below a cluster's engine: its clock, its edge, and the cores to wake.

use core::sync::atomic::Ordering;

use sched_dag::engine::{Body as _, Port};
use sched_dag::journal::What;
use sched_dag::lifecycle::{self, Request};
use sched_dag::{ClusterId, CoreId, Notice};

use super::EPOCH_NS;
use super::cluster::{Cluster, MAY_DIVIDE};
use super::core_set::CoreSet;
use super::letters::{self, Letters};
use super::loans::Loan;
use super::status::note_running;
use super::time::{here, instance_time_ns, since_epoch};
use crate::machine::timer::{self, Alarm};
use crate::machine::{clock, this_core};
use crate::run::edge;

/// A step of the engine on this core.
pub(super) struct SmpPort<'a> {
    pub(super) cluster: &'static Cluster,
    pub(super) id: ClusterId,
    pub(super) letters: &'a Letters,
    /// The other cores that have to look at what they should run.
    pub(super) woken: &'a mut CoreSet,
}

impl Port<Loan> for SmpPort<'_> {
    /// The edge tells of these, where a topic is recorded.
    const HEARS: &'static [What] = fass::edge::HEARS;

    fn now_ns(&self) -> u64 {
        since_epoch(clock::now_ns())
    }

    #[inline]
    fn on_clock(&self, time_ns: u64) -> u64 {
        time_ns.wrapping_add(EPOCH_NS.load(Ordering::Relaxed))
    }

    /// Start and finish are stamped with interrupts disabled, so that no preemption can stand
    /// between a stamp and what it says.
    #[inline(always)]
    fn start(&mut self, _: CoreId, loan: &mut Loan) -> u64 {
        let core = this_core::get();
        note_running(core, Some(loan.subject()));
        let now_ns = clock::now_ns();
        let budget_end_ns = match loan.budget_ns {
            u64::MAX => u64::MAX,
            budget_ns => {
                let end_ns = now_ns.saturating_add(budget_ns);
                timer::set_no_later(core, Alarm::Budget, end_ns);
                end_ns
            }
        };
        core.context().set_budget_end(budget_end_ns);
        instance_time_ns(now_ns)
    }

    #[inline]
    fn forward(&mut self, request: Request) -> bool {
        MAY_DIVIDE && letters::send(self.letters, self.id, request, self.woken)
    }

    #[inline]
    fn has_letters(&self) -> bool {
        self.cluster.may_have_letters()
    }

    fn take_letters(&mut self) -> Option<&lifecycle::Letters> {
        if !MAY_DIVIDE {
            return None;
        }
        self.cluster.has_letters.swap(false, Ordering::AcqRel);
        self.letters.as_deref()
    }

    #[inline]
    fn retarget(&mut self, core: CoreId) {
        if core != here() {
            self.woken.insert(self.cluster.core(core));
        }
    }

    fn hear(&mut self, notice: &Notice) {
        edge::happened(notice);
    }
}
