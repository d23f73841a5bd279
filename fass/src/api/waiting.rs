//! Registering subtasks that wait: functions that are async.
//!
//! Such a function is as any other of its tuples, and may await, between its inputs and its
//! outputs, what `fass` offers: [`sleep`](crate::sleep()), [`until`](crate::until()) an instant of its
//! job, the answer of a [device](crate::shared::Device), bytes of a
//! [wire](crate::shared::Wire::reading). While it waits its instance has no core and
//! no stack. The number of its waits and the limit of each are stated
//! ([`SubtaskAttributes::wait`]), so the response time is bounded, whatever a device does.
//!
//! # What is guaranteed
//!
//! - Each job calls the function once. Its future is polled once a turn: at the start of the
//!   instance, and when a wait has ended.
//! - Nothing is seen of an instance before it has returned (R3): no outputs, latest values, signals.
//! - A wait ends at its limit, also if nobody answers. No wait but a stated one is taken: see
//!   [`WaitFault`](crate::WaitFault).
//! - The future of a job that is aborted, or lost by a fault, while it waits is dropped, by the
//!   subtask's next instance or with the subtask.
//! - After the commit nothing is allocated for it.
//!
//! # What is not
//!
//! - A function that another one replaces after a fault ([`Dag::restarting`]) cannot wait.
//! - A [`State`](crate::shared::State) is for the time of a call, so an async function has none.

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

/// A device has not answered within the limit of the wait.
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
    /// Registers a source as [`register_periodic_subtask`](Self::register_periodic_subtask) does,
    /// whose function is async.
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

    /// Registers a subtask as [`register_subtask`](Self::register_subtask) does, whose function is
    /// async: it may wait as its attributes state.
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

    /// Registers a sink as [`register_sink_subtask`](Self::register_sink_subtask) does, whose
    /// function is async.
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

    /// Registers a subtask as [`register_untyped_subtask`](Self::register_untyped_subtask) does,
    /// whose function is async.
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

    /// Begins the registration of a source as [`source`](Self::source) does, whose function is
    /// async.
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

    /// Begins the registration of a subtask as [`subtask`](Self::subtask) does, whose function is
    /// async.
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

/// For uses that are not borrowed but given, such as that of a device: the function's future has
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
