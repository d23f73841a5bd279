//! Witnesses: all data needed to check bounds without solving anything.
//!
//! [`witness()`] writes a text of lines of words. The text begins with the commit in the analysis's
//! own terms, and a hash of it. A few certificates of each graph follow, and for each bound the
//! proving inequality with every term. `./scripts/check-witness` computes each term again from the
//! others; its own text lists the requirements on each line.
//!
//! ```text
//! machine CORES ORDER OVERHEAD_NS             static: by the numbers of subtasks; edf: by deadlines; any
//! bursts READY_NS LATE                        only if it takes time to make instances ready
//! moves MOVE_NS                               likewise to move them, where cores are told apart
//! device DEVICE_NS DISTANCE_NS                only if one interrupts a core
//! cluster CLUSTER CLUSTERS                    only of divided cores: which it is, of how many
//! dag DAG PERIOD DEADLINE IN_FLIGHT SUBTASKS EDGES "NAME"
//! queue WAITING                               of `bursts`, the most releases that wait for room: none, or
//!                                             1 for each job in flight; without it any number
//! subtask WCET NUMBER KEEPS_ITS_CORE          (a WCET of 0 is an unknown one)
//! edge FROM TO
//! wait SUBTASK WCET LIMIT WCET ..             of segments and waits, likewise
//! grid PHASE                                  of a periodic one in a table: its first release, modulo T
//! affinity CORE..                             of the cluster, counted from 0; without it all
//! due SUBTASK DEADLINE                        of a sink that is due before its job
//! releases OFFSET JOBS                        after the dags, of each, if the set is fixed; 0: no end
//! table LAP                                   after the dags; then the list of each of its cores
//! list CORE {DAG JOB SUBTASK START FINISH DEPTH}..
//! hash FNV_1A                                 of all above
//!
//! graph DAG LENGTH VOLUME
//! levels LEVEL..                              bottom levels by subtask
//! cover SUBTASK.. / part SUBTASK..            chains; -1-v is a subtask v that is passed
//!
//! bound DAG R paths CHAINS CORES LEFT BLOCKED BUSY
//! bound DAG R waiting CHAINS CORES LEFT BLOCKED BUSY
//! bound DAG R sharp CHAINS CORES 0 0 BUSY     whose excess of 1 is left out
//! bound DAG R reserved CHAINS CORES LEFT BUSY     of subtasks that wait, as the next one
//! bound DAG R blocked LEFT BUSY
//! chain SUBTASK..                             as `cover`
//! other DAG R CORES W CLIPPED                 clipped if `waiting` or `sharp`
//!
//! bound DAG R overlap OWN
//! window X BUSY                               and `other` lines with W in that window
//!
//! sink DAG SUBTASK R OWN                      that is complete before its job; as `overlap`
//!
//! bound DAG R core BUSY                       on one core; BUSY: the longest stretch
//! target SUBTASK                              that is the last of its deadline; none: the whole job
//! at A X..                                    the release after a stretch's begin, and the finish by
//!                                             each subtask that may keep the core as the stretch begins
//! sooner DAG R BUSY                           a sink; its target and points as above
//!
//! demand BUSY TIME..                          before all bounds, if it proves some
//! bound DAG R demand
//!
//! bound DAG R windows                         on one core, of a job's segments in a row
//! group COUNT END OWN_END                     so many of them, 0 for all; by what may keep the core
//!
//! bound DAG R widths                          as many cores as its DAGs are wide
//! reached DAG SUBTASK R                       a sink of such a DAG
//!
//! bound DAG R table                           of a DAG in a table
//! bound DAG R sequence OWNED                  of a member, on one core
//! bound DAG R lent CHAINS CLIPPED LEFT OWNED  of a member, on several; OWNED: by their tables
//! chain SUBTASK.. / other DAG R WORK          as above
//!
//! state LAPS COUNT.. FREE.. {VERTEX JOB LOW HIGH}..   before all bounds, of a certificate
//! bound DAG R graph
//! latest DAG SUBTASK R                        a sink that is complete before its job
//!
//! bound DAG R priorities CORES
//! path SUBTASK..                              each path of the DAG
//!
//! unproven DAG
//! seal FNV_1A                                 of all above
//! ```
//!
//! The number of `cover` lines is an upper limit on a DAG's width; without any, the DAG may use all
//! cores. `part` lines are disjoint chains, for the clipped form.

use alloc::string::String;
use alloc::vec;
use alloc::vec::Vec;

use super::AnalysisSettings;
use super::case::{AnalysisInput, of_cluster, with_case};
use super::cover::{heaviest, peel};
use super::overheads::Overheads;
use super::ranks::InstanceOrder;
use super::schedulability::{write_certificates, write_terms};
use super::witness_text::WitnessText;
use super::workload::waiting_rooms;
use crate::fnv::{EMPTY, fnv_1a};
use crate::ids::{ClusterId, DagId, to_u32};
use crate::policy::Preemption;
use crate::table::Table;
use crate::task_set::{Dag, Subtask, TaskSet};

