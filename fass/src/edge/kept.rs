//! The record of a boot: recorded values, together with the commits, the events of the runs, and
//! their measured times.
//!
//! A platform keeps one, behind a lock of its own. No instance waits for that lock, since the sink
//! may be slow. Events are copied out of a journal under the cluster's lock, and sent outside of
//! it.

use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;

use recording::{
    Commit, CommittedDag, CommittedSubtask, CommittedTopic, Counted, DagTimes, Sink, Stream,
    SubtaskTimes, Times,
};
use sched_dag::analysis::Overheads;
use sched_dag::engine::Run;
use sched_dag::law::Histogram;
use sched_dag::{
    Dag, DagId, Instance, Journal, LockUse, OnFault, OverrunPolicy, Preemption, SchedulerOptions,
    Subtask, SubtaskId, TaskSet, Vertex, Wait,
};

use super::{Outgoing, Record, RecordingState};
use crate::run::plan::Plan;

/// The number of events copied at once.
const AT_ONCE: usize = 64;

/// The number of clusters for which room is made at the start, so no commit changes the allocated
/// memory.
const MOST_CLUSTERS: usize = 64;

/// The record of a boot, and the sink of its bytes.
///
/// ```
/// use fass::edge::BootRecord;
///
/// let kept = BootRecord::new(Vec::new());
/// assert!(recording::Recording::read(&kept.finish()).is_ok());
/// ```
#[derive(Clone, Debug)]
pub struct BootRecord<S> {
    stream: Stream<S>,
    is_cut: bool,
    /// By cluster, the number of events of this run already looked at.
    taken: Vec<u64>,
}

impl<S: Sink + Send + 'static> BootRecord<S> {
    /// Begins a record.
    pub fn new(to: S) -> Self {
        Self {
            stream: Stream::begin(to),
            is_cut: false,
            taken: Vec::with_capacity(MOST_CLUSTERS),
        }
    }

    /// Lends the file.
    pub const fn file(&mut self) -> &mut Record {
        &mut self.stream
    }

    /// Lends the sink.
    pub const fn sink(&mut self) -> &mut S {
        self.stream.sink()
    }

    /// Adds the committed plan.
    pub fn commit(&mut self, plan: &Plan, options: &SchedulerOptions, overheads: Overheads) {
        self.stream.commit(&committed(plan, options, overheads));
        self.expect(plan.task_set.clusters().count());
    }

    /// Expects events of `clusters` clusters, from the first event on.
    fn expect(&mut self, clusters: usize) {
        self.taken.clear();
        self.taken.resize(clusters, 0);
    }

    /// Adds the new events of the clusters' journals; `look` lends the journal of a cluster.
    /// Reports whether there were any.
    pub fn take_events(&mut self, mut look: impl FnMut(usize, &mut dyn FnMut(&Journal))) -> bool {
        let mut are_there = false;
        for (cluster, taken) in (0_u16..).zip(&mut self.taken) {
            // A few at a time, so the scheduler's lock is held for a bounded time only.
            let (mut words, mut count, mut before) = ([[0; 3]; AT_ONCE], 0, *taken);
            look(cluster.into(), &mut |journal| {
                (before, count) = journal.copy_from(*taken, &mut words);
            });
            // `before` is beyond `taken` where the journal has lost events.
            *taken = before + count as u64;
            if count > 0 {
                // Not inside `look`, where the cluster's lock is held: the sink may be slow.
                self.stream.events(cluster, before, &words[..count]);
                are_there = true;
            }
        }
        are_there
    }

    /// Adds the events of a run whose journals were not looked at meanwhile, and the times measured
    /// in the run.
    pub fn end_run(&mut self, run: &Run) {
        // Functions are told the clock's time; with the epoch a reader can convert it to the run's
        // time.
        if let epoch_ns @ 1.. = run.epoch_ns() {
            let line = format!("{{\"kind\":\"epoch\",\"ns\":{epoch_ns}}}\n");
            self.stream.text(&line);
        }
        // Without a commit, there is only the history kept before a fault.
        if self.taken.is_empty() {
            return;
        }
        let journal = run.journal();
        let clusters = self.taken.len();
        // Nothing was taken while the run went on: a finished run has one journal for all clusters.
        if self.taken.iter().all(|taken| *taken == 0) {
            self.expect(1);
            while self.take_events(|_, take| take(journal)) {}
        }
        self.stream.times(&times(run, &self.taken));
        // The next run of the same commit begins at its first event.
        self.expect(clusters);
    }

    /// Adds the remaining entries of a recording, if there is one, and returns how complete it is.
    pub fn end_recording(&mut self, mut outgoing: Outgoing) -> Option<RecordingState> {
        let drain = outgoing.as_mut()?;
        // The run is over, so this loop ends.
        while drain.step(Some(&mut self.stream)) {}
        let drained = drain.send_losses(&mut self.stream)?;
        // A single cut run makes the whole file a cut one.
        self.is_cut |= drained.is_cut;
        Some(drained)
    }

    /// Ends the record, and returns its sink.
    pub fn finish(self) -> S {
        match self.is_cut {
            true => self.stream.cut(),
            false => self.stream.end(),
        }
    }
}

