//! The actual places of instances, and the scheduler's targets.
//!
//! The scheduler decides at one instant what each core runs: its *target*. The cores of a machine
//! follow a little later, when the request reaches them, in virtual time at once: the instance a
//! core actually has is its *current* instance. In between, anything may happen: the current
//! instance finishes before it could be preempted; another core wants the instance before the first
//! core has given it up; the target changes again. So each core compares target and current
//! instance whenever possible, and only the *place* of an instance is authoritative.
//!
//! A subtask has at most one started instance at a time (R2), so places are kept by subtask, and a
//! subtask's [`Vertex`] identifies the instance. The body rests in the table, or is with a core, or
//! lies on the stack of a suspended context.
//!
//! Drivers whose cores follow later share a cluster's placement, under the lock of that cluster:
//! the kernel and Linux.

use alloc::boxed::Box;

use crate::ids::{CoreId, Vertex};

/// The place of a subtask's body.
#[derive(Debug)]
enum BodyState<Body, Parked> {
    /// In the table: no instance of the subtask has started and not ended.
    Resting(Body),
    /// With the core currently running the body's instance.
    Running,
    /// In the table: the instance waits, or is in line again, and needs no context.
    Waiting(Body),
    /// On the stack of a context not running.
    Suspended(Parked),
    /// Not here: the instance was ended, another scheduler has the body, or none was put there yet.
    Lost,
}

/// The next work of a core without a current instance.
#[derive(Debug, PartialEq, Eq)]
pub enum NextWork<Body, Parked> {
    /// There is nothing for the core to do, at least until another core has given the target up.
    Nothing,
    /// The core starts an instance of a subtask.
    Start(Vertex, Body),
    /// The core goes on with the instance of a subtask, whose wait has ended.
    Proceed(Vertex, Body),
    /// The core goes on with a context.
    Continue(Parked),
}

/// The places of all subtasks, and the current and target instances of each core.
#[derive(Debug)]
pub struct Placement<Body, Parked> {
    places: Box<[BodyState<Body, Parked>]>,
    seats: Box<[CoreSlot]>,
}

/// A core's current and target vertex: [`NOTHING`], or a vertex.
///
/// Options would take two words each, and a seat changes twice with each instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct CoreSlot {
    current: Vertex,
    target: Vertex,
}

/// The mark for no vertex; no task set has so many subtasks.
const NOTHING: Vertex = Vertex(u32::MAX);

const EMPTY_SEAT: CoreSlot = CoreSlot {
    current: NOTHING,
    target: NOTHING,
};

fn some(vertex: Vertex) -> Option<Vertex> {
    (vertex != NOTHING).then_some(vertex)
}

impl<Body, Parked> Placement<Body, Parked> {
    /// Makes the places of so many vertices, all without a body until a body [is put
    /// there](Self::replace).
    pub fn empty(vertices: usize, cores: usize) -> Self {
        Self {
            places: (0..vertices).map(|_| BodyState::Lost).collect(),
            seats: alloc::vec![EMPTY_SEAT; cores].into_boxed_slice(),
        }
    }

    /// Notes the target of a core.
    pub fn set_target(&mut self, core: CoreId, target: Option<Vertex>) {
        self.seats[core.index()].target = target.unwrap_or(NOTHING);
    }

    /// Notes that core `core` has finished its current instance.
    #[inline]
    pub fn finish(&mut self, core: usize, vertex: Vertex, body: Body) {
        self.seats[core].current = NOTHING;
        self.put(vertex, body);
        self.forget_target(core, vertex);
    }

    /// Notes that an instance waits: the current instance of core `core`, or a parked instance.
    pub fn wait(&mut self, core: usize, vertex: Vertex, body: Body) {
        if self.seats[core].current == vertex {
            self.seats[core].current = NOTHING;
        }
        *self.body_state(vertex) = BodyState::Waiting(body);
        self.forget_target(core, vertex);
    }

    /// Notes that the waiting instance, if the subtask has one, was cancelled.
    pub fn cancel_wait(&mut self, vertex: Vertex) {
        let place = self.body_state(vertex);
        if let BodyState::Waiting(_) = place
            && let BodyState::Waiting(body) = core::mem::replace(place, BodyState::Lost)
        {
            *place = BodyState::Resting(body);
        }
    }

    /// Puts the body of an instance back into the table after its run.
    #[inline]
    fn put(&mut self, vertex: Vertex, body: Body) {
        let running = core::mem::replace(self.body_state(vertex), BodyState::Resting(body));
        debug_assert!(matches!(running, BodyState::Running));
        // `Running` holds nothing: `forget` skips the check for something to drop.
        core::mem::forget(running);
    }

    /// Notes that core `core`'s current instance was ended, and returns its vertex. The body stays
    /// on the stack of a context never resumed, unless the caller has taken it back.
    pub fn lose(&mut self, core: usize) -> Option<Vertex> {
        let vertex = self.detach(core)?;
        *self.body_state(vertex) = BodyState::Lost;
        self.forget_target(core, vertex);
        Some(vertex)
    }

    /// Puts a body to rest where there is none: at first, or after the body was [lost](Self::lose).
    pub fn replace(&mut self, vertex: Vertex, body: Body) {
        *self.body_state(vertex) = BodyState::Resting(body);
    }

    /// Takes the body of a subtask out, if it rests: no instance of the subtask has started and not
    /// ended.
    pub fn take(&mut self, vertex: Vertex) -> Option<Body> {
        let place = self.body_state(vertex);
        match core::mem::replace(place, BodyState::Lost) {
            BodyState::Resting(body) => Some(body),
            // The place was emptied for the check, and gets its content back.
            other => {
                *place = other;
                None
            }
        }
    }

