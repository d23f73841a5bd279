//! Optional parts of subtasks, cut in virtual time.
//!
//! Time passes where a function says that it executes, so that is where a refinement is cut: in
//! the call that would exceed the time of the optional part. It is unwound from there. One that
//! never says so is never cut, as a function that does not return is not ended.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

use crate::surroundings::Surroundings;

/// What a refinement is unwound with.
struct Cut;

/// Runs refinements until they end or have executed for `most_ns`; reports whether they were cut.
pub(crate) fn run(
    surroundings: &Surroundings,
    most_ns: u64,
    refinements: &mut dyn FnMut(),
) -> bool {
    let executed_ns = surroundings.executed_ns.get().unwrap_or(0);
    let end = &surroundings.optional_end_ns;
    end.set(Some(executed_ns.saturating_add(most_ns)));
    // Unwind safety: of what is cut only whole results are looked at again.
    let result = catch_unwind(AssertUnwindSafe(refinements));
    end.set(None);
    match result {
        Ok(()) => false,
        Err(payload) if payload.is::<Cut>() => true,
        Err(payload) => resume_unwind(payload),
    }
}

/// Returns for how long the running function may go on, which has executed for `executed_ns`.
pub(crate) fn left_ns(surroundings: &Surroundings, executed_ns: u64) -> u64 {
    let end_ns = surroundings.optional_end_ns.get();
    end_ns.map_or(u64::MAX, |end_ns| end_ns.saturating_sub(executed_ns))
}

/// Cuts the running refinement; what it drops meanwhile takes no more time.
pub(crate) fn cut() {
    if !std::thread::panicking() {
        // Not a panic: nobody is to be told of it.
        resume_unwind(Box::new(Cut));
    }
}
