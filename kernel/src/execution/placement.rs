//! Where instances really are, and where the scheduler wants them.
//!
//! The scheduler decides at one instant what each core runs: its *target*. The
//! cores follow a little later, when their interrupt arrives: what a core has
//! with it is its *current* instance. In between, anything may happen: the
//! current instance finishes before it could be preempted; it is wanted on
//! another core before it has left this one; the target changes again. So each
//! core compares the two whenever it can, and the one truth about an instance is
//! its *place*.
//!
//! A subtask has at most one started instance at a time (R2), so places are kept
//! by subtask: its body rests in the table, or is with a core, or lies on the
//! stack of a suspended context.
//!
//! Everything here runs under the execution's lock; it is generic over bodies
//! and contexts so that the tests run on the host.

use alloc::vec::Vec;

use sched_dag::{CoreId, Decision, Instance};

/// Where a subtask's body is.
#[derive(Debug)]
enum Place<Body, Parked> {
    /// In the table: no instance of the subtask has started.
    Resting(Body),
    /// With the core whose current instance it is.
    Running,
    /// On the stack of a context that does not run.
    Suspended(Parked),
    /// Nowhere any more: its instance was ended.
    Lost,
}

/// What a core without a current instance does next.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Next<Body, Parked> {
    /// Nothing is there for it to do.
    Nothing,
    /// It starts this instance.
    Start(Instance, Body),
    /// It goes on with this context.
    Continue(Parked),
}

/// The places of all subtasks, and what each core has and should have.
#[derive(Debug)]
pub(super) struct Placement<Body, Parked> {
    places: Vec<Vec<Place<Body, Parked>>>,
    targets: Vec<Option<Instance>>,
    currents: Vec<Option<Instance>>,
}

impl<Body, Parked> Placement<Body, Parked> {
    /// Puts all bodies to rest.
    pub(super) fn new(bodies: Vec<Vec<Body>>, cores: usize) -> Self {
        let rest = |bodies: Vec<Body>| bodies.into_iter().map(Place::Resting).collect();
        Self {
            places: bodies.into_iter().map(rest).collect(),
            targets: alloc::vec![None; cores],
            currents: alloc::vec![None; cores],
        }
    }

    /// Takes note of a decision of the scheduler.
    pub(super) fn decide(&mut self, decision: Decision) {
        self.targets[decision.core().index()] = match decision {
            Decision::Start { instance, .. } | Decision::Resume { instance, .. } => Some(instance),
            Decision::Preempt { .. } => None,
        };
    }

    /// Takes note that core `core` has finished its current instance.
    pub(super) fn finish(&mut self, core: usize, instance: Instance, body: Body) {
        self.currents[core] = None;
        *self.place(instance) = Place::Resting(body);
        self.forget_target(core, instance);
    }

    /// Takes note that core `core`'s current instance was ended, and returns it.
    /// Its body stays on the stack of a context that is never resumed.
    pub(super) fn lose(&mut self, core: usize) -> Option<Instance> {
        let instance = self.currents[core].take()?;
        *self.place(instance) = Place::Lost;
        self.forget_target(core, instance);
        Some(instance)
    }

    /// The scheduler knows that `instance` has ended: nobody is to run it.
    fn forget_target(&mut self, core: usize, instance: Instance) {
        let wants_it = |target: &Option<Instance>| *target == Some(instance);
        // Nearly always the core that ran it; another one if it was about to move.
        let place = match wants_it(&self.targets[core]) {
            true => Some(&mut self.targets[core]),
            false => self.targets.iter_mut().find(|target| wants_it(target)),
        };
        if let Some(target) = place {
            *target = None;
        }
    }

    /// Reports whether core `core` has an instance that it should give up.
    pub(super) fn must_suspend(&self, core: usize) -> bool {
        self.currents[core].is_some() && self.currents[core] != self.targets[core]
    }

    /// Reports whether core `core` has nothing and should have something.
    pub(super) fn is_wanted(&self, core: usize) -> bool {
        self.currents[core].is_none() && self.targets[core].is_some()
    }

    /// Takes core `core`'s current instance away from it, if it has one. To be
    /// followed by [`suspend`](Self::suspend), as soon as its context is known.
    pub(super) fn detach(&mut self, core: usize) -> Option<Instance> {
        self.currents[core].take()
    }

    /// Takes note that `context` holds a detached instance. Returns the core
    /// that has been waiting for it, if there is one.
    pub(super) fn suspend(&mut self, instance: Instance, context: Parked) -> Option<CoreId> {
        *self.place(instance) = Place::Suspended(context);
        let waits = |target: &Option<Instance>| *target == Some(instance);
        (0..)
            .map(CoreId)
            .zip(&self.targets)
            .find_map(|(core, target)| waits(target).then_some(core))
    }

    /// Gives core `core`, which has no current instance, what it should have, if
    /// that is suspended.
    pub(super) fn take_suspended(&mut self, core: usize) -> Option<Parked> {
        let instance = self.targets[core]?;
        let place = self.place(instance);
        match core::mem::replace(place, Place::Running) {
            Place::Suspended(context) => {
                self.currents[core] = Some(instance);
                Some(context)
            }
            other => {
                *place = other;
                None
            }
        }
    }

