//! Random sets of DAGs, in a form that is easy to shrink and to print.

use std::collections::VecDeque;
use std::fmt;

use sched_dag::{
    Activation, DagId, DagSpec, FaultLimit, Instance, OnFault, OverrunPolicy, Policy, Preemption,
    Priority, SchedulerOptions, SubtaskSpec,
};

use crate::random::Random;

/// One set with all that a run depends on.
#[derive(Clone)]
pub(crate) struct Set {
    pub(crate) options: SchedulerOptions,
    pub(crate) dags: Vec<Dag>,
    /// The seed of what a driver is free to choose.
    pub(crate) choices: u64,
}

#[derive(Clone)]
pub(crate) struct Dag {
    pub(crate) period_ns: u64,
    pub(crate) deadline_ns: u64,
    pub(crate) offset_ns: u64,
    pub(crate) jobs: u64,
    pub(crate) in_flight: u64,
    pub(crate) overrun: OverrunPolicy,
    pub(crate) subtasks: Vec<Subtask>,
    pub(crate) edges: Vec<(usize, usize)>,
    /// When signals come, in order, if it is sporadic.
    pub(crate) signals_ns: Option<Vec<u64>>,
    /// When it is paused and when resumed, in order, at different times.
    pub(crate) pauses_ns: Vec<(u64, u64)>,
    /// When it is stopped.
    pub(crate) stop_ns: Option<u64>,
    /// The faults that cost a job only.
    pub(crate) fault_limit: Option<FaultLimit>,
}

#[derive(Clone)]
pub(crate) struct Subtask {
    pub(crate) priority: u32,
    pub(crate) non_preemptive: bool,
    /// For each job.
    pub(crate) executions_ns: Vec<u64>,
    /// The job in which it fails at the end of its execution, if it starts.
    pub(crate) fails_in: Option<u64>,
    /// Whether there is another function for it.
    pub(crate) is_replaceable: bool,
    /// Of a sink, its own relative deadline.
    pub(crate) deadline_ns: Option<u64>,
}

/// Whether releases may find no room.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Overruns {
    /// As many jobs as there are may be in flight.
    Never,
    /// At most three jobs may be in flight.
    Often,
}

pub(crate) fn draw(random: &mut Random, overruns: Overruns) -> Set {
    let cores = if random.chance(5) {
        64
    } else {
        random.between(1, 4)
    };
    let options = SchedulerOptions {
        policy: if random.chance(50) {
            Policy::Edf
        } else {
            Policy::StaticPriority
        },
        preemption: if random.chance(75) {
            Preemption::Enabled
        } else {
            Preemption::Disabled
        },
        cores: u32::try_from(cores).expect("few cores"),
    };
    let dags = (0..random.between(1, 4))
        .map(|_| draw_dag(random, overruns))
        .collect();
    Set {
        options,
        dags,
        choices: random.next(),
    }
}

/// Draws a set in which instances fail, of one DAG at least.
pub(crate) fn draw_failing(random: &mut Random) -> Set {
    let overruns = if random.chance(50) {
        Overruns::Never
    } else {
        Overruns::Often
    };
    let mut set = draw(random, overruns);
    let certain = random.below(set.dags.len());
    for (number, dag) in set.dags.iter_mut().enumerate() {
        let faults = if number == certain {
            random.between(1, 3)
        } else {
            random.between(0, 4).saturating_sub(3)
        };
        for _ in 0..faults {
            let subtask = random.below(dag.subtasks.len());
            dag.subtasks[subtask].fails_in = Some(random.between(0, dag.jobs - 1));
        }
    }
    set
}

/// Draws a set with signals, pauses, stops and failures.
pub(crate) fn draw_disturbed(random: &mut Random) -> Set {
    let overruns = if random.chance(40) {
        Overruns::Never
    } else {
        Overruns::Often
    };
    let mut set = draw(random, overruns);
    for dag in &mut set.dags {
        if random.chance(40) {
            let mut signals_ns: Vec<u64> = (0..random.between(0, 10))
                .map(|_| random.between(0, 60))
                .collect();
            signals_ns.sort_unstable();
            dag.signals_ns = Some(signals_ns);
        }
        let mut time_ns = 0;
        for _ in 0..random.between(0, 4).saturating_sub(2) {
            let from_ns = time_ns + random.between(1, 20) - 1;
            let to_ns = from_ns + random.between(1, 20);
            dag.pauses_ns.push((from_ns, to_ns));
            time_ns = to_ns + 1;
        }
        dag.stop_ns = random.chance(15).then(|| random.between(0, 50));
        if random.chance(15) {
            let subtask = random.below(dag.subtasks.len());
            dag.subtasks[subtask].fails_in = Some(random.between(0, dag.jobs - 1));
        }
    }
    set
}

