//! The commit: from drafts to a running plan, or to all faults of the drafts.
//!
//! A commit has five steps. Each step either succeeds for all DAGs or ends the commit:
//!
//! 1. *Verify.* All faults of all DAGs are collected, from this crate and from the model. If there
//!    is any, nothing has happened; the handles are unchanged. This is so until step 4.
//! 2. *Assign.* Where the platform leaves the division to the commit, or only a division gives a
//!    demanded proof, the cores are divided among the DAGs.
//! 3. *Answer.* The response times are bounded where possible, for the platform's model. The lack
//!    of a demanded proof ends the commit like a fault; a certificate that cannot fix the set has
//!    ended it before.
//! 4. *Tie.* Edges get their rings, functions become bodies. This cannot fail.
//! 5. *Launch.* The platform takes the plan.

use alloc::format;
use alloc::rc::Rc;
use alloc::string::ToString;
use alloc::sync::Arc;
use alloc::vec::Vec;

use sched_dag::analysis::{self, NotAssigned};
use sched_dag::{
    CommitOptions, ConstructionPolicy, CountLimit, DagId, DagLabel, Policy, TaskSet, VerifiedDags,
    Warning, sorted_by_key, wcets,
};

use super::answer::{Commit, CommitAnswers, staleness};
use super::tie::tie;
use crate::api::dag::Dag;
use crate::api::lifecycle::dags_of_modes;
use crate::draft::fault::{CommitError, Fault};
use crate::draft::part::{CheckedDag, CommitCheck, Drafts, PartKind, Planner, one_of_each};
use crate::platform;
use crate::platform::{LaunchError, RunConfig};

/// Verifies DAGs and hands them to the installed platform for scheduling.
///
/// A successful commit ends construction: the DAGs can no longer be changed. The commit verifies
/// the DAGs for the platform's policy and cores, with the paper's construction policy: one source,
/// one sink, one writer per topic (in each DAG).
///
/// Given WCETs, the commit also answers about deadlines; see [`Commit::answers`].
///
/// # Errors
///
/// A [`CommitError`] with *every* fault of every DAG found by the verification; or, if there is
/// none, with the faults of a later step, such as a missing proof. Nothing runs then, and the app
/// can still add to the handles and commit again, with one exception: after [`Fault::NotLaunched`]
/// the functions are gone with the refused plan, and the DAGs must be built anew.
///
/// # Examples
///
/// ```
/// use core::time::Duration;
/// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
///
/// # let machine = virtual_time::VirtualTime::new();
/// let dag = create_dag();
/// dag.name("demo");
/// dag.register_periodic_subtask(
///     || (1_i32,),
///     ["number"],
///     Duration::from_millis(10),
///     SubtaskAttributes::named("source"),
/// );
/// dag.register_sink_subtask(
///     |(number,): (u64,)| println!("{number}"), // not the type that is written
///     ["number"],
///     Duration::from_millis(10),
///     SubtaskAttributes::named("sink"),
/// );
/// let error = finish_create_dags(&[dag.clone()]).unwrap_err();
/// assert_eq!(error.faults()[0].code(), "type_mismatch");
/// ```
pub fn finish_create_dags(dags: &[Dag]) -> Result<Commit, CommitError> {
    finish_create_dags_with(dags, ConstructionPolicy::paper())
}

/// Works like [`finish_create_dags`] for other shapes of graphs: with several sources or sinks, or
/// with several parts. Nothing else changes.
///
/// A topic has one writer whatever `construction` says: an input is one value per job, and with two
/// writers the value would depend on the schedule.
///
/// All sources of a job become ready at its release; a job is complete when all its sinks are
/// complete.
///
/// # Errors
///
/// As for [`finish_create_dags`], except for the shapes allowed by `construction`.
///
/// # Examples
///
/// ```
/// use core::time::Duration;
/// use fass::commit::{ConstructionPolicy, CountLimit, finish_create_dags_with};
/// use fass::{SubtaskAttributes, create_dag};
///
/// # let machine = virtual_time::VirtualTime::new();
/// let dag = create_dag();
/// let period = Duration::from_millis(10);
/// dag.jobs(2).period(period).relative_deadline(period);
/// let subtasks = [(); 3].map(|()| dag.register_untyped_subtask(|_| (), SubtaskAttributes::default()));
/// dag.precede(&subtasks[0], &subtasks[2]).precede(&subtasks[1], &subtasks[2]);
///
/// let construction = ConstructionPolicy {
///     sources: CountLimit::Several,
///     ..ConstructionPolicy::paper()
/// };
/// finish_create_dags_with(&[dag], construction).unwrap();
/// ```
pub fn finish_create_dags_with(
    dags: &[Dag],
    construction: ConstructionPolicy,
) -> Result<Commit, CommitError> {
    finish_create_dags_in_order(dags, construction, &[])
}

