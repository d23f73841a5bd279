//! Chains of subtasks across DAGs: how long an effect takes from end to end.
//!
//! Within a DAG, the response time bounds the effect. Between the DAG of a sensor and the DAG of a
//! motor, values pass by *sampling*: a subtask takes the latest value complete at its start. The
//! literature calls such a path of subtasks a *cause-effect chain* with *implicit communication*
//! (N. Feiertag et al., A Compositional Framework for End-to-End Path Delay Calculation of
//! Automotive Systems under Different Path Semantics, CRTS 2008; M. Günzel et al., Timing Analysis
//! of Asynchronized Distributed Cause-Effect Chains, RTAS 2021, doi:10.1109/RTAS52030.2021.00012).
//!
//! # Words
//!
//! - A chain has one *segment* in each DAG on its way: the subtask where the chain enters the DAG
//!   and the subtask where the chain leaves. The last subtask of the last segment makes the
//!   *outputs*.
//! - An output *goes back* to a job of the first DAG: follow the samples backwards, from the job of
//!   the output to the job whose value was sampled, and so on, hop by hop. (The literature calls
//!   this an *immediate backward chain*.)
//! - *Age of an output*: from the nominal release of the job to which the output goes back, to the
//!   output's finish. RTAS 2021 calls the maximum the *reduced* data age.
//! - *Data age*: the same, but to the finish of the next output, because the old output is in force
//!   until then. (*Last to last* of CRTS 2008.)
//! - *Reaction time*: from an input just after the release of a job of the first DAG, too late for
//!   this job, to the finish of the first output going back to a later job. (*First to first.*) The
//!   longest reaction time equals the longest data age, except for times cut off by the end of a
//!   run (M. Günzel et al., On the Equivalence of Maximum Reaction Time and Maximum Data Age for
//!   Cause-Effect Chains, ECRTS 2023, doi:10.4230/LIPIcs.ECRTS.2023.10).
//!
//! All times assume that the first subtask reads its sensor at the nominal release. In fact the
//! subtask starts later and reads a younger value, so the true times are never longer.
//!
//! # Parts
//!
//! [`Chain::all`] and [`Chain::between`] find chains. [`Chain::latencies`] measures a chain in the
//! events of a run. [`Chain::output_age_bound_ns`] and [`Chain::reaction_bound_ns`] bound a chain,
//! and [`Chain::output_age_bound_over_links_ns`] bounds a chain across machines.
//!
//! # Bounds: how long the times of a chain can be, where each of its DAGs has a bound
//!
//! Let DAG i of the chain, counted from 0 to n, have a proven response time R(i) from nominal
//! releases on. Let T(i) be the period. If the DAG survives faults, T(i) is longer by one period
//! for each job that faults may lose in a row ([`Dag::renewal_ns`]). Then
//!
//! - the age of an output is at most T(0) + R(0) + ... + T(n-1) + R(n-1) + R(n);
//! - data age and reaction time are at most T(n) longer.
//!
//! *Proof of the first.* Let job j of DAG i sample, at time t, the value of job k of DAG i-1. At t,
//! the next job not lost to a fault was not yet complete. Its release is at most T(i-1) after the
//! release of k, and its completion at most R(i-1) later; so t < r(k) + T(i-1) + R(i-1). And r(j)
//! <= t, as nothing of job j starts before its release. So the time from r(k) to r(j) is less than
//! T(i-1) + R(i-1). The sum over all samplings leads from the release of the job to which the
//! output goes back, to the release of the output's own job. The output's own job takes R(n) more.
//!
//! *Of the second.* The next output comes from the next job not lost to a fault, released at most
//! T(n) later: this gives the data age. The longest reaction time equals the longest data age, as
//! stated under "Words".
//!
//! The sum of T + R over all DAGs is the bound of A. Davare et al., Period Optimization for Hard
//! Real-time Distributed Automotive Systems, DAC 2007 (doi:10.1145/1278480.1278553). The bound is
//! safe for any phases of the DAGs, so for given phases it is not tight.
//!
//! The bound holds as long as jobs come: no job is skipped in a pause, and the DAGs go on. (DAGs
//! with bounds skip or abort jobs for no other reason.) The releases of a sporadic DAG have no
//! longest distance, so a sporadic DAG has no T. As the last DAG of a chain it still has an age of
//! outputs.
//!
//! # Links: chains that cross machines
//!
//! A subtask of DAG i-1 sends a message when it is complete, and a subtask of DAG i, on another
//! machine, *receives* the message: this edge is a *link* instead of a sampling. The app *states*
//! the link's delay N, from the writing of a message to its arrival; nothing proves N. A bound
//! containing N is valid only for outputs that go back over no message that took longer. For a
//! link, replace T(i-1) + R(i-1) in the first bound above by
//!
//! - R(i-1) + N, if DAG i is sporadic, each message raises its signal, nothing else does, each job
//!   takes all messages arrived so far, and T(i-1) by the slower clock is not less than T(i);
//! - R(i-1) + N + T(i), if DAG i is periodic; for the first job that has the message.
//!
//! *Proof.* The message of job k is sent at r(k) + R(i-1) at the latest, and so arrives at d(k) =
//! r(k) + R(i-1) + N at the latest. A *periodic* DAG releases a job not lost to a fault at most
//! T(i) after the arrival. This job or an earlier job takes the message.
//!
//! In a *sporadic* DAG, an arrival may follow the previous arrival by less than T(i); its job is
//! then released later (`scheduler::signals`, S1). Let each message arrive once, in the order of
//! jobs; some may be lost. Message k is taken by the job whose signal it raised, or by an earlier
//! job. That job is released either at its signal, or T(i) after the previous job. Let q be the
//! number of jobs since the latest job released at its signal, at an arrival a. So our job is
//! released at a + q T(i). The q + 1 jobs have the signals of as many messages, with k the last.
//! The first message, k', came at a, so a <= d(k'). As releases of DAG i-1 are at least T(i-1)
//! apart, d(k) >= d(k') + q T(i-1) >= a + q T(i). So T(i-1) has to be longer by the drift of the
//! clocks; otherwise each job would be put off a bit more. A dropped signal (S2) leaves its message
//! to a job of an earlier message that has not started: all the more is that job released at d(k)
//! at the latest. ∎
//!
//! After a message delayed by more than N, jobs released T(i) after the previous job may be late,
//! too. Since messages may be lost, nothing bounds data age and reaction time over a link.
//!
//! # Which outputs count
//!
//! Outputs count up to the first instant where the next job of a periodic DAG of the chain would
//! have been due and did not come, because the DAG had ended, was closed or had reached its limit
//! of jobs: from then on, sampled values only get older. During and after a pause, an output does
//! not count while any value on its way back dates from before the pause. The time between two
//! outputs does not count if the last DAG paused between them. Outputs going back to no job, such
//! as the first outputs of a run, do not count.
//!
//! Let outputs m and m+1 follow each other and go back to jobs s(m) and s(m+1). The data age of m
//! is f(m+1) - r(s(m)). If s(m+1) > s(m), this is also the reaction time to an input after the
//! release of job s(m); otherwise the reaction time is longer still. Conversely, take an input
//! after the release of job k >= s(m), and let m+1 be the first output going back to a later job
//! than k. Its reaction time is f(m+1) - r(k) <= f(m+1) - r(s(m)). So the two maxima are the same,
//! unless the run ends in between.
//!
//! # Samples
//!
//! An instance samples when it starts, and a value becomes visible when its writer's instance is
//! complete. The journal has an event for each, in the order of their occurrence under the lock of
//! the cluster's scheduler; between clusters, the time decides. So the sampled value is the value
//! of the writer's last finish before the start. On a machine, the function is called a few
//! instructions after the start was written; if a writer finishes in between, its value counts as
//! too late. In a replay, samples are the recorded samples, no matter which writers have finished
//! before.

