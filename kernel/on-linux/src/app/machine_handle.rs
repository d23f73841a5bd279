//! The machine as an app sees it: so many cores of this computer.

use std::cell::{Cell, RefCell};
use std::fs;
use std::io;
use std::time::Duration;

use fass::{Overheads, Policy, Preemption, Signal};
use linux::{EndSignals, Linux};
use sched_dag::DagId;

use super::ends::Ends;
use super::words::Words;
use crate::heap;
use front::app::bound_verdict::BoundVerdict;
use front::app::ending::Ending;
use front::app::fault_verdict::FaultVerdict;
use front::app::wcet_notes;
use front::json;
use front::options::{Options, UsageError};
use front::report;
use sched_dag::engine::Run;

/// The machine, lent to the app's function for the time of the run.
#[derive(Debug)]
pub struct Machine {
    pub(crate) options: Options<'static>,
    linux: Linux,
    cores: u32,
    overheads: Overheads,
    module: Cell<Option<&'static [u8]>>,
    has_asked: Cell<bool>,
    dumps_trace: bool,
    dumps_times: bool,
    pub(crate) wire: RefCell<Option<Ends>>,
    /// What bytes on standard input raise.
    input: RefCell<Option<Signal>>,
    /// What the app has asked for that Linux does not have.
    refusal: RefCell<Option<UsageError>>,
    /// How many runs have ended.
    runs: Cell<u64>,
    fault_verdict: FaultVerdict,
    bound_verdict: BoundVerdict,
    /// The reasons that end a run before its time.
    signals: EndSignals,
}

/// What of the program's memory is in use while nothing runs.
///
/// See [`Machine::resources`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Resources {
    /// The bytes of the heap that are in use.
    pub heap_bytes: usize,
    /// The stacks for instances that there are: none, for each run has its own threads.
    pub contexts: usize,
    /// How many of these can be taken.
    pub contexts_free: usize,
}

impl Machine {
    pub(crate) fn new(
        options: Options<'static>,
        linux: Linux,
        words: &Words,
        signals: EndSignals,
    ) -> Self {
        Self {
            cores: linux.cores(),
            options,
            linux,
            overheads: words.terms.overheads,
            module: Cell::new(words.module),
            has_asked: Cell::new(false),
            dumps_trace: words.dumps_trace,
            dumps_times: words.dumps_times,
            wire: RefCell::new(None),
            input: RefCell::new(None),
            refusal: RefCell::new(None),
            runs: Cell::new(0),
            fault_verdict: FaultVerdict::default(),
            bound_verdict: BoundVerdict::new(false, false),
            signals,
        }
    }

