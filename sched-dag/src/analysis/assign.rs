//! The commit's own clusters: heavy DAGs own cores and lend the time left there, or each DAG that
//! needs several cores gets cores of its own and the others share single cores.
//!
//! Under static priorities with preemption the cores are divided by [`lend`](super::lend()) if the
//! result proves all DAGs. Otherwise this is federated scheduling (papers below). Under other
//! policies federated scheduling comes first, and, with preemption, a table for all DAGs comes
//! second, if federated scheduling does not prove all.
//!
//! A DAG is *heavy* if a job is more work than one core does by its deadline, or by the next
//! release if earlier, or if subtasks wait. It gets a cluster of as many cores as its multi-path
//! bound needs, or of fewer with a table. The other DAGs are *light*. Clusters of one core each
//! take them, the densest first, each on the core with the least sum of densities (worst fit), so
//! every core keeps some room. A core takes light DAGs up to a sum of 1: enough for preemptive EDF,
//! but no proof for static priorities or without preemption. If a DAG ends up without cores, all
//! DAGs share all cores, provided such sharing proves each of them. Whatever the assignment, the
//! analysis of each cluster has the last word.
//!
//! # Federated scheduling: cores of its own for each DAG that needs several
//!
//! J. Li, J.-J. Chen, K. Agrawal, C. Lu, C. Gill, A. Saifullah, ECRTS 2014,
//! doi:10.1109/ECRTS.2014.23; with `D <= T`: S. Baruah, DATE 2015. A *heavy* DAG (`volume > D`)
//! gets `ceil((volume - length) / (D - length))` dedicated cores, where Graham's bound is at most
//! `D`. A *light* DAG executes sequentially on one of the remaining cores. A core takes light DAGs
//! while the sum of their densities `volume / D` is at most 1 (partitioned EDF).
//!
//! [`federated`] implements this form, the form compared in the literature; a commit that makes its
//! own clusters calls [`assign`]. Assumes `D <= T`.
//!
//! Light DAGs are placed first-fit by descending density, ties by position. Where this placement
//! fails, another may succeed.

use alloc::vec;
use alloc::vec::Vec;
use core::time::Duration;

use super::case::of_cluster;
use super::lending::{LendingAnswer, LendingPlan, LendingTerms, late_and_limit_ns};
use super::list_schedule::ListSchedule;
use super::multi_path::multi_path;
use super::ratio::{Ratio, sort_largest_first};
use super::set::constrained;
use super::task::{Task, TaskError};
use super::workload::WorkloadBursts;
use super::{AnalysisSettings, answer};
use crate::ids::{ClusterId, DagId, to_u32};
use crate::policy::{AssignmentReason, AttemptFailure, Preemption};
use crate::table::{ENTRY_LIMIT, Table};
use crate::task_set::TaskSet;
use crate::worded::texts;

/// A DAG without cores, and the reason.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NotAssigned {
    /// The DAG.
    pub dag: DagId,
    /// Why the DAG gets no cores.
    pub reason: AssignmentFailure,
    /// Why the [attempts](crate::LendingAttempt) to lend cores failed, each with the first DAG to
    /// fail, if any; `None` where lending does not apply.
    pub attempts: Option<FailedAttempts>,
}

/// For each failed attempt, the DAG and the reason.
pub type FailedAttempts = Vec<(Option<DagId>, AttemptFailure)>;