use alloc::collections::BTreeMap;
use alloc::vec;
use alloc::vec::Vec;
use core::fmt;

use crate::ids::{DagId, Instance, SubtaskId};
use crate::journal::{Event, EventKind};
use crate::task_set::{Dag, Subtask, TaskSet};

/// A subtask of a DAG.
pub type SubtaskRef = (DagId, SubtaskId);

/// A sampled topic: the subtask writing the topic and the subtask sampling it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct SampledEdge {
    /// The subtask writing the topic.
    pub writer: SubtaskRef,
    /// The subtask sampling the topic.
    pub reader: SubtaskRef,
}

/// The part of a chain that lies in one DAG.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct ChainSegment {
    dag: DagId,
    /// The subtask where the chain enters the DAG, by sampling, or begins.
    entry: SubtaskId,
    /// The subtask where the chain leaves the DAG: the writer of the next sampled value or of the
    /// outputs.
    exit: SubtaskId,
}

/// A path between two subtasks, along edges within DAGs and samplings between DAGs. A chain passes
/// no DAG twice.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Chain {
    /// One segment for each DAG, at least one.
    segments: Vec<ChainSegment>,
}

/// Two clocks drift apart by at most one part in so many: each crystal by 100 millionths.
const DRIFT: u64 = 5_000;

