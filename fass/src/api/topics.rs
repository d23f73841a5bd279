//! The topics of a subtask's inputs or outputs, as listed by an app.
//!
//! The length of an array is part of its type, so an array without exactly one topic for each
//! element of the function's tuple does not compile. The length of a `Vec` is known only at run
//! time: the commit counts the topics.

use alloc::vec::Vec;

use crate::run::tuple::{VecToPubs, VecToSubs};

/// A list of topic names: an array, or, as in the paper, a `Vec`.
///
/// ```
/// use core::time::Duration;
/// use fass::{SubtaskAttributes, create_dag};
///
/// let (dag, period) = (create_dag(), Duration::from_millis(10));
/// let named = SubtaskAttributes::named;
/// dag.register_periodic_subtask(|| (1, 2), ["left", "right"], period, named("sense"));
/// dag.register_subtask(|(left, right): (i32, i32)| (left + right,), vec!["left", "right"], ["sum"], named("add"));
/// ```
///
/// ```compile_fail,E0080
/// # use core::time::Duration;
/// # use fass::{SubtaskAttributes, create_dag};
/// # let (dag, period) = (create_dag(), Duration::from_millis(10));
/// // "name one output topic for each element of the function's result": there are two.
/// dag.register_periodic_subtask(|| (1, 2), ["left"], period, SubtaskAttributes::named("sense"));
/// ```
#[diagnostic::on_unimplemented(
    message = "`{Self}` is no list of topics",
    label = "should be an array of names, such as `[\"frame\"]`",
    note = "a topic is named by a `&str`, of a `String` by `.as_str()`; a `Vec` of them is a list, too"
)]
pub trait Topics {
    /// The number of topics, if the type tells the number.
    const COUNT: Option<usize>;

    /// Returns the names, in the order of the tuple's elements.
    ///
    /// See [`Topics`].
    fn names(&self) -> &[&str];
}

impl<const N: usize> Topics for [&str; N] {
    const COUNT: Option<usize> = Some(N);

    fn names(&self) -> &[&str] {
        self
    }
}

impl Topics for Vec<&str> {
    const COUNT: Option<usize> = None;

    fn names(&self) -> &[&str] {
        self
    }
}

/// Returns the topics of a function's argument. An array of another length does not compile.
pub(super) fn of_inputs<Args: VecToSubs, List: Topics>(list: &List) -> &[&str] {
    const {
        assert!(
            may_have(List::COUNT, Args::ARITY),
            "name one input topic for each element of the function's argument"
        );
    }
    list.names()
}

/// Returns the topics of a function's result. An array of another length does not compile.
pub(super) fn of_outputs<Ret: VecToPubs, List: Topics>(list: &List) -> &[&str] {
    const {
        assert!(
            may_have(List::COUNT, Ret::ARITY),
            "name one output topic for each element of the function's result"
        );
    }
    list.names()
}

/// Reports whether a list with `count` topics fits a tuple with `arity` elements. An unknown count
/// always fits.
const fn may_have(count: Option<usize>, arity: usize) -> bool {
    match count {
        Some(count) => count == arity,
        None => true,
    }
}
