//! Random task sets from a seed.

use std::ops::Range;

use random::Random;
use random::sets::set;
use sched_dag::analysis::{AnalysisSettings, Overheads, assign};
use sched_dag::{
    Activation, AssignmentReason, ClusterId, CommitOptions, ConstructionPolicy, CoreDivision, Dag,
    DagId, DagSpec, FaultLimit, OnFault, OverrunPolicy, Policy, Preemption, Priority, StateSpec,
    StateUser, SubtaskId, SubtaskSpec, TaskSet, Wait, verify,
};

use super::simulate::spec;

/// A task set with the platform it runs on.
#[derive(Debug)]
pub(crate) struct Sample {
    pub(crate) specs: Vec<DagSpec>,
    pub(crate) policy: Policy,
    pub(crate) preemption: Preemption,
    pub(crate) cores: u32,
    pub(crate) clusters: CoreDivision,
    /// Whether the commit assigns cores, which DAGs may lend.
    pub(crate) is_lent: bool,
    /// The lists of cores.
    pub(crate) lists: Vec<String>,
    pub(crate) dispatch_ns: u64,
}

impl Sample {
    pub(crate) fn settings(&self) -> AnalysisSettings {
        AnalysisSettings {
            policy: self.policy,
            preemption: self.preemption,
            cores: self.cores,
            overheads: Overheads {
                dispatch_ns: self.dispatch_ns,
                ..Overheads::default()
            },
        }
    }

    /// Returns what a commit makes of it, if it does not refuse a path beyond a deadline.
    pub(crate) fn task_set(&self) -> Option<TaskSet> {
        let options = CommitOptions::new(self.policy, self.cores)
            .with_construction(ConstructionPolicy::any_graph())
            .with_clusters(self.clusters.clone())
            .with_lists(&self.lists);
        let mut task_set = verify(&self.specs, &options).ok()?.task_set;
        if self.is_lent {
            assign(&mut task_set, &self.settings()).ok()?;
        }
        Some(task_set)
    }

    /// Returns that, with the times of tables by what executions are charged.
    pub(crate) fn charged(&self, settings: &AnalysisSettings) -> Option<TaskSet> {
        let mut task_set = self.task_set()?;
        if !self.is_lent {
            task_set.charge_tables(settings);
        }
        Some(task_set)
    }

    /// Returns the features of each cluster of what a commit has made of it.
    pub(crate) fn features(&self, task_set: &TaskSet) -> Vec<u32> {
        let mut subtasks = self.specs.iter().flat_map(|spec| &spec.subtasks);
        let is_preempted = self.preemption == Preemption::Enabled;
        let some_keep = is_preempted && subtasks.any(|subtask| subtask.non_preemptive);
        let clusters = task_set.clusters().map(|cluster| {
            let cores = task_set.cores_of(cluster, self.cores).len();
            let of_machine = mask(&[
                ("static", !self.policy.adds_release()),
                ("edf", self.policy == Policy::Edf),
                ("any", is_any(self.policy)),
                ("preempt", is_preempted && !some_keep),
                ("keep", !is_preempted),
                ("somekeep", some_keep),
                ("one core", cores == 1),
                ("clusters", task_set.is_divided()),
            ]);
            let ids = (0..).map(DagId);
            let dags = ids.zip(self.specs.iter().zip(task_set.dags()));
            let here = dags.filter(|(_, (_, dag))| dag.cluster() == cluster);
            here.fold(of_machine, |all, (id, (spec, dag))| {
                let in_table = task_set.table_of(id).is_some();
                all | of_dag(spec, dag) | mask(&[("tables", in_table)])
            })
        });
        clusters.collect()
    }
}

/// The features that a set or a run may have, which a test of schedulability may model or not.
pub(crate) const FEATURES: [&str; 20] = [
    "static", "edf", "any", "preempt", "keep", "somekeep", "one core", "clusters", "tables",
    "groups", "lent", "sinks", "waits", "overlap", "few", "sporadic", "states", "faults", "pauses",
    "modes",
];

/// The policies that have tests of their own; they are drawn more often.
const TESTED: [Policy; 2] = [Policy::StaticPriority, Policy::Edf];

/// Returns the bits of those features that there are.
pub(crate) fn mask(features: &[(&str, bool)]) -> u32 {
    let present = features.iter().filter(|(_, is_present)| *is_present);
    present.fold(0, |all, (name, _)| all | bit(name))
}

/// Returns the bit of a feature.
pub(crate) fn bit(name: &str) -> u32 {
    let at = FEATURES.iter().position(|feature| *feature == name);
    1 << at.expect("a feature")
}