impl Chain {
    /// Finds a subtask by a name `dag/subtask`; each part is a name or a number.
    pub fn find(task_set: &TaskSet, name: &str) -> Option<SubtaskRef> {
        // Names may contain a `/`, so every split is tried.
        let splits = name
            .match_indices('/')
            .map(|(at, _)| (&name[..at], &name[at + 1..]));
        splits.into_iter().find_map(|(dag, subtask)| {
            let dags = task_set.dags().iter().map(Dag::name);
            let dag = DagId(number_of(dags, dag)?);
            let subtasks = task_set.dag(dag).subtasks().iter().map(Subtask::name);
            Some((dag, SubtaskId(number_of(subtasks, subtask)?)))
        })
    }

    /// Returns the names of the subtasks where the chain enters and leaves DAGs, in order, as
    /// `dag/subtask`.
    pub fn names<'t>(&'t self, task_set: &'t TaskSet) -> impl Iterator<Item = impl fmt::Display> {
        self.segments.iter().flat_map(move |segment| {
            let ChainSegment { dag, entry, exit } = *segment;
            let exit = (exit != entry).then_some(exit);
            let of_segment = [Some(entry), exit].into_iter().flatten();
            of_segment.map(move |subtask| SubtaskName(task_set, (dag, subtask)))
        })
    }

    /// Returns the first and the last DAG of the chain.
    pub fn ends(&self) -> [DagId; 2] {
        [self.segments[0], self.segments[self.segments.len() - 1]].map(|segment| segment.dag)
    }

    /// Returns the samplings between consecutive DAGs of the chain.
    pub fn edges(&self) -> impl Iterator<Item = SampledEdge> {
        self.segments.windows(2).map(|pair| SampledEdge {
            writer: (pair[0].dag, pair[0].exit),
            reader: (pair[1].dag, pair[1].entry),
        })
    }

    /// Returns how old an output can be at its finish, in nanoseconds.
    ///
    /// # Errors
    ///
    /// The first DAG of the chain that has no bound of its own in `responses_ns` (in the order of
    /// the DAGs), or that is sporadic and not the last.
    pub fn output_age_bound_ns(
        &self,
        task_set: &TaskSet,
        responses_ns: &[Option<u64>],
    ) -> Result<u64, DagId> {
        self.output_age_bound_over_links_ns(task_set, responses_ns, &[])
    }

    /// Returns the same bound for a chain over links between machines, each with a stated delay.
    ///
    /// # Errors
    ///
    /// As above; also a sporadic DAG behind a link, if clock drift may make its jobs rarer than
    /// messages.
    pub fn output_age_bound_over_links_ns(
        &self,
        task_set: &TaskSet,
        responses_ns: &[Option<u64>],
        links: &[(SampledEdge, u64)],
    ) -> Result<u64, DagId> {
        let response = |dag: DagId| responses_ns.get(dag.index()).copied().flatten().ok_or(dag);
        let mut sum: u64 = 0;
        for edge in self.edges() {
            let dags = [edge.writer.0, edge.reader.0];
            let [from, to] = dags.map(|dag| task_set.dag(dag));
            let response_ns = response(dags[0])?;
            let way_ns = match links.iter().find(|link| link.0 == edge) {
                // Nobody knows when the next job of a sporadic DAG comes, so nothing bounds the way
                // through the DAG.
                None if from.is_sporadic() => return Err(dags[0]),
                None => from.renewal_ns(),
                Some((_, stated_ns)) if !to.is_sporadic() => {
                    stated_ns.saturating_add(to.renewal_ns())
                }
                Some(_) if from.period_ns() - from.period_ns().div_ceil(DRIFT) < to.period_ns() => {
                    return Err(dags[1]);
                }
                Some((_, stated_ns)) => *stated_ns,
            };
            sum = sum.saturating_add(response_ns).saturating_add(way_ns);
        }
        Ok(sum.saturating_add(response(self.ends()[1])?))
    }

    /// Returns the longest reaction time, equal to the longest data age.
    ///
    /// # Errors
    ///
    /// The first DAG of the chain that has no bound of its own, or that is sporadic.
    pub fn reaction_bound_ns(
        &self,
        task_set: &TaskSet,
        responses_ns: &[Option<u64>],
    ) -> Result<u64, DagId> {
        let age_ns = self.output_age_bound_ns(task_set, responses_ns)?;
        let last = task_set.dag(self.ends()[1]);
        let is_bounded = !last.is_sporadic();
        let bound_ns = age_ns.saturating_add(last.renewal_ns());
        is_bounded.then_some(bound_ns).ok_or(self.ends()[1])
    }
}

