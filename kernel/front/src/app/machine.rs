//! The machine lent to an app, the same on every platform.
//!
//! The methods of [`Machine`], the verdict on a run and the reports of a run are shared by all
//! platforms. Platform-specific services come from a [`System`]. Each platform crate known to apps
//! as `kernel` names a `Machine` with its own system.
//!
//! An image contains only the code of the services used by its app.

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

/// The platform below an app's machine: the bare machine, Linux or virtual time.
///
/// See [`Machine`].
pub trait System: Sized {
    /// The live run of this platform, for a person at the console.
    type Run: LiveRun + 'static;

    /// Reports whether a person can talk to a run.
    fn has_console(&self) -> bool {
        false
    }

    /// Returns the configuration of the commits to come.
    fn terms(&self) -> RunConfig;

    /// Changes the configuration of the commits to come, as far as the platform allows.
    fn change(&self, change: impl FnOnce(&mut RunConfig));

    /// Makes events less than `window` apart count as a single instant.
    fn set_coincidence(&self, window: Duration);

    /// Runs the committed DAGs from `epoch_ns` on, or as soon as possible, and prints the
    /// platform's own reports of the run.
    fn run(&self, epoch_ns: Option<u64>, input: Option<&Signal>) -> Result<Run, AppError>;

    /// Reports whether a person has ended the latest run.
    fn is_shut_down(&self) -> bool;

    /// Connects a wire to the device named by the options. A device's script is taken from the end
    /// of the app's file.
    fn connect(
        &self,
        wire: &Wire,
        options: &CommandLine<'static>,
        module: &Cell<Option<&'static [u8]>>,
    ) -> Result<(), AppError>;

    /// Connects a protocol to its peer, by the options for the network.
    fn connect_protocol(
        &self,
        protocol: Box<dyn Protocol>,
        peer: SocketAddrV4,
        options: &CommandLine<'static>,
    ) -> Result<(), AppError>;

    /// Returns a number unlikely to repeat, on another machine or later on the same machine.
    fn seed() -> u128;

    /// Returns the Unix time now, in nanoseconds, if the system knows the date.
    fn unix_ns() -> Option<u64>;

    /// Measures the platform's own overheads, and charges them to the commits to come with a margin
    /// of `margin_percent` hundredths.
    fn measure_overheads(margin_percent: u32) -> Result<(), AppError>;

    /// Returns the number of contexts for instances, and the number of free contexts.
    fn contexts() -> (usize, usize) {
        (0, 0)
    }

    /// Returns the present and the peak use of memory.
    fn memory() -> HeapUsage;
}

/// The machine, lent to the app's function for the time of the run.
///
/// An app gets its machine as the argument of this function; there is no other way.
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
    /// Whether the app has asked for the module.
    has_asked: Cell<bool>,
    /// The signal raised by bytes of input during a run.
    input: RefCell<Option<Signal>>,
    /// The faults and exceeded bounds of the runs so far, and whether they make the app fail.
    verdict: RunVerdict,
}

impl<S: System> Machine<S> {
    /// Lends `app` a machine on top of `system`, and returns how the app ends. `module` is the
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

