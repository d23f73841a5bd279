//! The host tool's program. The scripts in `scripts/` call its subcommands.
//!
//! A subcommand takes the words after its name and returns the exit code: 0 all is well, 1 a
//! failure, 2 a refused command line.

#![forbid(unsafe_code)]

fn main() -> std::process::ExitCode {
    tool::TOOL.carry_out()
}