/// Returns the position of a name, or else the position written as a number.
fn number_of<'n>(names: impl Iterator<Item = &'n str> + Clone, wanted: &str) -> Option<u32> {
    // Names first: a name may be a number.
    let named = (0..).zip(names.clone()).find(|(_, name)| *name == wanted);
    let number = || {
        wanted
            .parse()
            .ok()
            .filter(|number| (0..).zip(names).any(|(at, _)| at == *number))
    };
    named.map(|(at, _)| at).or_else(number)
}

/// A subtask as `dag/subtask`; DAGs and subtasks without a name show their number.
struct SubtaskName<'t>(&'t TaskSet, SubtaskRef);

impl fmt::Display for SubtaskName<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(task_set, (dag, subtask)) = self;
        let model = task_set.dag(*dag);
        match model.name() {
            "" => write!(f, "{}/", dag.0)?,
            name => write!(f, "{name}/")?,
        }
        match model.subtask(*subtask).name() {
            "" => write!(f, "{}", subtask.0),
            name => f.write_str(name),
        }
    }
}

/// The maximum number of chains to search for: the number may double with each DAG.
const MOST: usize = 1000;

impl Chain {
    /// Finds all maximal chains across DAGs: from a source that samples nothing to a sink that no
    /// DAG samples. Returns at most 1000.
    pub fn all(task_set: &TaskSet, samplings: &[SampledEdge]) -> Vec<Chain> {
        let mut search = ChainSearch::new(task_set, samplings);
        for (dag, model) in (0..).map(DagId).zip(task_set.dags()) {
            for &source in model.sources() {
                let place = (dag, source);
                // A sampling source continues the chain of another DAG and begins no chain.
                if samplings.iter().all(|sampling| sampling.reader != place) {
                    search.go_on_from(place, &|search, exit| {
                        !search.path.is_empty()
                            && model_of(search, exit).sinks().contains(&exit.1)
                            && samplings.iter().all(|sampling| sampling.writer != exit)
                    });
                }
            }
        }
        search.found
    }

    /// Finds the chains from a subtask to another subtask, in the same DAG or another, at most
    /// 1000. Returns none if no path leads there.
    pub fn between(
        task_set: &TaskSet,
        samplings: &[SampledEdge],
        from: SubtaskRef,
        to: SubtaskRef,
    ) -> Vec<Chain> {
        let mut search = ChainSearch::new(task_set, samplings);
        search.go_on_from(from, &|_, exit| exit == to);
        search.found
    }
}

fn model_of<'t>(search: &ChainSearch<'t>, (dag, _): SubtaskRef) -> &'t Dag {
    search.task_set.dag(dag)
}

struct ChainSearch<'t> {
    task_set: &'t TaskSet,
    /// Without duplicates: a subtask may sample a topic twice.
    samplings: Vec<SampledEdge>,
    /// The segments up to the current one.
    path: Vec<ChainSegment>,
    found: Vec<Chain>,
}

impl<'t> ChainSearch<'t> {
    fn new(task_set: &'t TaskSet, samplings: &[SampledEdge]) -> Self {
        let mut samplings = samplings.to_vec();
        samplings.sort_unstable();
        samplings.dedup();
        Self {
            task_set,
            samplings,
            path: Vec::new(),
            found: Vec::new(),
        }
    }

    /// Finds the chains continuing from a subtask. The recursion calls itself at most once for each
    /// DAG.
    fn go_on_from(&mut self, (dag, entry): SubtaskRef, is_end: &dyn Fn(&Self, SubtaskRef) -> bool) {
        for exit in self.reached_from((dag, entry)) {
            // The number of paths may grow exponentially with the DAGs.
            if self.found.len() >= MOST {
                return;
            }
            let segment = ChainSegment { dag, entry, exit };
            if is_end(self, (dag, exit)) {
                let segments = [&self.path[..], &[segment]].concat();
                self.found.push(Chain { segments });
            }
            self.path.push(segment);
            for at in 0..self.samplings.len() {
                let SampledEdge { writer, reader } = self.samplings[at];
                // DAGs may sample each other in a circle; a chain passes the circle once.
                let is_new = self.path.iter().all(|passed| passed.dag != reader.0);
                if writer == (dag, exit) && is_new {
                    self.go_on_from(reader, is_end);
                }
            }
            self.path.pop();
        }
    }