/// Writes a witness for the bounds given by [`answer()`](super::answer()). With divided cores, each
/// cluster gets a witness of its own, with its DAGs counted from 0.
#[must_use]
pub fn witness(task_set: &TaskSet, settings: &AnalysisSettings) -> String {
    let parts = task_set.clusters().map(|cluster| {
        let cores = to_u32(task_set.cores_of(cluster, settings.cores).len());
        let place = task_set.is_divided().then_some(cluster);
        let place = place.map(|cluster| (cluster.0, task_set.clusters().count()));
        let dags = task_set.part(cluster);
        let tables = part_of_tables(task_set, cluster);
        let settings = of_cluster(settings, cores, &mut dags.iter());
        let tables: Vec<&Table> = tables.iter().collect();
        whole((&dags, &tables, task_set.certificate()), place, &settings)
    });
    parts.collect()
}

/// Returns copies of the tables of a cluster, with the cluster's DAGs counted from 0.
fn part_of_tables(task_set: &TaskSet, cluster: ClusterId) -> Vec<Table> {
    let mut numbers = vec![DagId(0); task_set.dags().len()];
    let of_cluster = |dag: &usize| task_set.dags()[*dag].cluster() == cluster;
    for (dag, number) in (0..numbers.len()).filter(of_cluster).zip(0..) {
        numbers[dag] = DagId(number);
    }
    let mut tables = task_set.tables().to_vec();
    tables.retain(|table| table.cluster == cluster);
    for list in tables.iter_mut().flat_map(|table| &mut table.lists) {
        for entry in &mut list.entries {
            entry.dag = numbers[entry.dag.index()];
        }
    }
    tables
}

fn whole(
    (dags, tables, certificate): (&[Dag], &[&Table], Option<&str>),
    place: Option<(u32, usize)>,
    settings: &AnalysisSettings,
) -> String {
    let mut text = WitnessText(String::new());
    let all: Vec<usize> = (0..dags.len()).collect();
    let mut reasons = vec![None; dags.len()];
    with_case(
        (dags, tables, certificate),
        &all,
        settings,
        &mut reasons,
        |case, verdict, reasons| {
            text.machine(place, case);
            text.statement((dags, tables), certificate.is_some(), case);
            text.hash("hash");
            let bounds = verdict.bounds;
            for dag in 0..case.members.len() {
                text.graph(case, dag);
            }
            let responses = bounds.iter().map(|bound| bound.map(|bound| bound.bound_ns));
            let responses: Vec<Option<u64>> = responses.collect();
            write_certificates(case, &bounds, &mut text);
            for (dag, bound) in bounds.iter().enumerate() {
                match bound {
                    Some(bound) => write_terms(case, &responses, dag, *bound, &mut text),
                    None => text.line(format_args!("unproven {}", case.members[dag])),
                }
            }
            for (dag, _) in reasons
                .iter()
                .enumerate()
                .filter(|(_, reason)| reason.is_some())
            {
                text.line(format_args!("unproven {dag}"));
            }
        },
    );
    text.hash("seal");
    text.0
}

impl WitnessText {
    fn hash(&mut self, word: &str) {
        let hash = fnv_1a(EMPTY, self.0.as_bytes());
        self.line(format_args!("{word} {hash}"));
    }

    fn machine(&mut self, place: Option<(u32, usize)>, case: &AnalysisInput<'_>) {
        let (settings, bursts) = (case.settings, &case.set.bursts);
        let order = match case.relation.order {
            InstanceOrder::Ranked => "static",
            InstanceOrder::ByDeadline => "edf",
            InstanceOrder::Any => "any",
        };
        let overhead_ns = settings.overheads.of_an_instance_ns(settings.preemption);
        let (cores, overhead_ns) = (settings.cores, overhead_ns.unwrap_or(u64::MAX));
        self.line(format_args!("machine {cores} {order} {overhead_ns}"));
        if !bursts.are_none() {
            let ready_ns = settings.overheads.ready_ns;
            self.line(format_args!("bursts {ready_ns} {}", bursts.late_ns));
        }
        if case.tells_cores() && bursts.move_ns > 0 {
            self.line(format_args!("moves {}", bursts.move_ns));
        }
        let Overheads {
            device_ns,
            device_distance_ns,
            ..
        } = settings.overheads;
        if device_ns > 0 {
            self.line(format_args!("device {device_ns} {device_distance_ns}"));
        }
        if let Some((cluster, clusters)) = place {
            self.line(format_args!("cluster {cluster} {clusters}"));
        }
    }

