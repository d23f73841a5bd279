//! What people see and say while a run goes on: the log, and the console, at which a person at
//! standard input talks with the run.

use std::io::{self, BufReader, Read};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::sync::{Arc, Barrier, Mutex, OnceLock, PoisonError};
use std::thread;
use std::time::Duration;

use fass::edge::Seen;
use front::report::tell_log;
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

/// Shows the log and, if there is a console, talks, from another thread, as long as `run` takes.
/// Reports whether the person has ended it.
pub(crate) fn talk_during<R>(has_console: bool, run: impl FnOnce() -> R) -> (R, bool) {
    let listen = || {
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
    };
    if has_console {
        INPUT.get_or_init(listen);
    }
    IS_SHUT_DOWN.store(false, Ordering::Relaxed);
    // It is not scoped: where `run` panics, nobody waits for it.
    let shared = Arc::new((Barrier::new(2), AtomicBool::new(false)));
    let (has_begun, is_over) = &*shared;
    let own = Arc::clone(&shared);
    let thread = thread::spawn(move || {
        let (has_begun, is_over) = &*own;
        let mut session = has_console.then(|| Session::<LinuxRun>::new(false));
        let mut is_raised = !has_console;
        has_begun.wait();
        while !is_over.load(Ordering::Acquire) {
            if let Some(control) = Control::get() {
                if !is_raised {
                    control.raise();
                    is_raised = true;
                }
                tell_log(|| Some(Arc::clone(control.task_set())));
            }
            while session.as_mut().is_some_and(Session::slice) {}
            thread::park_timeout(Duration::from_nanos(PERIOD_NS));
        }
    });
    // What it allocates to begin is not the run's.
    has_begun.wait();
    let result = run();
    is_over.store(true, Ordering::Release);
    thread.thread().unpark();
    thread.join().expect("what it prints does not panic");
    (result, IS_SHUT_DOWN.load(Ordering::Relaxed))
}
