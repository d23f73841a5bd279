//! What is released when, with the words of the rules: due jobs, those that find no
//! room, signals and pauses.

use sched_dag::OverrunPolicy;

use super::{Reference, State};

impl Reference<'_> {
    /// Skips what waits when a pause begins.
    pub(super) fn pause(&mut self) {
        for dag in 0..self.states.len() {
            let mut pauses = self.set.dags[dag].pauses_ns.iter();
            if pauses.any(|&(from_ns, _)| from_ns == self.now_ns) {
                while let Some(job) = self.first(dag, |state| state == State::Waiting) {
                    self.skip(dag, job);
                }
            }
        }
    }

    /// Makes the next job of a sporadic DAG due, unless a signal is still kept.
    pub(super) fn take_signals(&mut self) {
        for (dag, model) in self.set.dags.iter().enumerate() {
            let signals_ns = model.signals_ns.iter().flatten();
            for _ in signals_ns.filter(|&&at_ns| at_ns == self.now_ns) {
                let is_kept = (0..self.states[dag].len()).any(|job| match self.states[dag][job] {
                    State::Ahead => self.due_ns[dag][job].is_some(),
                    state => state == State::Waiting,
                });
                let next = self.first(dag, |state| state == State::Ahead);
                self.outcome.statistics[dag].signals += 1;
                if let Some(next) = next.filter(|_| !is_kept) {
                    let earliest_ns = match next {
                        0 => model.offset_ns,
                        _ => self.due_ns[dag][next - 1].expect("it was due") + model.period_ns,
                    };
                    self.due_ns[dag][next] = Some(self.now_ns.max(earliest_ns));
                } else {
                    self.outcome.statistics[dag].dropped_signals += 1;
                }
            }
        }
    }

    pub(super) fn release(&mut self) {
        for dag in 0..self.states.len() {
            self.release_waiting(dag);
            for job in 0..self.states[dag].len() {
                if self.states[dag][job] == State::Ahead
                    && self.due_ns[dag][job] == Some(self.now_ns)
                {
                    self.states[dag][job] = State::Waiting;
                    self.release_or_overrun(dag, job);
                }
            }
        }
    }

    fn release_or_overrun(&mut self, dag: usize, job: usize) {
        if self.set.dags[dag].is_paused_at(self.now_ns) {
            self.skip(dag, job);
            return;
        }
        self.release_waiting(dag);
        if self.states[dag][job] == State::Waiting {
            self.overrun(dag, job);
        }
        if self.states[dag][job] == State::Waiting {
            self.outcome.statistics[dag].queued += 1;
        }
    }

    fn release_waiting(&mut self, dag: usize) {
        while let Some(job) = self.first(dag, |state| state == State::Waiting) {
            let in_flight = usize::try_from(self.set.dags[dag].in_flight).expect("few jobs");
            let blocked = (0..self.states[dag].len()).any(|other| {
                self.states[dag][other] == State::InFlight && other + in_flight <= job
            });
            if blocked {
                break;
            }
            self.states[dag][job] = State::InFlight;
            self.outcome.jobs[dag][job].released_ns = Some(self.now_ns);
            self.note_ready();
        }
    }

    fn overrun(&mut self, dag: usize, job: usize) {
        match self.set.dags[dag].overrun {
            OverrunPolicy::Queue => {}
            OverrunPolicy::Skip => self.skip(dag, job),
            OverrunPolicy::Abort => {
                let oldest = (0..self.states[dag].len()).find(|&other| {
                    self.states[dag][other] == State::InFlight && !self.is_cut(dag, other)
                });
                if let Some(oldest) = oldest {
                    self.outcome.jobs[dag][oldest].aborted_ns = Some(self.now_ns);
                    self.cancel_and_end();
                } else if let Some(waiting) = self.first(dag, |state| state == State::Waiting) {
                    self.skip(dag, waiting);
                }
                self.release_waiting(dag);
            }
        }
    }

    fn skip(&mut self, dag: usize, job: usize) {
        self.states[dag][job] = State::Over;
        self.outcome.jobs[dag][job].skipped_ns = Some(self.now_ns);
    }

    fn first(&self, dag: usize, is: impl Fn(State) -> bool) -> Option<usize> {
        self.states[dag].iter().position(|&state| is(state))
    }
}