    /// Returns a subtask and all its successors, direct and indirect, in its DAG.
    fn reached_from(&self, (dag, entry): SubtaskRef) -> Vec<SubtaskId> {
        let model = self.task_set.dag(dag);
        let mut is_reached = vec![false; model.subtasks().len()];
        is_reached[entry.index()] = true;
        let mut reached = Vec::new();
        for &subtask in model.topological_order() {
            if is_reached[subtask.index()] {
                reached.push(subtask);
                for successor in model.successors(subtask) {
                    is_reached[successor.index()] = true;
                }
            }
        }
        reached
    }
}

/// The times of a chain in one run, in nanoseconds, as defined in the docs of module `chains`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ChainLatencies {
    /// For each output: its age at its finish.
    pub output_age_ns: Vec<u64>,
    /// For each output followed by another output: its data age.
    pub data_age_ns: Vec<u64>,
    /// The reaction time to an input just after each job's release, if observed.
    pub reaction_ns: Vec<u64>,
}

impl Chain {
    /// Measures the chain in the events of a run, given in the order of the journal.
    pub fn latencies(
        &self,
        task_set: &TaskSet,
        events: impl Iterator<Item = Event> + Clone,
    ) -> ChainLatencies {
        let edges: Vec<SampledEdge> = self.edges().collect();
        let sampled = SampledJobs::new(&edges, events.clone());
        self.latencies_by(&sampled, task_set, events)
    }

    /// Measures the chain as above, with samples known beforehand.
    pub fn latencies_by(
        &self,
        sampled: &SampledJobs,
        task_set: &TaskSet,
        events: impl Iterator<Item = Event> + Clone,
    ) -> ChainLatencies {
        let hops: Vec<SampledEdge> = self.edges().collect();
        let releases = NominalReleases::of(task_set, events.clone());
        let pauses = PausedJobs::of(task_set, events.clone());
        let end_ns = self.segments.iter().map(|segment| {
            let model = task_set.dag(segment.dag);
            let last = releases.0.keys().rfind(|(dag, _)| *dag == segment.dag);
            match last {
                // Beyond the last release, sampled values only grow older; their age says nothing
                // about the chain.
                Some((_, job)) if !model.is_sporadic() => model.grid_ns(job.saturating_add(1)),
                _ => u64::MAX,
            }
        });
        let end_ns = end_ns.min().unwrap_or(u64::MAX);
        let (first, last) = (self.segments[0], self.segments[self.segments.len() - 1]);
        let mut latencies = ChainLatencies::default();
        // Of the previous output: its job, the job it goes back to, and the release of the latter.
        let mut before: Option<(u64, u64, u64)> = None;
        let is_output = |event: &Event| {
            (event.what, event.dag, event.subtask) == (EventKind::Finish, last.dag, Some(last.exit))
                && event.time_ns <= end_ns
        };
        for output in events.filter(is_output) {
            // The job to which the output goes back, hop by hop.
            let origin = hops.iter().rev().try_fold(output.job, |job, hop| {
                let (dag, subtask) = hop.reader;
                let job = sampled.job(Instance { dag, job, subtask }, hop.writer)?;
                let is_of_before = pauses.has_come(hop.writer.0, job, output.time_ns);
                (!is_of_before).then_some(job)
            });
            let release_ns = |job| releases.0.get(&(first.dag, job)).copied();
            let Some((origin, release_ns)) = origin.and_then(|job| Some((job, release_ns(job)?)))
            else {
                // The origin may be among lost events; a difference across the gap would mean
                // nothing.
                before = None;
                continue;
            };
            let since = |start_ns: u64| output.time_ns.saturating_sub(start_ns);
            latencies.output_age_ns.push(since(release_ns));
            if let Some((job, before, before_ns)) = before
                && !pauses.has_come(last.dag, job, output.time_ns)
            {
                latencies.data_age_ns.push(since(before_ns));
                // Inputs between the two origins reach no output earlier than the current one.
                let missed = releases
                    .0
                    .range((first.dag, before)..(first.dag, origin.max(before)));
                let reactions = missed.map(|(_, release_ns)| since(*release_ns));
                latencies.reaction_ns.extend(reactions);
            }
            before = Some((output.job, origin, release_ns));
        }
        latencies
    }
}