/// Works like [`finish_create_dags_with`], with a list for each of some cores: the order of
/// subtasks on the core, kept in every lap of the DAGs' common period.
///
/// A word of a list is `DAG.SUBTASK`, or `DAG.SUBTASK#N` for job N of a lap; entries in parentheses
/// may begin before the entry in front of them has ended. If one subtask of a DAG is in lists, all
/// its subtasks have to be, on cores of one cluster. On their cores, listed subtasks go before
/// everything else, except an instance that keeps its core (without preemption, or non-preemptive).
/// `docs/dag-file.md` has the notation.
///
/// # Errors
///
/// As for [`finish_create_dags_with`], and [`DagFault::CoreList`](sched_dag::DagFault::CoreList).
///
/// # Examples
///
/// ```
/// use core::time::Duration;
/// use fass::commit::{ConstructionPolicy, finish_create_dags_in_order};
/// use fass::{SubtaskAttributes, create_dag};
///
/// # let machine = virtual_time::VirtualTime::new().silent(virtual_time::Silent::Wcet);
/// let ms = Duration::from_millis;
/// let dags = [("fly", 10, 4), ("map", 20, 9)].map(|(name, period, wcet)| {
///     let dag = create_dag();
///     dag.name(name).jobs(4).period(ms(period)).relative_deadline(ms(period));
///     dag.register_untyped_subtask(|_job| (), SubtaskAttributes::named("run").wcet(ms(wcet)));
///     dag
/// });
/// let lists = ["core 0: fly.run map.run ( fly.run )"];
/// let commit = finish_create_dags_in_order(&dags, ConstructionPolicy::paper(), &lists).unwrap();
/// assert_eq!(machine.run().violations(), []);
/// ```
pub fn finish_create_dags_in_order(
    dags: &[Dag],
    construction: ConstructionPolicy,
    lists: &[&str],
) -> Result<Commit, CommitError> {
    // Whatever the caller allows: with two writers an input would depend on the schedule.
    let construction = ConstructionPolicy {
        writers: CountLimit::One,
        ..construction
    };
    let drafts: Vec<_> = dags.iter().map(|dag| Rc::clone(&dag.draft)).collect();
    let with = |policy, cores| CommitOptions::new(policy, cores).with_construction(construction);
    let Some(platform) = platform::installed() else {
        // Without a platform the commit can still report the other faults. Only the needed
        // attributes depend on the platform; EDF needs none.
        let mut error = match verify(&drafts, with(Policy::Edf, 1), None) {
            Ok(accepted) => CommitError {
                faults: Vec::new(),
                warnings: accepted.warnings,
            },
            Err(error) => error,
        };
        error.faults.insert(0, Fault::NoPlatform);
        return Err(error);
    };
    let terms = platform.terms();
    let options = with(terms.scheduler.policy, terms.scheduler.cores);
    let options = options
        .with_clusters(terms.clusters.clone())
        .with_lists(lists);
    let VerifiedDags {
        mut task_set,
        mut warnings,
    } = verify(&drafts, options, terms.wcets.as_deref())?;
    // Before the first analysis: the times of stated lists have to include the overheads.
    task_set.charge_tables(&terms.settings());
    if let Err(error) = divide(&mut task_set, &terms, &drafts, !lists.is_empty()) {
        return Err(CommitError::of(Fault::NotAssigned(error), warnings));
    }
    if !fix(&mut task_set, &terms, &drafts) {
        return Err(CommitError::of(Fault::NotFixed, warnings));
    }
    let answers = CommitAnswers::new(&task_set, &terms);
    let certain = answers.certain_misses();
    warnings.extend(certain.map(|(dag, reason)| Warning::CertainMiss { dag, reason }));
    let faults = lacking_proofs(&drafts, &answers);
    if !faults.is_empty() {
        return Err(CommitError { faults, warnings });
    }
    let staleness = Arc::new(staleness(&drafts, &task_set, &answers.of_dags));
    let task_set = Arc::new(task_set);
    let plan = tie(
        &drafts,
        Arc::clone(&task_set),
        &answers,
        Arc::clone(&staleness),
    );
    let launched = platform.launch(plan);
    // The launch has decided whether functions are told a recorded time.
    platform::clock::settle_clock(platform);
    match launched {
        Ok(()) => Ok(Commit {
            warnings,
            answers,
            staleness,
            task_set,
        }),
        Err(error) => Err(CommitError::of(Fault::NotLaunched(error), warnings)),
    }
}

