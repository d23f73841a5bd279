//! The compared methods: ways to divide cores among DAGs, and a fluid bound.
//!
//! - *Graham*: federated scheduling as in the literature;
//! - *multi-path*: federated scheduling by the multi-path bound, with light DAGs partitioned as in
//!   V-Fed, or else global fixed priorities;
//! - *V-Fed*: virtually-federated scheduling (X. Jiang, N. Guan, H. Liang, Y. Tang, L. Qiao, W. Yi,
//!   RTSS 2021; with light DAGs: X. Jiang, H. Liang, N. Guan, Y. Tang, L. Qiao, Y. Wang, IEEE TPDS
//!   34(1), 2023);
//! - *lent*: the analysis of tables in `docs/bounds.md`, with tables of one DAG only;
//! - *table*: the same with all tables, for periodic DAGs;
//! - *fluid*: the density test of DAG-Fluid (F. Guan, L. Peng, J. Qiao, IEEE TC 71(8), 2022);
//! - *unrefuted*: no test: all DAGs released together meet their deadlines in a run under global
//!   EDF on all cores. No test of global EDF can accept more.
//!
//! V-Fed and fluid are here for comparison only: no scheduler of this project fulfils their
//! assumptions. Both were written after another implementation, and agree with the papers' worked
//! examples, as quoted by the tests of that implementation. V-Fed comes in two forms: in the second
//! form a heavy DAG never executes on more of its cores than a *parallelism*, drawn for each DAG by
//! a hash from half its cores to all, as in the paper. Sums of fractions are floating-point
//! numbers, so a set accepted by a test with equality may be refused.
//!
//! All methods assume `D <= T`; `V` is the volume, `L` the length.

use std::rc::Rc;
use std::sync::Arc;

use random::{Random, nth};
use sched_dag::analysis::{
    InterferenceBound, ListSchedule, TableTerms, Task, federated, lend, multi_path, multi_path_fp,
};

use sched_dag::virtual_time::{ExecutionTimes, VirtualTime};
use sched_dag::{
    CommitOptions, ConstructionPolicy, DagId, DagSpec, Instance, Policy, Preemption,
    SchedulerOptions, SubtaskSpec, verify,
};

use super::sets::{Deadlines, edges};

/// A test of whether DAGs with `D <= T` can be executed on a number of cores.
pub(super) struct Method {
    /// The name in a table and a CSV file.
    pub(super) name: &'static str,
    /// The name in a picture.
    pub(super) title: &'static str,
    /// Returns whether a set is accepted.
    pub(super) accepts: fn(&[&Task], u32) -> bool,
}

/// The methods, in the order of columns, curves and legend.
pub(super) const METHODS: [Method; 8] = [
    Method {
        name: "graham",
        title: "federated, Graham's bound",
        accepts: |tasks, cores| federated(tasks, cores).is_some(),
    },
    Method {
        name: "multi_path",
        title: "federated, multi-path, or G-FP",
        accepts: by_multi_path,
    },
    Method {
        name: "v_fed",
        title: "virtually-federated",
        accepts: |tasks, cores| virtually_federated(tasks, cores, |_| u64::MAX),
    },
    Method {
        name: "v_fed_p",
        title: "the same, parallelism stated",
        accepts: |tasks, cores| virtually_federated(tasks, cores, parallelism),
    },
    Method {
        name: "lent",
        title: "lent cores (here)",
        accepts: |tasks, cores| lend(tasks, cores, 0).is_some_and(|answer| answer.plan.is_some()),
    },
    Method {
        name: "table",
        title: "tables (here)",
        accepts: by_tables,
    },
    Method {
        name: "fluid",
        title: "fluid",
        accepts: fluid,
    },
    Method {
        name: "unrefuted",
        title: "global EDF, not refuted by a run",
        accepts: is_unrefuted,
    },
];

