//! Registering subtasks that wait: functions that are async.
//!
//! An async function has tuples like any other function. Between its inputs and its outputs it may
//! await the waits offered by `fass`: [`sleep`](crate::sleep()), [`until`](crate::until()) an
//! instant of its job, the answer of a [device](crate::shared::Device), bytes of a
//! [wire](crate::shared::Wire::reading). A waiting instance has no core and no stack. The subtask
//! declares the number of its waits and a limit for each ([`SubtaskAttributes::wait`]), so the
//! response time can be bounded, whatever a device does.
//!
//! # Guarantees
//!
//! - Each job calls the function once, unless the job is cut before, or a replay takes recorded
//!   results instead. Its future is polled once per turn: at the start of the instance, and after
//!   the end of each wait.
//! - No outputs, latest values or signals of an instance are visible before the function has
//!   returned (R3). Only questions and written bytes leave earlier, each when its wait has begun.
//! - A wait ends at its limit, even without an answer. Only declared waits are possible: see
//!   [`WaitFault`](crate::WaitFault).
//! - If a job is aborted, or lost by a fault, while it waits, its future is dropped, by the
//!   subtask's next instance or with the subtask.
//! - After the commit nothing is allocated for an async function.
//!
//! # Limits
//!
//! - A function that can be replaced after a fault ([`Dag::restarting`]) cannot wait.
//! - An async function has no [`State`](crate::shared::State), since a state is lent for the time
//!   of a call.

use alloc::rc::Rc;
use core::fmt;
use core::time::Duration;

use super::dag::Dag;
use super::subtask::{Subtask, UntypedSubtask};
use super::topics::{self, Topics};
use super::uses::{SubtaskBuilder, Uses};
use crate::draft::{NamedTopics, SubtaskAttributes};
use crate::run::tuple::{VecToPubs, VecToSubs};
use crate::run::waiting::{defer, defer_untyped};

/// The error of a wait whose device has not answered within the limit, or whose written bytes found
/// no room.
///
/// ```
/// assert_eq!(fass::shared::TimedOut.to_string(), "the device has not answered in time");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TimedOut;

impl fmt::Display for TimedOut {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the device has not answered in time")
    }
}

impl core::error::Error for TimedOut {}

impl Dag {
    /// Registers a source whose function is async; otherwise like
    /// [`register_periodic_subtask`](Self::register_periodic_subtask).
    ///
    /// See [`sleep`](crate::sleep()).
    #[track_caller]
    pub fn register_periodic_async_subtask<F, Fut, Ret>(
        &self,
        f: F,
        output_topics: impl Topics,
        period: Duration,
        attributes: SubtaskAttributes,
    ) where
        F: FnMut() -> Fut + Send + 'static,
        Fut: Future<Output = Ret> + Send + 'static,
        Ret: VecToPubs,
    {
        let source = self
            .async_source(f)
            .writes(topics::of_outputs::<Ret, _>(&output_topics));
        let subtask = source.register_labelled(attributes);
        self.open().set_period(period, subtask);
    }

    /// Registers a subtask whose function is async and may wait as declared in its attributes;
    /// otherwise like [`register_subtask`](Self::register_subtask).
    ///
    /// ```
    /// use core::time::Duration;
    /// use fass::{SubtaskAttributes, create_dag, finish_create_dags, sleep};
    ///
    /// let machine = virtual_time::VirtualTime::new();
    /// let ms = Duration::from_millis;
    /// let (dag, named) = (create_dag(), SubtaskAttributes::named);
    /// dag.name("settle").jobs(1);
    /// dag.register_periodic_subtask(|| (7,), ["angle"], ms(20), named("turn").wcet(ms(1)));
    /// dag.register_async_subtask(
    ///     move |(angle,): (i32,)| async move {
    ///         sleep(ms(3)).await; // until it has settled
    ///         (angle * 2,)
    ///     },
    ///     ["angle"],
    ///     ["position"],
    ///     named("settle").wcet(ms(1)).wait(ms(4)).wcet(ms(2)),
    /// );
    /// let show = |(position,): (i32,)| assert_eq!(position, 14);
    /// dag.register_sink_subtask(show, ["position"], ms(20), named("show").wcet(ms(1)));
    /// finish_create_dags(&[dag]).unwrap();
    /// assert_eq!(machine.run().jobs[0].response_time_ns(), Some(8_000_000));
    /// ```
    #[track_caller]
    pub fn register_async_subtask<F, Args, Fut, Ret>(
        &self,
        f: F,
        input_topics: impl Topics,
        output_topics: impl Topics,
        attributes: SubtaskAttributes,
    ) where
        F: FnMut(Args) -> Fut + Send + 'static,
        Fut: Future<Output = Ret> + Send + 'static,
        Args: VecToSubs,
        Ret: VecToPubs,
    {
        self.async_subtask(f)
            .reads(topics::of_inputs::<Args, _>(&input_topics))
            .writes(topics::of_outputs::<Ret, _>(&output_topics))
            .register(attributes);
    }

