//! `run` with as many processors as there may be, and the memory that it chooses by itself.

use std::process::{Command, Stdio};

#[test]
fn the_usual_memory_suffices_for_all_processors() {
    for cores in ["24", "32", "64"] {
        let run = Command::new(env!("CARGO_BIN_EXE_fass-tool"))
            .args(["run", "--mode", "deterministic", "--jobs", "2"])
            .args(["--subtasks", "2", "--cores", cores])
            .stdin(Stdio::null())
            .output()
            .expect("the tool can be started");
        let said = String::from_utf8_lossy(&run.stdout);
        let complaints = String::from_utf8_lossy(&run.stderr);
        assert!(run.status.success(), "{cores}: {said}{complaints}");
    }
}
