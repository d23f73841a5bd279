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
//! by subtask, and a subtask's [`Vertex`] says which instance is meant: its body
//! rests in the table, or is with a core, or lies on the stack of a suspended
//! context.
//!
//! Drivers whose cores follow later share it, under their one lock: the kernel and Linux.

use alloc::boxed::Box;

use crate::ids::{CoreId, Vertex};

/// Where a subtask's body is.
#[derive(Debug)]
enum BodyState<Body, Parked> {
    /// In the table: no instance of the subtask has started.
    Resting(Body),
    /// With the core whose current instance it is.
    Running,
    /// In the table: its instance waits, or is in line again, and needs no context.
    Waiting(Body),
    /// On the stack of a context that does not run.
    Suspended(Parked),
    /// Not here: its instance was ended, or another scheduler has it.
    Lost,
}

/// The next work of a core without a current instance.
#[derive(Debug, PartialEq, Eq)]
pub enum NextWork<Body, Parked> {
    /// Nothing is there for it to do.
    Nothing,
    /// It starts an instance of this subtask.
    Start(Vertex, Body),
    /// It goes on with the instance of this subtask, whose wait has ended.
    Proceed(Vertex, Body),
    /// It goes on with this context.
    Continue(Parked),
}

/// The places of all subtasks, and what each core has and should have.
#[derive(Debug)]
pub struct Placement<Body, Parked> {
    places: Box<[BodyState<Body, Parked>]>,
    seats: Box<[CoreSlot]>,
}

/// The vertex that one core has, and the one that it should have: [`NOTHING`], or a vertex.
///
/// Not options, which would be two words each: a seat changes twice with each
/// instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct CoreSlot {
    current: Vertex,
    target: Vertex,
}

/// Stands where there is no vertex; no task set has that many subtasks.
const NOTHING: Vertex = Vertex(u32::MAX);

const EMPTY_SEAT: CoreSlot = CoreSlot {
    current: NOTHING,
    target: NOTHING,
};

fn some(vertex: Vertex) -> Option<Vertex> {
    (vertex != NOTHING).then_some(vertex)
}

impl<Body, Parked> Placement<Body, Parked> {
    /// Makes the places of so many vertices, all without a body until one
    /// [is put there](Self::replace).
    pub fn empty(vertices: usize, cores: usize) -> Self {
        Self {
            places: (0..vertices).map(|_| BodyState::Lost).collect(),
            seats: alloc::vec![EMPTY_SEAT; cores].into_boxed_slice(),
        }
    }

    /// Notes what the scheduler wants a core to run.
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

    /// Notes that an instance waits, which was the current one of core `core` or has been parked.
    pub fn wait(&mut self, core: usize, vertex: Vertex, body: Body) {
        if self.seats[core].current == vertex {
            self.seats[core].current = NOTHING;
        }
        *self.body_state(vertex) = BodyState::Waiting(body);
        self.forget_target(core, vertex);
    }

    /// Notes that the instance which waits, if the subtask has one, was cancelled.
    pub fn cancel_wait(&mut self, vertex: Vertex) {
        let place = self.body_state(vertex);
        if let BodyState::Waiting(_) = place
            && let BodyState::Waiting(body) = core::mem::replace(place, BodyState::Lost)
        {
            *place = BodyState::Resting(body);
        }
    }

    /// Puts the body of an instance that has run to rest.
    #[inline]
    fn put(&mut self, vertex: Vertex, body: Body) {
        let running = core::mem::replace(self.body_state(vertex), BodyState::Resting(body));
        debug_assert!(matches!(running, BodyState::Running));
        // `Running` holds nothing: this skips the check whether there is something to drop.
        core::mem::forget(running);
    }

    /// Notes that core `core`'s current instance was ended, and returns its
    /// vertex. Its body stays on the stack of a context that is never resumed.
    pub fn lose(&mut self, core: usize) -> Option<Vertex> {
        let vertex = self.detach(core)?;
        *self.body_state(vertex) = BodyState::Lost;
        self.forget_target(core, vertex);
        Some(vertex)
    }

    /// Puts a body to rest where there is none: in the place of one that was
    /// [lost](Self::lose), or at first.
    pub fn replace(&mut self, vertex: Vertex, body: Body) {
        *self.body_state(vertex) = BodyState::Resting(body);
    }