/// Returns the features of a DAG that was committed.
fn of_dag(spec: &DagSpec, dag: &Dag) -> u32 {
    use AssignmentReason::{Member, Owner};
    let any = |is: fn(&SubtaskSpec) -> bool| spec.subtasks.iter().any(is);
    let deadline_ns = dag.relative_deadline_ns();
    let is_tighter = |sink: &SubtaskId| dag.subtask(*sink).relative_deadline_ns() < deadline_ns;
    mask(&[
        ("groups", !spec.affinity.is_empty()),
        (
            "lent",
            matches!(dag.why_there(), Some(Owner { .. } | Member { .. })),
        ),
        ("sinks", dag.sinks().iter().any(is_tighter)),
        ("waits", any(|of| !of.waits.is_empty())),
        ("overlap", deadline_ns > dag.period_ns()),
        ("few", spec.in_flight.is_some()),
        ("sporadic", dag.is_sporadic()),
        ("states", !spec.states.is_empty()),
    ])
}

fn is_any(policy: Policy) -> bool {
    policy.adds_release() && policy != Policy::Edf
}

fn draw_policy(is_lent: bool, wanted: u32, random: &mut Random) -> Policy {
    let orders = ["static", "edf", "any"].map(|name| wanted & bit(name) != 0);
    let mut policies = [&Policy::ALL[..], &TESTED, &TESTED].concat();
    policies.retain(|policy| match orders {
        [is_static, ..] if is_static || is_lent => !policy.adds_release(),
        [_, true, _] => *policy == Policy::Edf,
        [_, _, true] => is_any(*policy),
        _ => true,
    });
    random.one_of(&policies)
}

/// Draws a task set for up to 5 cores with the wanted features, where these go together.
pub(crate) fn sample_with(wanted: u32, random: &mut Random) -> Sample {
    let wants = |name| wanted & bit(name) != 0;
    let is_lent = wants("lent") || random.chance(8);
    // What lends cores has few of the others, or no core is left to lend.
    let share = if is_lent { 5 } else { 20 };
    let drawn = (0..FEATURES.len()).map(|feature| u32::from(random.chance(share)) << feature);
    let all = drawn.fold(wanted, |all, drawn| all | drawn);
    let has_one = wants("one core") && !is_lent;
    let is_divided = all & bit("clusters") != 0 && !has_one && !is_lent;
    let policy = draw_policy(is_lent, wanted, random);
    let keeps = ["preempt", "keep", "somekeep"]
        .into_iter()
        .rfind(|kind| wants(kind));
    let any = random.one_of(&["preempt", "preempt", "keep", "somekeep"]);
    let keeps = keeps.unwrap_or(any);

    let most = if has_one { 1 } else { 5 };
    let cores = random.within(1 + u32::from(is_divided)..=most);
    let first = random.within(1..=(cores - 1).max(1));
    let mut sizes = match is_divided {
        true => vec![first, cores - first],
        false => vec![cores],
    };
    let mut specs = set(random, 1, &sizes);
    if is_lent || !is_divided && !has_one && random.chance(30) {
        (specs, sizes[0]) = heavy_set(random);
    }
    // Less load than a set is drawn for leaves more to prove, the more so where each core
    // counts for itself.
    let most = [16, 48][usize::from(all & bit("tables") != 0)];
    let slack = random.within(4..=if is_lent { 4 } else { most });
    for (spec, number) in specs.iter_mut().zip(0..) {
        spec.cluster = is_divided.then_some(ClusterId(number % 2));
        spec.period_ns = spec.period_ns.map(|ns| ns * slack / 4);
        spec.relative_deadline_ns = spec.relative_deadline_ns.map(|ns| ns * slack / 4);
        for (place, subtask) in spec.subtasks.iter_mut().enumerate() {
            let first = number == 0 && place == 0;
            subtask.non_preemptive = keeps == "somekeep" && (first || random.once_in(2));
        }
        let own = [(); 3].map(|()| u32::try_from(random.number() >> 32).unwrap_or(0));
        let rest = own[0] & (own[1] | own[2]);
        let others = if number == 0 { all } else { rest };
        add(spec, all & others, random);
    }
    let lists = match is_lent {
        true => Vec::new(),
        false => confine(&mut specs, &sizes, all, random),
    };
    Sample {
        specs,
        policy,
        preemption: match keeps {
            "keep" => Preemption::Disabled,
            _ => Preemption::Enabled,
        },
        cores: sizes.iter().sum(),
        clusters: match is_divided {
            true => CoreDivision::Of(sizes),
            false => CoreDivision::Undivided,
        },
        is_lent,
        lists,
        dispatch_ns: random.within(0..=5_u64).saturating_sub(3),
    }
}

