//! The machine as an app sees it, on whatever system it runs.
//!
//! What an app may ask of it, how a run is judged and what is told of it are the same everywhere.
//! What a system does itself is in its [`System`], by which each crate that apps know as `kernel`
//! names its own `Machine`.

use alloc::string::String;
use core::cell::{Cell, RefCell};
use core::time::Duration;

use fass::{Policy, Preemption, Signal, Terms, Wire};
use sched_dag::engine::Run;

use super::ending::Ending;
use super::verdict::{self, Verdict};
use crate::options::{Options, UsageError};
use crate::report::Memory;
use crate::shell::LiveRun;

/// What an app's machine is made of: the bare machine, or Linux.
///
/// See [`Machine`].
pub trait System: Sized {
    /// The run that a person can talk to.
    type Run: LiveRun + 'static;

    /// Reports whether a person can talk to a run.
    fn has_console(&self) -> bool {
        false
    }

    /// Returns the terms of the commits to come.
    fn terms(&self) -> Terms;

    /// Changes these, as far as the system allows it.
    fn change(&self, change: impl FnOnce(&mut Terms));

    /// Makes events that are less than `window` apart count as one instant.
    fn set_coincidence(&self, window: Duration);

    /// Runs the committed DAGs, from `epoch_ns` on or as soon as may be, and tells what is its
    /// own of the run.
    fn run(&self, epoch_ns: Option<u64>, input: Option<&Signal>) -> Result<Run, Ending>;

    /// Reports whether a person has ended the latest run.
    fn is_shut_down(&self) -> bool;

    /// Connects a wire to the device that the words name. The script of a device is taken from
    /// the end of the app's file.
    fn connect(
        &self,
        wire: &Wire,
        options: &Options<'static>,
        module: &Cell<Option<&'static [u8]>>,
    ) -> Result<(), Ending>;

    /// Has the topics of the runs to come be there to be looked at.
    fn let_look(&self);

    /// Measures what it takes itself, and charges that with so many hundredths more.
    fn measure_overheads(margin_percent: u32) -> Result<(), Ending>;

    /// Returns how many contexts there are for instances, and how many of these can be taken.
    fn contexts() -> (usize, usize) {
        (0, 0)
    }

    /// Returns what was wrong with a recording: why it could not be replayed, and what makes the app
    /// fail, if anything was.
    fn objections() -> [Option<String>; 2];

    /// Returns what memory is needed.
    fn memory() -> Memory;
}

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
pub struct Machine<S> {
    pub(super) system: S,
    pub(super) options: Options<'static>,
    pub(super) module: Cell<Option<&'static [u8]>>,
    /// Whether the app has asked for that.
    has_asked: Cell<bool>,
    /// What bytes of input raise during a run.
    input: RefCell<Option<Signal>>,
    /// Whether what they were like makes the app fail.
    verdict: Verdict,
}

impl<S: System> Machine<S> {
    /// Lends `app` the machine that a system makes, and returns how the app ends. `module` is the
    /// app's file.
    ///
    /// See [`Machine`].
    #[doc(hidden)]
    pub fn serve(
        system: S,
        options: Options<'static>,
        module: Option<&'static [u8]>,
        verdict: Verdict,
        app: fn(&Self) -> Result<(), Ending>,
    ) -> Result<(), Ending> {
        let machine = Self {
            system,
            options,
            module: Cell::new(module),
            has_asked: Cell::new(false),
            input: RefCell::new(None),
            verdict,
        };
        let result = app(&machine);
        if result.is_ok() && machine.module.get().is_some() && !machine.has_asked.get() {
            crate::println!(
                "warning: the app takes no file, and has not looked at the one it was given"
            );
        }
        let complaint = machine.verdict.complaint();
        match S::objections() {
            [Some(refusal), _] => Err(UsageError::new(refusal).into()),
            [None, other] => Ending::or_complaint(result, complaint.or(other)),
        }
    }

