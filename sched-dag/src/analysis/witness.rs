//! Witnesses: what it takes to check bounds without solving anything.
//!
//! [`witness()`] writes a text of lines of words. It begins with what was committed, in the
//! analysis's own terms, and a hash of that; then come a few certificates of each graph, and
//! of each bound the inequality that proves it with every term. `./scripts/check-witness`,
//! whose text says what it requires of each line, computes each term again from the others.
//!
//! ```text
//! machine CORES POLICY OVERHEAD_NS            static or edf
//! bursts READY_NS LATE                        only if it takes time to make instances ready
//! cluster CLUSTER CLUSTERS                    only of divided cores: which it is, of how many
//! dag DAG PERIOD DEADLINE IN_FLIGHT SUBTASKS EDGES "NAME"
//! subtask WCET PRIORITY KEEPS_ITS_CORE        (a WCET of 0 is an unknown one)
//! edge FROM TO
//! wait SUBTASK WCET LIMIT WCET ..             of segments and waits, likewise
//! pin SUBTASK CORE                            of the cluster, counted from 0
//! affinity CORE..                             of those that are not pinned; without it all
//! due SUBTASK DEADLINE                        of a sink that is due before its job
//! hash FNV_1A                                 of all above
//!
//! graph DAG LENGTH VOLUME
//! levels LEVEL..                              bottom levels by subtask
//! cover SUBTASK.. / part SUBTASK..            chains; -1-v is a subtask v that is passed
//!
//! bound DAG R paths CHAINS CORES LEFT BLOCKED BUSY
//! bound DAG R waiting CHAINS CORES LEFT BLOCKED BUSY
//! bound DAG R reserved CHAINS CORES LEFT BUSY     of subtasks that wait, as the next one
//! bound DAG R blocked LEFT BUSY
//! chain SUBTASK..                             as `cover`
//! other DAG R CORES W CLIPPED                 clipped only if `waiting`
//!
//! bound DAG R overlap OWN
//! window X BUSY                               and `other` lines with W in that window
//!
//! sink DAG SUBTASK R OWN                      that is complete before its job; as `overlap`
//!
//! bound DAG R response BLOCKED                on one core
//! window X OWN
//!
//! demand BUSY TIME..                          before all bounds, if it proves some
//! bound DAG R demand
//!
//! bound DAG R owner FINISH..                  by subtask, from the release on
//! bound DAG R sequence OWNED                  of a member, on one core
//! bound DAG R lent CHAINS CLIPPED LEFT OWNED  of a member, on several; OWNED: by their owners
//! chain SUBTASK.. / other DAG R WORK          as above
//!
//! bound DAG R priorities CORES
//! path SUBTASK..                              each path of the DAG
//!
//! unproven DAG
//! seal FNV_1A                                 of all above
//! ```
//!
//! `cover` lines show that a DAG is no wider than there are of them; without any it may use
//! all cores. `part` lines are disjoint chains, for the clipped form.

use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;
use core::fmt::{self, Write};

use super::case::{AnalysisInput, all_dues, are_in_time, loads, of_cluster, with_case};
use super::cover::{CoverChain, covering, heaviest, peel};
use super::interference::{DelaySources, InterferingDag};
use super::intra_task::each_path;
use super::judge;
use super::lent_cores::LentForm;
use super::one_core::{ResponseEquation, demand};
use super::pinned::PinnedCluster;
use super::pipelined::{PipelineTerms, STEP_LIMIT};
use super::waiting::reserved;
use super::workload::WorkloadBursts;
use super::{AnalysisSettings, DagBound, SchedulabilityTest};
use crate::fnv::{EMPTY, fnv_1a};
use crate::ids::to_u32;
use crate::policy::{Policy, Preemption};
use crate::task_set::{Dag, Subtask, TaskSet};

/// Writes a witness for the bounds that [`answer()`](super::answer()) gives; where the cores
/// are divided, one for each cluster, with its DAGs counted from 0.
#[must_use]
pub fn witness(task_set: &TaskSet, settings: &AnalysisSettings) -> String {
    let parts = task_set.clusters().map(|cluster| {
        let cores = to_u32(task_set.cores_of(cluster, settings.cores).len());
        let place = task_set.is_divided().then_some(cluster);
        let place = place.map(|cluster| (cluster.0, task_set.clusters().count()));
        let dags = task_set.part(cluster);
        let settings = of_cluster(settings, cores, dags.iter());
        whole(&dags, place, &settings)
    });
    parts.collect()
}