/// The shares of small sets on 4 cores accepted by He's analysis of global static priorities (IEEE
/// TPDS 30(10), 2019), by deadlines and utilization in percent. Measured once, on other draws, with
/// the library mive93/DAG-scheduling, commit 7ccd59d5.
pub(super) const HE: [(Deadlines, u64, u64); 7] = [
    (Deadlines::Implicit, 50, 98),
    (Deadlines::Implicit, 60, 83),
    (Deadlines::Implicit, 70, 22),
    (Deadlines::Constrained, 30, 73),
    (Deadlines::Constrained, 40, 57),
    (Deadlines::Constrained, 50, 33),
    (Deadlines::Constrained, 60, 6),
];

/// The length of a run that may refute a set, in longest periods.
const LONGEST_PERIODS: u64 = 10;

const fn is_heavy(task: &Task) -> bool {
    task.volume_ns() > task.relative_deadline_ns()
}

/// Divides the cores as a commit does, for DAGs with all offsets 0.
fn by_tables(tasks: &[&Task], cores: u32) -> bool {
    let terms = TableTerms {
        offset_ns: Some(0),
        ..TableTerms::default()
    };
    let periodic = |task: &&Task| (*task).clone().with_table_terms(terms.clone());
    let periodic: Vec<Task> = tasks.iter().map(periodic).collect();
    let answer = lend(
        &periodic.iter().collect::<Vec<_>>(),
        cores,
        sched_dag::ENTRY_LIMIT,
    );
    answer.is_some_and(|answer| answer.plan.is_some())
}

/// Gives each heavy DAG the least number of cores by the multi-path bound, and partitions the light
/// DAGs on the rest. If that fails, lets all DAGs share all cores by deadline-monotonic priorities,
/// with the bound that clips interference but does not look at chains.
fn by_multi_path(tasks: &[&Task], cores: u32) -> bool {
    let (heavy, light): (Vec<&Task>, Vec<&Task>) = tasks.iter().partition(|task| is_heavy(task));
    let left = heavy.iter().try_fold(cores, |left, task| {
        let is_enough = |&count: &u32| {
            multi_path(task, count).is_some_and(|ns| ns <= task.relative_deadline_ns())
        };
        (1..=left).find(is_enough).map(|count| left - count)
    });
    let mut by_deadline = tasks.to_vec();
    by_deadline.sort_by_key(|task| task.relative_deadline_ns());
    left.is_some_and(|left| are_partitioned(light, left))
        || multi_path_fp(&by_deadline, cores, InterferenceBound::Waiting).is_some()
}

/// The budget of a DAG on a core.
#[derive(Clone, Copy)]
struct CoreBudget {
    /// The longest execution of one of the owner's jobs on the core.
    budget_ns: u64,
    /// The owner's period.
    period_ns: u64,
    /// The owner's deadline, by which the budget is spent.
    deadline_ns: u64,
}

impl CoreBudget {
    /// Returns the least time that the budget leaves in any window of a length. In the worst
    /// window, the owner spends a budget first, ending at the deadline, and the next budget right
    /// after the release.
    fn supply_ns(self, window_ns: u64) -> u64 {
        let Some(after_ns) = window_ns.checked_sub(self.budget_ns) else {
            return 0;
        };
        let (periods, part_ns) = (after_ns / self.period_ns, after_ns % self.period_ns);
        let rest_ns = self.period_ns - self.deadline_ns;
        // Idle until the next release, then the budget, then idle again.
        let of_part_ns = part_ns.min(rest_ns.max(part_ns.saturating_sub(self.budget_ns)));
        periods * (self.period_ns - self.budget_ns) + of_part_ns
    }
}

/// The time left by budgets: a *passive virtual processor*.
#[derive(Clone)]
enum PassiveProcessor {
    /// The time left on a core with a budget.
    Left(CoreBudget),
    /// A whole core: the owner has as many other cores as its parallelism.
    Whole,
    /// An equal part of the cores of an owner, for as many processors as its parallelism.
    Shared(Rc<[CoreBudget]>, u64),
}