    /// Registers a sink whose function is async; otherwise like
    /// [`register_sink_subtask`](Self::register_sink_subtask).
    ///
    /// See [`register_async_subtask`](Self::register_async_subtask).
    #[track_caller]
    pub fn register_sink_async_subtask<F, Args, Fut>(
        &self,
        f: F,
        input_topics: impl Topics,
        relative_deadline: Duration,
        attributes: SubtaskAttributes,
    ) where
        F: FnMut(Args) -> Fut + Send + 'static,
        Fut: Future<Output = ()> + Send + 'static,
        Args: VecToSubs,
    {
        self.async_subtask(f)
            .reads(topics::of_inputs::<Args, _>(&input_topics))
            .due(relative_deadline)
            .register(attributes);
    }

    /// Registers a subtask without types whose function is async; otherwise like
    /// [`register_untyped_subtask`](Self::register_untyped_subtask).
    ///
    /// ```
    /// use core::time::Duration;
    /// use fass::{SubtaskAttributes, create_dag, sleep};
    ///
    /// let nap = |_job| sleep(Duration::ZERO);
    /// let attributes = SubtaskAttributes::named("nap").wait(Duration::ZERO);
    /// create_dag().register_untyped_async_subtask(nap, attributes);
    /// ```
    #[track_caller]
    pub fn register_untyped_async_subtask<F, Fut>(
        &self,
        f: F,
        attributes: SubtaskAttributes,
    ) -> UntypedSubtask
    where
        F: FnMut(u64) -> Fut + Send + 'static,
        Fut: Future<Output = ()> + Send + 'static,
    {
        let ends = NamedTopics::default();
        let subtask = (self.open()).register(defer_untyped(f), ends, attributes);
        UntypedSubtask {
            subtask: subtask.id.index(),
            draft: Rc::clone(&self.draft),
        }
    }

    /// Begins the registration of a source whose function is async; otherwise like
    /// [`source`](Self::source).
    ///
    /// See [`Subtask`] and [`register_async_subtask`](Self::register_async_subtask).
    pub fn async_source<F, Fut, Ret>(&self, mut f: F) -> Subtask<'_>
    where
        F: FnMut() -> Fut + Send + 'static,
        Fut: Future<Output = Ret> + Send + 'static,
        Ret: VecToPubs,
    {
        self.async_subtask(move |()| f())
    }

    /// Begins the registration of a subtask whose function is async; otherwise like
    /// [`subtask`](Self::subtask).
    ///
    /// See [`Subtask`] and [`register_async_subtask`](Self::register_async_subtask).
    pub fn async_subtask<F, Args, Fut, Ret>(&self, f: F) -> Subtask<'_>
    where
        F: FnMut(Args) -> Fut + Send + 'static,
        Fut: Future<Output = Ret> + Send + 'static,
        Args: VecToSubs,
        Ret: VecToPubs,
    {
        Subtask::new::<Args, Ret>(self, move |_, _| defer(f)).noted_by(|_, _| ())
    }
}

/// For uses given to the function, such as a device, rather than lent: the function's future owns
/// them.
impl<'d, U: Uses + 'd> SubtaskBuilder<'d, U> {
    /// Works like [`Dag::async_source`].
    ///
    /// See [`Device`](crate::shared::Device).
    #[track_caller]
    pub fn async_source<Given, F, Fut, Ret>(self, mut f: F) -> Subtask<'d>
    where
        U: for<'a> Uses<Borrowed<'a> = Given>,
        F: FnMut(Given) -> Fut + Send + 'static,
        Fut: Future<Output = Ret> + Send + 'static,
        Ret: VecToPubs,
    {
        self.async_subtask(move |given, ()| f(given))
    }

    /// Works like [`Dag::async_subtask`].
    ///
    /// See [`Device`](crate::shared::Device).
    #[track_caller]
    pub fn async_subtask<Given, F, Args, Fut, Ret>(self, mut f: F) -> Subtask<'d>
    where
        U: for<'a> Uses<Borrowed<'a> = Given>,
        F: FnMut(Given, Args) -> Fut + Send + 'static,
        Fut: Future<Output = Ret> + Send + 'static,
        Args: VecToSubs,
        Ret: VecToPubs,
    {
        let begin = move |dag: &Dag, subtask| {
            let mut held = self.uses.hold(dag, subtask);
            defer(move |args: Args| f(U::borrow(&mut U::enter(&mut held)), args))
        };
        Subtask::new::<Args, Ret>(self.dag, begin).noted_by(|_, _| ())
    }
}