    /// Returns the options of the command line left to the app by the kernel.
    ///
    /// See [`CommandLine`].
    pub const fn options(&self) -> &CommandLine<'static> {
        &self.options
    }

    /// Returns the app's file, if any: on the bare machine (`qemu -initrd FILE`) as left in memory
    /// by the loader, on Linux as named by the option `module=`. The loader's file is not copied,
    /// so files of any size cost the same memory and boot time. If the app never asks for its file,
    /// a warning says so at the end.
    pub fn module(&self) -> Option<&'static [u8]> {
        self.has_asked.set(true);
        self.module.get()
    }

    /// Reports whether a person can talk to the kernel during a run (`console=on`), and so end an
    /// otherwise endless run.
    pub fn has_console(&self) -> bool {
        self.system.has_console()
    }

    /// Returns the number of cores available to run subtasks.
    pub fn cores(&self) -> u32 {
        self.system.terms().scheduler.cores
    }

    /// Sets policy and preemption of the commits to come, overriding the command line. On Linux
    /// nothing is preempted without the right to use SCHED_FIFO.
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

    /// Makes events less than `window` apart count as a single instant in the runs to come. The
    /// scheduler then decides `window` after the first of such events, having seen them all. With a
    /// window of 0, the initial value, the scheduler decides at once after each event.
    ///
    /// In a model, completions and releases can fall on the same instant, and a single dispatch
    /// sees them all. On a machine they come one after the other, however close. A decision between
    /// two of them starts or preempts instances differently from the model. To compare the machine
    /// with the model, such events have to be taken together again. The price: every decision comes
    /// `window` later. On Linux and in virtual time the next run is refused, unless `window` is 0.
    pub fn set_coincidence(&self, window: Duration) {
        self.system.set_coincidence(window);
    }

    /// Leaves the verdict on faults to the app. Without this call, a fault ending a DAG in any run
    /// makes the app fail. The app may make the call at any time before its function returns.
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

    /// Leaves the verdict on response times beyond their proven bounds to the app. Without this
    /// call, such a response time in any run makes the app fail, except in the tool's mode
    /// `threads` and on Linux. The app may make the call at any time before its function returns.
    /// Exceeded bounds are printed in any case.
    pub fn accept_exceeded_bounds(&self) {
        self.verdict.accept_exceeded_bounds();
    }

    /// Runs the committed DAGs until each has ended all its jobs.
    ///
    /// The calling core takes part. The background of core 0 prints the progress in machine lines
    /// of kind `progress`. A fault ends its DAG, and makes the app fail (see
    /// [`accept_faults`](Self::accept_faults)).
    ///
    /// # Errors
    ///
    /// [`AppError::Failure`] if nothing has been committed since the last run.
    ///
    /// [`AppError::Shutdown`] if a person has ended the run, at the console, by ctrl-C, or on Linux
    /// by SIGTERM: then each DAG has ended the jobs in flight and released no more. If such a run
    /// broke a rule of the model, the error is [`AppError::Failure`] instead.
    ///
    /// See [`Run`].
    pub fn run(&self) -> Result<Run, AppError> {
        self.run_when(None)
    }

    /// Works like [`run`](Self::run), with the releases counted from `epoch_ns` on the clock of
    /// [`fass::now_ns`]. If `epoch_ns` is past, releases are late.
    ///
    /// # Errors
    ///
    /// As [`run`](Self::run).
    pub fn run_from(&self, epoch_ns: u64) -> Result<Run, AppError> {
        self.run_when(Some(epoch_ns))
    }

    // Not inlined into an app's function: that would enlarge the image.
    #[inline(never)]
    fn run_when(&self, epoch_ns: Option<u64>) -> Result<Run, AppError> {
        let run = self.system.run(epoch_ns, self.input.borrow().as_ref())?;
        let is_shut_down = self.system.is_shut_down();
        if is_shut_down {
            // The person waits, so the counts come before the slower reports.
            report::show_counts(&run);
        }
        self.verdict.note(&run);
        ending::note(&run, self.system.terms().overheads);
        if is_shut_down {
            return Err(AppError::after_shutdown(&run));
        }
        Ok(run)
    }

    /// Makes each byte received by the serial port during runs raise `signal`, in place of any
    /// signal set before. With `console=on` the bytes belong to the console and raise nothing. On
    /// Linux the bytes come from standard input.
    ///
    /// Core 0 polls the port when it has nothing else to do, so a byte may count up to 20 ms late,
    /// and later while core 0 is busy.
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

/// The default margin on measured overheads, in hundredths.
const MARGIN_PERCENT: u64 = 20;

impl<S: System> Machine<S> {
    /// Connects a wire to the endpoint named by its [option](super::endpoint). Without an option
    /// the endpoint is the second serial port (COM2, at I/O port 0x2f8): in the runs to come, the
    /// port sends the wire's output, and received bytes arrive on the wire. If the option `input=`
    /// declares the end of the loader's module a script, the script arrives instead, in each run.
    /// Call before [`CommandLine::finish`](crate::options::CommandLine::finish), which otherwise
    /// refuses these options, and before [`module`](Self::module).
    ///
    /// The port is polled every millisecond. Core 0 sends when it has nothing else to do. After
    /// each run a line reports the wire's counts. On Linux, standard input (`input=-`) and a file
    /// (`output=FILE`) take the port's place.
    ///
    /// # Errors
    ///
    /// [`AppError::Usage`] if there is no such port, another wire has the port, or neither end is
    /// named; [`AppError::Failure`] if the wire is connected already.
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

