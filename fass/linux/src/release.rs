//! The release thread: the clock of the scheduler. Each cluster has one, on its own processors.
//!
//! It sleeps until the scheduler's next event, at an absolute time, so that releases keep
//! to the nominal grid whatever one of them was late by. Idle workers are to be there first
//! (`look_out`); where all cores are busy it comes in time, and preempts. Others wake it earlier
//! with a request, or if the next event has become an earlier one. It makes the step and calls
//! the workers; it runs nothing itself.
//!
//! # Budgets
//!
//! A budget is in processor time, which a thread takes only while it has a processor.
//! Reading that clock is a system call, so no instance does it at its start: this thread
//! looks often enough, as often as the shortest budget, and begins to count when it
//! first sees the instance. So an instance ends after its budget, and no later than the
//! shortest budget of all, and 20 us, after that. Its thread cannot be ended: it is demoted for good.

use std::sync::atomic::Ordering;

use sched_dag::{CoreId, Vertex};

use crate::level::Role;
use crate::state::State;
use crate::sys;
use crate::team::Team;

/// What was seen of an instance that has a budget.
#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    /// The subtask and the job.
    what: Option<(Vertex, u64)>,
    /// The processor time of its thread then.
    processor_ns: u64,
}

/// The budgets of a run's subtasks, and what was seen of the instances on each core.
#[derive(Debug)]
pub(crate) struct Budgets {
    by_vertex: Box<[u64]>,
    shortest_ns: u64,
    seen: Box<[Seen]>,
}

impl Budgets {
    /// Takes each subtask's budget, or so many of its WCETs; 0: then it has none.
    pub(crate) fn new(state: &State, wcets: u64) -> Self {
        let dags = state.engine.task_set.dags().iter();
        let subtasks = dags.flat_map(|dag| dag.subtasks());
        let by_vertex: Box<[u64]> = subtasks.map(|s| s.most_execution_ns(wcets)).collect();
        Self {
            shortest_ns: by_vertex.iter().copied().min().unwrap_or(u64::MAX),
            seen: vec![Seen::default(); state.active.len()].into(),
            by_vertex,
        }
    }

    /// Looks at what runs. Returns a core whose instance has exceeded its budget, or when
    /// to look again.
    fn look(&mut self, team: &Team, state: &State, now_ns: u64) -> Result<u64, CoreId> {
        if self.shortest_ns == u64::MAX {
            return Ok(u64::MAX);
        }
        let mut next_ns = now_ns.saturating_add(self.shortest_ns);
        for (core, seen) in (0..).map(CoreId).zip(&mut self.seen) {
            let Some(vertex) = state.engine.placement.current(core.index()) else {
                continue;
            };
            let budget_ns = self.by_vertex[vertex.index()];
            let worker = &team.workers[state.active[core.index()]];
            let processor_ns = worker.thread().and_then(sys::processor_time_ns);
            let (Some(processor_ns), true) = (processor_ns, budget_ns < u64::MAX) else {
                continue;
            };
            let what = Some((vertex, state.engine.scheduler.instance_of(vertex).job));
            if seen.what != what {
                *seen = Seen { what, processor_ns };
            }
            let used_ns = processor_ns.saturating_sub(seen.processor_ns);
            if used_ns > budget_ns {
                *seen = Seen::default();
                return Err(core);
            }
            next_ns = next_ns.min(now_ns.saturating_add(pause_ns(budget_ns - used_ns)));
        }
        Ok(next_ns)
    }
}

/// Returns how long to sleep between two looks at an instance that has so much of its budget
/// left: not before it can have used that up, and for a while in any case. This thread may stand
/// on the instance's own core, and then that uses nothing up until we sleep.
fn pause_ns(rest_ns: u64) -> u64 {
    const LEAST_NS: u64 = 20_000;
    rest_ns.saturating_add(1).max(LEAST_NS)
}