fn committed(plan: &Plan, options: &SchedulerOptions, overheads: Overheads) -> Commit {
    let task_set = &*plan.task_set;
    let cores = |cluster| {
        let cores = task_set.cores_of(cluster, options.cores);
        u32::try_from(cores.len()).unwrap_or(u32::MAX)
    };
    let clusters = task_set.clusters().filter(|_| task_set.is_divided());
    let ids = (0..).map(DagId);
    let dags = ids.zip(task_set.dags()).zip(&plan.proven.bounds_ns);
    Commit {
        policy: options.policy as u8,
        is_preemptive: options.preemption == Preemption::Enabled,
        cores: options.cores,
        clusters: clusters.map(cores).collect(),
        charge_ns: overheads.of_an_instance_ns(options.preemption),
        ready_ns: overheads.ready_ns,
        dags: dags
            .map(|((id, dag), bound_ns)| CommittedDag {
                bound_ns: *bound_ns,
                samples: samples(plan, id),
                ..of_dag(dag)
            })
            .collect(),
        waits: waits(task_set),
        pins: Vec::new(),
        affinities: affinities(task_set),
        locks: locks(task_set),
        move_ns: overheads.of_a_move_ns(options.preemption),
        answers: plan.answers.in_words(),
        device_ns: [overheads.device_ns, overheads.device_distance_ns],
        lists: task_set.core_lists(),
    }
}

/// Returns all subtasks, each with the numbers of its DAG and its own.
fn subtasks(task_set: &TaskSet) -> impl Iterator<Item = (u32, u32, &Subtask)> {
    let dags = (0..).zip(task_set.dags());
    dags.flat_map(|(dag, of_dag)| {
        (0..)
            .zip(of_dag.subtasks())
            .map(move |(subtask, of)| (dag, subtask, of))
    })
}

fn affinities(task_set: &TaskSet) -> Vec<(u32, u32)> {
    let dags = (0..).zip(task_set.dags());
    let cores =
        dags.flat_map(|(dag, of_dag)| of_dag.affinity().iter().map(move |core| (dag, *core)));
    cores.collect()
}

fn locks(task_set: &TaskSet) -> Vec<(u32, u32, String, Option<u64>, u32)> {
    let mut all = Vec::new();
    for (dag, of_dag) in (0..).zip(task_set.dags()) {
        let told = |of: &LockUse| {
            let subtask = u32::try_from(of.subtask).unwrap_or(u32::MAX);
            (dag, subtask, of.lock.clone(), of.longest_ns, of.sections)
        };
        all.extend(of_dag.locks().iter().map(told));
    }
    all
}

fn waits(task_set: &TaskSet) -> Vec<(u32, u32, u64, Option<u64>)> {
    let waits = subtasks(task_set).flat_map(|(dag, subtask, of)| {
        let told = move |wait: &Wait| (dag, subtask, wait.limit_ns, wait.segment_ns);
        of.waits().iter().map(told)
    });
    waits.collect()
}

