//! The background: work of core 0 for people during a run, when it has nothing else to do.
//!
//! The background prints progress, the log's lines, contained faults and, if requested on the
//! command line, the status. It also holds the console's conversation. The background is suspended
//! whenever the core has an instance to run.
//!
//! It is not suspended within a *slice* of the status or the console. A slice holds a lock, with
//! interrupts off, for a single line, and for the status also a look at the journal since the last
//! line, 2,048 events at most. A release, or an instance handed over by another core, may be late
//! by one slice; `status` waits for a time without events nearby.
//!
//! Under overload the background may never run again, just when a person most wants to see the run,
//! and to stop it. So if the background has not run for [`STARVED_NS`], core 0's heartbeat takes
//! over the slices. It also reports a fault, but only in a run without bounds, because the report
//! might delay a job beyond its bound. The heartbeat also notices an instance that keeps its core
//! for long ([`stall`]).
//!
//! # Bytes from the serial port outside a conversation
//!
//! Such bytes are events: each raises the signal of a sporadic DAG. A single byte value ends the
//! run early, but in order: ctrl-C on a serial line (ETX in ASCII). With `console=stop` core 0's
//! heartbeat looks for that byte, four times a second, so ctrl-C works however busy the cores are.
//!
//! For events, core 0's background polls the port each time the core wakes up and has nothing else
//! to do, and at least every [`PERIOD_NS`] on an idle core. The value of a byte does not matter,
//! except for ctrl-C. Nor does the rate of the bytes: the scheduler enforces the DAG's minimum
//! inter-arrival time.
//!
//! [`PERIOD_NS`]: front::shell::PERIOD_NS

pub(crate) mod endpoint;
pub(crate) mod stall;
mod status;

use alloc::sync::Arc;
use core::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use endpoint::CONNECTED;
use executive::machine::spinlock::SpinLock;
use executive::machine::{clock, serial};
use executive::run::{containment, execution, heartbeat};
use executive::text::console;
use front::report::tell_log;
use front::shell::{self, END, LiveRun, ShellSession, shut_down};
use sched_dag::lifecycle::Request;
use sched_dag::{DagId, SchedulerQuery, TaskSet};
use status::{RunProgress, StatusPrinter};

/// Options of the background.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct BackgroundOptions {
    /// Whether there is a console, and whether it sends back typed bytes.
    pub(crate) console: Option<ConsoleEcho>,
    /// Whether ctrl-C ends the run, in order.
    pub(crate) stops: bool,
    /// The time between two lines of kind `status`, in nanoseconds; 0: none.
    pub(crate) status_ns: u64,
}

/// Whether the console sends back typed bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ConsoleEcho {
    /// Each byte is sent back, for a terminal that does not show typed bytes by itself.
    On,
    /// Nothing is sent back: the terminal shows typed bytes.
    Off,
}

/// The longest time without the background before the heartbeat helps out.
const STARVED_NS: u64 = 200_000_000;

/// Work done in slices, by the background or by the heartbeat.
struct SlicedWork {
    status: Option<StatusPrinter>,
    session: Option<ShellSession<KernelRun>>,
}

static SLICED: SpinLock<SlicedWork> = SpinLock::new(SlicedWork {
    status: None,
    session: None,
});

/// The time of the background's latest step, on the clock; `u64::MAX` outside runs.
static RAN_NS: AtomicU64 = AtomicU64::new(u64::MAX);

/// Whether the heartbeat may report a fault: nothing in the run has a bound.
static TELLS_FAULTS: AtomicBool = AtomicBool::new(false);

impl SlicedWork {
    /// Does a slice. Reports whether there is more to do at once.
    fn slice(&mut self, is_starved: bool) -> bool {
        if let Some(status) = &mut self.status {
            status.print_when_due(is_starved);
        }
        self.session.as_mut().is_some_and(ShellSession::slice)
    }
}

/// Does the work of core 0's heartbeat, and a slice if the background is starved.
pub(crate) fn beat(now_ns: u64) {
    stall::beat(now_ns);
    look_for_end();
    if now_ns.saturating_sub(RAN_NS.load(Ordering::Relaxed)) < STARVED_NS {
        return;
    }
    if TELLS_FAULTS.load(Ordering::Relaxed) {
        containment::tell_fault();
    }
    if let Some(mut sliced) = SLICED.try_lock() {
        sliced.slice(true);
    }
    console::send_what_goes_at_once();
}

/// The background of a single run.
pub(crate) struct Background {
    progress: RunProgress,
    listener: Option<ByteListener>,
    /// Whether [`SLICED`] has something to do.
    is_sliced: bool,
    /// The core's heartbeat before the run.
    heartbeat_before_ns: u64,
}