texts! {
    /// Why a DAG gets no cores.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum AssignmentFailure {
        /// The DAG states a cluster, but the clusters do not exist yet.
        Stated = "it states a cluster, and the commit is to make them; leave its cluster out";
        /// The DAG states cores of a cluster that does not exist yet.
        Confined =
            "it states cores of a cluster, and the commit is to make the clusters; leave its affinity out";
        /// The DAG enters a lock without a longest section.
        UnboundedLock =
            "it enters a lock without a longest section, in which it keeps what shares its cores \
             waiting; state one by `Lock::longest`";
        /// The number of cores needed is unknown.
        Unknown(error: TaskError) = "{error}";
        /// The longest path, overheads included, takes longer than a job has, on any number of
        /// cores.
        TooLong { length_ns: u64, within_ns: u64 } =
            "its longest path takes {:?}, and a job has {:?} until its deadline or the next \
             release; shorten the path, or lengthen both",
            Duration::from_nanos(*length_ns), Duration::from_nanos(*within_ns);
        /// The DAG is heavy, or waits, and too few cores are left.
        TooHeavy { left: u32 } =
            "a job needs cores of its own to be in time, and too few are left: {left}; add cores, or \
             lengthen its deadline and period";
        /// The DAG is light, and no core left by heavy DAGs has room.
        NoRoom { left: u32 } =
            "no core has room for it, of those that heavy DAGs leave: {left}; add cores, or \
             lengthen deadlines and periods";
    }
}

/// Divides the cores of the settings among DAGs.
///
/// # Errors
///
/// The first DAG that states its cluster or cores, enters a lock without a longest section or
/// cannot be analysed. Without one, the first DAG without cores: heavy and waiting DAGs in the
/// order of the commit, then light DAGs, the densest first.
pub fn assign(task_set: &mut TaskSet, settings: &AnalysisSettings) -> Result<(), NotAssigned> {
    let dags = task_set.dags().iter();
    let all = of_cluster(settings, settings.cores, &mut dags.clone());
    let overhead_ns = all.overheads.of_an_instance_ns(settings.preemption);
    let overhead_ns = overhead_ns.ok_or(TaskError::VolumeOverflow);
    let mut tasks = Vec::with_capacity(task_set.dags().len());
    for (dag, model) in dags.enumerate() {
        if model.unbounded_lock().is_some() {
            return Err(refused(dag, AssignmentFailure::UnboundedLock));
        }
        if model.states_cluster() {
            return Err(refused(dag, AssignmentFailure::Stated));
        }
        if model.is_confined() {
            return Err(refused(dag, AssignmentFailure::Confined));
        }
        let task = overhead_ns.and_then(|overhead_ns| Task::from_dag(model, overhead_ns));
        tasks.push(task.map_err(|error| refused(dag, AssignmentFailure::Unknown(error)))?);
    }
    let bursts = WorkloadBursts::of(task_set.dags().iter().map(|dag| (dag, false)), &all);
    let mut federated = task_set.clone();
    let outcome = federate(&mut federated, &bursts, &tasks, settings);
    // Under policies that look at releases, a table comes last: it fixes an order that such a
    // policy would decide.
    let is_proven = settings.policy.adds_release()
        && outcome.is_ok()
        && answer(&federated, settings).is_proven();
    let lent = (!is_proven).then(|| lend_cores(task_set, &bursts, &tasks, settings));
    let attempts = match lent.flatten() {
        None => None,
        Some(Ok(())) => return Ok(()),
        Some(Err(failed)) => Some(failed),
    };
    let Err(refused) = outcome else {
        *task_set = federated;
        return Ok(());
    };
    // Lending, where applicable, has already tried sharing; it knows neither waits nor EDF.
    let whole = LendingPlan::whole(tasks.len(), settings.cores as usize);
    let tasks: Vec<&Task> = tasks.iter().collect();
    match attempts.is_none() && take_if_proven(task_set, &whole, &tasks, settings) {
        true => Ok(()),
        false => Err(NotAssigned {
            attempts,
            ..refused
        }),
    }
}

/// Divides the cores as planned if the division proves all DAGs, and reports whether it does.
fn take_if_proven(
    task_set: &mut TaskSet,
    plan: &LendingPlan,
    tasks: &[&Task],
    settings: &AnalysisSettings,
) -> bool {
    let mut divided = task_set.clone();
    plan.divide(&mut divided, tasks);
    let is_proven = answer(&divided, settings).is_proven();
    if is_proven {
        *task_set = divided;
    }
    is_proven
}

