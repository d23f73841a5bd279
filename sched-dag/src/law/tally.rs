//! Statistics of a run of any length, in memory allocated before the first event is taken.
//!
//! A [`RunTally`] takes each event of a journal once, in order, and forgets each job at its end.
//! The tally keeps a [`Histogram`] of each of the following times, and the times of the jobs in
//! flight.
//!
//! - *Response time*, of a DAG's jobs: from the nominal release to the last finish. If a DAG has
//!   several sinks, also of each sink's instances, to the instance's finish.
//! - *Release jitter*, of a DAG's jobs: from the nominal release to the release.
//! - *Join latency*, of a subtask's instances: from the last predecessor's finish to the start. A
//!   source has none.
//! - *Execution time*, of a subtask's instances: from the start to the finish, without suspensions
//!   and waits. Execution times above the WCET are counted, too.
//!
//! Only complete jobs count in a DAG's response time; a job that was cut does not. Instances count
//! even in jobs that were cut, if they started or finished.

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec;

use super::Histogram;
use crate::ids::{ClusterId, DagId, Instance, SubtaskId, Vertex, to_u32};
use crate::journal::{Event, EventKind};
use crate::task_set::{Dag, TaskSet};

/// The statistics, and the jobs in flight.
#[derive(Clone, Debug)]
pub struct RunTally {
    task_set: Arc<TaskSet>,
    dags: Box<[DagTally]>,
    subtasks: Box<[SubtaskTally]>,
}

/// Statistics of one DAG.
#[derive(Clone, Debug)]
pub struct DagTally {
    /// From the nominal release of a complete job to its last finish.
    pub response_time: Histogram,
    /// From the nominal release of a job to its release.
    pub release_jitter: Histogram,
    /// The longest response time, and the number of its job.
    longest: (u64, u64),
    /// The nominal release of the sporadic job being released.
    due_ns: u64,
    /// The jobs in flight, each in the first free place at or after the place of its number.
    open: Box<[JobInFlight]>,
    /// The instances of the jobs in flight.
    instances: Box<[InstanceTimes]>,
}

/// Statistics of one subtask.
#[derive(Clone, Debug)]
pub struct SubtaskTally {
    /// From the last predecessor's finish to the start.
    pub join_latency: Histogram,
    /// From the start to the finish, without suspensions and waits.
    pub execution_time: Histogram,
    /// The number of execution times above the WCET.
    pub beyond_wcet: u64,
    /// From the nominal release to the finish, for a sink of a DAG with several sinks.
    pub response_time: Option<Histogram>,
}

#[derive(Clone, Copy, Debug, Default)]
struct JobInFlight {
    /// The job's number plus 1, or 0 if the place is free.
    number: u64,
    release_ns: u64,
    last_finish_ns: u64,
    is_cut: bool,
}

#[derive(Clone, Copy, Debug, Default)]
struct InstanceTimes {
    /// When the instance started or was resumed.
    since_ns: u64,
    executed_ns: u64,
    /// The latest finish of the predecessors.
    join_ns: u64,
}

impl RunTally {
    /// Makes an empty tally with histograms of `2^bits` buckets for each doubling.
    pub fn new(task_set: &Arc<TaskSet>, bits: u32) -> Self {
        let of_dag = |dag: &Dag| DagTally {
            response_time: Histogram::new(bits),
            release_jitter: Histogram::new(bits),
            longest: (0, 0),
            due_ns: 0,
            open: vec![JobInFlight::default(); dag.in_flight() as usize].into(),
            instances: vec![
                InstanceTimes::default();
                dag.in_flight() as usize * dag.subtasks().len()
            ]
            .into(),
        };
        let of_subtask = |is_sink: bool| SubtaskTally {
            join_latency: Histogram::new(bits),
            execution_time: Histogram::new(bits),
            beyond_wcet: 0,
            response_time: is_sink.then(|| Histogram::new(bits)),
        };
        let subtasks = task_set.dags().iter().flat_map(|dag| {
            let ids = (0..to_u32(dag.subtasks().len())).map(SubtaskId);
            ids.map(move |id| of_subtask(judged_sinks(dag).binary_search(&id).is_ok()))
        });
        Self {
            dags: task_set.dags().iter().map(of_dag).collect(),
            subtasks: subtasks.collect(),
            task_set: Arc::clone(task_set),
        }
    }

    /// Returns the size of a tally in bytes.
    pub fn size_of(task_set: &TaskSet, bits: u32) -> usize {
        let in_flight = |dag: &Dag| {
            let job = size_of::<JobInFlight>() + dag.subtasks().len() * size_of::<InstanceTimes>();
            size_of::<DagTally>() + (dag.in_flight() as usize).saturating_mul(job)
        };
        let places: usize = task_set.dags().iter().map(in_flight).sum();
        let sinks = task_set.dags().iter().map(|dag| judged_sinks(dag).len());
        let histograms = 2 * (task_set.dags().len() + task_set.vertices()) + sinks.sum::<usize>();
        places.saturating_add(histograms * Histogram::size_of(bits))
    }