impl PassiveProcessor {
    /// Returns the least time supplied in any window of a length.
    fn supply_ns(&self, window_ns: u64) -> u64 {
        match self {
            Self::Left(budget) => budget.supply_ns(window_ns),
            Self::Whole => window_ns,
            Self::Shared(budgets, parallelism) => {
                let left = budgets.iter().map(|of| of.supply_ns(window_ns));
                // The other processors are whole cores.
                let whole = window_ns * (budgets.len() as u64 - parallelism);
                left.sum::<u64>().saturating_sub(whole) / parallelism
            }
        }
    }
}

/// Takes processors for a DAG, the first useful ones, until `V <= base + sum of (supply - L)`; at
/// least one. If there are too few, takes none.
fn takes(pool: &mut Vec<PassiveProcessor>, task: &Task, base_ns: u64) -> bool {
    let (deadline_ns, length_ns) = (task.relative_deadline_ns(), task.length_ns());
    let mut have_ns = u128::from(base_ns);
    let mut left = Vec::new();
    let mut is_enough = false;
    for processor in &*pool {
        let gain_ns = processor.supply_ns(deadline_ns).saturating_sub(length_ns);
        if is_enough || gain_ns == 0 {
            left.push(processor.clone());
        } else {
            have_ns += u128::from(gain_ns);
            is_enough = have_ns >= task.volume_ns().into();
        }
    }
    if is_enough {
        *pool = left;
    }
    is_enough
}

/// Returns a heavy DAG's parallelism: half to all of the cores needed by federated scheduling.
fn parallelism(task: &Task) -> u64 {
    let (volume_ns, length_ns) = (task.volume_ns(), task.length_ns());
    let cores = (volume_ns - length_ns).div_ceil(task.relative_deadline_ns() - length_ns);
    let seed = nth(nth(volume_ns, task.period_ns()), length_ns);
    Random::new(seed).within(cores.div_ceil(2)..=cores)
}

/// Divides cores by virtually-federated scheduling, with the fewest sufficient cores for heavy
/// DAGs.
fn virtually_federated(tasks: &[&Task], cores: u32, most: fn(&Task) -> u64) -> bool {
    let (mut heavy, mut light): (Vec<&Task>, Vec<&Task>) =
        tasks.iter().partition(|task| is_heavy(task));
    if heavy
        .iter()
        .any(|task| task.length_ns() >= task.relative_deadline_ns())
    {
        return false;
    }
    heavy.sort_by_key(|task| task.relative_deadline_ns() - task.length_ns());
    // The densest first: V / D against V' / D', as products.
    light.sort_by(|one, other| {
        let product = |volume: &Task, deadline: &Task| {
            u128::from(volume.volume_ns()) * u128::from(deadline.relative_deadline_ns())
        };
        product(other, one).cmp(&product(one, other))
    });
    let least = u32::from(!heavy.is_empty());
    let found =
        (least..=cores).find_map(|count| Some((count, own_processors(&heavy, count, most)?)));
    let Some((count, mut pool)) = found else {
        return false;
    };
    light.retain(|task| !takes(&mut pool, task, task.length_ns()));
    are_partitioned(light, cores - count)
}

