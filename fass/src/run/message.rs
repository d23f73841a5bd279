//! Messages: values travelling on a topic, to one reader or to several.
//!
//! A *message* is the value carried by a job along a topic. With a single reader the value is
//! moved, never copied. With several readers every reader but the last gets a clone, and the last
//! gets the value itself. The app decides the cost of a clone: an `i32` is copied, an
//! `Arc<PointCloud>` is *shared* (all readers see the same bytes, nothing is copied), a `Vec` is
//! duplicated and so allocates, to be avoided in an app with deadlines.
//!
//! A type that cannot or must not be cloned travels inside [`Unique`]. Such a value is always
//! moved; a second reader of its topic is refused at commit.

use core::any::{TypeId, type_name};
use core::ops::{Deref, DerefMut};

use sched_dag::TopicPort;

/// A value carried by a topic from one subtask to others.
///
/// Every `Clone + Send + 'static` type is a message already, and so is [`Unique<T>`](Unique) for
/// types without `Clone`. There is nothing to implement.
///
/// # Examples
///
/// ```
/// use std::sync::Arc;
///
/// fn is_message<M: fass::Message>() {}
///
/// is_message::<i32>();
/// is_message::<Arc<[f32; 1024]>>(); // shared between readers, not copied
/// is_message::<fass::Unique<std::sync::mpsc::Receiver<u8>>>(); // only moved
/// ```
///
/// The compiler refuses any other type:
///
/// ```compile_fail,E0277
/// struct NotClone;
/// fn is_message<M: fass::Message>() {}
/// is_message::<NotClone>();
/// ```
#[diagnostic::on_unimplemented(
    message = "`{Self}` cannot travel on a topic",
    label = "is not `Clone + Send + 'static`",
    note = "a message is cloned for every reader but the last: derive `Clone`, or share it as `Arc<{Self}>`",
    note = "a message that is only ever moved, to a single reader, travels as `fass::Unique<{Self}>`"
)]
pub trait Message: Send + Sized + 'static {
    /// Whether a topic of this type may have several readers.
    ///
    /// ```
    /// use fass::{Message, Unique};
    /// assert!(i32::CAN_FAN_OUT && !Unique::<i32>::CAN_FAN_OUT);
    /// ```
    const CAN_FAN_OUT: bool;

    /// Makes the value for another reader, or returns `None` if the type can only be moved.
    ///
    /// ```
    /// use fass::{Message, Unique};
    /// assert_eq!(7.for_another_reader(), Some(7));
    /// assert_eq!(Unique::new(7).for_another_reader(), None);
    /// ```
    fn for_another_reader(&self) -> Option<Self>;
}

#[diagnostic::do_not_recommend]
impl<T: Clone + Send + 'static> Message for T {
    const CAN_FAN_OUT: bool = true;

    fn for_another_reader(&self) -> Option<Self> {
        Some(self.clone())
    }
}

#[diagnostic::do_not_recommend]
impl<T: Send + 'static> Message for Unique<T> {
    const CAN_FAN_OUT: bool = false;

    fn for_another_reader(&self) -> Option<Self> {
        None
    }
}

/// A message moved from its writer to its only reader, never cloned.
///
/// `Unique<T>` is deliberately not `Clone`, whatever `T` is. Two subtasks reading a topic of this
/// type are a fault at commit.
///
/// # Examples
///
/// ```
/// use core::time::Duration;
/// use fass::{SubtaskAttributes, Unique, create_dag, finish_create_dags};
/// use virtual_time::VirtualTime;
///
/// struct Frame([u8; 4096]); // not `Clone`: nobody can copy it by mistake
///
/// let machine = VirtualTime::new();
/// let dag = create_dag();
/// dag.jobs(2);
/// dag.register_periodic_subtask(
///     || (Unique::new(Frame([7; 4096])),),
///     ["frame"],
///     Duration::from_millis(10),
///     SubtaskAttributes::named("camera"),
/// );
/// dag.register_sink_subtask(
///     |(frame,): (Unique<Frame>,)| assert_eq!(frame.into_inner().0[0], 7),
///     ["frame"],
///     Duration::from_millis(10),
///     SubtaskAttributes::named("store"),
/// );
/// finish_create_dags(&[dag]).unwrap();
/// machine.run();
/// ```
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Unique<T>(T);

impl<T> Unique<T> {
    /// Wraps a value.
    ///
    /// ```
    /// assert_eq!(fass::Unique::new(7).into_inner(), 7);
    /// ```
    pub const fn new(value: T) -> Self {
        Self(value)
    }

    /// Returns the value.
    ///
    /// ```
    /// assert_eq!(fass::Unique::new("a frame").into_inner(), "a frame");
    /// ```
    pub fn into_inner(self) -> T {
        self.0
    }
}

impl<T> Deref for Unique<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.0
    }
}

impl<T> DerefMut for Unique<T> {
    fn deref_mut(&mut self) -> &mut T {
        &mut self.0
    }
}

/// The type of a message, as the commit compares it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MessageType {
    id: TypeId,
    name: &'static str,
    can_fan_out: bool,
}

impl MessageType {
    /// Describes the type `M`.
    pub(crate) fn of<M: Message>() -> Self {
        Self {
            id: TypeId::of::<M>(),
            name: type_name::<M>(),
            can_fan_out: M::CAN_FAN_OUT,
        }
    }

    /// Returns one end of a topic of this type.
    pub(crate) fn port(&self, topic: &str) -> TopicPort {
        TopicPort {
            topic: topic.into(),
            type_id: self.id,
            type_name: self.name,
            can_fan_out: self.can_fan_out,
        }
    }

    /// Returns the identity of the type.
    pub(crate) const fn id(&self) -> TypeId {
        self.id
    }
}