/// Gives a DAG features of its own, and what becomes of its faults and overruns.
fn add(spec: &mut DagSpec, own: u32, random: &mut Random) {
    let has = |name| own & bit(name) != 0;
    if has("overlap") {
        let period_ns = spec.period_ns.unwrap_or(1);
        spec.relative_deadline_ns = Some(period_ns + random.within(1..=3 * period_ns));
    }
    spec.in_flight = has("few").then(|| random.within(1..=2));
    if has("sporadic") {
        spec.activation = Activation::Sporadic;
    }
    if has("states") && spec.subtasks.len() > 1 {
        let later = random.within(1..=spec.subtasks.len() - 1);
        let users = [random.within(0..=later - 1), later];
        let updates = true;
        let users = users.map(|subtask| StateUser { subtask, updates });
        let (name, users) = ("shared".into(), users.into());
        spec.states.push(StateSpec { name, users });
    }
    if has("sinks") {
        draw_sinks(random, spec);
    }
    if has("waits") {
        draw_waits(random, spec);
    }
    if random.once_in(2) {
        let [faults, in_all] = [9, 20].map(|most| random.within(1..=most));
        let window = random.within(1..=9);
        spec.on_fault = OnFault::DropJob(FaultLimit::new(faults, window, in_all));
    }
    use OverrunPolicy::{Abort, Queue, Skip};
    spec.overrun = random.one_of(&[Queue, Skip, Abort]);
    if random.once_in(20) {
        // Not known, which a WCET of 0 says, too.
        let (count, wcet_ns) = (spec.subtasks.len(), random.one_of(&[None, Some(0)]));
        for subtask in &mut spec.subtasks[random.index(count)..] {
            (subtask.wcet_ns, subtask.waits) = (wcet_ns, Vec::new());
        }
    }
}

/// Draws DAGs that are heavy now and then, of which the one with the shorter deadline is the more
/// urgent, and for how many cores.
fn heavy_set(random: &mut Random) -> (Vec<DagSpec>, u32) {
    let (cores, count) = (random.within(2..=5), random.within(2..=5));
    let dags = (0..count).map(|_| {
        let count = random.within(1..=9);
        let wcets: Vec<u64> = (0..count).map(|_| random.within(1..=9)).collect();
        let edges: Vec<_> = random.edges(count, 30).collect();
        let deadline = wcets.iter().sum::<u64>() * random.within(50..=200) / 100;
        let deadline = deadline.max(9);
        let period = deadline + random.within(0..=deadline / 2);
        spec(period, deadline, &wcets, &edges, 0)
    });
    let mut specs: Vec<DagSpec> = dags.collect();
    let mut order: Vec<&mut DagSpec> = specs.iter_mut().collect();
    order.sort_by_key(|dag| dag.relative_deadline_ns);
    for (rank, dag) in (0..).zip(order) {
        let subtasks = dag.subtasks.iter_mut();
        subtasks.for_each(|subtask| subtask.priority = Some(Priority(rank)));
    }
    (specs, cores)
}

/// Gives some DAGs tables, of their own or of a family with periods on a grid, and leaves parts of
/// clusters to the others; returns the lists.
fn confine(specs: &mut [DagSpec], sizes: &[u32], all: u32, random: &mut Random) -> Vec<String> {
    let mut owned = vec![0; sizes.len()];
    let mut families: Vec<(Vec<usize>, Range<u32>)> = Vec::new();
    let kinds = random.one_of(&[3, 5]) * usize::from(all & bit("tables") != 0);
    for dag in 0..specs.len() {
        let cluster = specs[dag].cluster.unwrap_or_default().index();
        let first: u32 = sizes[..cluster].iter().sum();
        let (cores, taken) = (first..first + sizes[cluster], first + owned[cluster]);
        let waits = specs[dag].subtasks.iter().any(|of| !of.waits.is_empty());
        let is_sporadic = specs[dag].activation == Activation::Sporadic;
        let here = |family: &&mut (Vec<usize>, Range<u32>)| cores.contains(&family.1.start);
        match random.index(kinds.max(1)) {
            1 | 2
                if !waits
                    && !is_sporadic
                    && let Some(family) = families.iter_mut().find(here) =>
            {
                // So many jobs at most in a lap, and no shorter periods, if these are not far longer.
                let base_ns = specs[family.0[0]].period_ns.unwrap_or(1);
                let own_ns = specs[dag].period_ns.unwrap_or(1);
                let times = [1, 2, 4]
                    .into_iter()
                    .find(|times| base_ns * times >= own_ns);
                specs[dag].period_ns = Some(base_ns * times.unwrap_or(4));
                family.0.push(dag);
            }
            1..=4 if !waits && taken < cores.end => {
                let end = random.within(taken + 1..=cores.end);
                owned[cluster] = end - first;
                families.push((vec![dag], taken..end));
            }
            _ if all & bit("groups") != 0 => {
                let split = owned[cluster].max(1).min(sizes[cluster] - 1);
                let groups = [0..split.max(1), split..sizes[cluster]];
                let group = random.index(2) * usize::from(split > 0);
                specs[dag].affinity = groups[group].clone().collect();
            }
            _ => {}
        }
    }
    let lists = families.into_iter();
    let lists = lists.flat_map(|(dags, cores)| lists_of(specs, &dags, cores, random));
    lists.collect()
}