    /// Takes the body of a subtask out, if no instance of it has started.
    pub fn take(&mut self, vertex: Vertex) -> Option<Body> {
        let place = self.body_state(vertex);
        match core::mem::replace(place, BodyState::Lost) {
            BodyState::Resting(body) => Some(body),
            // The place was emptied to look into it, and gets back what it had.
            other => {
                *place = other;
                None
            }
        }
    }

    /// Takes note that an instance has finished that no core has: on a driver where a
    /// parked one may still be executed.
    pub fn finish_parked(&mut self, vertex: Vertex, body: Body) {
        *self.body_state(vertex) = BodyState::Resting(body);
        self.forget_target(0, vertex);
    }

    /// Takes note that such an instance was ended, and its body stays on a stack that goes on with
    /// nothing.
    pub fn lose_parked(&mut self, vertex: Vertex) {
        *self.body_state(vertex) = BodyState::Lost;
        self.forget_target(0, vertex);
    }

    /// The scheduler knows that the instance has ended: nobody is to run it.
    fn forget_target(&mut self, core: usize, vertex: Vertex) {
        let wants_it = |seat: &CoreSlot| seat.target == vertex;
        // Nearly always the core that ran it; another one if it was about to move.
        let seat = match wants_it(&self.seats[core]) {
            true => Some(&mut self.seats[core]),
            false => self.seats.iter_mut().find(|seat| wants_it(seat)),
        };
        if let Some(seat) = seat {
            seat.target = NOTHING;
        }
    }

    /// Reports whether core `core` has an instance that it should give up.
    pub fn must_suspend(&self, core: usize) -> bool {
        let CoreSlot { current, target } = self.seats[core];
        current != NOTHING && current != target
    }

    /// Reports whether core `core` has nothing and should have something.
    pub fn is_wanted(&self, core: usize) -> bool {
        let CoreSlot { current, target } = self.seats[core];
        current == NOTHING && target != NOTHING
    }

    /// Takes core `core`'s current instance away from it, if it has one. To be
    /// followed by [`suspend`](Self::suspend), as soon as its context is known.
    pub fn detach(&mut self, core: usize) -> Option<Vertex> {
        some(core::mem::replace(&mut self.seats[core].current, NOTHING))
    }

    /// Notes that `context` holds a detached instance. Returns the core
    /// that has been waiting for it, if there is one.
    pub fn suspend(&mut self, vertex: Vertex, context: Parked) -> Option<CoreId> {
        *self.body_state(vertex) = BodyState::Suspended(context);
        let mut seats = (0..).map(CoreId).zip(&self.seats);
        // The scheduler may have given it to another core before its context was known.
        seats.find_map(|(core, seat)| (seat.target == vertex).then_some(core))
    }

    /// Gives core `core`, which has no current instance, what it should have, if
    /// that is suspended.
    pub fn take_suspended(&mut self, core: usize) -> Option<Parked> {
        let vertex = some(self.seats[core].target)?;
        let place = self.body_state(vertex);
        match core::mem::replace(place, BodyState::Running) {
            // Only if that has arrived: the core that it left may still be saving its registers.
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

    /// Gives core `core`, which has no current instance, what it should have.
    pub fn next(&mut self, core: usize) -> NextWork<Body, Parked> {
        let Some(vertex) = some(self.seats[core].target) else {
            return NextWork::Nothing;
        };
        let place = self.body_state(vertex);
        let next = match core::mem::replace(place, BodyState::Running) {
            BodyState::Resting(body) => NextWork::Start(vertex, body),
            BodyState::Waiting(body) => NextWork::Proceed(vertex, body),
            BodyState::Suspended(context) => NextWork::Continue(context),
            // The core that still has it will say when it no longer has.
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

    /// Gives a core, which has no current instance, one of this subtask to
    /// start. `None`, and nothing is changed, if it is suspended.
    #[inline]
    pub fn start(&mut self, core: CoreId, vertex: Vertex) -> Option<Body> {
        let place = self.body_state(vertex);
        match core::mem::replace(place, BodyState::Running) {
            BodyState::Resting(body) => {
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

    /// Notes that a core has finished its current instance, which was its target, and
    /// should have one of subtask `next`; gives it that to start. `None` if that is
    /// suspended: then the core has nothing yet.
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
        // The next instance is suspended, and its context may not be here yet: the core looks for
        // it as any other.
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

    /// Returns the body of a subtask of which no instance has started.
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
