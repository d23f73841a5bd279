//! What is released when: due jobs, those that find no room, signals, pauses, closings.

use sched_dag::OverrunPolicy;
use sched_dag::journal::What;

use super::{Facts, Job, State};

impl Facts<'_> {
    pub(crate) fn pause(&mut self, dag: usize) {
        if self.dags[dag].is_closed {
            return;
        }
        self.judge(dag, None);
        if !std::mem::replace(&mut self.dags[dag].is_paused, true) {
            self.said[dag].push((What::Off, 0));
        }
        while let Some(job) = self.first(dag, State::Waiting) {
            self.skip(dag, job);
        }
    }

    pub(crate) fn resume(&mut self, dag: usize) {
        if std::mem::take(&mut self.dags[dag].is_paused) {
            self.dags[dag].resumed_ns = self.now_ns;
            self.said[dag].push((What::On, 0));
        }
    }

    /// C1 to C5.
    pub(crate) fn close(&mut self, dag: usize) {
        if self.dags[dag].is_closed {
            return;
        }
        self.judge(dag, None);
        self.dags[dag].is_closed = true;
        self.dags[dag].is_paused = false;
        self.said[dag].push((What::Closed, 0));
        while let Some(job) = self.first(dag, State::Waiting) {
            self.skip(dag, job);
        }
        let ahead = self.dags[dag].jobs.iter_mut();
        let ahead = ahead.filter(|job| job.state == State::Ahead);
        ahead.for_each(|job| job.state = State::Over);
    }

    pub(crate) fn signal(&mut self, dag: usize) {
        let next = self.next_due(dag);
        // What was due before, and nobody has dealt with, is dealt with first.
        if next.is_some_and(|(_, due_ns)| due_ns.is_some_and(|due_ns| due_ns < self.now_ns)) {
            self.serve(dag);
        }
        let is_kept = self.first(dag, State::Waiting).is_some();
        let model = &self.set.dags[dag];
        let now_ns = self.now_ns;
        let next = self.next_due(dag);
        self.dags[dag].statistics.signals += 1;
        match next {
            Some((job, None)) if !is_kept => {
                let before_ns = job
                    .checked_sub(1)
                    .map(|job| self.dags[dag].jobs[job].due_ns);
                let earliest_ns = before_ns
                    .flatten()
                    .map_or(model.offset_ns, |due_ns| due_ns + model.period_ns);
                self.dags[dag].jobs[job].due_ns = Some(now_ns.max(earliest_ns));
            }
            _ => self.dags[dag].statistics.dropped_signals += 1,
        }
    }

    pub(super) fn serve(&mut self, dag: usize) {
        self.judge(dag, None);
        self.release_waiting(dag);
        while let Some((job, Some(due_ns))) = self.next_due(dag)
            && due_ns <= self.now_ns
        {
            self.dags[dag].jobs[job].state = State::Due;
            self.release_or_overrun(dag, job, due_ns);
            self.judge(dag, None);
        }
    }

    fn release_or_overrun(&mut self, dag: usize, job: usize, due_ns: u64) {
        if self.dags[dag].is_paused || due_ns < self.dags[dag].resumed_ns {
            return self.skip(dag, job);
        }
        self.release_waiting(dag);
        if self.dags[dag].jobs[job].state == State::Due {
            match self.set.dags[dag].overrun {
                OverrunPolicy::Queue => {}
                OverrunPolicy::Skip => self.skip_oldest(dag),
                OverrunPolicy::Abort => self.make_room(dag),
            }
        }
        if self.dags[dag].jobs[job].state == State::Due {
            self.dags[dag].jobs[job].state = State::Waiting;
            self.dags[dag].statistics.queued += 1;
            self.said[dag].push((What::Queued, job));
        }
    }

    fn make_room(&mut self, dag: usize) {
        let in_flight = |job: &Job| job.state == State::InFlight && !job.starts_nothing();
        let oldest = self.dags[dag].jobs.iter_mut().enumerate();
        match oldest.into_iter().find(|(_, job)| in_flight(job)) {
            Some((number, oldest)) => {
                oldest.is_aborted = true;
                self.said[dag].push((What::Aborted, number));
                self.dags[dag].statistics.aborts += 1;
                self.settle(dag);
            }
            None => self.skip_oldest(dag),
        }
        self.release_waiting(dag);
    }

    fn release_waiting(&mut self, dag: usize) {
        while let Some(job) = self.oldest_waiting(dag) {
            let room = usize::try_from(self.set.dags[dag].in_flight).expect("few jobs");
            let mut jobs = self.dags[dag].jobs.iter().enumerate();
            if jobs.any(|(other, of)| of.state == State::InFlight && other + room <= job) {
                break;
            }
            self.dags[dag].jobs[job].state = State::InFlight;
            self.dags[dag].statistics.released += 1;
            self.said[dag].push((What::Released, job));
            self.settle(dag);
        }
    }

    /// The oldest job that is due and not released, whether dealt with or not.
    fn oldest_waiting(&self, dag: usize) -> Option<usize> {
        let mut jobs = self.dags[dag].jobs.iter();
        jobs.position(|job| matches!(job.state, State::Due | State::Waiting))
    }

    fn skip_oldest(&mut self, dag: usize) {
        if let Some(oldest) = self.oldest_waiting(dag) {
            self.skip(dag, oldest);
        }
    }

    fn skip(&mut self, dag: usize, job: usize) {
        self.dags[dag].jobs[job].state = State::Over;
        self.dags[dag].statistics.skips += 1;
        self.said[dag].push((What::Skipped, job));
    }

    pub(super) fn next_due(&self, dag: usize) -> Option<(usize, Option<u64>)> {
        let job = self.first(dag, State::Ahead)?;
        Some((job, self.dags[dag].jobs[job].due_ns))
    }
}
