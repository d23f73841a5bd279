//! What a failure costs, with the words of the rules: the job, or the DAG; and stops.

use super::{Reference, State};

impl Reference<'_> {
    /// Judges what has just failed, in the order of the instances.
    pub(super) fn judge_failures(&mut self) {
        self.judged.clear();
        // What completions of this instant bring about comes first, cancellations included.
        self.cancel_and_end();
        for (dag, job, subtask) in self.all_instances() {
            let instance = &self.outcome.instances[dag][job][subtask];
            if instance.failed_ns != Some(self.now_ns) {
                continue;
            }
            if self.survives(dag, job, subtask) {
                self.survived[dag].push(job);
                if !self.is_cut(dag, job) {
                    self.outcome.jobs[dag][job].has_failed = true;
                }
            } else {
                self.end_dag(dag);
            }
            self.judged.push((dag, job, subtask));
            self.cancel_and_end();
        }
    }

    /// D1.
    fn survives(&self, dag: usize, job: usize, subtask: usize) -> bool {
        let model = &self.set.dags[dag];
        let Some(limit) = model.fault_limit else {
            return false;
        };
        let before = &self.survived[dag];
        let nth = before.iter().rev().nth(limit.faults as usize - 1);
        let window = usize::try_from(limit.window).expect("few jobs");
        model.subtasks[subtask].is_replaceable
            && !self.is_ended[dag]
            && before.len() < limit.in_all as usize
            && nth.is_none_or(|nth| nth + window <= job)
    }

    /// Ends DAGs that are stopped.
    pub(super) fn end_dags(&mut self) {
        for dag in 0..self.states.len() {
            if self.set.dags[dag].stop_ns == Some(self.now_ns) {
                self.end_dag(dag);
            }
        }
    }

    /// Ends a DAG: what is in flight and not complete is cut, the rest does not happen.
    fn end_dag(&mut self, dag: usize) {
        self.is_ended[dag] = true;
        for job in 0..self.states[dag].len() {
            let is_complete = self.outcome.instances[dag][job]
                .iter()
                .all(|instance| instance.finish_ns.is_some());
            match self.states[dag][job] {
                State::InFlight if is_complete || self.is_cut(dag, job) => {}
                State::InFlight => self.outcome.jobs[dag][job].is_cut = true,
                State::Waiting => self.outcome.statistics[dag].dropped += 1,
                State::Ahead | State::Over => {}
            }
            if self.states[dag][job] != State::InFlight {
                self.states[dag][job] = State::Over;
            }
        }
    }
}
