//! The gate to the app's code: all of it that a platform brings about is called through here.
//!
//! It is called in an instance, in the app's main function, or nowhere; the list of places is in
//! `docs/architecture.md`. A debug build asks the platform each time whether that is so.

use super::cell::SetOnce;

/// The platform's answer.
static MAY_CALL: SetOnce<fn() -> bool> = SetOnce::new();

/// Has a debug build ask that before each call.
pub(crate) fn guard(may_call: fn() -> bool) {
    MAY_CALL.set(may_call);
}

/// Calls the app's code.
///
/// # Panics
///
/// In a debug build, if the platform says that it holds a lock here, or has disabled interrupts.
///
/// ```
/// assert_eq!(fass::platform::call_app(|| 7), 7);
/// ```
#[inline(always)]
pub fn call_app<T>(call: impl FnOnce() -> T) -> T {
    debug_assert!(
        MAY_CALL.get().is_none_or(|may_call| may_call()),
        "the app's code is called under a lock, or with interrupts disabled; call it in an \
         instance, or in the app's main function"
    );
    call()
}
