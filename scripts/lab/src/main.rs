//! The laboratory's program. The scripts in `scripts/` call the subcommands, as with the tool.

#![forbid(unsafe_code)]

fn main() -> std::process::ExitCode {
    lab::LAB.carry_out()
}