    /// Returns the words of the command line that are left to the app.
    #[must_use]
    pub const fn options(&self) -> &Options<'static> {
        &self.options
    }

    /// Returns the file that the word `module=` names, if there is one.
    #[must_use]
    pub fn module(&self) -> Option<&'static [u8]> {
        self.has_asked.set(true);
        self.module.get()
    }

    pub(crate) const fn linux(&self) -> &Linux {
        &self.linux
    }

    /// Reports whether there is a file that the app has not asked for.
    pub(crate) fn has_spare_module(&self) -> bool {
        self.module.get().is_some() && !self.has_asked.get()
    }

    /// Reports whether a person can talk to a run: never on Linux.
    #[must_use]
    pub const fn has_console(&self) -> bool {
        false
    }

    /// Returns the number of cores that run subtasks.
    #[must_use]
    pub const fn cores(&self) -> u32 {
        self.cores
    }

    /// Chooses policy and preemption of the commits to come, instead of what the command line
    /// says. Without the right to use SCHED_FIFO nothing is preempted.
    pub fn configure(&self, policy: Policy, preemption: Preemption) {
        self.linux.configure(policy, preemption);
    }

    /// Is refused on Linux, at the next run, unless it is 0: there events are as far apart as
    /// they are.
    pub fn set_coincidence(&self, window: Duration) {
        if window > Duration::ZERO {
            let line = "events are taken together on the machine only; choose a window of 0";
            self.refusal.replace(Some(UsageError::new(line)));
        }
    }

    /// Leaves it to the app to judge faults.
    pub fn accept_faults(&self) {
        self.fault_verdict.accept();
    }

    /// Leaves it to the app to judge response times beyond their proven bounds, which on Linux
    /// are said and not judged in any case.
    pub fn accept_exceeded_bounds(&self) {
        self.bound_verdict.accept();
    }

    /// Runs the committed DAGs until each has ended all its jobs.
    ///
    /// # Errors
    ///
    /// [`Ending::Failure`] if nothing has been committed since the last run. [`Ending::Shutdown`]
    /// if SIGINT (ctrl-C) or SIGTERM has ended the run: then each DAG has ended the jobs that it
    /// had in flight and released no more.
    pub fn run(&self) -> Result<Run, Ending> {
        self.run_when(Linux::run)
    }

    /// Works like [`run`](Self::run), with the releases counted from `epoch_ns` on the clock of
    /// [`fass::now_ns`]. If that is past, releases are late.
    ///
    /// # Errors
    ///
    /// As [`run`](Self::run).
    pub fn run_from(&self, epoch_ns: u64) -> Result<Run, Ending> {
        self.run_when(|linux| linux.run_from(epoch_ns))
    }

    fn run_when(
        &self,
        run: impl FnOnce(&Linux) -> Result<linux::Run, linux::StartError>,
    ) -> Result<Run, Ending> {
        if let Some(refusal) = self.refusal.take() {
            return Err(refusal.into());
        }
        let failure = |why: String| Ending::Failure(why);
        let ends = self.wire.borrow();
        let connection = ends.as_ref().map(|ends| ends.connect(&self.linux));
        let connection = connection.transpose()?;
        if let Some(signal) = &*self.input.borrow() {
            let watched = self.linux.raise_on_input(signal, &io::stdin());
            watched.map_err(|why| failure(format!("standard input cannot be watched: {why}")))?;
        }
        if let Some(control) = self.linux.control() {
            let watched = control.close_when_asked(&self.signals);
            watched.map_err(|why| failure(format!("no signal can be waited for: {why}")))?;
        }
        let run = run(&self.linux).map_err(|why| failure(why.to_string()))?;
        drop(connection);
        tell_faults(&run);
        let run = run.into_run();
        let faults = |dag: DagId| run.statistics(dag).faults - run.statistics(dag).restarts;
        self.fault_verdict.note(run.task_set(), faults);
        self.bound_verdict.note(&run);
        wcet_notes::note(&run, self.overheads);
        if let Some(ends) = &*ends {
            report::wire::report(&ends.wire);
        }
        if self.dumps_times {
            report::times::dump(&run);
        }
        if self.dumps_trace {
            report::trace::dump(&run, self.runs.replace(self.runs.get() + 1));
        }
        match self.signals.count() {
            0 => Ok(run),
            _ => Err(Ending::after_shutdown(&run)),
        }
    }

    /// Makes whatever arrives on standard input raise a signal, in the runs to come.
    ///
    /// # Panics
    ///
    /// If the signal's DAG is not committed.
    pub fn raise_on_input(&self, signal: &Signal) {
        assert!(
            signal.target().is_some(),
            "a signal is connected before its DAG is committed; commit that first"
        );
        self.input.replace(Some(signal.clone()));
    }

    /// Returns what is in use between two runs.
    #[must_use]
    pub fn resources(&self) -> Resources {
        Resources {
            heap_bytes: heap::in_use_bytes(),
            contexts: 0,
            contexts_free: 0,
        }
    }

    /// Prints how much memory the run has needed, as a `memory` machine line.
    pub fn report_memory(&self) {
        let (peak, all) = (heap::peak_bytes(), memory_kib());
        crate::println!(
            "heap: {} KiB at its peak, of {all} KiB",
            peak.div_ceil(1024)
        );
        json::emit("memory", |line| {
            line.number("heap_peak_bytes", peak as u64)
                .number("heap_bytes", all * 1024)
                .number("allocations", heap::allocations());
        });
    }

    /// Returns how the app ends whose function has returned `result`.
    pub(crate) fn judge(&self, result: Result<(), Ending>) -> Result<(), Ending> {
        self.bound_verdict.judge(self.fault_verdict.judge(result))
    }
}

/// Says which faults there were, as the kernel does at once.
fn tell_faults(run: &linux::Run) {
    for fault in run.faults() {
        let instance = fault.instance;
        let cause = if fault.is_overrun {
            "budget overrun"
        } else {
            "panic"
        };
        let dag = run.task_set().dag(instance.dag);
        let subtask = dag.subtask(instance.subtask).name();
        crate::println!(
            "fault: {cause} in subtask `{subtask}` of dag `{}`, job {}: {}; {}",
            dag.name(),
            instance.job,
            fault.cause,
            fault.cost.consequence()
        );
        json::report("fault", |line| {
            line.text("cause", cause)
                .number("dag", instance.dag.0)
                .text("dag_name", dag.name())
                .number("subtask", instance.subtask.0)
                .text("subtask_name", subtask)
                .number("job", instance.job)
                .text("cost", fault.cost.word())
                .number("cpu", 0_u32)
                .text("place", "unknown")
                .text("message", &fault.cause);
        });
    }
}

/// Returns how much memory the computer has.
pub(crate) fn memory_kib() -> u64 {
    let text = fs::read_to_string("/proc/meminfo").unwrap_or_default();
    let line = text.lines().find(|line| line.starts_with("MemTotal:"));
    let number = line.and_then(|line| line.split_whitespace().nth(1)?.parse().ok());
    number.unwrap_or(0)
}