/// Divides the cores by [`lend`](super::lend()), where applicable. The error tells why each attempt
/// failed.
fn lend_cores(
    task_set: &mut TaskSet,
    bursts: &WorkloadBursts,
    tasks: &[Task],
    settings: &AnalysisSettings,
) -> Option<Result<(), FailedAttempts>> {
    if settings.preemption == Preemption::Disabled {
        return None;
    }
    let tasks: Vec<&Task> = tasks.iter().collect();
    // A table has no slack for steps, interrupts and sections that delay all its entries at once.
    let is_delayed =
        bursts.during(0) > 0 || task_set.dags().iter().any(|dag| !dag.locks().is_empty());
    let terms = LendingTerms {
        bursts,
        entry_limit: if is_delayed { 0 } else { ENTRY_LIMIT },
        // Members are ranked by deadline, and an order that depends on releases does not rank them
        // so.
        has_members: !settings.policy.adds_release(),
    };
    let LendingAnswer { plan, failed } = terms.lend(&tasks, settings.cores)?;
    let Some(plan) = plan else {
        let id = |dag| DagId(to_u32(dag));
        let failed = failed.into_iter().map(|(dag, why)| (dag.map(id), why));
        return (terms.has_members).then(|| Err(failed.collect()));
    };
    // Stated priorities may rank DAGs differently than by deadline.
    take_if_proven(task_set, &plan, &tasks, settings).then_some(Ok(()))
}

/// Divides the cores by federated scheduling.
fn federate(
    task_set: &mut TaskSet,
    bursts: &WorkloadBursts,
    tasks: &[Task],
    settings: &AnalysisSettings,
) -> Result<(), NotAssigned> {
    // The number of cores of each cluster, and the cluster of each DAG.
    let mut sizes = Vec::new();
    let mut of_dags = vec![(ClusterId(0), AssignmentReason::Light); tasks.len()];
    let (mut tables, mut left) = (Vec::new(), settings.cores);
    let mut light = Vec::new();
    for (dag, task) in tasks.iter().enumerate() {
        let (volume_ns, within_ns) = density(task);
        // One core is enough for a light DAG, so it may share a core. Light DAGs are packed last,
        // onto the cores left by heavy DAGs. A DAG with waits gets cores of its own: a sum of
        // densities is no test for waits.
        if volume_ns <= within_ns && !task.has_waits() {
            light.push(dag);
            continue;
        }
        // No number of cores shortens the longest path, so this case differs from a lack of cores.
        let length_ns = task.span_ns();
        if length_ns > within_ns {
            let too_long = AssignmentFailure::TooLong {
                length_ns,
                within_ns,
            };
            return Err(refused(dag, too_long));
        }
        let may_have_table = settings.preemption == Preemption::Enabled
            && !task.has_waits()
            && task_set.dags()[dag].locks().is_empty()
            && task.table_terms().sink_deadlines_ns.is_empty();
        let (_, limit_ns) = late_and_limit_ns(bursts, task);
        let enough = |count: u32| {
            if multi_path(task, count).is_some_and(|ns| ns <= within_ns) {
                return Some((count, None));
            }
            let limits_ns = vec![limit_ns; task.subtask_count().min(count as usize)];
            let schedule = ListSchedule::within(task, &limits_ns).filter(|_| may_have_table)?;
            Some((count, Some(schedule.table(dag, task.period_ns(), 0))))
        };
        // The least number of cores with a proof, since light DAGs share the rest.
        let Some((count, table)) = (1..=left).find_map(enough) else {
            return Err(refused(dag, AssignmentFailure::TooHeavy { left }));
        };
        tables.extend(table.map(|table| Table {
            cluster: ClusterId(to_u32(sizes.len())),
            ..table
        }));
        let why = match volume_ns > within_ns {
            true => AssignmentReason::Heavy {
                volume_ns,
                within_ns,
            },
            false => AssignmentReason::Waits,
        };
        of_dags[dag] = (ClusterId(to_u32(sizes.len())), why);
        sizes.push(count);
        left -= count;
    }
    pack(tasks, light, left, &mut sizes, &mut of_dags)?;
    task_set.divide(&sizes, &of_dags);
    task_set.set_tables(tables);
    Ok(())
}

