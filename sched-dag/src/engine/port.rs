//! The two traits between the engine and a platform: what it runs, and what it runs on.

use core::ops::DerefMut;

use crate::ids::{CoreId, Instance};
use crate::journal::{Subject, What};
use crate::lifecycle::{Letters, Request};
use crate::scheduler::Notice;

/// The code of one subtask, as the engine handles it. There is one for each subtask, which has one
/// started instance at a time (R2).
pub trait Body {
    /// A function that would take over after a fault.
    type Alternate: Alternate;

    /// Begins with another job.
    fn set_job(&mut self, job: u64);

    /// Returns its instance as events are written of it.
    fn subject(&self) -> Subject;

    /// Gives up the inputs that have arrived for a job which it will not run.
    fn discard(&mut self, job: u64);

    /// Reports whether a completion has effects besides the scheduler's.
    fn has_effects(&self) -> bool;

    /// Publishes these effects, and passes on what the function asks of the run. The time is that
    /// of the clock which functions read.
    fn complete(&mut self, finish_ns: u64, ask: &mut dyn FnMut(Request));

    /// Returns what takes over if a fault ends the function.
    fn alternate(&self) -> Option<Self::Alternate>;

    /// Makes it go on with that, after a fault.
    fn replace(&mut self);
}

/// A way to a body, such as a box, is one.
impl<D: DerefMut<Target: Body>> Body for D {
    type Alternate = <D::Target as Body>::Alternate;

    #[inline]
    fn set_job(&mut self, job: u64) {
        (**self).set_job(job);
    }

    #[inline]
    fn subject(&self) -> Subject {
        (**self).subject()
    }

    fn discard(&mut self, job: u64) {
        (**self).discard(job);
    }

    #[inline]
    fn has_effects(&self) -> bool {
        (**self).has_effects()
    }

    #[inline]
    fn complete(&mut self, finish_ns: u64, ask: &mut dyn FnMut(Request)) {
        (**self).complete(finish_ns, ask);
    }

    fn alternate(&self) -> Option<Self::Alternate> {
        (**self).alternate()
    }

    fn replace(&mut self) {
        (**self).replace();
    }
}

/// Which function takes over after a fault; it can be asked while the body runs.
pub trait Alternate {
    /// Reports whether there is one at present.
    fn is_there(&self) -> bool;

    /// Reports whether it is the one to fall back on, by which the DAG is degraded.
    fn is_fallback(&self) -> bool;
}

/// One that is made anew each time.
impl Alternate for () {
    fn is_there(&self) -> bool {
        true
    }

    fn is_fallback(&self) -> bool {
        false
    }
}

/// The part of a platform that the engine calls while it takes a step.
///
/// All else a step returns: whoever takes it holds the lock around the engine, and wakes and
/// suspends cores by the platform's own means, mostly after the lock.
pub trait Port<B> {
    /// The kinds of events that the platform acts on itself.
    const HEARS: &'static [What] = &[];

    /// Whether a core gives up what it runs some time after it was asked to.
    const SUSPENDS_LATER: bool = true;

    /// Returns the time, in nanoseconds since the run's epoch.
    fn now_ns(&self) -> u64;

    /// Converts a time of the run to one on the clock that functions read.
    fn on_clock(&self, time_ns: u64) -> u64 {
        time_ns
    }

    /// A core begins with a body as soon as the engine's lock is free. Returns when.
    fn start(&mut self, core: CoreId, body: &mut B) -> u64;

    /// Forwards a request to the other clusters that it concerns, and reports whether it does not
    /// concern this one.
    fn forward(&mut self, request: Request) -> bool {
        let _ = request;
        false
    }

    /// Reports whether there may be letters of other clusters, or from outside.
    fn has_letters(&self) -> bool {
        false
    }

    /// Returns them, if there may be any, and takes note that they are read.
    fn take_letters(&mut self) -> Option<&Letters> {
        None
    }

    /// A core may have to do something else than it does.
    fn retarget(&mut self, core: CoreId) {
        let _ = core;
    }

    /// An event of a kind that it [hears](Self::HEARS) of was written down.
    fn hear(&mut self, notice: &Notice) {
        let _ = notice;
    }
}

/// What a core does after a completion.
#[derive(Debug, PartialEq, Eq)]
#[must_use]
pub enum Continuation<B> {
    /// It runs this at once, and nothing else changes.
    Run(B),
    /// It may have a target; nothing changes for other cores.
    Look {
        /// Whether the time of the next event may have changed.
        is_rescheduled: bool,
    },
    /// A step has to be taken first: one in which this instance completes, or else one that goes
    /// on with the instant in hand.
    Step(Option<Instance>),
}

/// The cost of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cost {
    /// The DAG is ended.
    Dag,
    /// The job is lost, and the subtask goes on with a function that was made anew.
    Job,
    /// The job is lost, and the subtask goes on with the function to fall back on.
    Degraded,
}

impl Cost {
    /// Returns its word in machine lines.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Dag => "dag",
            Self::Job => "job",
            Self::Degraded => "degraded",
        }
    }

    /// Returns the consequence, for people.
    #[must_use]
    pub const fn consequence(self) -> &'static str {
        match self {
            Self::Dag => "the DAG is ended",
            Self::Job => "the job is lost, and the subtask is made anew",
            Self::Degraded => "the job is lost, and the subtask falls back",
        }
    }
}