/// Gives heavy DAGs budgets on cores. A DAG with too few cores also takes time left by others'
/// budgets. Returns the passive processors still free; `most` is the parallelism of a DAG.
fn own_processors(
    heavy: &[&Task],
    cores: u32,
    most: fn(&Task) -> u64,
) -> Option<Vec<PassiveProcessor>> {
    let mut left = u64::from(cores);
    let mut pool = Vec::new();
    let mut tasks = heavy.iter();
    while let Some(task) = tasks.next() {
        let (deadline_ns, volume_ns) = (task.relative_deadline_ns(), task.volume_ns());
        let slack_ns = deadline_ns - task.length_ns();
        // The DAG owns the first core until the deadline, and each other core for the slack of its
        // longest path.
        let (mut budget_ns, mut unserved_ns) = (deadline_ns, volume_ns);
        let mut budgets = Vec::new();
        while left > 0 && unserved_ns > 0 {
            budgets.push(CoreBudget {
                budget_ns: budget_ns.min(unserved_ns),
                period_ns: task.period_ns(),
                deadline_ns,
            });
            left -= 1;
            unserved_ns = unserved_ns.saturating_sub(budget_ns);
            budget_ns = slack_ns;
        }
        let parallelism = most(task);
        let whole = (budgets.len() as u64).saturating_sub(parallelism);
        if whole == 0 {
            pool.extend(budgets.into_iter().map(PassiveProcessor::Left));
        } else {
            pool.extend((0..whole).map(|_| PassiveProcessor::Whole));
            let shared = PassiveProcessor::Shared(budgets.into(), parallelism);
            pool.extend((0..parallelism).map(|_| shared.clone()));
        }
        if unserved_ns > 0 {
            // The cores are spent: the present DAG has some, later DAGs have none.
            let is_served = takes(&mut pool, task, volume_ns - unserved_ns)
                && tasks.all(|task| takes(&mut pool, task, task.length_ns()));
            return is_served.then_some(pool);
        }
    }
    Some(pool)
}

/// Partitions light DAGs in the order of deadlines. Each goes to the fullest core (by utilization)
/// with room for it, by the approximate demand under EDF (S. Baruah, N. Fisher, RTSS 2005).
fn are_partitioned(mut light: Vec<&Task>, cores: u32) -> bool {
    let utilization = |task: &Task| task.volume_ns() as f64 / task.period_ns() as f64;
    light.sort_by_key(|task| task.relative_deadline_ns());
    // For each core, the sums of the utilizations u and of V - u D. The demand by a time t is the
    // second sum, plus t times the first.
    let mut bins = vec![(0.0, 0.0); cores as usize];
    light.into_iter().all(|task| {
        let (volume, of_task) = (task.volume_ns() as f64, utilization(task));
        let deadline = task.relative_deadline_ns() as f64;
        let fits = |&&mut (sum, base): &&mut (f64, f64)| {
            base + sum * deadline + volume <= deadline && sum + of_task <= 1.0
        };
        // Among equally full cores the first.
        let fullest = bins.iter_mut().rev().filter(fits);
        let Some((sum, base)) = fullest.max_by(|one, other| one.0.total_cmp(&other.0)) else {
            return false;
        };
        *sum += of_task;
        *base += volume - of_task * deadline;
        true
    })
}

/// Reports whether no DAG is late in a run of [`LONGEST_PERIODS`] longest periods under global EDF,
/// with WCETs and all DAGs released at once.
fn is_unrefuted(tasks: &[&Task], cores: u32) -> bool {
    let specs: Vec<DagSpec> = tasks.iter().map(|task| spec(task)).collect();
    let policy = Policy::Edf;
    let options = CommitOptions::new(policy, cores);
    let options = options.with_construction(ConstructionPolicy::any_graph());
    if (tasks.iter()).any(|task| task.length_ns() > task.relative_deadline_ns()) {
        return false;
    }
    let verified = verify(&specs, &options).expect("a graph as drawn is well formed");
    let task_set = Arc::new(verified.task_set);
    let options = SchedulerOptions {
        policy,
        preemption: Preemption::Enabled,
        cores,
    };
    let mut run = VirtualTime::new(&task_set, options);
    let longest_ns = tasks.iter().map(|task| task.period_ns()).max().unwrap_or(0);
    let wcet_ns = |of: Instance| tasks[of.dag.index()].wcets_ns()[of.subtask.index()];
    let _ = run.run_until(LONGEST_PERIODS * longest_ns, &mut ExecutionTimes(wcet_ns));
    let mut dags = (0..).map(DagId).take(tasks.len());
    dags.all(|dag| run.scheduler_of(dag).statistics(dag).misses == 0)
}

