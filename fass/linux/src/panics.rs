//! Panics of instances: one that unwinds, and one that cannot.
//!
//! A panic unwinds to the worker that has called the function, and costs the instance its DAG or its
//! job. If a destructor on the way panics, too, nothing can be unwound any more: Rust calls the panic
//! hook for the last time, and then aborts the program. Our hook does not return from that. It ends
//! the instance as one whose budget is exceeded: its DAG is ended, a spare worker has its place, and
//! its thread, with all that is on its stack, sleeps to the end of the program.
//!
//! Such a panic in no instance still ends the program, and so does any in a program that replaces
//! the hook. From such a fault on nobody can replace it: `set_hook` waits for the thread in the hook.

use std::any::Any;
use std::panic::{self, AssertUnwindSafe, catch_unwind};
use std::sync::Once;
use std::thread;

use crate::edge;

/// The messages of panics that the standard library lets nothing survive.
const LAST: [&str; 2] = [
    "panic in a destructor during cleanup",
    "panic in a function that cannot unwind",
];

/// Adds to the hook that is there, once: places are noted, and a panic that cannot unwind is kept to
/// its DAG. `strand` gives the calling thread's instance up, and reports whether it has one.
pub(crate) fn contain(strand: fn(&str) -> bool) {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        // It has told of the panics before the last one, and may take that for the program's end.
        let before = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            let text = info.payload().downcast_ref::<&str>();
            if let Some(text) = text.filter(|text| LAST.contains(text))
                && strand(text)
            {
                loop {
                    thread::park();
                }
            }
            info.location().into_iter().for_each(edge::note_place);
            before(info);
        }));
    });
}

/// Calls a function of the app; the error is its panic's message.
#[inline]
pub(crate) fn caught<T>(call: impl FnOnce() -> T) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(call)).map_err(message)
}

/// Returns a panic's message, and drops what it was raised with: that is the app's, and may panic.
#[cold]
fn message(panic: Box<dyn Any + Send>) -> String {
    let text = panic.downcast_ref::<&str>().copied();
    let text = text.or_else(|| panic.downcast_ref::<String>().map(String::as_str));
    let text = text.unwrap_or("a panic without a message").to_owned();
    if let Err(another) = catch_unwind(AssertUnwindSafe(|| drop(panic))) {
        // It may go on like that.
        std::mem::forget(another);
    }
    text
}
