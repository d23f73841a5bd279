//! The laboratory's program. The scripts in `scripts/` call its subcommands, like the tool's.

#![forbid(unsafe_code)]

fn main() -> std::process::ExitCode {
    lab::LAB.carry_out()
}
