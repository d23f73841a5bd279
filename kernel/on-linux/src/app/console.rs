//! What people see and say while a run goes on: the log, and the console, at which a person at
//! standard input talks with the run.

use std::io::{self, BufReader, Read};
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::sync::{Arc, Barrier, Mutex, OnceLock, PoisonError};
use std::thread;
use std::time::Duration;

use fass::edge::Seen;
use front::report::log;
use front::shell::topics::Topics;
use front::shell::{Commands, END, Extra, LiveRun, PERIOD_NS, Session};
use linux::Live;
use sched_dag::lifecycle::Request;
use sched_dag::{DagId, Journal, Snapshot, TaskSet};

/// What comes on standard input; the thread that reads it lasts as long as the program.
static INPUT: OnceLock<Mutex<Receiver<u8>>> = OnceLock::new();

/// Commands about parameters, and about topics.
pub(crate) static PARAMETERS: OnceLock<&'static dyn Commands> = OnceLock::new();
static TOPICS: OnceLock<&'static dyn Commands> = OnceLock::new();

/// The most lines of the log that are shown before the person is listened to again.
const MOST_LINES: usize = 64;

/// Whether a person has ended the run.
static IS_SHUT_DOWN: AtomicBool = AtomicBool::new(false);

/// The run of this program.
#[derive(Debug)]
struct LinuxRun;

impl LiveRun for LinuxRun {
    fn task_set() -> Option<Arc<TaskSet>> {
        Some(Arc::clone(Live::get()?.task_set()))
    }

    fn snapshot(dag: DagId) -> Option<Snapshot> {
        Live::get()?.snapshot(dag)
    }

    fn control(dag: DagId, change: fn(DagId) -> Request) {
        if let Some(live) = Live::get() {
            live.change(dag, change);
        }
    }

    fn now_ns() -> u64 {
        Live::now_ns()
    }

    fn clusters() -> usize {
        Live::get().map_or(0, |live| live.clusters())
    }

    fn with_journal<R>(cluster: usize, look: impl FnOnce(&mut Journal) -> R) -> Option<R> {
        Live::get()?.with_journal(cluster, look)
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

    fn shut_down() {
        if let Some(live) = Live::get() {
            front::println!("shutting down: nothing more is released; what is in flight goes on");
            IS_SHUT_DOWN.store(true, Ordering::Relaxed);
            live.close();
        }
    }

    fn watch(topic: Option<&str>) -> bool {
        Live::get().is_some_and(|live| live.watch(topic))
    }

    fn take_seen(into: &mut [u8]) -> Option<Seen> {
        Live::get()?.take_seen(into)
    }

    fn extra() -> Extra {
        [&PARAMETERS, &TOPICS].map(|once| once.get().copied())
    }
}

/// Reports whether a run goes on that does not end by itself.
fn is_endless() -> bool {
    let has_end = |live: Live| {
        live.task_set()
            .dags()
            .iter()
            .all(|dag| dag.jobs().is_some())
    };
    !IS_SHUT_DOWN.load(Ordering::Relaxed) && !Live::get().is_none_or(has_end)
}

/// Lets people look at topics.
pub(crate) fn show_topics() {
    static ALL: Topics<LinuxRun> = Topics::new();
    TOPICS.get_or_init(|| &ALL);
}

/// Reads standard input, from now on.
fn listen() {
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
}

/// Shows the log and, with a console, talks, from another thread, as long as `run` takes. Reports
/// whether the person has ended it.
pub(crate) fn talk_during<R>(has_console: bool, run: impl FnOnce() -> R) -> (R, bool) {
    if has_console {
        listen();
    }
    // What a thread allocates when it begins is not the run's.
    let begun = Barrier::new(2);
    IS_SHUT_DOWN.store(false, Ordering::Relaxed);
    let is_over = AtomicBool::new(false);
    let result = thread::scope(|scope| {
        let thread = scope.spawn(|| {
            let mut session = has_console.then(|| Session::<LinuxRun>::new(false));
            begun.wait();
            let mut is_raised = false;
            while !is_over.load(Ordering::Acquire) {
                if let Some(live) = Live::get().filter(|_| has_console && !is_raised) {
                    live.raise();
                    is_raised = true;
                }
                while session.as_mut().is_some_and(Session::slice) {}
                // When the run is over, the rest is told, with the names that it has.
                let tells = |live: Live| log::tell(|| Some(Arc::clone(live.task_set())));
                let _ = (0..MOST_LINES).all(|_| Live::get().is_some_and(tells));
                thread::park_timeout(Duration::from_nanos(PERIOD_NS));
            }
        });
        begun.wait();
        let result = catch_unwind(AssertUnwindSafe(run));
        is_over.store(true, Ordering::Release);
        thread.thread().unpark();
        result.unwrap_or_else(|panic| resume_unwind(panic))
    });
    (result, IS_SHUT_DOWN.load(Ordering::Relaxed))
}
