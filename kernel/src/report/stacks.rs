//! How much of its stack each subtask has used, with `measure=stacks`.

use core::sync::atomic::Ordering;

use executive::run::{contexts, stacks};
use front::json;

use sched_dag::engine::Run;

/// Prints a line for each subtask, if that was measured.
pub(crate) fn dump(run: &Run) {
    let of_bytes = contexts::stack_bytes(run.task_set());
    let dags = run.task_set().dags();
    let subtasks = dags.iter().flat_map(|dag| {
        let subtasks = dag.subtasks().iter();
        subtasks.map(move |subtask| (dag.name(), subtask.name()))
    });
    for ((dag, subtask), used) in subtasks.zip(stacks::used()) {
        let used = used.load(Ordering::Relaxed);
        crate::println!("stack: `{subtask}` of `{dag}` used {used} of {of_bytes} bytes at most");
        json::emit("stack", |line| {
            line.text("dag_name", dag)
                .text("subtask_name", subtask)
                .number("used_bytes", used)
                .number("stack_bytes", of_bytes);
        });
    }
}