/// Returns a DAG's specification for a commit.
pub(super) fn spec(task: &Task) -> DagSpec {
    let subtask = |&wcet_ns: &u64| SubtaskSpec {
        wcet_ns: Some(wcet_ns),
        ..SubtaskSpec::default()
    };
    DagSpec {
        period_ns: Some(task.period_ns()),
        relative_deadline_ns: Some(task.relative_deadline_ns()),
        subtasks: task.wcets_ns().iter().map(subtask).collect(),
        edges: edges(task),
        ..DagSpec::default()
    }
}

/// Reports whether the DAGs' densities sum up to at most the number of cores. Each segment of a DAG
/// gets a constant share of the cores.
fn fluid(tasks: &[&Task], cores: u32) -> bool {
    let densities: Option<Vec<f64>> = tasks.iter().map(|task| density(task)).collect();
    densities.is_some_and(|densities| densities.iter().sum::<f64>() <= f64::from(cores))
}

/// Returns the density of a DAG, or `None` if a heavy DAG is longer than its deadline.
///
/// A heavy DAG is cut into segments: within a segment the same subtasks execute, given a core for
/// each. A segment too narrow for the density of the rest executes at full speed, and the other
/// segments share the remaining time evenly.
fn density(task: &Task) -> Option<f64> {
    let (mut volume_ns, mut time_ns) = (task.volume_ns(), task.relative_deadline_ns());
    if is_heavy(task) {
        let mut segments = segments(task)?.into_iter();
        // Some segment is wide enough: else all of them would take less time than their work.
        while let (width, length_ns) = segments.next()?
            && u128::from(volume_ns) > u128::from(time_ns) * u128::from(width)
        {
            volume_ns -= width * length_ns;
            time_ns -= length_ns;
        }
    }
    Some(volume_ns as f64 / time_ns as f64)
}