fn draw_dag(random: &mut Random, overruns: Overruns) -> Dag {
    let count = random.between(1, 7);
    let jobs = random.between(1, 6);
    let longest = random.between(1, 8);
    let priorities = random.between(0, 6);
    let often_non_preemptive = if random.chance(30) { 40 } else { 0 };
    let subtasks: Vec<Subtask> = (0..count)
        .map(|_| Subtask {
            priority: u32::try_from(random.between(0, priorities)).expect("few priorities"),
            non_preemptive: random.chance(often_non_preemptive),
            executions_ns: (0..jobs).map(|_| random.between(1, longest)).collect(),
            fails_in: None,
            is_replaceable: random.chance(80),
            deadline_ns: None,
        })
        .collect();
    let period_ns = random.between(1, 24);
    let mut dag = Dag {
        period_ns,
        deadline_ns: if random.chance(40) {
            period_ns
        } else {
            random.between(1, 40)
        },
        offset_ns: if random.chance(50) {
            0
        } else {
            random.between(0, 20)
        },
        jobs,
        in_flight: if overruns == Overruns::Never {
            jobs
        } else {
            random.between(1, 3)
        },
        overrun: match random.between(0, 2) {
            _ if overruns == Overruns::Never => OverrunPolicy::Queue,
            0 => OverrunPolicy::Queue,
            1 => OverrunPolicy::Skip,
            _ => OverrunPolicy::Abort,
        },
        edges: draw_edges(random, subtasks.len()),
        subtasks,
        signals_ns: None,
        pauses_ns: Vec::new(),
        stop_ns: None,
        fault_limit: random.chance(50).then(|| draw_fault_limit(random)),
    };
    if random.chance(50) {
        for subtask in 0..dag.subtasks.len() {
            if dag.is_sink(subtask) && random.chance(70) {
                dag.subtasks[subtask].deadline_ns = Some(random.between(1, dag.deadline_ns));
            }
        }
    }
    dag
}

fn draw_fault_limit(random: &mut Random) -> FaultLimit {
    FaultLimit {
        faults: u32::try_from(random.between(1, 3)).expect("few faults"),
        window: random.between(1, 4),
        in_all: u32::try_from(random.between(1, 5)).expect("few faults"),
    }
}

/// Draws edges along a random order, so that indices are not sorted by
/// precedence; transitive and repeated edges occur.
fn draw_edges(random: &mut Random, count: usize) -> Vec<(usize, usize)> {
    let mut order: Vec<usize> = (0..count).collect();
    for position in (1..count).rev() {
        order.swap(position, random.below(position + 1));
    }
    let density = random.between(5, 70);
    let mut edges = Vec::new();
    for later in 1..count {
        for earlier in 0..later {
            if random.chance(density) {
                edges.push((order[earlier], order[later]));
            }
        }
    }
    edges
}

impl Set {
    pub(crate) fn specs(&self) -> Vec<DagSpec> {
        self.dags.iter().map(Dag::spec).collect()
    }

    fn subtask(&self, instance: Instance) -> &Subtask {
        &self.dags[instance.dag.index()].subtasks[instance.subtask.index()]
    }

    pub(crate) fn execution_ns(&self, instance: Instance) -> u64 {
        let job = usize::try_from(instance.job).expect("few jobs");
        self.subtask(instance).executions_ns[job]
    }

    pub(crate) fn fails(&self, instance: Instance) -> bool {
        self.subtask(instance).fails_in == Some(instance.job)
    }

    pub(crate) fn is_replaceable(&self, instance: Instance) -> bool {
        self.subtask(instance).is_replaceable
    }

    /// Returns all signals, in order.
    pub(crate) fn signals(&self) -> VecDeque<(u64, DagId)> {
        let of_dag = |(id, dag): (DagId, &Dag)| {
            let signals_ns = dag.signals_ns.clone().unwrap_or_default();
            signals_ns.into_iter().map(move |at_ns| (at_ns, id))
        };
        let dags = (0..).map(DagId).zip(&self.dags);
        let mut signals: Vec<_> = dags.flat_map(of_dag).collect();
        signals.sort_by_key(|&(at_ns, _)| at_ns);
        signals.into()
    }
}