fn refused(dag: usize, reason: AssignmentFailure) -> NotAssigned {
    let dag = DagId(to_u32(dag));
    NotAssigned {
        dag,
        reason,
        attempts: None,
    }
}

/// Returns the work of a job, and the time in which one core would have to finish it.
fn density(task: &Task) -> (u64, u64) {
    (task.volume_ns(), task.within_ns())
}

/// Packs light DAGs onto clusters of one core each, at most `left`.
fn pack(
    tasks: &[Task],
    mut light: Vec<usize>,
    left: u32,
    sizes: &mut Vec<u32>,
    of_dags: &mut [(ClusterId, AssignmentReason)],
) -> Result<(), NotAssigned> {
    sort_largest_first(&mut light, |dag| density(&tasks[dag]));
    let first = sizes.len();
    // The densities on each core.
    let mut loads: Vec<Vec<(u64, u64)>> = Vec::new();
    for dag in light {
        if loads.len() < left as usize {
            loads.push(Vec::new());
            sizes.push(1);
        }
        let sum = |place: usize| Ratio::sum(loads[place].iter().copied());
        let is_emptier = |one, other| match (sum(one), sum(other)) {
            (Some(one), Some(other)) => one.at_most(other.numerator, other.denominator),
            (one, _) => one.is_some(),
        };
        let emptier = |one, other| if is_emptier(one, other) { one } else { other };
        let place = (0..loads.len()).reduce(emptier);
        let fits = |place: &usize| {
            let all = loads[*place].iter().copied().chain([density(&tasks[dag])]);
            Ratio::sum(all).is_some_and(|sum| sum.at_most(1, 1))
        };
        let Some(place) = place.filter(fits) else {
            return Err(refused(dag, AssignmentFailure::NoRoom { left }));
        };
        loads[place].push(density(&tasks[dag]));
        of_dags[dag].0 = ClusterId(to_u32(first + place));
    }
    Ok(())
}

/// An assignment of cores to DAGs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Federation {
    /// The heavy DAGs by position, each with its number of dedicated cores.
    pub heavy: Vec<(usize, u32)>,
    /// The light DAGs of each remaining core, by position; the length is the number of cores left
    /// for light DAGs.
    pub light: Vec<Vec<usize>>,
}

/// Assigns cores by Graham's bound. Returns `None` if the assignment fails, or if a DAG has `D > T`
/// or waits.
#[must_use]
pub fn federated(tasks: &[&Task], cores: u32) -> Option<Federation> {
    if !constrained(tasks, cores) || tasks.iter().any(|task| task.has_waits()) {
        return None;
    }
    let mut left = cores;
    let mut heavy = Vec::new();
    let mut light = Vec::new();
    for (position, task) in tasks.iter().enumerate() {
        if task.volume_ns() > task.relative_deadline_ns() {
            // With zero slack, the volume (more than `D`) exceeds the length, so no number of cores
            // is enough.
            let slack = task.relative_deadline_ns().checked_sub(task.length_ns())?;
            let beside = task.volume_ns() - task.length_ns();
            let room = beside.checked_add(slack.checked_sub(1)?)?;
            let count = u32::try_from(room.checked_div(slack)?).ok()?;
            left = left.checked_sub(count)?;
            heavy.push((position, count));
        } else {
            light.push(position);
        }
    }
    let light = pack_sorted(tasks, light, left)?;
    Some(Federation { heavy, light })
}