fn of_dag(dag: &Dag) -> CommittedDag {
    let subtasks = dag.subtasks().iter().map(|subtask| CommittedSubtask {
        name: subtask.name().into(),
        priority: subtask.priority().0,
        is_non_preemptive: subtask.is_non_preemptive(),
        wcet_ns: subtask.wcet_ns(),
    });
    let ids = (0..).map(SubtaskId).take(dag.subtasks().len());
    let edges = ids.flat_map(|from| dag.successors(from).iter().map(move |to| (from.0, to.0)));
    let sinks = dag.sinks().iter();
    let topics = dag.topics().iter().map(|topic| CommittedTopic {
        name: topic.name.clone(),
        type_name: topic.type_name.into(),
        writer: topic.writer.0,
        readers: topic.readers.iter().map(|reader| reader.0).collect(),
        is_sampled: topic.is_sampled,
    });
    let states = dag.state_precedences().iter();
    CommittedDag {
        name: dag.name().into(),
        hash: dag.graph_hash(),
        is_sporadic: dag.is_sporadic(),
        period_ns: dag.period_ns(),
        relative_deadline_ns: dag.relative_deadline_ns(),
        offset_ns: dag.offset_ns(),
        jobs: dag.jobs(),
        in_flight: dag.in_flight(),
        overrun: match dag.overrun() {
            OverrunPolicy::Queue => 0,
            OverrunPolicy::Skip => 1,
            OverrunPolicy::Abort => 2,
        },
        survives: match dag.on_fault() {
            OnFault::DropJob(limit) => Some((limit.faults, limit.window, limit.in_all)),
            _ => None,
        },
        cluster: dag.states_cluster().then_some(dag.cluster().0),
        subtasks: subtasks.collect(),
        edges: edges.collect(),
        sinks: sinks
            .map(|sink| (sink.0, dag.subtask(*sink).relative_deadline_ns()))
            .collect(),
        topics: topics.collect(),
        states: states
            .map(|edge| (edge.state.clone(), edge.earlier.0, edge.later.0))
            .collect(),
        ..CommittedDag::default()
    }
}

fn samples(plan: &Plan, reader: DagId) -> Vec<(u32, u32, u32, Option<u64>)> {
    let all = plan.staleness.iter();
    let of_reader = all.filter(|sample| sample.reader_dag.id == reader);
    let samples = of_reader.filter_map(|sample| {
        let writer = sample.writer_dag.id;
        let mut topics = plan.task_set.dag(writer).topics().iter();
        let topic = topics.position(|topic| topic.name == sample.topic)?;
        let bound = sample.bound.map(|bound| bound.as_nanos());
        let bound_ns = bound.and_then(|bound_ns| u64::try_from(bound_ns).ok());
        let topic = u32::try_from(topic).ok()?;
        Some((sample.reader.id.0, writer.0, topic, bound_ns))
    });
    samples.collect()
}

fn times(run: &Run, written: &[u64]) -> Times {
    let ids = (0..).map(DagId).zip(run.task_set().dags());
    let of_dag = |(dag, model): (DagId, &Dag)| {
        let times = run.times()?;
        let of_dag = times.dag(dag);
        let subtasks = (0..).map(SubtaskId).take(model.subtasks().len());
        let subtasks = subtasks.map(|subtask| {
            let of_subtask = times.subtask(vertex(run.task_set(), dag, subtask));
            let sink = of_subtask.response_time.as_ref();
            SubtaskTimes {
                join_latency: counted(&of_subtask.join_latency),
                execution: counted(&of_subtask.execution_time),
                sink: sink.map(|times| {
                    let misses = run.sink_misses(dag, subtask);
                    (counted(times), misses, run.sink_bound_ns(dag, subtask))
                }),
            }
        });
        Some(DagTimes {
            response: counted(&of_dag.response_time),
            release_jitter: counted(&of_dag.release_jitter),
            subtasks: subtasks.collect(),
        })
    };
    Times {
        written: written.into(),
        dags: ids.map_while(of_dag).collect(),
    }
}

fn vertex(task_set: &TaskSet, dag: DagId, subtask: SubtaskId) -> Vertex {
    let job = 0;
    task_set.vertex(Instance { dag, job, subtask })
}

fn counted(times: &Histogram) -> Counted {
    let times = times.distribution();
    Counted {
        min_ns: times.min(),
        buckets: times.values().collect(),
    }
}
