//! The gate to the app's code: every call of that code by a platform passes through here.
//!
//! The app's code is called in an instance, in the app's main function, or nowhere;
//! `docs/architecture.md` lists the places. A debug build asks the platform each time whether this
//! holds.

use super::cell::SetOnce;

/// The platform's check, made before each call.
static MAY_CALL: SetOnce<fn() -> bool> = SetOnce::new();

/// Installs the function that a debug build asks before each call.
pub(crate) fn guard(may_call: fn() -> bool) {
    MAY_CALL.set(may_call);
}

/// Calls the app's code.
///
/// # Panics
///
/// In a debug build, if the platform reports a held lock or disabled interrupts.
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