    /// Sets a clock of Unix time by the machine's own clock. A PC's clock is right within a second,
    /// at best. In mode `deterministic` the guest's clock begins at the first second of 2000.
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

    /// Lets people look at topics at the console. `echo TOPIC` shows the values of a recorded topic
    /// ([`Dag::record`](fass::Dag::record)) as instances complete them; `hz TOPIC` shows how often
    /// any topic was written lately. Call before the commit. Without a console the call does
    /// nothing.
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
            // An earlier call may have set the commands; the second set has no effect.
            TOPICS.set(Box::leak(Box::new(TopicCommands::<S::Run>::new())));
        }
    }

    /// Lets people set parameters: at the console by `set NAME VALUE`, before the first run by the
    /// option `set=NAME=VALUE,...` of the command line, as passed by `./scripts/run --set` and
    /// `--params`. Call before [`CommandLine::finish`](crate::options::CommandLine::finish), which
    /// otherwise refuses the option.
    ///
    /// # Errors
    ///
    /// [`AppError::Usage`] in a single line, if the option names no parameter, or no value of the
    /// parameter's type and range; [`AppError::Failure`] if two parameters share a name, or
    /// parameters were offered before.
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

    /// Takes the option `overheads`. With `overheads=measured` the kernel now runs DAGs of its own,
    /// on all cores, and measures its overheads. The commits to come charge the result with a
    /// margin of 20 %, or `overheads_margin=PERCENT`, and report the charge in their answers.
    ///
    /// Call before anything is committed and before the cores are divided. The measurement fixes
    /// the size of stacks: subtasks may then state no more than 64 KiB.
    ///
    /// # Errors
    ///
    /// If the options are wrong, or `overheads_ns` states the overheads as well; if there is too
    /// little memory for the measurement; on Linux, where overheads are not measured.
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

    /// Returns the resources in use and free between two runs. The result is the same after equal
    /// work, unless something leaks. During a run the stacks of running instances are not free.
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

    /// Prints the run's peak use of memory, as a `memory` machine line.
    pub fn report_memory(&self) {
        S::memory().report();
    }

    /// Divides the cores, from core 0 on, into clusters of the given sizes in the commits to come.
    /// With no sizes, the cores are not divided. Each cluster schedules its own DAGs
    /// ([`fass::Dag::cluster`]).
    pub fn divide(&self, sizes: &[u32]) {
        self.system.change(|terms| terms.divide(sizes));
    }

    /// Gives the commits to come a certificate, and so [fixes](RunConfig::certificate) their set of
    /// DAGs. An empty text removes the certificate.
    pub fn fix(&self, certificate: &str) {
        let text = (!certificate.is_empty()).then(|| certificate.to_owned().into());
        self.system.change(|terms| terms.certificate = text);
    }

    /// Leaves the division of the cores to the option `clusters` of the command line.
    /// `clusters=2,2` sets the sizes of the clusters. With `clusters=auto` the commit divides the
    /// cores ([`sched_dag::analysis::assign()`]): each DAG in need of several cores gets a cluster
    /// of its own, and the others share clusters of a single core each. This requires WCETs for all
    /// subtasks, and no DAG may state a cluster. Without the option the cores are not divided. An
    /// app with options of its own calls this before
    /// [`finish`](crate::options::CommandLine::finish), which refuses unread options.
    ///
    /// # Errors
    ///
    /// If the option is neither `auto` nor numbers of cores.
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

    /// Assigns the DAGs to the clusters in turn.
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

    /// Returns the division of the cores, unless the commit is to choose the division.
    pub fn clusters(&self) -> CoreDivision {
        self.system.terms().clusters
    }
}