impl Team {
    /// Makes the scheduler's steps until all jobs have ended.
    pub(crate) fn release(&self, mut budgets: Budgets) {
        sys::make_timers_exact();
        if self.lock().engine.task_set.is_divided() {
            // Were it woken on another cluster's processor, that would wait for it.
            let _ = sys::confine(sys::thread(), &self.lock().processors);
        }
        if let Some(levels) = self.levels {
            levels.bring(sys::thread(), Role::Release);
        }
        self.say_ready();
        let alarm = self.office.alarm(self.cluster);
        let mut rests = false;
        loop {
            let seen = alarm.load(Ordering::Acquire);
            let mut state = self.lock();
            let budgets_ns = self.step_in_time(&mut state, &mut budgets, &mut rests);
            self.call(state);
            match budgets_ns {
                Some(budgets_ns) => self.sleep(seen, budgets_ns),
                None => return,
            }
        }
    }

    /// Sleeps until it is rung for, or an event or the look at budgets is due. An event that a
    /// worker has seen to is none.
    fn sleep(&self, seen: u32, budgets_ns: u64) {
        let alarm = self.office.alarm(self.cluster);
        while alarm.load(Ordering::Acquire) == seen {
            let looks_at_ns = self.settle_look(budgets_ns);
            if sys::now_ns() < looks_at_ns {
                let until_ns = (looks_at_ns < u64::MAX).then_some(looks_at_ns);
                sys::wait(alarm, seen, until_ns);
            }
            let now_ns = sys::now_ns();
            let own_ns = self.look_out.of_release(self.look_out.next_ns(), now_ns);
            if own_ns <= now_ns && self.look_out.claim(now_ns) || budgets_ns <= now_ns {
                return;
            }
        }
    }

    /// Settles when it looks next. A thread that makes the next event an earlier one writes that first
    /// and then reads when we look; we do it the other way round, so one of us sees the other.
    fn settle_look(&self, budgets_ns: u64) -> u64 {
        loop {
            let next_ns = self.look_out.next_ns();
            let own_ns = self.look_out.of_release(next_ns, sys::now_ns());
            let looks_at_ns = own_ns.min(budgets_ns);
            self.looks_at_ns.store(looks_at_ns, Ordering::SeqCst);
            if self.look_out.next_ns() == next_ns {
                return looks_at_ns;
            }
        }
    }

    /// Makes one step, and returns when to look at budgets; `None` if all jobs have ended.
    fn step_in_time(
        &self,
        state: &mut State,
        budgets: &mut Budgets,
        rests: &mut bool,
    ) -> Option<u64> {
        if sys::now_ns() < state.time.epoch_ns {
            // What is asked for before time 0 is done then. The workers look out from now on.
            self.look_out.announce(state.time.epoch_ns);
            let active = state.active.iter();
            active.for_each(|worker| self.workers[*worker].call());
            return Some(state.time.epoch_ns);
        }
        state.step(&self.workers, |_| ());
        let look_ns = loop {
            match budgets.look(self, state, sys::now_ns()) {
                Ok(look_ns) => break look_ns,
                Err(core) => self.abandon(state, core),
            }
        };
        self.announce(state);
        let is_finished = state.engine.scheduler.is_finished();
        let opened = std::mem::take(&mut state.opened);
        if !self.office.settle(rests, is_finished, opened) {
            if is_finished {
                // This one rests.
                self.look_out.announce(u64::MAX);
            }
            return Some(look_ns);
        }
        self.workers.iter().for_each(|worker| worker.call());
        None
    }

    /// Ends a core's instance, which has exceeded its budget, and with it its DAG: its function
    /// cannot be taken back.
    pub(crate) fn abandon(&self, state: &mut State, core: CoreId) {
        let number = state.active[core.index()];
        let Some(vertex) = state.engine.placement.current(core.index()) else {
            return;
        };
        // If it has just ended, it was in time after all.
        if !self.workers[number].demote(self.levels, Role::Abandoned) {
            return;
        }
        state.engine.placement.lose(core.index());
        state.seats[number] = None;
        state.abandoned.push(number);
        state.replace(core, &self.workers);
        let cause = "its budget was exceeded".to_owned();
        state.fail(&self.workers, (core, vertex), None, (cause, true));
        state.report_left(core, &self.workers);
    }
}

#[cfg(test)]
mod tests {
    use super::pause_ns;

    #[test]
    fn an_instance_at_the_end_of_its_budget_gets_time_to_exceed_it() {
        // Were it 1 ns, this thread would look without end, on the core that the instance needs.
        assert!([0, 1, 100].map(pause_ns).iter().all(|ns| *ns >= 10_000));
        assert_eq!(pause_ns(5_000_000), 5_000_001);
    }
}
