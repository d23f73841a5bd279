//! The machine as an app sees it.

use core::cell::Cell;
use core::fmt;
use core::panic::Location;
use core::time::Duration;

use fass::{Platform, Policy, Preemption, Signal};
use sched_dag::DagId;

use crate::options::Options;
use crate::report::{self, Ns};
use crate::watch::background::{Background, LINE, Wishes};
use executive::machine;
use executive::machine::interrupts_off;
use executive::memory::heap;
use executive::run::platform::KERNEL;
use executive::run::{edge, execution, heartbeat, worker};
use executive::text::console;
use front::app::bound_verdict::BoundVerdict;
use front::app::ending::Ending;
use front::app::fault_verdict::FaultVerdict;
use front::app::wcet_notes;
use front::json;
use sched_dag::engine::{Counts, Run};

/// The machine, lent to the app's function for the time of the run.
///
/// An app's function gets it; there is no other way to one.
///
/// ```no_run
/// use kernel::{Ending, Machine, println};
///
/// fn app(machine: &Machine) -> Result<(), Ending> {
///     let jobs = machine.options().number("jobs", 1..=100_000, 100)?;
///     machine.options().finish(&["jobs"])?;
///     // build DAGs with that number of jobs and commit them
///     let run = machine.run()?;
///     machine.report_memory();
///     println!("{} cores, {} allocations", machine.cores(), run.allocations());
///     Ok(())
/// }
/// ```
#[derive(Debug)]
pub struct Machine {
    pub(crate) options: Options<'static>,
    pub(crate) module: Cell<Option<&'static [u8]>>,
    /// Whether the app has asked for that.
    pub(crate) has_asked: Cell<bool>,
    /// Whether each run's trace is printed after it.
    pub(crate) dumps_trace: bool,
    /// Whether each run's statistics are printed after it.
    pub(crate) dumps_times: bool,
    /// What people want to see, and say, during a run.
    pub(crate) wishes: Wishes,
    /// What bytes of input raise during a run: a plan and a DAG of it.
    pub(crate) input: Cell<Option<(u64, DagId)>>,
    /// How many runs have ended.
    pub(crate) runs: Cell<u64>,
    /// Whether faults in them make the app fail.
    pub(crate) fault_verdict: FaultVerdict,
    /// Whether response times beyond their bounds do.
    pub(crate) bound_verdict: BoundVerdict,
}