    /// Takes note that an instance has finished without a core: for drivers where a parked instance
    /// may still execute.
    pub fn finish_parked(&mut self, vertex: Vertex, body: Body) {
        *self.body_state(vertex) = BodyState::Resting(body);
        // Core 0 is merely looked at first: the core waiting for the instance, if any, is unknown.
        self.forget_target(0, vertex);
    }

    /// Takes note that a parked instance was ended. The body stays on a stack never resumed.
    pub fn lose_parked(&mut self, vertex: Vertex) {
        *self.body_state(vertex) = BodyState::Lost;
        self.forget_target(0, vertex);
    }

    /// Clears the target: the scheduler knows of the end, so no core is to run the instance.
    fn forget_target(&mut self, core: usize, vertex: Vertex) {
        let wants_it = |seat: &CoreSlot| seat.target == vertex;
        // Nearly always the core that ran the instance; another core if the instance was about to
        // move.
        let seat = match wants_it(&self.seats[core]) {
            true => Some(&mut self.seats[core]),
            false => self.seats.iter_mut().find(|seat| wants_it(seat)),
        };
        if let Some(seat) = seat {
            seat.target = NOTHING;
        }
    }

    /// Reports whether core `core` has an instance to give up.
    pub fn must_suspend(&self, core: usize) -> bool {
        let CoreSlot { current, target } = self.seats[core];
        current != NOTHING && current != target
    }

    /// Reports whether core `core` has no current instance, but a target.
    pub fn is_wanted(&self, core: usize) -> bool {
        let CoreSlot { current, target } = self.seats[core];
        current == NOTHING && target != NOTHING
    }

    /// Takes core `core`'s current instance away, if there is one. To be followed by
    /// [`suspend`](Self::suspend), as soon as the context is known.
    pub fn detach(&mut self, core: usize) -> Option<Vertex> {
        some(core::mem::replace(&mut self.seats[core].current, NOTHING))
    }

    /// Notes that `context` holds a detached instance. Returns the core waiting for the instance,
    /// if there is one.
    pub fn suspend(&mut self, vertex: Vertex, context: Parked) -> Option<CoreId> {
        *self.body_state(vertex) = BodyState::Suspended(context);
        let mut seats = (0..).map(CoreId).zip(&self.seats);
        // The scheduler may have given the instance to another core before its context was known.
        seats.find_map(|(core, seat)| (seat.target == vertex).then_some(core))
    }

    /// Gives core `core`, without a current instance, its target if the target is suspended.
    pub fn take_suspended(&mut self, core: usize) -> Option<Parked> {
        let vertex = some(self.seats[core].target)?;
        let place = self.body_state(vertex);
        match core::mem::replace(place, BodyState::Running) {
            // Only if the context has arrived: the core the instance left may still be saving its
            // registers.
            BodyState::Suspended(context) => {
                self.seats[core].current = vertex;
                Some(context)
            }
            other => {
                *place = other;
                None
            }
        }
    }

    /// Gives core `core`, without a current instance, its target.
    pub fn next(&mut self, core: usize) -> NextWork<Body, Parked> {
        let Some(vertex) = some(self.seats[core].target) else {
            return NextWork::Nothing;
        };
        let place = self.body_state(vertex);
        let next = match core::mem::replace(place, BodyState::Running) {
            BodyState::Resting(body) => NextWork::Start(vertex, body),
            BodyState::Waiting(body) => NextWork::Proceed(vertex, body),
            BodyState::Suspended(context) => NextWork::Continue(context),
            // The core still running the instance will report when it has given the instance up.
            BodyState::Running => return NextWork::Nothing,
            // The subtask of an ended DAG: nothing of it is to run.
            BodyState::Lost => {
                *place = BodyState::Lost;
                return NextWork::Nothing;
            }
        };
        self.seats[core].current = vertex;
        next
    }

    /// Gives a core without a current instance an instance of subtask `vertex` to start. Returns
    /// `None`, with nothing changed, if the instance has started before, such as a suspended one.
    #[inline]
    pub fn start(&mut self, core: CoreId, vertex: Vertex) -> Option<Body> {
        let place = self.body_state(vertex);
        match core::mem::replace(place, BodyState::Running) {
            BodyState::Resting(body) => {
                // The target, too, since the short way makes no decision to set it.
                self.seats[core.index()] = CoreSlot {
                    current: vertex,
                    target: vertex,
                };
                Some(body)
            }
            other => {
                *place = other;
                None
            }
        }
    }

    /// Notes that a core has finished the instance it was meant to run, and makes subtask `next`
    /// its target. Returns the body to start. Returns `None` if the next instance has started
    /// before, such as a suspended one: then the core has nothing yet.
    #[inline]
    pub fn exchange(
        &mut self,
        core: CoreId,
        finished: Vertex,
        body: Body,
        next: Vertex,
    ) -> Option<Body> {
        self.put(finished, body);
        let started = self.start(core, next);
        // The next instance has started before. If it is suspended, its context may not be here
        // yet. So the core looks for the instance in the usual way.
        if started.is_none() {
            self.seats[core.index()] = CoreSlot {
                current: NOTHING,
                target: next,
            };
        }
        started
    }

    /// Returns the vertex of core `core`'s current instance.
    pub fn current(&self, core: usize) -> Option<Vertex> {
        some(self.seats[core].current)
    }

    /// Returns the body of a subtask if it rests: no instance has started and not ended, and the
    /// body is not lost.
    pub fn resting(&mut self, vertex: Vertex) -> Option<&mut Body> {
        match self.body_state(vertex) {
            BodyState::Resting(body) => Some(body),
            _ => None,
        }
    }

    fn body_state(&mut self, vertex: Vertex) -> &mut BodyState<Body, Parked> {
        &mut self.places[vertex.index()]
    }
}

#[cfg(test)]
mod tests;
