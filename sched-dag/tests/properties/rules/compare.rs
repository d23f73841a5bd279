//! Holding a scheduler against the facts, after each instant.

use std::collections::BTreeSet;

use sched_dag::journal::What;
use sched_dag::{CoreId, DagId, Instance, Notice, Scheduler, SubtaskId};

use super::{Facts, Place, State};

impl Facts<'_> {
    /// Returns what a scheduler has that the rules have not, with what it has reported of this
    /// instant, and ends that.
    pub(crate) fn compare(
        &mut self,
        scheduler: &Scheduler,
        notices: &[Notice],
    ) -> Result<(), String> {
        let mut said = vec![Vec::new(); self.said.len()];
        let mut turned = BTreeSet::new();
        for Notice { event, at_ns } in notices {
            let (dag, job) = (event.dag.index(), usize::try_from(event.job).expect("few"));
            if let Some(subtask) = event.subtask.filter(|_| event.what != What::Restarted) {
                turned.insert(((dag, job, subtask.index()), event.what == What::Ready));
                continue;
            }
            said[dag].push((event.what, job));
            if matches!(event.what, What::Released | What::Queued | What::Skipped) {
                same("nominal release", &self.dags[dag].jobs[job].due_ns, at_ns)?;
            }
        }
        same("reports", &self.said, &said)?;
        same("of instances", &self.turned, &turned)?;
        self.said.iter_mut().for_each(Vec::clear);
        self.turned.clear();
        let cores = (0..scheduler.options().cores).map(CoreId);
        let running: BTreeSet<Instance> =
            cores.filter_map(|core| scheduler.running(core)).collect();
        let expected = self.running.iter().copied().map(instance).collect();
        same("running", &expected, &running)?;
        same(
            "next event",
            &self.next_event_ns(),
            &scheduler.next_event_ns(),
        )?;
        for (dag, (of_dag, model)) in self.dags.iter().zip(&self.set.dags).enumerate() {
            let id = id(dag);
            same("counters", &of_dag.statistics, scheduler.statistics(id))?;
            same("ended", &of_dag.is_ended, &scheduler.is_ended(id))?;
            same("closed", &of_dag.is_closed, &scheduler.is_closed(id))?;
            same("paused", &of_dag.is_paused, &scheduler.is_paused(id))?;
            let count = |state| of_dag.jobs.iter().filter(|job| job.state == state).count() as u64;
            same("waiting", &count(State::Waiting), &scheduler.waiting(id))?;
            same(
                "in flight",
                &count(State::InFlight),
                &scheduler.in_flight(id),
            )?;
            let is_over = count(State::Over) == model.jobs;
            same("over", &is_over, &scheduler.is_over(id))?;
            for sink in (0..model.subtasks.len()).filter(|&subtask| model.is_sink(subtask)) {
                let misses = scheduler.sink_misses(id, subtask(sink));
                same("misses of a sink", &of_dag.sink_misses[sink], &misses)?;
            }
        }
        Ok(())
    }
}

fn same<T: PartialEq + std::fmt::Debug>(
    what: &str,
    expected: &T,
    happened: &T,
) -> Result<(), String> {
    match expected == happened {
        true => Ok(()),
        false => Err(format!(
            "{what}: expected {expected:?}, happened {happened:?}"
        )),
    }
}

fn id(dag: usize) -> DagId {
    DagId(u32::try_from(dag).expect("few DAGs"))
}

fn subtask(subtask: usize) -> SubtaskId {
    SubtaskId(u32::try_from(subtask).expect("few subtasks"))
}

pub(crate) fn instance((dag, job, number): Place) -> Instance {
    Instance {
        dag: id(dag),
        job: job as u64,
        subtask: subtask(number),
    }
}

/// Returns the place of an instance.
pub(crate) fn place(instance: Instance) -> Place {
    let job = usize::try_from(instance.job).expect("few jobs");
    (instance.dag.index(), job, instance.subtask.index())
}