fn pack_sorted(tasks: &[&Task], mut light: Vec<usize>, cores: u32) -> Option<Vec<Vec<usize>>> {
    let cores = usize::try_from(cores).ok()?;
    let density = |position: usize| {
        let task = tasks[position];
        (task.volume_ns(), task.relative_deadline_ns())
    };
    sort_largest_first(&mut light, density);
    let mut placed = vec![Vec::new(); cores];
    for position in light {
        let fits = |there: &&mut Vec<usize>| {
            let all = there.iter().chain([&position]).map(|&dag| density(dag));
            Ratio::sum(all).is_some_and(|sum| sum.at_most(1, 1))
        };
        placed.iter_mut().find(fits)?.push(position);
    }
    Some(placed)
}

#[cfg(test)]
mod tests {
    use super::{federated, *};
    use crate::analysis::{Overheads, Task};
    use crate::task_set::Dag;
    use crate::{
        CommitOptions, ConstructionPolicy, DagSpec, Policy, Preemption, SubtaskSpec, Wait,
    };

    /// A DAG of as many subtasks side by side as there are WCETs, with a deadline.
    fn parallel(wcets_ns: &[u64], deadline_ns: u64) -> DagSpec {
        let subtask = |&wcet_ns: &u64| SubtaskSpec {
            wcet_ns: Some(wcet_ns),
            ..SubtaskSpec::default()
        };
        DagSpec {
            period_ns: Some(20),
            relative_deadline_ns: Some(deadline_ns),
            subtasks: wcets_ns.iter().map(subtask).collect(),
            ..DagSpec::default()
        }
    }

    fn assigned(dags: &[DagSpec], cores: u32) -> Result<TaskSet, NotAssigned> {
        let options = CommitOptions::new(Policy::Edf, cores)
            .with_construction(ConstructionPolicy::any_graph());
        let verified = crate::verify(dags, &options).expect("the DAGs are right");
        let settings = AnalysisSettings {
            policy: Policy::Edf,
            preemption: Preemption::Enabled,
            cores,
            overheads: Overheads::default(),
        };
        let mut divided = verified.task_set;
        assign(&mut divided, &settings)?;
        let answer = crate::analysis::answer(&divided, &settings);
        assert!(answer.is_proven(), "{:?}", answer.first_failing);
        Ok(divided)
    }

    #[test]
    fn heavy_dags_get_cores_and_light_ones_the_emptiest() {
        // The heavy one's four subtasks of 6 fit into 10 side by side only. The others have
        // densities of 0.5, 0.8, 0.3 and 0.2.
        let dags = [
            parallel(&[3, 2], 10),
            parallel(&[6, 6, 6, 6], 10),
            parallel(&[8], 10),
            parallel(&[3], 10),
            parallel(&[2], 10),
        ];
        let found = assigned(&dags, 6).unwrap();
        assert_eq!(sizes(&found), [4, 1, 1]);
        let clusters = found.dags().iter().map(|dag| dag.cluster().0);
        assert_eq!(clusters.collect::<Vec<_>>(), [2, 0, 1, 2, 1]);
        let heavy = AssignmentReason::Heavy {
            volume_ns: 24,
            within_ns: 10,
        };
        let light = Some(AssignmentReason::Light);
        let whys = found.dags().iter().map(Dag::why_there);
        assert_eq!(
            whys.collect::<Vec<_>>(),
            [light, Some(heavy), light, light, light]
        );
    }

    fn sizes(task_set: &TaskSet) -> Vec<usize> {
        let cores = |cluster| task_set.cores_of(cluster, 0).len();
        task_set.clusters().map(cores).collect()
    }

    #[test]
    fn a_core_more_than_there_are_light_dags_stays_idle() {
        let found = assigned(&[parallel(&[8], 10)], 4).unwrap();
        assert_eq!(sizes(&found), [1]);
    }

    #[test]
    fn a_table_needs_fewer_cores() {
        let found = assigned(&[parallel(&[3, 3, 2, 2, 2], 7)], 4).unwrap();
        assert_eq!((sizes(&found), found.tables().len()), (vec![2], 1));
    }

