//! What a platform cuts refinements with.

/// Calls a function in an instance, and cuts it when it has executed for so many nanoseconds;
/// reports whether it was cut. The time does not count as that of the budget.
///
/// # Safety
///
/// What the function has on the stack is given up at any instruction, and not dropped: nobody
/// may rely on that, nor look at it afterwards.
///
/// ```
/// /// Where nothing can be cut although it ought to be.
/// fn patient(_most_ns: u64, refinements: &mut dyn FnMut()) -> bool {
///     refinements();
///     false
/// }
/// let cutter: fass::Cutter = patient;
/// ```
pub type Cutter = unsafe fn(most_ns: u64, refinements: &mut dyn FnMut()) -> bool;
