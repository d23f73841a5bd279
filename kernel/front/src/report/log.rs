//! Lines of the log, as platforms show them.

use alloc::sync::Arc;
use core::iter;

use fass::log::Line;
use sched_dag::TaskSet;

use crate::text::json;

/// The most lines that are shown at once: as many as can wait.
const AT_ONCE: usize = 64;

/// Shows the lines that wait, with the names of the run that they are of. Nothing is allocated.
pub fn tell(task_set: impl Fn() -> Option<Arc<TaskSet>>) {
    for line in iter::from_fn(Line::take).take(AT_ONCE) {
        let task_set = task_set();
        let task_set = task_set.as_deref();
        crate::println!("{}", line.shown(task_set));
        json::emit("log", |object| {
            object
                .text("level", line.level.word())
                .text("message", line.text)
                .number("time_ns", line.at_ns);
            if let Some((dag, subtask, instance)) = line.names(task_set) {
                object
                    .number("dag", instance.dag.0)
                    .text("dag_name", dag)
                    .number("subtask", instance.subtask.0)
                    .text("subtask_name", subtask)
                    .number("job", instance.job);
            }
            let fields = |fields: &mut json::Object<'_, '_>| {
                for (key, value) in line.fields() {
                    fields.shown(key, &value);
                }
            };
            object
                .object("fields", fields)
                .number("left_out", line.left_out);
        });
    }
}
