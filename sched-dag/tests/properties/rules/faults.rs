//! What a fault costs, the DAG (E1 to E8) or the job (D1 to D7), and stops.

use sched_dag::journal::What;

use super::{Facts, OfDag, Part, Place, State};

impl Facts<'_> {
    pub(crate) fn fail(&mut self, place: Place) {
        self.running.remove(&place);
        self.dags[place.0].statistics.faults += 1;
        self.stop(place.0);
        *self.part_mut(place) = Part::Failed;
        self.settle(place.0);
    }

    /// D1 to D5.
    pub(crate) fn fail_replaceable(&mut self, place: Place) {
        let (dag, number, _) = place;
        if !self.survives(dag, number) {
            return self.fail(place);
        }
        self.running.remove(&place);
        self.judge(dag, None);
        let OfDag {
            jobs,
            survived,
            statistics,
            ..
        } = &mut self.dags[dag];
        survived.push(number);
        statistics.faults += 1;
        statistics.restarts += 1;
        self.said[dag].push((What::Restarted, number));
        let job = &mut jobs[number];
        if !job.starts_nothing() {
            job.has_failed = true;
            statistics.failed += 1;
        }
        self.settle(dag);
        *self.part_mut(place) = Part::Failed;
        self.settle(dag);
    }

    fn survives(&self, dag: usize, job: usize) -> bool {
        let before = &self.dags[dag].survived;
        self.set.dags[dag].fault_limit.is_some_and(|limit| {
            let nth = before.iter().rev().nth(limit.faults as usize - 1);
            let window = usize::try_from(limit.window).expect("a small window");
            !self.dags[dag].is_ended
                && before.len() < limit.in_all as usize
                && nth.is_none_or(|nth| nth + window <= job)
        })
    }

    pub(crate) fn stop(&mut self, dag: usize) {
        if self.dags[dag].is_ended {
            return;
        }
        self.judge(dag, None);
        let OfDag {
            jobs,
            is_ended,
            is_closed,
            is_paused,
            statistics,
            ..
        } = &mut self.dags[dag];
        (*is_ended, *is_closed, *is_paused) = (true, true, false);
        self.said[dag].push((What::Stopped, 0));
        for job in jobs {
            match job.state {
                State::InFlight if !job.starts_nothing() => {
                    job.is_cut = true;
                    statistics.cut_short += 1;
                }
                State::InFlight => {}
                State::Waiting => {
                    statistics.dropped += 1;
                    job.state = State::Over;
                }
                _ => job.state = State::Over,
            }
        }
        self.settle(dag);
    }
}