    /// Returns the words of the command line that the kernel left to the app.
    ///
    /// See [`Options`].
    #[must_use]
    pub const fn options(&self) -> &Options<'static> {
        &self.options
    }

    /// Returns the file that the loader left in memory (`qemu -initrd FILE`), or on Linux the one
    /// that the word `module=` names, if there is one. The loader's is not copied: memory and the
    /// boot's time are the same for files of any size. If there is one and the app never asks for
    /// it, a line says so at the end.
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
    pub fn has_console(&self) -> bool {
        self.system.has_console()
    }

    /// Returns the number of cores that run subtasks.
    ///
    /// See [`Machine`].
    #[must_use]
    pub fn cores(&self) -> u32 {
        self.system.terms().scheduler.cores
    }

    /// Chooses policy and preemption of the commits to come, instead of what the
    /// command line says. On Linux nothing is preempted without the right to use SCHED_FIFO.
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
        self.system.change(|terms| {
            (terms.scheduler.policy, terms.scheduler.preemption) = (policy, preemption);
        });
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
    /// later. On Linux the next run is refused, unless `window` is 0.
    ///
    /// ```no_run
    /// fn compare_with_model(machine: &kernel::Machine) {
    ///     machine.set_coincidence(core::time::Duration::from_micros(10));
    /// }
    /// ```
    pub fn set_coincidence(&self, window: Duration) {
        self.system.set_coincidence(window);
    }

    /// Leaves it to the app to judge faults. Unless it says so, at any time before its
    /// function returns, a fault that ended a DAG in any of its runs makes it fail.
    ///
    /// ```no_run
    /// fn may_lose_a_camera(machine: &kernel::Machine) -> Result<(), kernel::Ending> {
    ///     machine.accept_faults();
    ///     let run = machine.run()?;
    ///     let lost = ["left", "right"].map(|camera| run.statistics(camera).faults > 0);
    ///     match lost {
    ///         [true, true] => Err(kernel::Ending::Failure("both cameras are lost".into())),
    ///         _ => Ok(()),
    ///     }
    /// }
    /// ```
    pub fn accept_faults(&self) {
        self.verdict.accept_faults();
    }

    /// Leaves it to the app to judge response times beyond their proven bounds. Unless
    /// it says so, at any time before its function returns, one in any of its runs makes
    /// it fail (neither in the tool's mode `threads` nor on Linux). A line says so in any case.
    ///
    /// ```no_run
    /// fn measures_wcets(machine: &kernel::Machine) -> Result<(), kernel::Ending> {
    ///     machine.accept_exceeded_bounds(); // those stated are guesses
    ///     machine.run().map(drop)
    /// }
    /// ```
    pub fn accept_exceeded_bounds(&self) {
        self.verdict.accept_exceeded_bounds();
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
    /// [`Ending::Shutdown`] if a person has ended the run, at the console, by ctrl-C, or on Linux by
    /// SIGTERM: then each DAG has ended the jobs that it had in flight and released no more. If that
    /// run broke a rule of the model, it is a failure instead.
    ///
    /// See [`Run`].
    pub fn run(&self) -> Result<Run, Ending> {
        self.run_when(None)
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
        self.run_when(Some(epoch_ns))
    }

    // Within an app's function it would make the image larger.
    #[inline(never)]
    fn run_when(&self, epoch_ns: Option<u64>) -> Result<Run, Ending> {
        let run = self.system.run(epoch_ns, self.input.borrow().as_ref())?;
        self.verdict.note(&run);
        verdict::note(&run, self.system.terms().overheads);
        if self.system.is_shut_down() {
            return Err(Ending::after_shutdown(&run));
        }
        Ok(run)
    }

    /// Makes each byte that the serial port receives during runs raise a signal, in
    /// place of the signal named before. With `console=on` bytes are the console's
    /// and raise nothing. On Linux it is whatever arrives on standard input.
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
    ///     let key = dag.sporadic(Duration::from_millis(50));
    ///     dag.source(|| ()).register(SubtaskAttributes::named("answer"));
    ///     finish_create_dags(&[dag])?;
    ///     machine.raise_on_input(&key);
    ///     machine.run().map(drop)
    /// }
    /// ```
    pub fn raise_on_input(&self, signal: &Signal) {
        assert!(
            signal.target().is_some(),
            "a signal is connected before its DAG is committed; commit that first"
        );
        self.input.replace(Some(signal.clone()));
    }
}