/// Fixes the set if there is a certificate, and reports success. With a certificate it fails if a
/// subtask may change the running DAGs, or a DAG starts paused.
fn fix(task_set: &mut TaskSet, terms: &RunConfig, drafts: &Drafts) -> bool {
    let Some(certificate) = &terms.certificate else {
        return true;
    };
    let mut planners = one_of_each::<Planner>(drafts).into_iter();
    let may_change = planners.any(|(kind, _)| kind == PartKind::Lifecycle);
    if !may_change {
        task_set.fix(certificate);
    }
    !may_change
}

/// Divides the cores if the commit has to, or if only a division gives a demanded proof. Stated
/// lists count as a division.
fn divide(
    task_set: &mut TaskSet,
    terms: &RunConfig,
    drafts: &Drafts,
    is_stated: bool,
) -> Result<(), LaunchError> {
    let demands_proof = || drafts.iter().any(|draft| draft.borrow().demands_proof);
    match (terms.assigns, is_stated) {
        (true, true) => {
            let why =
                "lists of cores are stated, and the commit is to divide the cores; leave one out";
            return Err(LaunchError::new(why.to_string()));
        }
        (true, false) => assign_clusters(task_set, terms)?,
        (false, false) if demands_proof() => divide_to_prove(task_set, terms, drafts),
        _ => {}
    }
    Ok(())
}

/// Divides undivided cores, where only a division gives a demanded proof. All DAGs in modes have to
/// stay together, since a single cluster enters a mode.
fn divide_to_prove(task_set: &mut TaskSet, terms: &RunConfig, drafts: &Drafts) {
    let is_free = |dag: &sched_dag::Dag| !dag.states_cluster();
    if task_set.is_divided() || !task_set.dags().iter().all(is_free) {
        return;
    }
    let settings = terms.settings();
    if analysis::answer(task_set, &settings).is_proven() {
        return;
    }
    // Tried on a copy: where a division gives no proof either, the cores stay undivided.
    let mut divided = task_set.clone();
    let is_assigned = assign_clusters(&mut divided, terms).is_ok();
    let cluster = |dag: &DagId| divided.dag(*dag).cluster();
    let of_modes = dags_of_modes(drafts).concat();
    if is_assigned
        && divided.is_divided()
        && of_modes
            .windows(2)
            .all(|pair| cluster(&pair[0]) == cluster(&pair[1]))
        && analysis::answer(&divided, &settings).is_proven()
    {
        *task_set = divided;
    }
}

/// Returns a fault for each DAG with a demanded but missing proof.
fn lacking_proofs(drafts: &Drafts, answers: &CommitAnswers) -> Vec<Fault> {
    let demanding =
        (drafts.iter().zip(&*answers.of_dags)).filter(|(draft, _)| draft.borrow().demands_proof);
    let lacking = demanding.filter_map(|(_, answer)| {
        Some(Fault::NotProven {
            dag: answer.dag.clone(),
            unproven: answer.verdict.unproven()?.clone(),
        })
    });
    lacking.collect()
}

/// Reports for each DAG whether the DAG occurs earlier in the list, too.
fn repeated(drafts: &Drafts) -> Vec<bool> {
    let address = |number: usize| Rc::as_ptr(&drafts[number]);
    let mut is_repeated = alloc::vec![false; drafts.len()];
    for pair in sorted_by_key(drafts.len(), address).windows(2) {
        is_repeated[pair[1]] = address(pair[0]) == address(pair[1]);
    }
    is_repeated
}