    fn statement(
        &mut self,
        (dags, tables): (&[Dag], &[&Table]),
        is_fixed: bool,
        case: &AnalysisInput<'_>,
    ) {
        let (settings, bursts) = (case.settings, &case.set.bursts);
        for (id, dag) in dags.iter().enumerate() {
            let edges = dag.graph.successors.edges();
            self.line(format_args!(
                "dag {id} {} {} {} {} {} {:?}",
                dag.period_ns(),
                dag.relative_deadline_ns(),
                dag.in_flight(),
                dag.subtasks().len(),
                edges.len(),
                dag.name(),
            ));
            if let Some(waiting) = waiting_rooms(dag).filter(|_| !bursts.are_none()) {
                self.line(format_args!("queue {waiting}"));
            }
            for (subtask, number) in dag.subtasks().iter().zip(settings.policy.numbers(dag)) {
                let keeps =
                    subtask.is_non_preemptive() || settings.preemption == Preemption::Disabled;
                let number = match case.relation.order {
                    InstanceOrder::Ranked => number,
                    // Numbers of other orders prove nothing, so the priority is written.
                    _ => subtask.priority().0.into(),
                };
                let wcet = subtask.locking_wcet_ns().unwrap_or(0);
                self.line(format_args!("subtask {wcet} {number} {}", u8::from(keeps)));
            }
            for (from, to) in edges {
                self.line(format_args!("edge {from} {to}"));
            }
            for (id, subtask) in dag.subtasks().iter().enumerate() {
                self.waits(id, subtask);
            }
            let own = DagId(to_u32(id));
            if !dag.is_sporadic() && tables.iter().any(|table| table.dags().contains(&own)) {
                self.line(format_args!("grid {}", dag.offset_ns() % dag.period_ns()));
            }
            if !dag.affinity().is_empty() {
                let cores = dag.affinity().iter().map(|&core| core.into());
                self.list("affinity", cores);
            }
            for &sink in dag.sinks() {
                let deadline_ns = dag.subtask(sink).relative_deadline_ns();
                // A sink with a shared state may precede other subtasks: the graph alone does not
                // show that it is a sink.
                if deadline_ns < dag.relative_deadline_ns() || !dag.successors(sink).is_empty() {
                    self.line(format_args!("due {} {deadline_ns}", sink.0));
                }
            }
        }
        let fixed = dags.iter().filter(|_| is_fixed);
        fixed.for_each(|dag| {
            let jobs = dag.jobs().unwrap_or(0);
            self.line(format_args!("releases {} {jobs}", dag.offset_ns()));
        });
        tables.iter().for_each(|table| self.table(dags, table));
    }

    fn table(&mut self, dags: &[Dag], table: &Table) {
        let is_alone = table.is_of_one_dag();
        self.line(format_args!("table {}", table.lap_ns));
        for list in &table.lists {
            let entries = list.entries.iter().flat_map(|of| {
                let finish_ns = i128::from(of.start_ns) + i128::from(of.length_ns);
                let (dag, subtask) = (of.dag.0.into(), of.subtask.0.into());
                let model = &dags[of.dag.index()];
                // Counted from the first release in lap 0, like `grid`.
                let before = model.offset_ns() / model.period_ns() * u64::from(!is_alone);
                let (job, depth) = (i128::from(of.job) + i128::from(before), of.depth.into());
                [dag, job, subtask, of.start_ns.into(), finish_ns, depth]
            });
            self.list("list", core::iter::once(list.core.into()).chain(entries));
        }
    }

    fn waits(&mut self, id: usize, subtask: &Subtask) {
        let limits_ns = subtask.waits().iter().map(|wait| wait.limit_ns);
        if limits_ns.len() == 0 {
            return;
        }
        let segments_ns = subtask.locking_segments_ns();
        let segments_ns = segments_ns.unwrap_or(vec![0; limits_ns.len() + 1]);
        let later = limits_ns.zip(&segments_ns[1..]);
        let later = later.flat_map(|(limit_ns, &segment_ns)| [limit_ns, segment_ns]);
        let times = core::iter::once(segments_ns[0]).chain(later);
        let numbers = core::iter::once(id as i128).chain(times.map(i128::from));
        self.list("wait", numbers);
    }

    fn graph(&mut self, case: &AnalysisInput<'_>, dag: usize) {
        let (task, shape) = (case.tasks[dag], &case.set.shapes[dag]);
        let (length, volume) = (task.length_ns(), task.volume_ns());
        self.line(format_args!(
            "graph {} {length} {volume}",
            case.members[dag]
        ));
        self.list("levels", task.bottom_levels().into_iter().map(i128::from));
        if shape.parallelism < case.set.cores.into() {
            self.chains("cover", &heaviest(task, most(shape.parallelism)));
        }
        self.chains("part", &peel(task, most(shape.parallelism)));
    }
}

fn most(parallelism: u64) -> usize {
    usize::try_from(parallelism).unwrap_or(usize::MAX)
}