    /// Gives core `core`, which has no current instance, what it should have.
    pub(super) fn next(&mut self, core: usize) -> Next<Body, Parked> {
        let Some(instance) = self.targets[core] else {
            return Next::Nothing;
        };
        let place = self.place(instance);
        let next = match core::mem::replace(place, Place::Running) {
            Place::Resting(body) => Next::Start(instance, body),
            Place::Suspended(context) => Next::Continue(context),
            // The core that still has it will say when it no longer has.
            Place::Running => return Next::Nothing,
            Place::Lost => {
                *place = Place::Lost;
                return Next::Nothing;
            }
        };
        self.currents[core] = Some(instance);
        next
    }

    /// Returns core `core`'s current instance.
    pub(super) fn current(&self, core: usize) -> Option<Instance> {
        self.currents[core]
    }

    /// Returns the body of a subtask of which no instance has started.
    pub(super) fn resting(&mut self, instance: Instance) -> Option<&mut Body> {
        match self.place(instance) {
            Place::Resting(body) => Some(body),
            _ => None,
        }
    }

    fn place(&mut self, instance: Instance) -> &mut Place<Body, Parked> {
        &mut self.places[instance.dag.index()][instance.subtask.index()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sched_dag::{DagId, SubtaskId};

    type Cores = Placement<char, &'static str>;

    const X: Instance = Instance {
        dag: DagId(0),
        job: 3,
        subtask: SubtaskId(0),
    };
    const Y: Instance = Instance {
        dag: DagId(0),
        job: 2,
        subtask: SubtaskId(1),
    };

    fn start(core: u32, instance: Instance) -> Decision {
        Decision::Start {
            core: CoreId(core),
            instance,
        }
    }

    fn resume(core: u32, instance: Instance) -> Decision {
        Decision::Resume {
            core: CoreId(core),
            instance,
        }
    }

    fn preempt(core: u32, instance: Instance) -> Decision {
        Decision::Preempt {
            core: CoreId(core),
            instance,
        }
    }

    /// Two cores; core 0 runs `X`, and the scheduler wants `Y` there instead.
    fn about_to_preempt() -> Cores {
        let mut cores = Cores::new(vec![vec!['x', 'y']], 2);
        cores.decide(start(0, X));
        assert_eq!(cores.next(0), Next::Start(X, 'x'));
        assert!(!cores.must_suspend(0));
        cores.decide(preempt(0, X));
        cores.decide(start(0, Y));
        assert!(cores.must_suspend(0));
        cores
    }

    /// Core 0 leaves what it has.
    fn suspend(cores: &mut Cores, context: &'static str) -> Option<CoreId> {
        let instance = cores.detach(0).unwrap();
        assert_eq!(cores.take_suspended(0), None);
        cores.suspend(instance, context)
    }

    #[test]
    fn a_preempted_instance_continues_on_any_core() {
        let mut cores = about_to_preempt();
        assert_eq!(suspend(&mut cores, "context of x"), None);
        assert_eq!(cores.next(0), Next::Start(Y, 'y'));
        cores.decide(resume(1, X));
        assert!(cores.is_wanted(1));
        assert_eq!(cores.next(1), Next::Continue("context of x"));
        cores.finish(1, X, 'x');
        assert_eq!(cores.next(1), Next::Nothing);
        assert_eq!(cores.current(0), Some(Y));
    }

    #[test]
    fn an_instance_that_finishes_before_its_preemption_makes_way() {
        let mut cores = about_to_preempt();
        cores.finish(0, X, 'x');
        assert!(!cores.must_suspend(0));
        assert_eq!(cores.next(0), Next::Start(Y, 'y'));
    }

    #[test]
    fn a_core_waits_for_an_instance_that_another_still_has() {
        let mut cores = about_to_preempt();
        cores.decide(resume(1, X));
        assert_eq!(cores.next(1), Next::Nothing);
        assert_eq!(suspend(&mut cores, "context of x"), Some(CoreId(1)));
        assert_eq!(cores.next(1), Next::Continue("context of x"));
    }

    #[test]
    fn an_instance_wanted_elsewhere_may_finish_where_it_is() {
        let mut cores = about_to_preempt();
        cores.decide(resume(1, X));
        cores.finish(0, X, 'x');
        assert_eq!(cores.next(1), Next::Nothing);
        assert_eq!(cores.next(0), Next::Start(Y, 'y'));
    }

    #[test]
    fn a_preemption_that_is_taken_back_changes_nothing() {
        let mut cores = about_to_preempt();
        cores.decide(preempt(0, Y));
        cores.decide(resume(0, X));
        assert!(!cores.must_suspend(0));
        cores.decide(resume(1, Y));
        assert_eq!(cores.next(1), Next::Start(Y, 'y'));
    }

    #[test]
    fn a_lost_instance_is_never_run_again() {
        let mut cores = about_to_preempt();
        assert_eq!(cores.lose(0), Some(X));
        cores.decide(resume(1, X));
        assert_eq!(cores.next(1), Next::Nothing);
        assert!(cores.resting(X).is_none());
        assert_eq!(cores.next(0), Next::Start(Y, 'y'));
    }
}
