//! The traits of the paper's figure 4, for tuples of 0 to 16 messages.
//!
//! A subtask is a function from a tuple of messages to a tuple of messages. From the tuple types
//! the system generates everything else: from the arguments' tuple the subscribers ([`VecToSubs`]),
//! which receive the arguments ([`MulRecv`]), and from the results' tuple the publishers
//! ([`VecToPubs`]), which send the results ([`MulSend`]). The names are the paper's. Two things
//! differ from its figure:
//!
//! - `recv_all` and `send_all` return `impl Future + Send` where the figure returns a boxed future,
//!   so no job allocates.
//! - Both take `&mut self` where the figure takes `&self`: the borrow checker then guarantees a
//!   single user at a time for each end of an edge, and the end needs no lock.
//!
//! One macro, `for_each_arity`, counts from 0 to 16 and implements all four traits for each arity.
//! Apps never call these traits. They meet them in the bounds of
//! [`Dag::register_subtask`](crate::Dag::register_subtask) and in the compiler's messages, which
//! use the words of this crate. The futures exist only inside a
//! [`SubtaskCode`](crate::platform::SubtaskCode).

use alloc::vec::Vec;
use core::future::ready;
use core::pin::Pin;
use core::task::{Context, Poll};

use super::message::{Message, MessageType};
use super::topic::{Ports, Publisher, Subscriber};

mod sealed {
    /// Keeps the traits to this crate: granting and discarding happen only in the scheduler's
    /// steps.
    pub trait Sealed {}

    impl<Ends> Sealed for super::Subscribers<Ends> {}
    impl<Ends> Sealed for super::Publishers<Ends> {}
}

/// Receives all inputs of an instance at once.
///
/// # Examples
///
/// ```
/// fn items_of<R: fass::MulRecv>() -> &'static str {
///     std::any::type_name::<R::Items>()
/// }
/// type Subs = <(i32, u8) as fass::VecToSubs>::Subs;
/// assert_eq!(items_of::<Subs>(), "(i32, u8)");
/// ```
#[diagnostic::on_unimplemented(
    message = "`{Self}` does not receive a subtask's inputs",
    note = "the receivers are generated from the argument tuple: `<Args as VecToSubs>::Subs`"
)]
pub trait MulRecv: sealed::Sealed {
    /// The tuple of one job's inputs.
    type Items;

    /// Waits until the platform grants an instance, then returns its inputs, all of one job.
    ///
    /// # Panics
    ///
    /// When polled, if an input is missing: the platform granted an instance whose predecessors
    /// were not complete.
    fn recv_all(&mut self) -> impl Future<Output = Self::Items> + Send;

    /// Grants an instance: the next `recv_all` returns the inputs of `job`, once.
    fn grant(&mut self, job: u64);

    /// Gives up the arrived inputs of `job`, which no instance will take. Runs no code of the app
    /// and waits for nothing.
    fn discard_all(&mut self, job: u64);
}

/// Sends all outputs of an instance at once; never blocks.
///
/// # Examples
///
/// ```
/// fn items_of<S: fass::MulSend>() -> &'static str {
///     std::any::type_name::<S::Items>()
/// }
/// type Pubs = <(i32, u8) as fass::VecToPubs>::Pubs;
/// assert_eq!(items_of::<Pubs>(), "(i32, u8)");
/// ```
#[diagnostic::on_unimplemented(
    message = "`{Self}` does not send a subtask's outputs",
    note = "the senders are generated from the result tuple: `<Ret as VecToPubs>::Pubs`"
)]
pub trait MulSend: sealed::Sealed {
    /// The tuple of one job's outputs.
    type Items;

    /// Puts each item into its topic for the instance's job and ends the instance, at once: the
    /// future has nothing left to do.
    ///
    /// # Panics
    ///
    /// If no slot is free: the platform did not discard the inputs of a cancelled instance.
    fn send_all(&mut self, items: Self::Items) -> impl Future<Output = ()> + Send;

    /// Grants an instance: the next `send_all` sends outputs of `job`.
    fn grant(&mut self, job: u64);
}

