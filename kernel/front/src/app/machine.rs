//! The machine as an app sees it, on whatever system it runs.
//!
//! Its methods, how a run is judged and what is told of it are the same everywhere.
//! The part that differs is in its [`System`], by which each crate that apps know as `kernel`
//! names its own `Machine`.
//!
//! An image has the code of those services alone that its app asks for.

use alloc::borrow::ToOwned;
use alloc::boxed::Box;
use alloc::vec::Vec;
use core::cell::{Cell, RefCell};
use core::net::SocketAddrV4;
use core::time::Duration;

use fass::commit::CoreDivision;
use fass::platform::{self, Protocol, RunConfig, call_app};
use fass::shared::{Signal, Tunable, WallClock, Wire};
use fass::{Dag, Policy, Preemption};
use sched_dag::engine::Run;

use super::ending::AppError;
use super::ending::{self, RunVerdict};
use crate::options::{CommandLine, UsageError};
use crate::report::{self, HeapUsage, MemoryInUse};
use crate::shell::parameters::ParameterTable;
use crate::shell::topics::TopicCommands;
use crate::shell::{LiveRun, PARAMETERS, TOPICS};

/// The system below an app's machine: the bare machine, or Linux.
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
    fn terms(&self) -> RunConfig;

    /// Changes these, as far as the system allows it.
    fn change(&self, change: impl FnOnce(&mut RunConfig));

    /// Makes events that are less than `window` apart count as one instant.
    fn set_coincidence(&self, window: Duration);

    /// Runs the committed DAGs, from `epoch_ns` on or as soon as may be, and tells what is its
    /// own of the run.
    fn run(&self, epoch_ns: Option<u64>, input: Option<&Signal>) -> Result<Run, AppError>;

    /// Reports whether a person has ended the latest run.
    fn is_shut_down(&self) -> bool;

    /// Connects a wire to the device that the words name. The script of a device is taken from
    /// the end of the app's file.
    fn connect(
        &self,
        wire: &Wire,
        options: &CommandLine<'static>,
        module: &Cell<Option<&'static [u8]>>,
    ) -> Result<(), AppError>;

    /// Connects a protocol to its peer, by the words for the network.
    fn connect_protocol(
        &self,
        protocol: Box<dyn Protocol>,
        peer: SocketAddrV4,
        options: &CommandLine<'static>,
    ) -> Result<(), AppError>;

    /// Returns a number that is hardly another machine's, or one of this machine's before.
    fn seed() -> u128;

    /// Returns the Unix time now, in nanoseconds, if the system knows it.
    fn unix_ns() -> Option<u64>;

    /// Measures what it takes itself, and charges that with so many hundredths more.
    fn measure_overheads(margin_percent: u32) -> Result<(), AppError>;

    /// Returns how many contexts there are for instances, and how many of these can be taken.
    fn contexts() -> (usize, usize) {
        (0, 0)
    }

    /// Returns how much memory is and was in use.
    fn memory() -> HeapUsage;
}

/// The machine, lent to the app's function for the time of the run.
///
/// An app's function gets it; there is no other way to one.
///
/// ```no_run
/// use kernel::{AppError, Machine, println};
///
/// fn app(machine: &Machine) -> Result<(), AppError> {
///     let jobs = machine.options().number("jobs", 1..=100_000, 100)?;
///     machine.options().finish(&["jobs"])?;
///     // build DAGs with that number of jobs and commit them
///     let run = machine.run()?;
///     machine.report_memory();
///     println!("{} cores, {} allocations", machine.cores(), run.allocations());
///     Ok(())
/// }
/// ```
pub struct Machine<S> {
    pub(super) system: S,
    pub(super) options: CommandLine<'static>,
    pub(super) module: Cell<Option<&'static [u8]>>,
    /// Whether the app has asked for that.
    has_asked: Cell<bool>,
    /// The signal that bytes of input raise during a run.
    input: RefCell<Option<Signal>>,
    /// Whether what they were like makes the app fail.
    verdict: RunVerdict,
}