    /// Returns the statistics of a DAG's jobs.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    pub fn dag(&self, dag: DagId) -> &DagTally {
        &self.dags[dag.index()]
    }

    /// Returns the statistics of a subtask's instances.
    ///
    /// # Panics
    ///
    /// If there is no such subtask.
    pub fn subtask(&self, vertex: Vertex) -> &SubtaskTally {
        &self.subtasks[vertex.index()]
    }

    /// Takes over another tally's statistics for the DAGs of a cluster.
    pub(crate) fn adopt(&mut self, other: Self, cluster: ClusterId) {
        let of_dags = self.dags.iter_mut().zip(other.dags);
        let mut subtasks = self.subtasks.iter_mut().zip(other.subtasks);
        for (model, (ours, theirs)) in self.task_set.dags().iter().zip(of_dags) {
            let of_dag = subtasks.by_ref().take(model.subtasks().len());
            if model.cluster() == cluster {
                *ours = theirs;
                of_dag.for_each(|(ours, theirs)| *ours = theirs);
            } else {
                // Passed over, so that the next DAG's subtasks come next.
                of_dag.for_each(drop);
            }
        }
    }

    /// Forgets the jobs in flight, because events of these jobs are missing.
    pub fn skip(&mut self) {
        for dag in &mut self.dags {
            dag.open.fill(JobInFlight::default());
        }
    }

    /// Takes the next event. Events of a job without a known release are ignored.
    pub fn add(&mut self, event: &Event) {
        let model = self.task_set.dag(event.dag);
        let dag = &mut self.dags[event.dag.index()];
        match event.what {
            EventKind::Due => {
                dag.due_ns = event.time_ns;
                return;
            }
            EventKind::Released => {
                let release_ns = model.release_ns(event.job, dag.due_ns);
                dag.open_job(event, release_ns, model.subtasks().len());
                return;
            }
            // Times of a job that was cut say nothing about the times of whole jobs.
            EventKind::DagEnded => {
                for job in &mut dag.open {
                    job.is_cut = true;
                }
                return;
            }
            what if what.is_of_dag() => return,
            _ => {}
        }
        let Some(place) = dag.slot(event.job) else {
            return;
        };
        let Some(instance) = event
            .instance()
            .filter(|_| event.what != EventKind::Restarted)
        else {
            dag.of_job(place, event.what);
            return;
        };
        let statistics = &mut self.subtasks[self.task_set.vertex(instance).index()];
        dag.of_instance(place, model, instance, event, statistics);
    }
}

impl DagTally {
    /// Returns the longest response time of a complete job, and the job's number; zeros without
    /// one.
    pub const fn longest(&self) -> (u64, u64) {
        self.longest
    }

    /// Returns the place of a job in flight.
    fn slot(&self, job: u64) -> Option<usize> {
        let places = self.open.len();
        // Less than the number of places.
        let first = usize::try_from(job % places as u64).unwrap_or(0);
        let mut order = (first..places).chain(0..first);
        order.find(|&place| self.open[place].number == job + 1)
    }

    fn open_job(&mut self, event: &Event, release_ns: u64, subtasks: usize) {
        let places = self.open.len();
        let first = usize::try_from(event.job % places as u64).unwrap_or(0);
        let mut order = (first..places).chain(0..first);
        // There is always a free place, for no more jobs are in flight than there are places.
        let free = order.find(|&place| self.open[place].number == 0);
        let place = free.unwrap_or(first);
        self.open[place] = JobInFlight {
            number: event.job + 1,
            release_ns,
            ..JobInFlight::default()
        };
        self.instances[place * subtasks..][..subtasks].fill(InstanceTimes::default());
        let jitter_ns = event.time_ns.saturating_sub(release_ns);
        self.release_jitter.add(jitter_ns);
    }

    fn of_job(&mut self, place: usize, what: EventKind) {
        let job = &mut self.open[place];
        match what {
            EventKind::Aborted | EventKind::Restarted => job.is_cut = true,
            EventKind::Completed => {
                if !job.is_cut {
                    let response_ns = job.last_finish_ns.saturating_sub(job.release_ns);
                    self.response_time.add(response_ns);
                    self.longest = self.longest.max((response_ns, job.number - 1));
                }
                *job = JobInFlight::default();
            }
            _ => {}
        }
    }

    fn of_instance(
        &mut self,
        place: usize,
        model: &Dag,
        instance: Instance,
        event: &Event,
        statistics: &mut SubtaskTally,
    ) {
        let subtasks = model.subtasks().len();
        let instances = &mut self.instances[place * subtasks..][..subtasks];
        let times = &mut instances[instance.subtask.index()];
        match event.what {
            EventKind::Start => {
                times.since_ns = event.time_ns;
                if !model.predecessors(instance.subtask).is_empty() {
                    let latency_ns = event.time_ns.saturating_sub(times.join_ns);
                    statistics.join_latency.add(latency_ns);
                }
            }
            EventKind::Resume => times.since_ns = event.time_ns,
            EventKind::Suspend | EventKind::Wait => {
                times.executed_ns += event.time_ns.saturating_sub(times.since_ns)
            }
            EventKind::Finish => {
                let last_ns = event.time_ns.saturating_sub(times.since_ns);
                let executed_ns = times.executed_ns + last_ns;
                statistics.execution_time.add(executed_ns);
                let wcet_ns = model.subtask(instance.subtask).wcet_ns();
                statistics.beyond_wcet += u64::from(wcet_ns.is_some_and(|wcet| executed_ns > wcet));
                // The latest predecessor counts; the next finish may make another predecessor the
                // latest.
                for next in model.successors(instance.subtask) {
                    let join_ns = &mut instances[next.index()].join_ns;
                    *join_ns = event.time_ns.max(*join_ns);
                }
                let job = &mut self.open[place];
                // Two cores may finish in one order and be written down in the other.
                job.last_finish_ns = event.time_ns.max(job.last_finish_ns);
                if let Some(response_time) = &mut statistics.response_time {
                    response_time.add(event.time_ns.saturating_sub(job.release_ns));
                }
            }
            _ => {}
        }
    }
}

/// Returns the sinks whose response times may differ from the DAG's: all, or none if there is only
/// one.
fn judged_sinks(dag: &Dag) -> &[SubtaskId] {
    match dag.sinks() {
        [_] => &[],
        several => several,
    }
}