impl Background {
    /// Begins the background of a run of `total` jobs; 0 if their number is unknown. Each byte of
    /// input raises the sporadic DAG `input` of a plan.
    pub(crate) fn begin(
        wishes: BackgroundOptions,
        input: Option<(u64, DagId)>,
        total: u64,
    ) -> Self {
        let before_ns = heartbeat::own_heartbeat_ns();
        let periods = [
            (wishes.console.is_some() || input.is_some()).then_some(shell::PERIOD_NS),
            Some(wishes.status_ns).filter(|&period_ns| period_ns > 0),
            (!CONNECTED.is_empty()).then_some(endpoint::PERIOD_NS),
        ];
        let periods = periods.into_iter().flatten();
        heartbeat::set_own_heartbeat(periods.fold(before_ns.min(stall::LOOK_NS), u64::min));
        let is_sliced = wishes.console.is_some() || wishes.status_ns > 0;
        if is_sliced {
            *SLICED.lock() = SlicedWork {
                status: (wishes.status_ns > 0)
                    .then(|| StatusPrinter::every(wishes.status_ns, total)),
                session: wishes
                    .console
                    .map(|echo| ShellSession::new(echo == ConsoleEcho::On)),
            };
        }
        RAN_NS.store(clock::now_ns(), Ordering::Relaxed);
        TELLS_FAULTS.store(!execution::has_bound(), Ordering::Relaxed);
        stall::start();
        // Bytes typed at the console are not events.
        let input = input.filter(|_| wishes.console.is_none());
        let listener = input.map(|input| ByteListener::new(input, wishes.stops));
        watch_for_end(wishes.stops && wishes.console.is_none() && listener.is_none());
        let endpoints = CONNECTED.iter();
        endpoints.for_each(|endpoint| endpoint.begin_run(clock::now_ns()));
        Self {
            heartbeat_before_ns: before_ns,
            progress: RunProgress::new(total),
            is_sliced,
            listener,
        }
    }

    /// Does the work that is due. Reports whether there is more to do at once.
    pub(crate) fn step(&mut self) -> bool {
        RAN_NS.store(clock::now_ns(), Ordering::Relaxed);
        self.progress.print_when_due();
        tell_log(execution::task_set);
        while containment::tell_fault() {}
        if let Some(listener) = &self.listener {
            listener.step();
        }
        // A fold without a shortcut, unlike `any`: each endpoint gets its turn.
        let steps = CONNECTED.iter().map(|endpoint| endpoint.step());
        let has_more = steps.fold(false, |has_more, more| has_more | more);
        if !self.is_sliced {
            return has_more;
        }
        SLICED.lock().slice(false) || has_more
    }

    /// Ends the background. Reports whether a person has asked for the run's end.
    pub(crate) fn end(self) -> bool {
        heartbeat::set_own_heartbeat(self.heartbeat_before_ns);
        stall::stop();
        CONNECTED.iter().for_each(|endpoint| endpoint.end_run());
        tell_log(execution::task_set);
        containment::take_last_faults(containment::tell_fault);
        // From now on the heartbeat takes no slice: the time since then saturates to 0.
        RAN_NS.store(u64::MAX, Ordering::Relaxed);
        let mut sliced = SLICED.lock();
        sliced.status = None;
        sliced.session = None;
        watch_for_end(false);
        shell::IS_SHUT_DOWN.swap(false, Ordering::Relaxed)
    }
}

/// Whether the heartbeat looks for ctrl-C.
static IS_WATCHED: AtomicBool = AtomicBool::new(false);

/// Makes the heartbeat look for ctrl-C, or not.
fn watch_for_end(is_watched: bool) {
    IS_WATCHED.store(is_watched, Ordering::Relaxed);
}

/// Looks for ctrl-C. Called in core 0's heartbeat.
fn look_for_end() {
    /// The size of the port's FIFO.
    const MOST_BYTES: usize = 16;
    let is_watched = IS_WATCHED.load(Ordering::Relaxed);
    // Lazy: where nobody watches for the end, no byte is taken from the console.
    let mut bytes = (0..MOST_BYTES).map_while(|_| serial::FIRST.receive());
    if is_watched && bytes.any(|byte| byte == END) {
        shut_down::<KernelRun>();
    }
}

/// The DAG raised by bytes.
pub(super) struct ByteListener {
    plan: u64,
    dag: DagId,
    /// Whether ctrl-C ends the run instead.
    stops: bool,
}

impl ByteListener {
    pub(super) const fn new((plan, dag): (u64, DagId), stops: bool) -> Self {
        Self { plan, dag, stops }
    }

    /// Raises the signal for each received byte.
    pub(super) fn step(&self) {
        /// A limit, because the port may deliver bytes without an end.
        const MOST_BYTES: usize = 256;
        for _ in 0..MOST_BYTES {
            match serial::FIRST.receive() {
                None => return,
                Some(END) if self.stops => shut_down::<KernelRun>(),
                Some(_) => execution::raise(self.plan, self.dag),
            }
        }
    }
}

/// The kernel's run.
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

    fn ask(cluster: usize, query: SchedulerQuery<'_>) -> Option<u64> {
        execution::with_scheduler(cluster, |scheduler| scheduler.show(query))
    }

    fn receive() -> Option<u8> {
        serial::FIRST.receive()
    }
}
