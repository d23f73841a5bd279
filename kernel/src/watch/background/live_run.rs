//! The run that goes on, as the shell sees it.

use alloc::sync::Arc;

use executive::machine::{clock, serial};
use executive::run::{edge, execution};
use fass::edge::Seen;
use front::shell::LiveRun;
use sched_dag::lifecycle::Request;
use sched_dag::{DagId, Scheduler, TaskSet};

/// The kernel's run.
#[derive(Debug)]
pub struct KernelRun;

impl LiveRun for KernelRun {
    fn task_set() -> Option<Arc<TaskSet>> {
        execution::task_set()
    }

    fn control(dag: DagId, change: fn(DagId) -> Request) {
        execution::control(dag, change);
    }

    fn now_ns() -> u64 {
        clock::now_ns()
    }

    fn with_scheduler<T>(cluster: usize, look: impl FnOnce(&mut Scheduler) -> T) -> Option<T> {
        execution::with_scheduler(cluster, look)
    }

    fn receive() -> Option<u8> {
        serial::FIRST.receive()
    }

    fn watch(topic: Option<&str>) -> bool {
        edge::get().watch(topic)
    }

    fn take_seen(into: &mut [u8]) -> Option<Seen> {
        edge::get().take_seen(into)
    }
}