    #[test]
    fn what_waits_gets_cores_of_its_own() {
        let mut waits = parallel(&[2, 4], 10);
        waits.subtasks[0].waits.push(Wait {
            limit_ns: 6,
            segment_ns: Some(1),
        });
        // Work of 6 within 10, but on one core it may take 12: it needs two.
        let found = assigned(&[parallel(&[1], 10), waits], 4).unwrap();
        assert_eq!(sizes(&found), [2, 1]);
        let whys = found.dags().iter().map(Dag::why_there);
        let expected = [AssignmentReason::Light, AssignmentReason::Waits];
        assert!(whys.eq(expected.map(Some)));
        // Where cores of its own leave none to others, all share all that there are.
        let mut waits = parallel(&[2], 20);
        waits.subtasks[0].waits.push(Wait {
            limit_ns: 6,
            segment_ns: Some(1),
        });
        let found = assigned(&[parallel(&[1], 10), waits], 1).unwrap();
        let whole = Some(AssignmentReason::Whole { left_percent: 85 });
        assert!(found.dags().iter().all(|dag| dag.why_there() == whole));
    }

    #[test]
    fn what_gets_no_cores_is_named() {
        let refused = |dags: &[DagSpec], cores| {
            let NotAssigned { dag, reason, .. } = assigned(dags, cores).unwrap_err();
            (dag.0, reason)
        };
        let (heavy, light) = (parallel(&[6, 6, 6, 6], 10), parallel(&[8], 10));
        let both = [light.clone(), heavy];
        assert_eq!(
            refused(&both, 3),
            (1, AssignmentFailure::TooHeavy { left: 3 })
        );
        assert_eq!(
            refused(&both, 4),
            (0, AssignmentFailure::NoRoom { left: 0 })
        );
        let two = [light.clone(), light];
        assert_eq!(refused(&two, 1), (1, AssignmentFailure::NoRoom { left: 1 }));
        // Neither cores nor a later deadline help what is longer than its period.
        let too_long = AssignmentFailure::TooLong {
            length_ns: 21,
            within_ns: 20,
        };
        assert_eq!(refused(&[parallel(&[21], 30)], 8), (0, too_long));
        let unknown = [parallel(&[0], 10)];
        assert!(matches!(
            refused(&unknown, 1),
            (0, AssignmentFailure::Unknown(_))
        ));
    }

    #[test]
    fn e6_a_heavy_dag_and_two_light_ones() {
        let fork = (1..5).flat_map(|v| [(0, v), (v, 5)]).collect::<Vec<_>>();
        let heavy = Task::new(12, 12, vec![2, 6, 5, 4, 3, 1], &fork).unwrap();
        let one = Task::new(10, 10, vec![2, 3], &[(0, 1)]).unwrap();
        let two = Task::new(10, 8, vec![1, 3], &[(0, 1)]).unwrap();
        let tasks = [&heavy, &one, &two];
        assert_eq!(federated(&tasks, 4), None);
        let five = federated(&tasks, 5).unwrap();
        assert_eq!((five.heavy, five.light), (vec![(0, 4)], vec![vec![1, 2]]));
        let six = federated(&tasks, 6).unwrap();
        assert_eq!((six.heavy, six.light.len()), (vec![(0, 4)], 2));
    }

    #[test]
    fn charges_of_centuries_are_refused_and_overflow_nowhere() {
        let dags = [parallel(&[1], 20), parallel(&[1], 20)];
        let options = CommitOptions::new(Policy::Edf, 2);
        let mut divided = crate::verify(&dags, &options)
            .expect("they are right")
            .task_set;
        let settings = AnalysisSettings {
            policy: Policy::Edf,
            preemption: Preemption::Enabled,
            cores: 2,
            overheads: Overheads {
                dispatch_ns: u64::MAX / 4,
                ..Overheads::NONE
            },
        };
        assert!(assign(&mut divided, &settings).is_err());
    }
}
