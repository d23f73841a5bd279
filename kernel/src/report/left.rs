//! How much of the heap the faults of a run have left in use.
//!
//! What a function owned when a fault ended it is lost: no destructor of it is called. Whatever a
//! DAG's functions have allocated in the run, and is in use after all that belongs to the run was
//! dropped, is either that, or was handed to somebody else, such as a `static`.

use alloc::vec;
use sched_dag::DagId;

use executive::memory::heap;
use front::json;

use sched_dag::engine::Run;

/// Prints a line for each DAG that had faults and has left something.
pub(crate) fn dump(run: &Run) {
    let dags = run.task_set().dags();
    let mut left = vec![0; dags.len()];
    heap::take_owned(&mut left);
    for ((id, dag), bytes) in (0..).map(DagId).zip(dags).zip(left) {
        let faults = run.statistics(id).faults;
        if faults > 0 && bytes > 0 {
            let name = dag.name();
            crate::println!(
                "left: of what dag `{name}` has allocated, {bytes} bytes stay in use, after \
                 {faults} faults"
            );
            json::emit("left", |line| {
                line.text("dag_name", name)
                    .number("faults", faults)
                    .number("heap_bytes", bytes as u64);
            });
        }
    }
}