/// The nominal releases of all released jobs.
struct NominalReleases(BTreeMap<(DagId, u64), u64>);

impl NominalReleases {
    fn of(task_set: &TaskSet, events: impl Iterator<Item = Event>) -> Self {
        let mut due_ns = BTreeMap::new();
        let mut releases = BTreeMap::new();
        for event in events {
            let of = (event.dag, event.job);
            match event.what {
                EventKind::Due => {
                    due_ns.insert(of, event.time_ns);
                }
                EventKind::Released => {
                    let model = task_set.dag(event.dag);
                    let due_ns = due_ns.get(&of).copied().unwrap_or(event.time_ns);
                    releases.insert(of, model.release_ns(event.job, due_ns));
                }
                _ => {}
            }
        }
        Self(releases)
    }
}

/// The times when jobs were skipped because their DAGs were paused.
struct PausedJobs(BTreeMap<(DagId, u64), u64>);

impl PausedJobs {
    fn of(task_set: &TaskSet, events: impl Iterator<Item = Event>) -> Self {
        let mut resumed_ns = BTreeMap::new();
        let mut skipped = BTreeMap::new();
        for Event {
            what,
            dag,
            job,
            time_ns,
            ..
        } in events
        {
            match what {
                EventKind::Off => _ = resumed_ns.insert(dag, u64::MAX),
                EventKind::On => _ = resumed_ns.insert(dag, time_ns),
                EventKind::Skipped => {
                    // A late driver may report the skipped job only after the pause.
                    let due_ns = task_set.dag(dag).grid_ns(job);
                    if resumed_ns.get(&dag).is_some_and(|&ns| due_ns < ns) {
                        skipped.insert((dag, job), time_ns);
                    }
                }
                _ => {}
            }
        }
        Self(skipped)
    }

    /// Reports whether a later job of the DAG had been skipped for a pause by the instant `by_ns`.
    fn has_come(&self, dag: DagId, job: u64, by_ns: u64) -> bool {
        let mut later = self.0.range((dag, job + 1)..=(dag, u64::MAX));
        later.next().is_some_and(|(_, &time_ns)| time_ns <= by_ns)
    }
}

/// The samples of a run.
#[derive(Clone, Debug, Default)]
pub struct SampledJobs {
    /// The sampled job, by reading instance and by the writer.
    jobs: BTreeMap<(Instance, SubtaskRef), u64>,
}

impl SampledJobs {
    /// Follows the events of a run, in the order of the journal.
    pub fn new(samplings: &[SampledEdge], events: impl Iterator<Item = Event>) -> Self {
        let mut readers: BTreeMap<SubtaskRef, Vec<SubtaskRef>> = BTreeMap::new();
        // For each writer: the last complete job.
        let mut latest: BTreeMap<SubtaskRef, Option<u64>> = BTreeMap::new();
        for sampling in samplings {
            let writers = readers.entry(sampling.reader).or_default();
            writers.push(sampling.writer);
            latest.insert(sampling.writer, None);
        }
        let mut jobs = BTreeMap::new();
        for event in events {
            let Some(instance) = event.instance() else {
                continue;
            };
            let place = (instance.dag, instance.subtask);
            match event.what {
                EventKind::Start => {
                    for writer in readers.get(&place).into_iter().flatten() {
                        if let Some(Some(job)) = latest.get(writer) {
                            jobs.insert((instance, *writer), *job);
                        }
                    }
                }
                EventKind::Finish => {
                    if let Some(latest) = latest.get_mut(&place) {
                        *latest = Some(event.job);
                    }
                }
                _ => {}
            }
        }
        Self { jobs }
    }

    /// Adds a value passed from one instance to another by other means, such as a message.
    pub fn add(&mut self, reader: Instance, writer: Instance) {
        let place = (writer.dag, writer.subtask);
        self.jobs.insert((reader, place), writer.job);
    }

    /// Returns the job whose value an instance has sampled from a writer. Returns `None` if the
    /// instance has not started or found no value.
    pub fn job(&self, reader: Instance, writer: SubtaskRef) -> Option<u64> {
        self.jobs.get(&(reader, writer)).copied()
    }

    /// Returns all samples: the sampling instance and the instance whose value was sampled.
    pub fn all(&self) -> impl Iterator<Item = (Instance, Instance)> {
        self.jobs.iter().map(|((reader, (dag, subtask)), job)| {
            let (dag, job, subtask) = (*dag, *job, *subtask);
            (*reader, Instance { dag, job, subtask })
        })
    }
}
