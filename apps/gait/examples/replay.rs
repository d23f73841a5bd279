//! Replays a recorded walk on the host; `--until gait/JOB` shows each subtask's inputs and outputs.

use std::error::Error;
use std::process::ExitCode;

use fass::finish_create_dags;
use gait::build;
use recording::Recording;

fn main() -> ExitCode {
    virtual_time::replay_command(commit)
}

fn commit(file: &'static [u8]) -> Result<(), Box<dyn Error>> {
    let (dag, _walk) = build(&Recording::read(file)?)?;
    finish_create_dags(&[dag])?;
    Ok(())
}