impl Machine {
    /// Returns the words of the command line that the kernel left to the app.
    ///
    /// See [`Options`].
    #[must_use]
    pub const fn options(&self) -> &Options<'static> {
        &self.options
    }

    /// Returns the file that the loader left in memory (`qemu -initrd FILE`), if
    /// there is one. It is not copied: memory and the boot's time are the same
    /// for files of any size. If there is one and the app never asks for it, the
    /// kernel says so at the end.
    ///
    /// ```no_run
    /// fn size(machine: &kernel::Machine) -> usize {
    ///     machine.module().map_or(0, <[u8]>::len)
    /// }
    /// ```
    #[must_use]
    pub fn module(&self) -> Option<&'static [u8]> {
        self.has_asked.set(true);
        self.module.get()
    }

    /// Reports whether a person can talk to the kernel during a run (`console=on`), and
    /// so end one that would not end by itself.
    ///
    /// ```no_run
    /// fn least_jobs(machine: &kernel::Machine) -> u64 {
    ///     u64::from(!machine.has_console()) // 0 is without end
    /// }
    /// ```
    #[must_use]
    pub const fn has_console(&self) -> bool {
        self.wishes.console.is_some()
    }

    /// Returns the number of cores that run subtasks.
    ///
    /// See [`Machine`].
    #[must_use]
    pub fn cores(&self) -> u32 {
        KERNEL.cores()
    }

    /// Chooses policy and preemption of the commits to come, instead of what the
    /// command line says.
    ///
    /// ```no_run
    /// use fass::{Policy, Preemption};
    ///
    /// fn compare(machine: &kernel::Machine) -> Result<(), kernel::Ending> {
    ///     for policy in [Policy::StaticPriority, Policy::Edf] {
    ///         machine.configure(policy, Preemption::Enabled);
    ///         // build and commit the DAGs anew
    ///         machine.run()?;
    ///     }
    ///     Ok(())
    /// }
    /// ```
    pub fn configure(&self, policy: Policy, preemption: Preemption) {
        KERNEL.set_policy(policy);
        KERNEL.set_preemption(preemption);
    }

    /// Makes events that are less than `window` apart count as one instant in the
    /// runs to come: the scheduler decides that long after the first of them,
    /// and has then seen them all. With 0, as at the start, it decides after
    /// each event at once.
    ///
    /// In a model, completions and releases can fall on the same instant, and
    /// one dispatch sees them all. On a machine they come one after the other,
    /// however close, and a decision between two of them starts or preempts what
    /// the model would not. To compare the machine with the model, they have to
    /// be taken together again. The price is that every decision comes `window`
    /// later.
    ///
    /// ```no_run
    /// fn compare_with_model(machine: &kernel::Machine) {
    ///     machine.set_coincidence(core::time::Duration::from_micros(10));
    /// }
    /// ```
    pub fn set_coincidence(&self, window: Duration) {
        KERNEL.set_coincidence_ns(u64::try_from(window.as_nanos()).unwrap_or(u64::MAX));
    }

    /// Leaves it to the app to judge faults. Unless it says so, at any time before its
    /// function returns, a fault that ended a DAG in any of its runs makes it fail.
    ///
    /// ```no_run
    /// fn may_lose_a_camera(machine: &kernel::Machine) -> Result<(), kernel::Ending> {
    ///     machine.accept_faults();
    ///     let run = machine.run()?;
    ///     let cameras = [sched_dag::DagId(0), sched_dag::DagId(1)];
    ///     let lost = cameras.map(|dag| run.statistics(dag).faults > 0);
    ///     match lost {
    ///         [true, true] => Err(kernel::Ending::Failure("both cameras are lost".into())),
    ///         _ => Ok(()),
    ///     }
    /// }
    /// ```
    pub fn accept_faults(&self) {
        self.fault_verdict.accept();
    }

    /// Leaves it to the app to judge response times beyond their proven bounds. Unless
    /// it says so, at any time before its function returns, one in any of its runs makes
    /// it fail (not in the tool's mode `threads`). A line says so in any case.
    ///
    /// ```no_run
    /// fn measures_wcets(machine: &kernel::Machine) -> Result<(), kernel::Ending> {
    ///     machine.accept_exceeded_bounds(); // those stated are guesses
    ///     machine.run().map(drop)
    /// }
    /// ```
    pub fn accept_exceeded_bounds(&self) {
        self.bound_verdict.accept();
    }

    /// Runs the committed DAGs until each has ended all its jobs.
    ///
    /// The calling core takes part. Progress is printed in machine lines of
    /// kind `progress`, by core 0's background. A fault ends its DAG, and makes the app
    /// fail (see [`accept_faults`](Self::accept_faults)).
    ///
    /// # Errors
    ///
    /// [`Ending::Failure`] if nothing has been committed since the last run.
    /// [`Ending::Shutdown`] if a person has ended the run, at the console or by ctrl-C: then each
    /// DAG has ended the jobs that it had in flight and released no more. If that
    /// run broke a rule of the model, it is a failure instead.
    ///
    /// See [`Run`].
    pub fn run(&self) -> Result<Run, Ending> {
        /// Time for the cores to get ready between now and the first release.
        const LEAD_NS: u64 = 100_000;
        self.run_from(machine::clock::now_ns() + LEAD_NS)
    }

    /// Works like [`run`](Self::run), with the releases counted from `epoch_ns` on
    /// the clock of [`fass::now_ns`]. If that is past, releases are late.
    ///
    /// # Errors
    ///
    /// As [`run`](Self::run).
    ///
    /// ```no_run
    /// /// Sets the first release to a second from now.
    /// fn later(machine: &kernel::Machine) -> Result<kernel::Run, kernel::Ending> {
    ///     machine.run_from(fass::now_ns() + 1_000_000_000)
    /// }
    /// ```
    pub fn run_from(&self, epoch_ns: u64) -> Result<Run, Ending> {
        let nothing = || Ending::Failure("nothing is committed; call finish_create_dags".into());
        let total = execution::begin(epoch_ns).ok_or_else(nothing)?;
        let mut outgoing = edge::begin(epoch_ns);
        let allocations_before = heap::usage().allocations;
        let locks_before = execution::lock_acquisitions();
        console::defer();
        execution::arm_all();
        let mut background = Background::begin(self.wishes.with_input(self.input.get()), total);
        // What was measured before, while booting and printing, does not count.
        let _ = interrupts_off::take_longest();
        worker::wait_in_background(|| edge::send(&mut outgoing) | background.step());
        let shuts_down = background.end();
        let longest = interrupts_off::take_longest();
        let allocations = heap::usage().allocations - allocations_before;
        let locks = execution::lock_acquisitions().wrapping_sub(locks_before);
        let dropped = console::resume();
        if dropped > 0 {
            // What was cut off has most likely lost the end of its line.
            crate::println!("\n({dropped} bytes of output did not fit in the buffer)");
        }
        let run = execution::end().ok_or_else(nothing)?;
        edge::end(outgoing, !shuts_down);
        let run = run.with_counts(Counts {
            epoch_ns,
            allocations,
            lock_acquisitions: locks,
        });
        report::left::dump(&run);
        let faults = |dag| run.statistics(dag).faults - run.statistics(dag).restarts;
        self.fault_verdict.note(run.task_set(), faults);
        self.bound_verdict.note(&run);
        wcet_notes::note(&run, KERNEL.overheads());
        if let Some(line) = LINE.get() {
            line.report();
        }
        if let Some((ticks, place)) = longest {
            report_interrupts_off(machine::clock::ticks_to_ns(ticks), place);
        }
        report::stacks::dump(&run);
        if self.dumps_times {
            report::times::dump(&run);
        }
        if self.dumps_trace {
            report::trace::dump(&run, self.runs.replace(self.runs.get() + 1));
        }
        if shuts_down {
            return Err(Ending::after_shutdown(&run));
        }
        Ok(run)
    }

    /// Makes each byte that the serial port receives during runs raise a signal, in
    /// place of the signal named before. With `console=on` bytes are the console's
    /// and raise nothing.
    ///
    /// Core 0 looks for bytes when it has nothing else to do, so one may count up to
    /// 20 ms late, and later where that core is busy.
    ///
    /// # Panics
    ///
    /// If the signal's DAG is not committed.
    ///
    /// ```no_run
    /// use core::time::Duration;
    /// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
    ///
    /// fn answer_keys(machine: &kernel::Machine) -> Result<(), kernel::Ending> {
    ///     let dag = create_dag();
    ///     dag.jobs(10).relative_deadline(Duration::from_millis(5));
    ///     let least = Duration::from_millis(50);
    ///     let answer = SubtaskAttributes::named("answer");
    ///     let key = dag.register_sporadic_subtask(|| (), Vec::new(), least, answer);
    ///     finish_create_dags(&[dag])?;
    ///     machine.raise_on_input(&key);
    ///     machine.run().map(drop)
    /// }
    /// ```
    pub fn raise_on_input(&self, signal: &Signal) {
        let target = signal.target();
        assert!(
            target.is_some(),
            "a signal is connected before its DAG is committed; commit that first"
        );
        self.input.set(target);
    }

    /// Interrupts every core each `period` from now on, besides what scheduling
    /// needs; back to normal if 0. For tests of the kernel's own robustness.
    ///
    /// ```no_run
    /// fn disturb(machine: &kernel::Machine) {
    ///     machine.set_heartbeat(core::time::Duration::from_micros(50));
    /// }
    /// ```
    pub fn set_heartbeat(&self, period: Duration) {
        heartbeat::set_heartbeats(u64::try_from(period.as_nanos()).unwrap_or(u64::MAX));
    }
}

/// Prints the longest section of a run without interrupts.
fn report_interrupts_off(longest_ns: u64, place: &Location<'_>) {
    let place = fmt::from_fn(|f| write!(f, "{}:{}", place.file(), place.line()));
    crate::println!(
        "longest section without interrupts: {}, from {place}",
        Ns(longest_ns)
    );
    json::emit("interrupts_off", |line| {
        line.number("longest_ns", longest_ns).text("place", &place);
    });
}