fn whole(dags: &[Dag], place: Option<(u32, usize)>, settings: &AnalysisSettings) -> String {
    let mut text = WitnessText(String::new());
    text.statement(dags, place, settings);
    text.hash("hash");
    let all: Vec<usize> = (0..dags.len()).collect();
    let mut reasons = alloc::vec![None; dags.len()];
    with_case(dags, &all, settings, &mut reasons, |case, reasons| {
        let bounds = case.verdict().bounds;
        for dag in 0..case.members.len() {
            text.graph(case, dag);
        }
        let responses = bounds.iter().map(|bound| bound.map(|bound| bound.bound_ns));
        let responses: Vec<Option<u64>> = responses.collect();
        let by_demand = |bound: &DagBound| bound.test == SchedulabilityTest::Demand;
        let is_asked = case.relation.ranks_sinks && are_in_time(case);
        if (is_asked || bounds.iter().flatten().any(by_demand))
            && let Some((busy, times)) = demand(&all_dues(case), &case.set.bursts)
        {
            let numbers = core::iter::once(busy).chain(times);
            text.list("demand", numbers.map(u128::cast_signed));
        }
        for (dag, bound) in bounds.iter().enumerate() {
            match bound {
                Some(bound) => {
                    text.bound(case, &responses, dag, *bound);
                    text.sinks(case, &responses, dag, bound.bound_ns);
                }
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
    });
    text.hash("seal");
    text.0
}

struct WitnessText(String);

impl WitnessText {
    fn hash(&mut self, word: &str) {
        let hash = fnv_1a(EMPTY, self.0.as_bytes());
        self.line(format_args!("{word} {hash}"));
    }

    fn line(&mut self, words: fmt::Arguments<'_>) {
        // Writing into a `String` cannot fail.
        let _ = writeln!(self.0, "{words}");
    }

    fn list(&mut self, word: &str, numbers: impl Iterator<Item = i128>) {
        self.0.push_str(word);
        for number in numbers {
            let _ = write!(self.0, " {number}");
        }
        self.0.push('\n');
    }

    fn statement(
        &mut self,
        dags: &[Dag],
        place: Option<(u32, usize)>,
        settings: &AnalysisSettings,
    ) {
        let policy = match settings.policy {
            Policy::StaticPriority => "static",
            Policy::Edf => "edf",
        };
        let overhead_ns = settings.overheads.of_an_instance_ns(settings.preemption);
        let (cores, overhead_ns) = (settings.cores, overhead_ns.unwrap_or(u64::MAX));
        self.line(format_args!("machine {cores} {policy} {overhead_ns}"));
        let bursts = WorkloadBursts::of(dags.iter(), settings);
        if !bursts.are_none() {
            let ready_ns = settings.overheads.ready_ns;
            self.line(format_args!("bursts {ready_ns} {}", bursts.late_ns));
        }
        if let Some((cluster, clusters)) = place {
            self.line(format_args!("cluster {cluster} {clusters}"));
        }
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
            for subtask in dag.subtasks() {
                let keeps =
                    subtask.is_non_preemptive() || settings.preemption == Preemption::Disabled;
                let (wcet, priority) = (subtask.wcet_ns().unwrap_or(0), subtask.priority().0);
                self.line(format_args!(
                    "subtask {wcet} {priority} {}",
                    u8::from(keeps)
                ));
            }
            for (from, to) in edges {
                self.line(format_args!("edge {from} {to}"));
            }
            for (id, subtask) in dag.subtasks().iter().enumerate() {
                self.waits(id, subtask);
            }
            for (id, subtask) in dag.subtasks().iter().enumerate() {
                if let Some(core) = subtask.core() {
                    self.line(format_args!("pin {id} {core}"));
                }
            }
            if !dag.affinity().is_empty() {
                let cores = dag.affinity().iter().map(|&core| core.into());
                self.list("affinity", cores);
            }
            for &sink in dag.sinks() {
                let deadline_ns = dag.subtask(sink).relative_deadline_ns();
                if deadline_ns < dag.relative_deadline_ns() {
                    self.line(format_args!("due {} {deadline_ns}", sink.0));
                }
            }
        }
    }

    fn waits(&mut self, id: usize, subtask: &Subtask) {
        let limits_ns = subtask.waits().iter().map(|wait| wait.limit_ns);
        if limits_ns.len() == 0 {
            return;
        }
        let segments_ns = subtask.segments_ns();
        let segments_ns = segments_ns.unwrap_or(alloc::vec![0; limits_ns.len() + 1]);
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

    fn chains(&mut self, word: &str, chains: &[CoverChain]) {
        for chain in chains {
            let numbers = chain.iter().map(|&(subtask, takes)| {
                let subtask = subtask as i128;
                if takes { subtask } else { -1 - subtask }
            });
            self.list(word, numbers);
        }
    }

    fn bound(
        &mut self,
        case: &AnalysisInput<'_>,
        responses: &[Option<u64>],
        dag: usize,
        DagBound { bound_ns, test }: DagBound,
    ) {
        let (id, task) = (case.members[dag], case.tasks[dag]);
        match test {
            SchedulabilityTest::Demand => self.line(format_args!("bound {id} {bound_ns} demand")),
            SchedulabilityTest::OneCore => self.response(case, dag, bound_ns),
            SchedulabilityTest::IntraTask => self.priorities(case, dag, bound_ns),
            SchedulabilityTest::Owner => self.owner(case, dag, bound_ns),
            SchedulabilityTest::Member => self.member(case, dag, bound_ns, responses),
            _ => {
                let may_outrank = |other, dag| case.relation.may_outrank(other, dag);
                let Ok(delays) = case.set.delays_of_job(dag, responses, may_outrank) else {
                    return;
                };
                let listed = listed(case, dag, responses, &delays);
                if bound_ns > task.period_ns() {
                    let figures = &case.set.figures[dag];
                    let begin = format_args!("bound {id} {bound_ns} overlap");
                    self.overlap(begin, figures, bound_ns, &delays, &listed);
                } else {
                    self.paths(case, dag, bound_ns, &delays, &listed);
                }
            }
        }
    }

    /// Writes the bounds of sinks that are below their job's.
    fn sinks(
        &mut self,
        case: &AnalysisInput<'_>,
        responses: &[Option<u64>],
        dag: usize,
        whole_ns: u64,
    ) {
        for (sink, equation) in judge::equations(case, dag, responses) {
            if let Some((figures, delays)) = equation
                && let Ok(bound_ns) = figures.solve(&delays, 0, &mut { STEP_LIMIT })
                && bound_ns < whole_ns
            {
                let listed = listed(case, dag, responses, &delays);
                let begin = format_args!("sink {} {} {bound_ns}", case.members[dag], sink.0);
                self.overlap(begin, &figures, bound_ns, &delays, &listed);
            }
        }
    }

    fn paths(
        &mut self,
        case: &AnalysisInput<'_>,
        dag: usize,
        bound_ns: u64,
        delays: &DelaySources,
        listed: &[OutrankingDag<'_>],
    ) {
        let (id, task) = (case.members[dag], case.tasks[dag]);
        let equations = case.set.equations(dag);
        let waiting = bound_ns - task.span_ns();
        let enough = |cores: u128| cores * u128::from(waiting);
        let mut forms = equations.forms(delays, bound_ns);
        let Some(form) = forms.find(|form| form.busy.value <= enough(form.cores)) else {
            return;
        };
        let (cores, busy) = (form.cores, form.busy.value);
        let chains = equations.cores + 1 - usize::try_from(cores).unwrap_or(0);
        let by_cover = equations.covers.get(chains - 1).map(|cover| {
            let left = task.oblivious().volume_ns() - cover;
            if form.is_clipped { left.max(1) } else { left }
        });
        let own = equations.left[chains - 1];
        match (delays.left_and_blocking, by_cover) {
            (Some(left), _) => {
                self.line(format_args!("bound {id} {bound_ns} blocked {left} {busy}"))
            }
            (None, Some(left)) if form.is_clipped || left == own => {
                let word = if form.is_clipped { "waiting" } else { "paths" };
                let blocked = delays
                    .blocking
                    .during(equations.cores, chains - 1, form.is_clipped);
                self.line(format_args!(
                    "bound {id} {bound_ns} {word} {chains} {cores} {left} {blocked} {busy}"
                ));
                let most = equations.covers.len();
                self.chains("chain", &covering(task.oblivious(), most, chains));
            }
            _ => {
                let chains = chains - 1;
                self.line(format_args!(
                    "bound {id} {bound_ns} reserved {chains} {cores} {own} {busy}"
                ));
                let reserved = reserved(task, case.set.cores).into_iter();
                let reserved = reserved.skip(1).take(chains).map(|with| with.chain);
                self.chains("chain", &reserved.collect::<Vec<_>>());
            }
        }
        for other in listed {
            let count = usize::try_from(cores).unwrap_or(usize::MAX);
            let (count, [all, clipped]) = other.workloads.on((bound_ns, waiting), count);
            let (id, response) = (other.id, other.response_ns);
            if form.is_clipped {
                self.line(format_args!(
                    "other {id} {response} {count} {all} {clipped}"
                ));
            } else {
                self.line(format_args!("other {id} {response} {count} {all}"));
            }
        }
    }

    fn overlap(
        &mut self,
        begin: fmt::Arguments<'_>,
        figures: &PipelineTerms,
        bound_ns: u64,
        delays: &DelaySources,
        listed: &[OutrankingDag<'_>],
    ) {
        let Ok((windows, own)) = figures.windows(delays, bound_ns) else {
            return;
        };
        self.line(format_args!("{begin} {own}"));
        for (back, window) in windows.iter().enumerate() {
            let window_ns = u64::try_from(*window).unwrap_or(u64::MAX);
            let busy = figures.busy(back as u128, own, delays, window_ns).value;
            self.line(format_args!("window {window} {busy}"));
            for other in listed {
                let (count, [all, _]) = other.workloads.on((window_ns, 0), usize::MAX);
                let (id, response) = (other.id, other.response_ns);
                self.line(format_args!("other {id} {response} {count} {all}"));
            }
        }
    }

    fn response(&mut self, case: &AnalysisInput<'_>, dag: usize, bound_ns: u64) {
        let (id, loads) = (case.members[dag], loads(case));
        let response = ResponseEquation::of(&loads, &case.set.bursts, dag);
        let blocked = response.blocking;
        self.line(format_args!("bound {id} {bound_ns} response {blocked}"));
        let windows = response.windows(&mut { u64::MAX }).unwrap_or_default();
        for (back, window) in (0..).zip(windows) {
            let own = response.own_work(back, window);
            self.line(format_args!("window {window} {own}"));
        }
    }

    fn owner(&mut self, case: &AnalysisInput<'_>, dag: usize, bound_ns: u64) {
        let id = case.members[dag];
        let finishes_ns = case.tasks[dag].finishes_ns();
        let finishes = finishes_ns.iter().map(|&ns| i128::from(ns));
        self.list(&format!("bound {id} {bound_ns} owner"), finishes);
        let cluster = PinnedCluster::of(case);
        for &sink in case.dag(dag).sinks() {
            if let Some(finish_ns) = cluster.finish_ns(case, dag, sink)
                && finish_ns < bound_ns
            {
                self.line(format_args!("sink {id} {} {finish_ns} 0", sink.0));
            }
        }
    }

    fn member(
        &mut self,
        case: &AnalysisInput<'_>,
        dag: usize,
        bound_ns: u64,
        responses: &[Option<u64>],
    ) {
        let (id, task) = (case.members[dag], case.tasks[dag]);
        let cluster = PinnedCluster::of(case);
        let Ok(terms) = cluster.terms(case, dag, responses) else {
            return;
        };
        if let [core] = terms.cores[..] {
            let owned = core.busy_ns(bound_ns);
            return self.line(format_args!("bound {id} {bound_ns} sequence {owned}"));
        }
        let waiting = u128::from(bound_ns - task.length_ns());
        let above = terms.above();
        let mut forms = terms.own.forms(&terms.cores, &above, bound_ns);
        let all = |form: &LentForm| form.works.iter().map(|work| work.value).sum::<u128>();
        let Some(form) = forms.find(|form| all(form) <= form.free as u128 * waiting) else {
            return;
        };
        let (chains, clipped) = (terms.cores.len() + 1 - form.free, u8::from(form.is_clipped));
        let [left, owned, others @ ..] = &form.works[..] else {
            return;
        };
        let (left, owned) = (left.value, owned.value);
        self.line(format_args!(
            "bound {id} {bound_ns} lent {chains} {clipped} {left} {owned}"
        ));
        self.chains("chain", &covering(task, terms.own.covers.len(), chains));
        for ((other, _, response_ns), work) in terms.above.iter().zip(others) {
            let id = case.members[*other];
            self.line(format_args!("other {id} {response_ns} {}", work.value));
        }
    }

    fn priorities(&mut self, case: &AnalysisInput<'_>, dag: usize, bound_ns: u64) {
        let id = case.members[dag];
        self.line(format_args!(
            "bound {id} {bound_ns} priorities {}",
            case.set.cores
        ));
        let task = case.tasks[dag];
        each_path(task, |path| {
            self.list("path", path.iter().map(|&subtask| subtask as i128));
        });
    }
}

/// A DAG that may outrank another, with its number in the commit.
struct OutrankingDag<'a> {
    id: usize,
    response_ns: u64,
    workloads: &'a InterferingDag,
}

/// Names the DAGs that may outrank one, in the order of their workloads.
fn listed<'a>(
    case: &AnalysisInput<'_>,
    dag: usize,
    responses: &[Option<u64>],
    delays: &'a DelaySources,
) -> Vec<OutrankingDag<'a>> {
    let ids = (0..responses.len()).filter(|&other| case.relation.may_outrank(other, dag));
    let listed = ids
        .zip(&delays.others)
        .map(|(other, workloads)| OutrankingDag {
            id: case.members[other],
            response_ns: responses[other].unwrap_or(u64::MAX),
            workloads,
        });
    listed.collect()
}

fn most(parallelism: u64) -> usize {
    usize::try_from(parallelism).unwrap_or(usize::MAX)
}