/// Verifies all DAGs, and collects the faults of both crates.
fn verify(
    drafts: &Drafts,
    options: CommitOptions,
    observed: Option<&str>,
) -> Result<VerifiedDags, CommitError> {
    let mut faults = Vec::new();
    let open: Vec<_> = drafts.iter().map(|draft| draft.borrow()).collect();
    let mut specs = Vec::with_capacity(drafts.len());
    for ((number, draft), is_repeated) in open.iter().enumerate().zip(repeated(drafts)) {
        let label = DagLabel {
            id: DagId(u32::try_from(number).unwrap_or(u32::MAX)),
            name: draft.spec.name.clone(),
        };
        if is_repeated {
            // Its other faults are those of the first occurrence, and are reported there.
            faults.push(Fault::GivenTwice { dag: label });
            continue;
        }
        if draft.is_committed {
            faults.push(Fault::AlreadyCommitted { dag: label });
            continue;
        }
        let mut spec = draft.spec_with_known_types();
        if specs.len() < number && spec.name.is_empty() {
            // DAGs before this one were left out, so the model counts differently.
            spec.to_mut().name = number.to_string();
        }
        let checked = CheckedDag {
            drafts,
            draft,
            label: DagLabel {
                id: DagId(u32::try_from(specs.len()).unwrap_or(u32::MAX)),
                name: spec.name.clone(),
            },
        };
        faults.extend(draft.flaws.iter().map(|flaw| flaw(checked.label.clone())));
        if let Some(Err(fault)) = observed.map(|file| wcets::apply(file, spec.to_mut())) {
            let dag = checked.label.clone();
            faults.push(Fault::WcetsRefused { dag, fault });
        }
        checked.check(&mut faults);
        specs.push(spec);
    }
    for (_, check) in one_of_each::<CommitCheck>(drafts) {
        check(drafts, &mut faults);
    }
    // For a commit of nothing but repeated DAGs the faults are already reported.
    if specs.is_empty() && !faults.is_empty() {
        let warnings = Vec::new();
        return Err(CommitError { faults, warnings });
    }
    // Also after faults of this crate, so that the app learns of all faults at once.
    match sched_dag::verify(&specs, &options) {
        Ok(verified) if faults.is_empty() => Ok(verified),
        Ok(VerifiedDags { warnings, .. }) => Err(CommitError { faults, warnings }),
        Err(rejected) => {
            let (mut news, warnings) = rejected.into_parts();
            news.retain(|fault| !is_consequence(fault, &faults));
            faults.extend(news.into_iter().map(Fault::Model));
            Err(CommitError { faults, warnings })
        }
    }
}

/// Reports whether a fault of the model only repeats a fault of this crate: a period or a deadline
/// is missing because the stated duration was too long.
fn is_consequence(fault: &sched_dag::DagFault, ours: &[Fault]) -> bool {
    let (label, missing) = match fault {
        sched_dag::DagFault::MissingPeriod { dag } => (dag, "period"),
        sched_dag::DagFault::MissingDeadline { dag } => (dag, "relative deadline"),
        _ => return false,
    };
    ours.iter().any(|fault| {
        matches!(fault, Fault::DurationTooLong { dag, what, .. } if dag == label && *what == missing)
    })
}

/// Divides a platform's cores for a task set, like [`sched_dag::analysis::assign()`]. The error
/// names the DAG without cores, and the reason.
fn assign_clusters(task_set: &mut TaskSet, terms: &RunConfig) -> Result<(), LaunchError> {
    analysis::assign(task_set, &terms.settings()).map_err(
        |NotAssigned {
             dag,
             reason,
             attempts,
         }| {
            let dag = task_set.label(dag);
            let mut text = format!("{dag} gets no cores: {reason}");
            for (number, (dag, why)) in (0..).zip(attempts.into_iter().flatten()) {
                text += &format!("; attempt {number}: {why}");
                if let Some(dag) = dag {
                    text += &format!(" ({})", task_set.label(dag));
                }
            }
            LaunchError::new(text)
        },
    )
}