/// Returns lists of DAGs, a subtask about when it could start if there were no others.
fn lists_of(
    specs: &[DagSpec],
    dags: &[usize],
    cores: Range<u32>,
    random: &mut Random,
) -> Vec<String> {
    let period_ns = |dag: usize| specs[dag].period_ns.unwrap_or(1);
    let lap_ns = dags.iter().map(|&dag| period_ns(dag)).max().unwrap_or(1);
    // Of a sporadic one it does not begin.
    let mut entries = Vec::new();
    for &dag in dags {
        let spec = &specs[dag];
        let mut earliest_ns = vec![0; spec.subtasks.len()];
        let shared = spec
            .states
            .iter()
            .map(|of| (of.users[0].subtask, of.users[1].subtask));
        let mut edges: Vec<_> = spec.edges.iter().copied().chain(shared).collect();
        edges.sort_unstable();
        for (from, to) in edges {
            let end_ns = earliest_ns[from] + spec.subtasks[from].wcet_ns.unwrap_or(0);
            earliest_ns[to] = end_ns.max(earliest_ns[to]);
        }
        let phase_ns = spec.offset_ns % period_ns(dag) * u64::from(dags.len() > 1);
        for job in 0..lap_ns / period_ns(dag) {
            let release_ns = phase_ns + job * period_ns(dag);
            let subtasks = earliest_ns.iter().enumerate();
            entries.extend(subtasks.map(|(of, ns)| (release_ns + ns, dag, of, job)));
        }
    }
    entries.sort_unstable();
    let nests = random.one_of(&[0, 30]);
    let mut lists: Vec<(String, usize)> = cores.map(|core| (format!("core {core}:"), 0)).collect();
    for (_, dag, subtask, job) in entries {
        let at = random.index(lists.len());
        let (list, depth) = &mut lists[at];
        if !list.ends_with(':') && random.chance(nests) {
            *list += " (";
            *depth += 1;
        } else if *depth > 0 && random.once_in(2) {
            *list += " )";
            *depth -= 1;
        }
        *list += &format!(" {dag}.{subtask}#{job}");
    }
    let lists = lists.into_iter().filter(|(list, _)| !list.ends_with(':'));
    let close = |(list, depth): (String, usize)| list + &" )".repeat(depth);
    lists.map(close).collect()
}

/// Gives most sinks a deadline of their own.
fn draw_sinks(random: &mut Random, spec: &mut DagSpec) {
    let deadline = spec.relative_deadline_ns.expect("given");
    let wcets = spec.subtasks.iter().filter_map(|subtask| subtask.wcet_ns);
    let least = wcets.max().unwrap_or(1).min(deadline).max(deadline / 4);
    for (position, subtask) in spec.subtasks.iter_mut().enumerate() {
        if spec.edges.iter().all(|&(from, _)| from != position) && !random.once_in(3) {
            let latest = random.one_of(&[least, deadline]);
            subtask.relative_deadline_ns = Some(random.within(least..=latest));
        }
    }
}

/// Gives some subtasks waits, whose segments may be unknown.
fn draw_waits(random: &mut Random, spec: &mut DagSpec) {
    let room = spec.period_ns.min(spec.relative_deadline_ns).unwrap_or(8) / 8;
    for subtask in &mut spec.subtasks {
        let mut left_ns = subtask.wcet_ns.unwrap_or(0);
        let are_known = !random.once_in(5);
        while random.once_in(4) && left_ns > 1 {
            let segment_ns = random.within(1..=left_ns - 1);
            left_ns -= segment_ns;
            subtask.waits.push(Wait {
                limit_ns: random.within(0..=room),
                segment_ns: are_known.then_some(segment_ns),
            });
        }
    }
}
