//! A backtrace as a machine line: addresses, which the host makes into names.

use core::fmt;

use crate::machine::backtrace::{self, CallSite};
use front::json::JsonObject;

/// The most calls that a line has, so that it stays together (`console`).
const MOST: usize = 24;

/// The calls that a stack held, for when it holds others.
pub struct Backtrace {
    instruction: Option<u64>,
    calls: [Option<CallSite>; MOST],
}

/// Where code was as it failed.
#[derive(Clone, Copy, Debug)]
pub struct CodeLocation {
    /// The instruction, if it is known apart from the stack.
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

    /// Reads the calls, all of this core's stack.
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

/// Shows a call as where it returns to and what it called.
fn shown(call: &CallSite) -> impl fmt::Display {
    fmt::from_fn(move |f| {
        write!(f, "\"{:#x}", call.returns_to)?;
        if let Some(callee) = call.callee {
            write!(f, " {callee:#x}")?;
        }
        f.write_str("\"")
    })
}
