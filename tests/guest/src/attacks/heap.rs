//! Attacks on the heap, used up, and on a stack used up inside the allocator.

use alloc::boxed::Box;
use alloc::string::String;
use core::hint::black_box;

use faults::crimes::Unpunished;

/// Allocates small strings and forgets them, until there is no memory.
pub(super) fn leak_strings() -> Unpunished {
    while black_box(true) {
        core::mem::forget(black_box(String::from("leaked")));
    }
    Unpunished
}

/// A box in a chain of boxes.
struct Link(#[expect(dead_code, reason = "it is there to be allocated")] Option<Box<Link>>);

/// Allocates small boxes and keeps them, until there is no memory.
pub(super) fn keep_boxes() -> Unpunished {
    let mut chain = None;
    while black_box(true) {
        chain = Some(Box::new(Link(chain)));
    }
    core::mem::forget(chain);
    Unpunished
}

/// Recurses, and allocates on the way, until the stack is too short for the allocator.
pub(super) fn overflow_in_the_allocator() -> Unpunished {
    #[expect(unconditional_recursion, reason = "that is the crime")]
    fn deeper(number: u64) -> u64 {
        let boxed = black_box(Box::new(number));
        deeper(*boxed + 1).wrapping_add(*boxed)
    }
    black_box(deeper(0));
    Unpunished
}
