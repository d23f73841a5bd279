//! Panics of instances: those that unwind, and those that cannot.
//!
//! A panic unwinds to the worker that called the function, and costs the instance its DAG or its
//! job. If a destructor on the way panics, too, unwinding is impossible: Rust calls the panic hook
//! for the last time, and then aborts the program. Our hook does not return from such a call.
//! Instead, the hook ends the instance like one whose budget is exceeded: its DAG is ended, and a
//! spare worker takes its place. Its thread, with everything on its stack, sleeps until the end of
//! the program.
//!
//! Outside of instances, such a panic still ends the program, and so does any such panic in a
//! program that replaces the hook. After such a fault nobody can replace the hook: `set_hook` waits
//! for the thread inside.

use std::any::Any;
use std::panic::{self, AssertUnwindSafe, catch_unwind};
use std::sync::Once;
use std::thread;

use crate::edge;

/// The messages of panics after which the standard library lets nothing survive.
const LAST: [&str; 2] = [
    "panic in a destructor during cleanup",
    "panic in a function that cannot unwind",
];

/// Extends the present panic hook, once: notes the places of panics, and confines a panic that
/// cannot unwind to its DAG. `strand` gives up the calling thread's instance, and reports whether
/// there is one.
pub(crate) fn contain(strand: fn(&str) -> bool) {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        // The hook before ours has reported the earlier panics, and may take the last one for the
        // program's end.
        let before = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            let text = info.payload().downcast_ref::<&str>();
            if let Some(text) = text.filter(|text| LAST.contains(text))
                && strand(text)
            {
                // A hook that returned here would have the program aborted.
                loop {
                    thread::park();
                }
            }
            info.location().into_iter().for_each(edge::note_place);
            before(info);
        }));
    });
}

/// Calls a function of the app. The error is the message of a panic.
#[inline]
pub(crate) fn caught<T>(call: impl FnOnce() -> T) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(call)).map_err(message)
}

/// Returns a panic's message, and drops the panic's payload. The payload is the app's, so dropping
/// may panic.
#[cold]
fn message(panic: Box<dyn Any + Send>) -> String {
    let text = panic.downcast_ref::<&str>().copied();
    let text = text.or_else(|| panic.downcast_ref::<String>().map(String::as_str));
    let text = text.unwrap_or("a panic without a message").to_owned();
    if let Err(another) = catch_unwind(AssertUnwindSafe(|| drop(panic))) {
        // Dropping the second payload may panic again.
        std::mem::forget(another);
    }
    text
}