/// An argument tuple. A subtask's subscribers are generated from it.
///
/// Implemented for tuples of 0 to 16 [`Message`]s. `()` is the argument of a source, whose function
/// takes no argument at all.
///
/// # Examples
///
/// ```
/// use fass::VecToSubs;
///
/// assert_eq!(<(i32, String)>::input_types().len(), 2);
/// ```
///
/// The compiler refuses an argument other than a tuple:
///
/// ```compile_fail,E0277
/// use fass::VecToSubs;
/// let _ = <i32 as VecToSubs>::input_types(); // should be `(i32,)`
/// ```
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not the argument of a subtask",
    label = "should be a tuple of messages, one for each input topic",
    note = "a subtask takes one tuple of at most 16 messages; with one input topic that is `({Self},)`, comma included",
    note = "every message must be `Clone + Send + 'static`, or a `fass::Unique`"
)]
pub trait VecToSubs: sealed::Sealed + Sized + Send + 'static {
    /// The number of elements, equal to the number of input topics.
    const ARITY: usize;

    /// The subscribers, one for each element.
    type Subs: MulRecv<Items = Self> + Send + Sync + 'static;

    /// Returns the types of the elements, in order.
    ///
    /// ```
    /// use fass::VecToSubs;
    /// assert_eq!(<(u8, i32)>::input_types().len(), 2);
    /// ```
    fn input_types() -> Vec<MessageType>;

    /// Generates the subscribers from a subtask's ports. Called by the commit.
    fn gen_subs(ports: Ports<'_>) -> Self::Subs;
}

/// A result tuple. A subtask's publishers are generated from it.
///
/// Implemented for tuples of 0 to 16 [`Message`]s. `()` is the result of a sink.
///
/// # Examples
///
/// ```
/// use fass::VecToPubs;
///
/// assert_eq!(<(i32, String)>::output_types().len(), 2);
/// ```
///
/// The compiler refuses a result other than a tuple:
///
/// ```compile_fail,E0277
/// use core::time::Duration;
/// use fass::{SubtaskAttributes, create_dag};
///
/// create_dag().register_periodic_subtask(
///     || 7, // should be `(7,)`
///     ["number"],
///     Duration::from_millis(10),
///     SubtaskAttributes::default(),
/// );
/// ```
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not the result of a subtask",
    label = "should be a tuple of messages, one for each output topic",
    note = "a subtask returns one tuple of at most 16 messages; with one output topic that is `({Self},)`, comma included",
    note = "every message must be `Clone + Send + 'static`, or a `fass::Unique`"
)]
pub trait VecToPubs: sealed::Sealed + Sized + Send + 'static {
    /// The number of elements, equal to the number of output topics.
    const ARITY: usize;

    /// The publishers, one for each element.
    type Pubs: MulSend<Items = Self> + Send + Sync + 'static;

    /// Returns the types of the elements, in order.
    ///
    /// ```
    /// use fass::VecToPubs;
    /// assert_eq!(<(u8, i32)>::output_types().len(), 2);
    /// ```
    fn output_types() -> Vec<MessageType>;

    /// Generates the publishers from a subtask's ports. Called by the commit.
    fn gen_pubs(ports: Ports<'_>) -> Self::Pubs;
}

/// The subscribers of a subtask: a tuple of [`Subscriber`]s behind the gate.
///
/// See [`MulRecv`].
pub struct Subscribers<Ends> {
    /// The job granted and not yet begun: the *gate* is open for it.
    granted: Option<u64>,
    ends: Ends,
}

/// The publishers of a subtask: a tuple of [`Publisher`]s.
///
/// See [`MulSend`].
pub struct Publishers<Ends> {
    /// The job granted last.
    job: u64,
    ends: Ends,
}

/// The future waiting at the gate, the only place where a subtask's future ever waits, besides the
/// waits of an async function. Arriving values do not open the gate; only a grant does. So an
/// instance cannot begin before the platform declares its predecessors complete (R2), and once
/// begun it reaches its end in the same poll (R3), unless its function waits. Equivalent to
/// `core::future::PollFn`, but compiled into its caller, even where the caller is compiled for
/// size.
struct AtTheGate<F>(F);

