//! A backtrace as a machine line: addresses, turned into names by the host.

use core::fmt;

use crate::machine::backtrace::{self, CallSite};
use front::json::JsonObject;

/// The most calls in a line, so that the line stays together (`console`).
const MOST: usize = 24;

/// A copy of the calls on a stack, kept for when the stack holds others.
pub struct Backtrace {
    instruction: Option<u64>,
    calls: [Option<CallSite>; MOST],
}

/// The place of a failure in code.
#[derive(Clone, Copy, Debug)]
pub struct CodeLocation {
    /// The instruction, if known apart from the stack.
    pub instruction: Option<u64>,
    /// The stack pointer there, or further down.
    pub stack_pointer: u64,
}

impl CodeLocation {
    /// Returns the place of this very call.
    #[inline(never)]
    pub fn here() -> CodeLocation {
        let local = 0u8;
        CodeLocation {
            instruction: None,
            stack_pointer: (&raw const local) as u64,
        }
    }

    /// Reads the calls from this core's stack.
    pub fn backtrace(self) -> Backtrace {
        let mut found = backtrace::calls(self.stack_pointer);
        Backtrace {
            instruction: self.instruction,
            calls: core::array::from_fn(|_| found.next()),
        }
    }
}

impl Backtrace {
    /// Writes the members of a line of kind `backtrace`.
    pub fn write(&self, core: u32, line: &mut JsonObject<'_, '_>) {
        line.number("cpu", core);
        if let Some(instruction) = self.instruction {
            line.text("place", format_args!("{instruction:#x}"));
        }
        line.list("calls", self.calls.iter().flatten().map(shown));
    }
}

/// Shows a call as its return address and its callee.
fn shown(call: &CallSite) -> impl fmt::Display {
    fmt::from_fn(move |f| {
        write!(f, "\"{:#x}", call.returns_to)?;
        if let Some(callee) = call.callee {
            write!(f, " {callee:#x}")?;
        }
        f.write_str("\"")
    })
}
