//! Lines of the log, as platforms show them.

use alloc::sync::Arc;

use fass::log::take;
use sched_dag::TaskSet;

use crate::text::json;

/// Shows the oldest line that waits, with the names of the run that it is of; `false`: there is
/// none. Nothing is allocated.
pub fn tell(task_set: impl FnOnce() -> Option<Arc<TaskSet>>) -> bool {
    let Some(line) = take() else {
        return false;
    };
    let task_set = task_set();
    let task_set = task_set.as_deref();
    crate::println!("{}", line.shown(task_set));
    json::emit("log", |object| {
        object
            .text("level", line.level().word())
            .text("message", line.text())
            .number("time_ns", line.at_ns);
        if let Some((dag, subtask, instance)) = line.names(task_set) {
            object
                .number("dag", instance.dag.0)
                .text("dag_name", dag)
                .number("subtask", instance.subtask.0)
                .text("subtask_name", subtask)
                .number("job", instance.job);
        }
        object
            .object("fields", |fields| {
                for (key, value) in line.fields() {
                    fields.shown(key, &value);
                }
            })
            .number("left_out", line.left_out);
    });
    true
}

/// Shows all lines that wait, when nothing runs.
pub fn tell_all(task_set: Option<&Arc<TaskSet>>) {
    while tell(|| task_set.cloned()) {}
}
