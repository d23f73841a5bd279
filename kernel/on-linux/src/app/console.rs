//! The console: a person at standard input talks with the run.

use std::io::{self, BufReader, Read};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::thread;
use std::time::Duration;

use fass::edge::Seen;
use front::shell::{END, IS_SHUT_DOWN, LiveRun, PERIOD_NS, Session};
use linux::Control;
use sched_dag::lifecycle::Request;
use sched_dag::{DagId, Scheduler, TaskSet};

/// What comes on standard input; the thread that reads it lasts as long as the program.
static INPUT: OnceLock<Mutex<Receiver<u8>>> = OnceLock::new();

/// The run of this program.
#[derive(Debug)]
pub struct LinuxRun;

impl LiveRun for LinuxRun {
    fn task_set() -> Option<Arc<TaskSet>> {
        Some(Arc::clone(Control::get()?.task_set()))
    }

    fn control(dag: DagId, change: fn(DagId) -> Request) {
        if let Some(live) = Control::get() {
            live.change(dag, change);
        }
    }

    fn now_ns() -> u64 {
        linux::now_ns()
    }

    fn with_scheduler<T>(cluster: usize, look: impl FnOnce(&mut Scheduler) -> T) -> Option<T> {
        Control::get()?.with_scheduler(cluster, look)
    }

    fn receive() -> Option<u8> {
        let input = INPUT.get()?.lock().unwrap_or_else(PoisonError::into_inner);
        match input.try_recv() {
            Ok(byte) => Some(byte),
            // Nobody could end it any more.
            Err(TryRecvError::Disconnected) if is_endless() => Some(END),
            Err(_) => None,
        }
    }

    fn watch(topic: Option<&str>) -> bool {
        Control::get().is_some_and(|live| live.see(topic))
    }

    fn take_seen(into: &mut [u8]) -> Option<Seen> {
        Control::get()?.take_seen(into)
    }
}

/// Reports whether a run goes on that does not end by itself.
fn is_endless() -> bool {
    let has_end = |live: Control| {
        live.task_set()
            .dags()
            .iter()
            .all(|dag| dag.jobs().is_some())
    };
    !IS_SHUT_DOWN.load(Ordering::Relaxed) && !Control::get().is_none_or(has_end)
}

/// Talks, from another thread, as long as `run` takes. Reports whether the person has ended it.
pub(crate) fn talk_during<R>(run: impl FnOnce() -> R) -> (R, bool) {
    INPUT.get_or_init(|| {
        let (bytes, input) = channel();
        thread::spawn(move || {
            let all = BufReader::new(io::stdin()).bytes().map_while(Result::ok);
            // The last line may lack its end.
            for byte in all.chain(*b"\n") {
                if bytes.send(byte).is_err() {
                    break;
                }
            }
        });
        Mutex::new(input)
    });
    IS_SHUT_DOWN.store(false, Ordering::Relaxed);
    let is_over = AtomicBool::new(false);
    let result = thread::scope(|scope| {
        scope.spawn(|| {
            let mut session = Session::<LinuxRun>::new(false);
            let mut is_raised = false;
            while !is_over.load(Ordering::Acquire) {
                if let Some(live) = Control::get().filter(|_| !is_raised) {
                    live.raise();
                    is_raised = true;
                }
                while session.slice() {}
                thread::sleep(Duration::from_nanos(PERIOD_NS));
            }
        });
        let result = run();
        is_over.store(true, Ordering::Release);
        result
    });
    (result, IS_SHUT_DOWN.load(Ordering::Relaxed))
}