impl Dag {
    pub(crate) fn is_sink(&self, subtask: usize) -> bool {
        self.edges.iter().all(|&(from, _)| from != subtask)
    }

    pub(crate) fn jobs(&self) -> usize {
        usize::try_from(self.jobs).expect("few jobs")
    }

    /// Returns the relative deadline of a sink.
    pub(crate) fn relative_ns(&self, sink: usize) -> u64 {
        self.subtasks[sink].deadline_ns.unwrap_or(self.deadline_ns)
    }

    /// Returns the relative deadline of the most urgent sink that a subtask reaches.
    pub(crate) fn earliest_ns(&self, subtask: usize) -> u64 {
        let successors = self.edges.iter().filter(|edge| edge.0 == subtask);
        let of_successors = successors.map(|edge| self.earliest_ns(edge.1)).min();
        of_successors.unwrap_or_else(|| self.relative_ns(subtask))
    }

    fn spec(&self) -> DagSpec {
        let subtask = |subtask: &Subtask| SubtaskSpec {
            priority: Some(Priority(subtask.priority)),
            non_preemptive: subtask.non_preemptive,
            relative_deadline_ns: subtask.deadline_ns,
            ..SubtaskSpec::default()
        };
        DagSpec {
            activation: match self.signals_ns {
                Some(_) => Activation::Sporadic,
                None => Activation::default(),
            },
            period_ns: Some(self.period_ns),
            relative_deadline_ns: Some(self.deadline_ns),
            offset_ns: self.offset_ns,
            in_flight: Some(u32::try_from(self.in_flight).expect("few jobs")),
            overrun: self.overrun,
            on_fault: self.fault_limit.map_or(OnFault::EndDag, OnFault::DropJob),
            jobs: Some(self.jobs),
            subtasks: self.subtasks.iter().map(subtask).collect(),
            edges: self.edges.clone(),
            ..DagSpec::default()
        }
    }
}

/// Writes the set in the words of the reference schedules' text form, with what
/// it cannot say after each line.
impl fmt::Display for Set {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let SchedulerOptions {
            policy,
            preemption,
            cores,
        } = self.options;
        let edf = u8::from(policy == Policy::Edf);
        let preemptive = u8::from(preemption == Preemption::Enabled);
        writeln!(
            f,
            "case shrunk {cores} {edf} {preemptive} {}",
            self.dags.len()
        )?;
        for dag in &self.dags {
            writeln!(
                f,
                "dag {} {} {} {} {} {}    in_flight {} {:?}",
                dag.period_ns,
                dag.deadline_ns,
                dag.offset_ns,
                dag.jobs,
                dag.subtasks.len(),
                dag.edges.len(),
                dag.in_flight,
                dag.overrun
            )?;
            for subtask in &dag.subtasks {
                let longest = subtask.executions_ns.iter().max().unwrap_or(&0);
                write!(f, "sub {longest} {}", subtask.priority)?;
                for execution_ns in &subtask.executions_ns {
                    write!(f, " {execution_ns}")?;
                }
                writeln!(
                    f,
                    "{}",
                    if subtask.non_preemptive {
                        "    non-preemptive"
                    } else {
                        ""
                    }
                )?;
                if let Some(job) = subtask.fails_in {
                    let is_replaceable = subtask.is_replaceable;
                    writeln!(f, "    fails in job {job}, replaceable: {is_replaceable}")?;
                }
            }
            for (from, to) in &dag.edges {
                writeln!(f, "edge {from} {to}")?;
            }
            for (subtask, of) in dag.subtasks.iter().enumerate() {
                if let Some(deadline_ns) = of.deadline_ns {
                    writeln!(f, "sink {subtask} {deadline_ns}")?;
                }
            }
            if let Some(signals_ns) = &dag.signals_ns {
                writeln!(f, "    signals at {signals_ns:?}")?;
            }
            for (from_ns, to_ns) in &dag.pauses_ns {
                writeln!(f, "    paused at {from_ns}, resumed at {to_ns}")?;
            }
            if let Some(fault_limit) = dag.fault_limit {
                writeln!(f, "    {fault_limit:?}")?;
            }
            if let Some(stop_ns) = dag.stop_ns {
                writeln!(f, "    stopped at {stop_ns}")?;
            }
        }
        writeln!(f, "    choices {}", self.choices)
    }
}