impl<T, F: FnMut() -> Poll<T> + Unpin> Future for AtTheGate<F> {
    type Output = T;

    #[inline(always)]
    fn poll(mut self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<T> {
        (self.0)()
    }
}

/// Counts names.
macro_rules! arity {
    () => { 0 };
    ($first:ident $($rest:ident)*) => { 1 + arity!($($rest)*) };
}

/// Implements the four traits for one arity.
macro_rules! implement_arity {
    ($(($Item:ident $item:ident $end:ident))*) => {
        #[allow(
            unused_mut,
            unused_variables,
            clippy::unused_unit,
            reason = "the empty tuple has no ends"
        )]
        const _: () = {
            impl<$($Item: Message),*> MulRecv for Subscribers<($(Subscriber<$Item>,)*)> {
                type Items = ($($Item,)*);

                #[inline]
                fn recv_all(&mut self) -> impl Future<Output = Self::Items> + Send {
                    AtTheGate(move || {
                        let ($($end,)*) = &mut self.ends;
                        match self.granted.take() {
                            Some(job) => Poll::Ready(($($end.recv(job),)*)),
                            None => Poll::Pending,
                        }
                    })
                }

                #[inline]
                fn grant(&mut self, job: u64) {
                    self.granted = Some(job);
                }

                fn discard_all(&mut self, job: u64) {
                    let ($($end,)*) = &mut self.ends;
                    $($end.discard(job);)*
                }
            }

            impl<$($Item: Message),*> MulSend for Publishers<($(Publisher<$Item>,)*)> {
                type Items = ($($Item,)*);

                #[inline]
                fn send_all(&mut self, items: Self::Items) -> impl Future<Output = ()> + Send {
                    let job = self.job;
                    let ($($item,)*) = items;
                    let ($($end,)*) = &mut self.ends;
                    $($end.send(job, $item);)*
                    ready(())
                }

                #[inline]
                fn grant(&mut self, job: u64) {
                    self.job = job;
                }
            }

            impl<$($Item: Message),*> sealed::Sealed for ($($Item,)*) {}

            impl<$($Item: Message),*> VecToSubs for ($($Item,)*) {
                type Subs = Subscribers<($(Subscriber<$Item>,)*)>;

                const ARITY: usize = arity!($($Item)*);

                fn input_types() -> Vec<MessageType> {
                    Vec::from([$(MessageType::of::<$Item>()),*])
                }

                fn gen_subs(mut ports: Ports<'_>) -> Self::Subs {
                    Subscribers {
                        granted: None,
                        ends: ($(ports.subscriber::<$Item>(),)*),
                    }
                }
            }

            impl<$($Item: Message),*> VecToPubs for ($($Item,)*) {
                type Pubs = Publishers<($(Publisher<$Item>,)*)>;

                const ARITY: usize = arity!($($Item)*);

                fn output_types() -> Vec<MessageType> {
                    Vec::from([$(MessageType::of::<$Item>()),*])
                }

                fn gen_pubs(mut ports: Ports<'_>) -> Self::Pubs {
                    Publishers {
                        job: 0,
                        ends: ($(ports.publisher::<$Item>(),)*),
                    }
                }
            }
        };
    };
}

/// Calls a macro with no element, with the first element, with the first two, and so on up to all
/// of them.
macro_rules! for_each_arity {
    ($implement:ident: $($element:tt)*) => {
        for_each_arity!(@step $implement [] $($element)*);
    };
    (@step $implement:ident [$($taken:tt)*]) => {
        $implement!($($taken)*);
    };
    (@step $implement:ident [$($taken:tt)*] $next:tt $($rest:tt)*) => {
        $implement!($($taken)*);
        for_each_arity!(@step $implement [$($taken)* $next] $($rest)*);
    };
}

for_each_arity!(implement_arity:
    (A a a_end) (B b b_end) (C c c_end) (D d d_end)
    (E e e_end) (F f f_end) (G g g_end) (H h h_end)
    (I i i_end) (J j j_end) (K k k_end) (L l l_end)
    (M m m_end) (N n n_end) (O o o_end) (P p p_end)
);