/// Returns the segments of a DAG, each with the number of its subtasks and its length in
/// nanoseconds, the narrowest first; `None` if the DAG is longer than its deadline.
fn segments(task: &Task) -> Option<Vec<(u64, u64)>> {
    // With a core for each subtask, all start as soon as their predecessors have finished.
    let limits_ns = vec![task.relative_deadline_ns(); task.subtask_count()];
    let schedule = ListSchedule::within(task, &limits_ns)?;
    let all = || schedule.cores.iter().flatten();
    let mut ends_ns: Vec<u64> = all().flat_map(|of| [of.start_ns, of.finish_ns]).collect();
    ends_ns.sort_unstable();
    ends_ns.dedup();
    let segment = |ends_ns: &[u64]| {
        let runs = all().filter(|of| of.start_ns <= ends_ns[0] && ends_ns[1] <= of.finish_ns);
        (runs.count() as u64, ends_ns[1] - ends_ns[0])
    };
    let mut segments: Vec<(u64, u64)> = ends_ns.windows(2).map(segment).collect();
    segments.sort_unstable();
    Some(segments)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Makes a DAG of a volume and a length, without edges.
    fn dag(volume: u64, length: u64, period: u64, deadline: u64) -> Task {
        let rest = (length..volume).map(|_| 1);
        Task::new(
            period,
            deadline,
            [length].into_iter().chain(rest).collect(),
            &[],
        )
        .unwrap()
    }

    fn by(method: fn(&[&Task], u32) -> bool, tasks: &[Task], cores: u32) -> bool {
        method(&tasks.iter().collect::<Vec<_>>(), cores)
    }

    #[test]
    fn a_passive_processor_supplies_what_the_papers_figure_shows() {
        let of = |budget_ns| CoreBudget {
            budget_ns,
            period_ns: 8,
            deadline_ns: 7,
        };
        let curve = |budget_ns| {
            (0..=8)
                .map(|ns| of(budget_ns).supply_ns(ns))
                .collect::<Vec<_>>()
        };
        assert_eq!(curve(6), [0, 0, 0, 0, 0, 0, 0, 1, 1]);
        assert_eq!(curve(2), [0, 0, 0, 1, 1, 1, 2, 3, 4]);
        // From then on, each period repeats.
        assert_eq!(of(2).supply_ns(2 + 8 + 5), 6 + 3);
        // Two of three cores never need the third one: 3 times 4, less 8, is shared by two.
        let shared = PassiveProcessor::Shared([of(2); 3].into(), 2);
        assert_eq!([7, 8].map(|ns| shared.supply_ns(ns)), [(3 * 3 - 7) / 2, 2]);
        assert_eq!(PassiveProcessor::Whole.supply_ns(8), 8);
    }

    #[test]
    fn v_fed_divides_cores_as_in_the_papers_example() {
        // The first gets budgets of 8, 1, 1, 1, 1, the second one of 8 and the second passive
        // processor, the third the next two, the fourth the fifth; the last DAG needs a core.
        let tasks = [
            dag(12, 7, 10, 8),
            dag(10, 4, 10, 8),
            dag(10, 2, 9, 9),
            dag(6, 2, 10, 10),
            dag(5, 3, 10, 10),
        ];
        let heavy: Vec<&Task> = tasks[..3].iter().collect();
        let free = |cores| {
            let pool = own_processors(&heavy, cores, |_| u64::MAX)?;
            let budget_ns = |of: &PassiveProcessor| match of {
                PassiveProcessor::Left(budget) => budget.budget_ns,
                _ => 0,
            };
            Some(pool.iter().map(budget_ns).collect::<Vec<_>>())
        };
        assert_eq!(free(5), None);
        assert_eq!(free(6), Some(vec![8, 1, 8]));
        assert_eq!(free(7), Some(vec![8, 1, 1, 8, 2]));
        assert!(by(METHODS[2].accepts, &tasks, 7));
        assert!(!by(METHODS[2].accepts, &tasks, 6));
        let from_the_end: Vec<Task> = tasks.iter().rev().cloned().collect();
        assert!(by(METHODS[2].accepts, &from_the_end, 7));
        // Federated scheduling needs 5, 2 and 2 cores for the heavy ones alone.
        assert!(!by(METHODS[0].accepts, &tasks, 9));
    }

    #[test]
    fn a_core_takes_light_dags_by_their_demand() {
        // Densities of 1/2 and 4/6 exceed a core; the demand is 2 + (6 - 4) 2 / 8 + 4 = 6.5 by 6,
        // and with a period of 16 still 6.25, and with WCETs of 3 it is 5.5.
        for (period, wcet, fits) in [(8, 4, false), (16, 4, false), (8, 3, true)] {
            let tasks = [dag(2, 2, period, 4), dag(wcet, wcet, 20, 6)];
            assert_eq!(by(METHODS[2].accepts, &tasks, 1), fits, "{period} {wcet}");
            assert!(by(METHODS[2].accepts, &tasks, 2));
        }
        // The third goes to the second on the fuller core, and leaves the first room for the last.
        let of = |volume, period| dag(volume, volume, period, period);
        let tasks = [of(3, 10), of(8, 11), of(2, 12), of(8, 13)];
        assert!(by(METHODS[2].accepts, &tasks, 2));
    }

    #[test]
    fn the_densest_light_dag_takes_what_a_heavy_one_leaves() {
        // Budgets of 40 and 2: the second leaves 36 of 40 to the 35, and the third core has 4 + 30.
        let of = |volume| dag(volume, volume, 40, 40);
        let tasks = [dag(42, 20, 40, 40), of(4), of(35), of(30)];
        assert!(by(METHODS[2].accepts, &tasks, 3));
        assert!(!by(METHODS[2].accepts, &tasks, 2));
    }

    #[test]
    fn narrow_segments_execute_at_full_speed() {
        // Segments of width 1, 2, 3, 2, 1 and length 10, 10, 20, 10, 10. The two narrow ones leave
        // 100 of 120 and 60 of 80, and 100 / 60 is less than 2.
        let wcets = vec![10, 10, 20, 50, 30];
        let edges = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 4)];
        let task = |deadline| Task::new(90, deadline, wcets.clone(), &edges).unwrap();
        let expected = [(1, 10), (1, 10), (2, 10), (2, 10), (3, 20)];
        assert_eq!(segments(&task(80)), Some(expected.to_vec()));
        let of = |deadline| density(&task(deadline)).map(|density| (60.0 * density).round());
        assert_eq!(of(80), Some(100.0));
        // 65: of 45 left for 100, those of width 2 take 20 for 40: 60 / 25.
        assert_eq!(of(65), Some(144.0));
        assert_eq!(of(60), Some(180.0));
        assert_eq!(of(59), None);
        assert!(by(fluid, &[task(80)], 2));
        assert!(!by(fluid, &[task(80)], 1));
        // Light ones have their volume over the deadline.
        assert!(by(fluid, &[task(80), dag(20, 5, 60, 60)], 2));
        assert!(!by(fluid, &[task(80), dag(21, 5, 60, 60)], 2));
    }

    #[test]
    fn each_method_accepts_what_it_should() {
        let free = |period, deadline, wcets| Task::new(period, deadline, wcets, &[]).unwrap();
        let heavy = || free(10, 10, vec![4, 4, 3]);
        let light = || Task::new(12, 9, vec![2, 4], &[(0, 1)]).unwrap();
        let wide = || free(100, 10, vec![1; 6]);
        for (tasks, cores, expected) in [
            // On two cores the lists of 4, 3 and 4 leave what the light DAG needs if they are
            // squeezed, and a budget of 10 and 1 leaves it, too. With three cores the heavy one gets
            // two, the light one the third.
            (vec![heavy(), light()], 1, [0, 0, 0, 0, 0, 0, 0, 0]),
            (vec![heavy(), light()], 2, [0, 0, 1, 1, 1, 1, 1, 1]),
            (vec![heavy(), light()], 3, [1, 1, 1, 1, 1, 1, 1, 1]),
            // Two paths of 9 leave a core for the 3: Graham's bound counts one path, and needs
            // ceil(12 / 3) cores.
            (
                vec![free(20, 12, vec![9, 9, 3])],
                2,
                [0, 1, 0, 0, 1, 1, 1, 1],
            ),
            (
                vec![free(20, 12, vec![9, 9, 3])],
                4,
                [1, 1, 1, 1, 1, 1, 1, 1],
            ),
            // Only an order of the subtasks is done by 7: 3, 2 and 2 next to 3 and 2.
            (
                vec![free(20, 7, vec![3, 3, 2, 2, 2])],
                2,
                [0, 0, 0, 0, 1, 1, 1, 1],
            ),
            (
                vec![free(20, 7, vec![3, 3, 2, 2, 2])],
                3,
                [1, 1, 1, 1, 1, 1, 1, 1],
            ),
            // Two of three light ones would be on one core, with 12 in 10; side by side on both the
            // third has 1 + ceil((5 + 12) / 2) = 10.
            (vec![wide(), wide(), wide()], 2, [0, 1, 0, 0, 1, 1, 1, 1]),
            // The volume of four is 24 in 10, more than two cores do.
            (
                vec![wide(), wide(), wide(), wide()],
                2,
                [0, 0, 0, 0, 0, 0, 0, 0],
            ),
        ] {
            let of: Vec<&Task> = tasks.iter().collect();
            let accepted = METHODS.map(|method| u8::from((method.accepts)(&of, cores)));
            assert_eq!(accepted, expected, "{cores} cores, {tasks:?}");
        }
    }
}