impl<S: System> Machine<S> {
    /// Lends `app` the machine that a system makes, and returns how the app ends. `module` is the
    /// app's file.
    #[doc(hidden)]
    pub fn serve(
        system: S,
        options: CommandLine<'static>,
        module: Option<&'static [u8]>,
        verdict: RunVerdict,
        app: fn(&Self) -> Result<(), AppError>,
    ) -> Result<(), AppError> {
        let machine = Self {
            system,
            options,
            module: Cell::new(module),
            has_asked: Cell::new(false),
            input: RefCell::new(None),
            verdict,
        };
        let result = call_app(|| app(&machine));
        if result.is_ok() && machine.module.get().is_some() && !machine.has_asked.get() {
            crate::println!(
                "warning: the app takes no file, and has not looked at the one it was given"
            );
        }
        let complaint = machine.verdict.complaint();
        match platform::objections() {
            [Some(refusal), _] => Err(UsageError::new(refusal).into()),
            [None, other] => AppError::or_complaint(result, complaint.or(other)),
        }
    }

    /// Returns the words of the command line that the kernel left to the app.
    ///
    /// See [`CommandLine`].
    pub const fn options(&self) -> &CommandLine<'static> {
        &self.options
    }

    /// Returns the file that the loader left in memory (`qemu -initrd FILE`), or on Linux the one
    /// that the word `module=` names, if there is one. The loader's is not copied: memory and the
    /// boot's time are the same for files of any size. If there is one and the app never asks for
    /// it, a line says so at the end.
    pub fn module(&self) -> Option<&'static [u8]> {
        self.has_asked.set(true);
        self.module.get()
    }

    /// Reports whether a person can talk to the kernel during a run (`console=on`), and
    /// so end one that would not end by itself.
    pub fn has_console(&self) -> bool {
        self.system.has_console()
    }

    /// Returns the number of cores that run subtasks.
    pub fn cores(&self) -> u32 {
        self.system.terms().scheduler.cores
    }

    /// Chooses policy and preemption of the commits to come, instead of what the
    /// command line says. On Linux nothing is preempted without the right to use SCHED_FIFO.
    ///
    /// ```no_run
    /// use fass::{Policy, Preemption};
    ///
    /// fn compare(machine: &kernel::Machine) -> Result<(), kernel::AppError> {
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
    pub fn set_coincidence(&self, window: Duration) {
        self.system.set_coincidence(window);
    }

    /// Leaves it to the app to judge faults. Unless it says so, at any time before its
    /// function returns, a fault that ended a DAG in any of its runs makes it fail.
    ///
    /// ```no_run
    /// fn may_lose_a_camera(machine: &kernel::Machine) -> Result<(), kernel::AppError> {
    ///     machine.accept_faults();
    ///     let run = machine.run()?;
    ///     let lost = ["left", "right"].map(|camera| run.statistics(camera).faults > 0);
    ///     match lost {
    ///         [true, true] => Err(kernel::AppError::Failure("both cameras are lost".into())),
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
    /// [`AppError::Failure`] if nothing has been committed since the last run.
    /// [`AppError::Shutdown`] if a person has ended the run, at the console, by ctrl-C, or on
    /// Linux by
    /// SIGTERM: then each DAG has ended the jobs that it had in flight and released no more. If
    /// that
    /// run broke a rule of the model, it is a failure instead.
    ///
    /// See [`Run`].
    pub fn run(&self) -> Result<Run, AppError> {
        self.run_when(None)
    }

    /// Works like [`run`](Self::run), with the releases counted from `epoch_ns` on
    /// the clock of [`fass::now_ns`]. If that is past, releases are late.
    ///
    /// # Errors
    ///
    /// As [`run`](Self::run).
    pub fn run_from(&self, epoch_ns: u64) -> Result<Run, AppError> {
        self.run_when(Some(epoch_ns))
    }

    // Within an app's function it would make the image larger.
    #[inline(never)]
    fn run_when(&self, epoch_ns: Option<u64>) -> Result<Run, AppError> {
        let run = self.system.run(epoch_ns, self.input.borrow().as_ref())?;
        let is_shut_down = self.system.is_shut_down();
        if is_shut_down {
            // Before anything that may take longer than a person waits.
            report::show_counts(&run);
        }
        self.verdict.note(&run);
        ending::note(&run, self.system.terms().overheads);
        if is_shut_down {
            return Err(AppError::after_shutdown(&run));
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
    /// fn answer_keys(machine: &kernel::Machine) -> Result<(), kernel::AppError> {
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

/// The margin if nobody states one, in hundredths.
const MARGIN_PERCENT: u64 = 20;

impl<S: System> Machine<S> {
    /// Connects a wire to what its [word](super::endpoint) says. Without one it is the second serial
    /// port (COM2, at I/O port 0x2f8): what is sent goes there in the runs to come, and what the port gets
    /// arrives. If the word `input=` says that the end of the loader's module is a script, that arrives
    /// instead, in each run. To be called before
    /// [`CommandLine::finish`](crate::options::CommandLine::finish), which otherwise refuses these words,
    /// and before [`module`](Self::module).
    ///
    /// The port is looked at every millisecond. Core 0 sends when it has nothing else to do.
    /// After each run a line says what the wire has counted. On Linux standard input (`input=-`) and a
    /// file (`output=FILE`) are in the port's place.
    ///
    /// # Errors
    ///
    /// [`AppError::Usage`] if there is no such port, another wire has it, or neither end is named;
    /// [`AppError::Failure`] if the wire is connected already.
    ///
    /// ```no_run
    /// use fass::shared::{Received, Wire};
    /// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
    ///
    /// fn listen(machine: &kernel::Machine) -> Result<(), kernel::AppError> {
    ///     let wire = Wire::new("keys");
    ///     machine.connect(&wire)?;
    ///     machine.options().finish(&[])?;
    ///     let (dag, ms) = (create_dag(), core::time::Duration::from_millis);
    ///     dag.jobs(10).relative_deadline(ms(5));
    ///     dag.sporadic(ms(50));
    ///     let hear = |keys: Received<'_, u8>| kernel::println!("{} lines", keys.count());
    ///     dag.using(wire.receiving(|line| line.first().copied()))
    ///         .source(hear)
    ///         .register(SubtaskAttributes::named("hear"));
    ///     finish_create_dags(&[dag])?;
    ///     machine.run().map(drop)
    /// }
    /// ```
    pub fn connect(&self, wire: &Wire) -> Result<(), AppError> {
        self.system.connect(wire, &self.options, &self.module)
    }

    /// Sets a clock of Unix time by the machine's own: that of a PC is right within a second, at best.
    /// In mode `deterministic` it is set by the first second of 2000, on the guest's clock.
    ///
    /// # Errors
    ///
    /// [`AppError::Failure`] if the machine keeps no date.
    ///
    /// ```no_run
    /// fn app(machine: &kernel::Machine) -> Result<(), kernel::AppError> {
    ///     let clock = fass::shared::WallClock::new();
    ///     machine.set_clock(&clock)?;
    ///     machine.options().finish(&[])?;
    ///     // a source that uses `clock.reading()` stamps what it makes
    ///     machine.run().map(drop)
    /// }
    /// ```
    pub fn set_clock(&self, clock: &WallClock) -> Result<(), AppError> {
        let unix_ns = S::unix_ns().ok_or_else(|| {
            let line = "the machine has no clock that keeps the date; state the time by \
                        `WallClock::correct`";
            AppError::Failure(line.into())
        })?;
        clock.correct(fass::now_ns(), unix_ns, Duration::ZERO);
        Ok(())
    }

    /// Lets people look at topics at the console: `echo TOPIC` shows values of those that are
    /// recorded ([`Dag::record`](fass::Dag::record)) as they are completed, `hz TOPIC` says how
    /// often any topic was written lately. To be called before the commit. Without a console it
    /// does nothing.
    ///
    /// ```no_run
    /// fn app(machine: &kernel::Machine) -> Result<(), kernel::AppError> {
    ///     machine.show_topics();
    ///     machine.options().finish(&[])?;
    ///     // build DAGs, record topics, commit
    ///     machine.run().map(drop)
    /// }
    /// ```
    pub fn show_topics(&self) {
        if self.has_console() {
            platform::let_look();
            // Once is enough.
            TOPICS.set(Box::leak(Box::new(TopicCommands::<S::Run>::new())));
        }
    }

    /// Lets people set parameters: at the console by `set NAME VALUE`, before the first run by the
    /// word `set=NAME=VALUE,...` of the command line, which `./scripts/run --set` and `--params`
    /// make. To be called before [`CommandLine::finish`](crate::options::CommandLine::finish),
    /// which
    /// otherwise refuses that word.
    ///
    /// # Errors
    ///
    /// [`AppError::Usage`] in one line, if the word names no parameter, or no value of its type and
    /// range; [`AppError::Failure`] if two have one name, or it was called before.
    ///
    /// ```no_run
    /// use fass::shared::Parameter;
    ///
    /// fn gain(machine: &kernel::Machine) -> Result<Parameter<f64>, kernel::AppError> {
    ///     let gain = Parameter::new("gain", 0.5, 0.0..=2.0);
    ///     machine.offer(&[&gain])?;
    ///     machine.options().finish(&[])?;
    ///     Ok(gain)
    /// }
    /// ```
    pub fn offer(&self, parameters: &[&dyn Tunable]) -> Result<(), AppError> {
        let offered = ParameterTable::new(parameters).map_err(AppError::Failure)?;
        if let Some(word) = self.options.text("set") {
            offered.set_all(word)?;
        }
        match PARAMETERS.set(Box::leak(Box::new(offered))) {
            true => Ok(()),
            false => Err(AppError::Failure(
                "parameters are offered twice; offer all at once".into(),
            )),
        }
    }

    /// Takes the word `overheads`. With `overheads=measured` the kernel runs DAGs of its own
    /// now, on all cores, and measures what it takes itself; the commits to come charge that
    /// with a margin of 20 %, or `overheads_margin=PERCENT`, and their answers say so.
    ///
    /// To be called before anything is committed and before the cores are divided. It settles
    /// the size of stacks: subtasks may state no more than 64 KiB then.
    ///
    /// # Errors
    ///
    /// If the words are wrong, or `overheads_ns` states the overheads besides; if there is no
    /// memory for it; on Linux, where what it costs is not measured.
    ///
    /// ```no_run
    /// fn take_part(machine: &kernel::Machine) -> Result<(), kernel::AppError> {
    ///     machine.offer_overheads()?;
    ///     machine.options().finish(&["overheads", "overheads_margin"])?;
    ///     // build and commit DAGs
    ///     machine.run().map(drop)
    /// }
    /// ```
    pub fn offer_overheads(&self) -> Result<(), AppError> {
        let options = self.options();
        let measures = options.choice("overheads", &[("stated", false), ("measured", true)])?;
        let margin = options.text("overheads_margin").is_some();
        let percent = options.number("overheads_margin", 0..=10_000, MARGIN_PERCENT)?;
        if measures && options.text("overheads_ns").is_some() {
            let line = "`overheads=measured` and `overheads_ns` exclude each other; give one";
            return Err(UsageError::new(line).into());
        }
        if margin && !measures {
            let line = "`overheads_margin` is for overheads that are measured; add \
                        `overheads=measured`, or leave it out";
            return Err(UsageError::new(line).into());
        }
        match measures {
            true => S::measure_overheads(u32::try_from(percent).unwrap_or(u32::MAX)),
            false => Ok(()),
        }
    }

    /// Returns what is in use and what is free between two runs: the same after
    /// equal work, unless something leaks. During a run the stacks of running instances are not
    /// free.
    ///
    /// ```no_run
    /// fn leaks(machine: &kernel::Machine, work: impl Fn()) -> bool {
    ///     work();
    ///     let before = machine.resources();
    ///     work();
    ///     machine.resources() != before
    /// }
    /// ```
    pub fn resources(&self) -> MemoryInUse {
        let (contexts, contexts_free) = S::contexts();
        MemoryInUse {
            heap_bytes: S::memory().in_use_bytes,
            contexts,
            contexts_free,
        }
    }

    /// Prints how much memory the run has needed, as a `memory` machine line.
    pub fn report_memory(&self) {
        S::memory().report();
    }

    /// Divides the cores, from core 0 on, into clusters of so many each in the commits to come;
    /// no number: they are not divided. Each cluster schedules its own DAGs
    /// ([`fass::Dag::cluster`]).
    pub fn divide(&self, sizes: &[u32]) {
        self.system.change(|terms| terms.divide(sizes));
    }

    /// Gives the commits to come a certificate, and so [fixes](RunConfig::certificate) their set; an
    /// empty text does neither.
    pub fn fix(&self, certificate: &str) {
        let text = (!certificate.is_empty()).then(|| certificate.to_owned().into());
        self.system.change(|terms| terms.certificate = text);
    }

    /// Leaves that to the command line's word `clusters`: `clusters=2,2` divides the cores so;
    /// with `clusters=auto` the commit does ([`sched_dag::analysis::assign()`]): a DAG that
    /// needs several cores gets a cluster of its own, the others share clusters of one core each.
    /// For that all subtasks need WCETs, and no DAG states a cluster. Without the word cores are
    /// not divided. An app that reads options calls it before
    /// [`finish`](crate::options::CommandLine::finish), which refuses words that nothing has read.
    ///
    /// # Errors
    ///
    /// If the word is neither `auto` nor numbers of cores.
    ///
    /// ```no_run
    /// fn take_part(machine: &kernel::Machine) -> Result<(), kernel::AppError> {
    ///     machine.offer_clusters()?;
    ///     // build and commit DAGs
    ///     machine.run().map(drop)
    /// }
    /// ```
    pub fn offer_clusters(&self) -> Result<(), UsageError> {
        if self.options.text("clusters") == Some("auto") {
            self.system.change(RunConfig::divide_by_commit);
            return Ok(());
        }
        let sizes = self
            .options
            .numbers("clusters", 0..=u64::from(u32::MAX), &[])?;
        let sizes = sizes.into_iter().map(u32::try_from);
        let sizes: Vec<u32> = sizes.filter_map(Result::ok).collect();
        self.divide(&sizes);
        Ok(())
    }

    /// Gives each of these DAGs to one of the clusters that there are, in turn.
    ///
    /// ```no_run
    /// fn take_part(machine: &kernel::Machine, dags: &[fass::Dag]) -> Result<(), kernel::AppError> {
    ///     machine.offer_clusters()?;
    ///     machine.spread(dags);
    ///     fass::finish_create_dags(dags)?;
    ///     machine.run().map(drop)
    /// }
    /// ```
    pub fn spread(&self, dags: &[Dag]) {
        let clusters = (0..).take(self.clusters().sizes().len());
        for (cluster, dag) in clusters.cycle().zip(dags) {
            dag.cluster(cluster);
        }
    }

    /// Returns how the cores are divided, unless the commit is to find that.
    pub fn clusters(&self) -> CoreDivision {
        self.system.terms().clusters
    }
}
