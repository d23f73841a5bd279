//! DAGs that leave a run: rules A5 and A6 of `sched-dag/src/scheduler/adding.rs`, on the machine.
//!
//! A removed DAG is closed. Core 0's background looks now and then whether it is over; then its
//! bodies are taken out under the cluster's lock and dropped outside of it, with what its functions
//! hold, its rings and its values. The stacks that it might have needed are there for the next
//! DAG. Its number stays, with its counters and its statistics.

use alloc::vec::Vec;

use fass::LaunchError;
use sched_dag::{ClusterId, DagId, Instance, SubtaskId, TaskSet};

use super::control::{Control, control};
use super::present::Present;
use super::{Execution, cluster};
use crate::machine::interrupt_flag;
use crate::machine::spinlock::SpinLock;

/// What has become of a DAG's removal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Removal {
    /// It was not asked for.
    #[default]
    None,
    /// It was asked for.
    Asked,
    /// Its bodies are gone; it still counts in proofs.
    Left,
    /// What it may have delayed is over.
    Forgotten,
}

/// The removals from the run, by DAG; those that are missing are not asked for.
static REMOVALS: SpinLock<Vec<Removal>> = SpinLock::new(Vec::new());

/// Closes a DAG of the run of a plan, and has its bodies given back when it is over.
pub fn remove(plan: u64, dag: DagId) -> Result<(), LaunchError> {
    Present::of(plan)?;
    if of(dag) != Removal::None {
        return Ok(());
    }
    set(dag, Removal::Asked);
    // The timer is set without a lock.
    let were_enabled = interrupt_flag::disable();
    control(Control::Close(dag));
    if were_enabled {
        interrupt_flag::enable();
    }
    let_go();
    Ok(())
}

/// Reports whether a DAG counts in a proof that is made now (A6).
pub fn counts(dag: DagId) -> bool {
    let_go();
    of(dag) != Removal::Forgotten
}

/// Reports whether a DAG's bodies are gone.
pub(super) fn has_left(dag: DagId) -> bool {
    matches!(of(dag), Removal::Left | Removal::Forgotten)
}

/// Reports whether the run is being shut down: nothing else closes a DAG but a removal, and the
/// fault that ends it.
pub(super) fn is_shut_down(task_set: &TaskSet) -> bool {
    let place = cluster::nth(0).execution.lock();
    let Some(scheduler) = place.as_ref().map(|execution| &execution.scheduler) else {
        return false;
    };
    let mut others =
        (task_set.ids()).filter(|dag| of(*dag) == Removal::None && !scheduler.is_ended(*dag));
    others.any(|dag| scheduler.is_closed(dag))
}

/// Drops the bodies of removed DAGs of a run that are over (A5), and forgets DAGs of which nothing
/// is left behind (A6). In core 0's background, as what is dropped is the app's.
pub fn let_go() {
    let mut next = DagId(0);
    while let Some((dag, removal)) = next_leaving(next) {
        next = DagId(dag.0 + 1);
        let has_left = removal == Removal::Left || leave(dag);
        if has_left {
            let is_idle = look(|execution| execution.scheduler.is_idle(ClusterId(0)));
            let removal = match is_idle {
                Some(true) => Removal::Forgotten,
                _ => Removal::Left,
            };
            set(dag, removal);
        }
    }
}

/// Gives back the bodies of a DAG, if it is over, and reports whether none is left.
fn leave(dag: DagId) -> bool {
    let subtasks = look(|execution| {
        let is_over = execution.scheduler.is_over(dag);
        is_over.then(|| execution.task_set().dag(dag).subtasks().len())
    });
    let Some(subtasks) = subtasks.flatten() else {
        return false;
    };
    let (mut bodies, mut others) = (Vec::with_capacity(subtasks), Vec::with_capacity(subtasks));
    let is_started = look(|execution| {
        let mut is_started = false;
        for subtask in (0..).map(SubtaskId).take(subtasks) {
            let any = Instance {
                dag,
                job: 0,
                subtask,
            };
            let vertex = execution.task_set().vertex(any);
            let watcher = &mut execution.watcher;
            bodies.extend(watcher.placement.take_resting(vertex));
            others.push(core::mem::take(&mut watcher.others[vertex.index()]));
            // Of a DAG that a fault has ended, others may go on.
            is_started |= watcher.placement.is_started(vertex);
        }
        is_started
    });
    is_started == Some(false)
}

/// Looks at the run, or changes it, under its lock.
fn look<R>(with: impl FnOnce(&mut Execution) -> R) -> Option<R> {
    cluster::nth(0).execution.lock().as_mut().map(with)
}

/// Returns the first DAG from one on that is leaving, and how far that has come.
fn next_leaving(from: DagId) -> Option<(DagId, Removal)> {
    let removals = REMOVALS.lock();
    let mut leaving = (from.0..)
        .map(DagId)
        .zip(removals.get(from.index()..)?.iter());
    let is_leaving = |removal: &Removal| matches!(removal, Removal::Asked | Removal::Left);
    let found = leaving.find(|(_, removal)| is_leaving(removal));
    found.map(|(dag, removal)| (dag, *removal))
}

fn of(dag: DagId) -> Removal {
    let removals = REMOVALS.lock();
    removals.get(dag.index()).copied().unwrap_or_default()
}

fn set(dag: DagId, removal: Removal) {
    let mut removals = REMOVALS.lock();
    if removals.len() <= dag.index() {
        removals.resize(dag.index() + 1, Removal::None);
    }
    removals[dag.index()] = removal;
}

/// Ends the removals with their run.
pub fn forget() {
    let removals = core::mem::take(&mut *REMOVALS.lock());
    drop(removals);
}
