//! Replays a recording of the app on the host: `--until app-template/17`
//! shows the inputs and outputs of each subtask in a job.

use std::process::ExitCode;

use fass::finish_create_dags;

fn main() -> ExitCode {
    virtual_time::replay_command(|_file| {
        // As many jobs as any run has: those that were not recorded are skipped.
        finish_create_dags(&app_template::build(100_000))?;
        Ok(())
    })
}
