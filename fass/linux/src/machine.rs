//! The machine as an app sees it: a number of cores of this computer.
//!
//! # Wires on Linux: from any readable file, and to any writable one
//!
//! Each wire connected by [`Linux::connect`] has two threads without a real-time level. They wait
//! where the run's threads never do: one in a read, the other for a millisecond whenever nothing is
//! to be sent. So bytes may arrive and leave late while the cores are busy, but delay nobody.

use std::io::{self, ErrorKind, Read, Write};
use std::os::fd::AsFd;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::thread::{self, JoinHandle};
use std::time::Duration;
use std::{fmt, fs};

use fass::Preemption;
use fass::edge::{BootRecord, EdgeMode, RecordingState, ReplayOutcome};
use fass::platform::{Platform as _, RunConfig};
use fass::shared::{DeviceEnd, Signal, Wire};

use crate::control::{self, Control};
use crate::edge::{self, FILE, File, IS_LIVE, LEFT, unpoisoned};
use crate::level::{Levels, Seats, USUAL_TOP};
use crate::panics;
use crate::platform::HOST;
use crate::platform::{self, Run, Threads};
use crate::team::{self, with_own_worker};
use crate::worker::Worker;
use crate::{clock, sys};

/// How Linux carries out the scheduler's decisions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mechanism {
    /// Levels of SCHED_FIFO. An instance chosen to run goes before all normal programs, and more
    /// urgent instances preempt it, where the terms and its subtask permit.
    Fifo,
    /// Our `sched_ext` policy, the paper's mechanism. The order is the same as with
    /// [`Fifo`](Self::Fifo), but a store sets it instead of a system call. The policy has to be
    /// loaded.
    SchedExt,
    /// Ordinary threads. Nothing is preempted, and other programs get their share of the cores. No
    /// privilege is needed.
    Normal,
    /// Ordinary threads, as with [`Normal`](Self::Normal), but without sleep: the thread of an idle
    /// core watches for work. Calling such a thread costs a cache line instead of a wake-up by the
    /// kernel. The processors stay busy as long as the run goes on.
    Poll,
}

/// Cores of this computer, for the next commit of DAGs.
///
/// A new machine has static priorities, and preemption where its [`Mechanism`] can preempt;
/// [`with`](Self::with) changes the settings before the commit. A program has one machine at a
/// time.
///
/// # Examples
///
/// ```
/// use std::time::Duration;
/// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
/// use linux::{Linux, Mechanism};
///
/// let machine = Linux::new(1, Mechanism::Normal).expect("one processor is there");
/// let dag = create_dag();
/// dag.jobs(3);
/// let period = Duration::from_millis(2);
/// let named = SubtaskAttributes::named;
/// dag.register_periodic_subtask(|| (20u64,), ["number"], period, named("source"));
/// let sink = |(number,): (u64,)| assert_eq!(number, 20);
/// dag.register_sink_subtask(sink, ["number"], period, named("sink"));
/// finish_create_dags(&[dag.clone()]).unwrap();
///
/// let run = machine.run().unwrap();
/// assert_eq!(run.statistics(&dag).completed, 3);
/// assert_eq!(run.violations().count(), 0);
/// ```
#[derive(Debug)]
pub struct Linux {
    warnings: Vec<String>,
}

/// Why a machine cannot be had, or has nothing to run: the fact, the offender and the remedy.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StartError(pub(crate) String);

impl fmt::Display for StartError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for StartError {}

/// Returns the core, counted within its cluster, for the calling thread; `None` outside of
/// functions of a run. If the thread was preempted and goes on elsewhere, the answer may be the
/// former core.
pub fn own_core() -> Option<u32> {
    with_own_worker(Worker::seat).flatten().map(|core| core.0)
}

/// Returns the time on the clock, whatever time functions are told.
pub fn now_ns() -> u64 {
    clock::now_ns()
}

/// Returns how many processors this program may use.
pub fn processors() -> u32 {
    u32::try_from(sys::processors().len()).unwrap_or(u32::MAX)
}

impl Linux {
    /// Takes the first `cores` processors available to this program. With SCHED_FIFO or
    /// `sched_ext`, also checks for settings harmful to real time ([`warnings`](Self::warnings)).
    ///
    /// If SCHED_FIFO is requested and the program may not use it, the machine works as with
    /// [`Mechanism::Normal`], and commits account for that.
    ///
    /// # Errors
    ///
    /// If `cores` is 0 or exceeds the available processors; or if `sched_ext` is requested and our
    /// policy is not loaded, or belongs to another program.
    ///
    /// # Panics
    ///
    /// If the program has another platform, or another machine.
    pub fn new(cores: u32, mechanism: Mechanism) -> Result<Self, StartError> {
        let mut processors = sys::processors();
        let there = processors.len();
        if cores == 0 || there < cores as usize {
            return Err(StartError(format!(
                "{cores} cores are asked for, and this program may use {there}; do ask for 1 to \
                 {there}, or give it more (`taskset`, or the cpuset of its control group)"
            )));
        }
        processors.truncate(cores as usize);
        Self::on(processors, mechanism)
    }

    /// Takes `cores` cores. If there are fewer processors, several cores share each.
    ///
    /// For executions that wait and do not compute. A held execution
    /// ([`Occupation::Hold`](fass::Occupation)) leaves its processor to the others. A computing
    /// execution keeps its processor from them, whatever the scheduler wants.
    ///
    /// # Errors
    ///
    /// If `cores` is 0, or if the mechanism is not available, as with [`new`](Self::new).
    ///
    /// # Panics
    ///
    /// As [`new`](Self::new).
    pub fn sharing(cores: u32, mechanism: Mechanism) -> Result<Self, StartError> {
        let there = sys::processors();
        let processors: Vec<u32> = there.iter().copied().cycle().take(cores as usize).collect();
        match processors.is_empty() {
            true => Err(StartError(
                "0 cores are asked for; do ask for 1 or more".to_owned(),
            )),
            false => Self::on(processors, mechanism),
        }
    }

    /// Makes a machine with one core for each entry of `processors`.
    fn on(processors: Vec<u32>, mechanism: Mechanism) -> Result<Self, StartError> {
        // Levels first: where they are refused, nothing has been installed yet.
        let (mut levels, mut found) = (None, Vec::new());
        match mechanism {
            Mechanism::Fifo => match Levels::of_fifo(USUAL_TOP) {
                Ok(taken) => levels = Some(taken),
                Err(why) => found.push(no_privilege(USUAL_TOP, &why)),
            },
            Mechanism::SchedExt => {
                levels = Some(Levels::SchedExt(Seats::acquire().map_err(StartError)?));
            }
            Mechanism::Normal | Mechanism::Poll => {}
        }
        if levels.is_some() {
            let is_throttled = mechanism == Mechanism::Fifo;
            found.extend(look(&processors, is_throttled));
        }
        // Once a program: a machine made after another was dropped finds the platform installed.
        static IS_OURS: OnceLock<bool> = OnceLock::new();
        assert!(
            IS_OURS.get_or_init(|| fass::platform::install(&HOST).is_ok()),
            "another platform is installed; `Linux` must be the program's only one"
        );
        panics::contain(team::strand);
        let cores = u32::try_from(processors.len()).unwrap_or(u32::MAX);
        let mut threads = HOST.threads();
        assert!(
            threads.is_none(),
            "this program has a `Linux` already; drop it first"
        );
        *threads = Some(Threads {
            terms: RunConfig::of_cores(cores),
            processors: processors.into(),
            levels,
            polls: mechanism == Mechanism::Poll,
            skips_idle: false,
            allocations: || 0,
        });
        // `with` takes the lock, too. Its change is empty, for its effect: without levels it turns
        // preemption off.
        drop(threads);
        Ok(Self { warnings: found }.with(|_| ()))
    }

    /// Returns the terms of the commits to come.
    pub fn terms(&self) -> RunConfig {
        HOST.terms()
    }

    /// Changes the terms of the commits to come. Without SCHED_FIFO or `sched_ext` a started
    /// instance never loses its core, whatever the terms say.
    pub fn change(&self, change: impl FnOnce(&mut RunConfig)) {
        if let Some(Threads { terms, levels, .. }) = HOST.threads().as_mut() {
            change(terms);
            if levels.is_none() {
                terms.scheduler.preemption = Preemption::Disabled;
            }
        }
    }

    /// Changes the terms of the commits to come, as [`change`](Self::change) does.
    ///
    /// ```
    /// use std::time::Duration;
    /// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
    /// use linux::{Linux, Mechanism};
    ///
    /// let machine = Linux::sharing(2, Mechanism::Normal).unwrap();
    /// let machine = machine.with(|terms| terms.divide(&[1, 1]));
    /// let dags = [0, 1].map(|cluster| {
    ///     let (dag, period) = (create_dag(), Duration::from_millis(2));
    ///     dag.cluster(cluster).jobs(3).period(period).relative_deadline(period);
    ///     dag.register_untyped_subtask(|_job| (), SubtaskAttributes::named("tick"));
    ///     dag
    /// });
    /// finish_create_dags(&dags).unwrap();
    /// let run = machine.run().unwrap();
    /// assert!(run.journal().events().all(|event| event.core.0 == event.dag.0));
    /// ```
    #[must_use = "the machine itself is returned"]
    pub fn with(self, change: impl FnOnce(&mut RunConfig)) -> Self {
        self.change(change);
        self
    }

    fn set(self, set: impl FnOnce(&mut Threads)) -> Self {
        if let Some(threads) = HOST.threads().as_mut() {
            set(threads);
        }
        self
    }

    /// Makes the run's time skip idle intervals: when no core has work, the next event is due at
    /// once. So jobs follow one another as fast as possible, whatever their periods. This is for
    /// measurements, and needs a single cluster, or clusters without common instants.
    #[must_use = "the machine itself is returned"]
    pub fn skipping_idle_time(self) -> Self {
        self.set(|threads| threads.skips_idle = true)
    }

    /// Sets the function counting the program's allocations so far, for
    /// [`allocations`](sched_dag::engine::Run::allocations). The function should count only in
    /// [threads of a run](crate::is_of_run); otherwise, allocations of other threads meanwhile
    /// count as the jobs'.
    #[must_use = "the machine itself is returned"]
    pub fn allocations(self, count: fn() -> u64) -> Self {
        self.set(|threads| threads.allocations = count)
    }

    /// Makes the kernel end this program, by SIGKILL, when one of its threads has run at a level of
    /// SCHED_FIFO for `time` without ever waiting. Threads of the other mechanisms have no such
    /// level. For tests, and wherever an error must not make a computer unusable.
    ///
    /// # Errors
    ///
    /// The kernel's reason.
    pub fn limit_real_time(&self, time: Duration) -> io::Result<()> {
        sys::limit_real_time(u64::try_from(time.as_micros()).unwrap_or(u64::MAX))
    }

    /// Returns warnings of harmful settings of this computer, a line each: fact and remedy.
    #[must_use]
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Reports whether started instances may lose their cores.
    pub fn is_preemptive(&self) -> bool {
        self.terms().scheduler.preemption == Preemption::Enabled
    }

    /// Returns the handle for changing the committed run from any thread; `None` if nothing is
    /// committed.
    pub fn control(&self) -> Option<Control> {
        control::latest()
    }

    /// Raises a signal whenever input arrives in a file that `poll` can wait for (a pipe, a socket,
    /// a device), until the run ends. The signal's DAG is expected to read the input.
    ///
    /// # Errors
    ///
    /// The kernel's reason: the file cannot be waited for.
    ///
    /// # Panics
    ///
    /// If the signal's DAG is not committed, or its run is over.
    pub fn raise_on_input(&self, signal: &Signal, file: &impl AsFd) -> io::Result<()> {
        let target = signal.target();
        let Some((_, dag)) = target else {
            panic!("a signal is connected before its DAG is committed; commit that first");
        };
        let control = self.control();
        let control = control.expect("what is committed can be controlled");
        control.raise_on_input(dag, sys::Arrivals::of(file)?)
    }

    /// Runs the committed DAGs until each is over: all its jobs have ended, or it was closed or
    /// ended, or it is sporadic without a limit of jobs and has no signal pending. Releases count
    /// from the instant at which all threads are ready.
    ///
    /// # Errors
    ///
    /// If nothing has been committed since the last run.
    ///
    /// # Panics
    ///
    /// If the system has no more threads.
    pub fn run(&self) -> Result<Run, StartError> {
        self.run_when(None)
    }

    /// Works like [`run`](Self::run), but counts releases from `epoch_ns` on the clock of
    /// [`fass::now_ns`]. If `epoch_ns` has passed before the threads are ready, releases are late.
    ///
    /// # Errors
    ///
    /// As [`run`](Self::run).
    pub fn run_from(&self, epoch_ns: u64) -> Result<Run, StartError> {
        self.run_when(Some(epoch_ns))
    }

    fn run_when(&self, epoch_ns: Option<u64>) -> Result<Run, StartError> {
        let launched = HOST.take_launched().ok_or_else(|| {
            StartError("nothing is committed; call finish_create_dags first".to_owned())
        })?;
        let run = platform::run(launched, epoch_ns);
        control::set(None);
        Ok(run)
    }
}

impl Drop for Linux {
    fn drop(&mut self) {
        *HOST.threads() = None;
        control::set(None);
    }
}

/// The most bytes waiting to be sent.
const ROOM_BYTES: usize = 8 << 20;

impl Linux {
    /// Keeps a record of the commits and runs to come, under the name of an app, with the recorded
    /// values of the first of these commits. The file grows while a run goes on.
    ///
    /// ```no_run
    /// use std::fs::File;
    /// use linux::{Linux, Mechanism};
    ///
    /// let machine = Linux::new(2, Mechanism::Fifo).expect("two processors are there");
    /// machine.keep("pump", File::create("pump.rec").expect("a file"));
    /// // build DAGs, name topics by `Dag::record`, commit
    /// machine.run().expect("it is committed");
    /// machine.end_recording(true);
    /// Linux::end_record().expect("the file is written");
    /// ```
    pub fn keep(&self, app: &'static str, to: impl Write + Send + 'static) {
        self.keep_events(to);
        IS_LIVE.store(true, Ordering::Relaxed);
        let wish = EdgeMode::Record {
            app,
            bytes: ROOM_BYTES,
        };
        edge::get().set_wish(wish);
    }

    /// Keeps a record without values, and adds each run when that run is over.
    ///
    /// See [`keep`](Self::keep).
    pub fn keep_events(&self, to: impl Write + Send + 'static) {
        *unpoisoned(&FILE) = Some(BootRecord::new(File {
            writer: Box::new(to),
            failure: None,
        }));
    }

    /// Adds a line to the record, if there is one.
    pub fn note(line: &str) {
        if let Some(file) = &mut *unpoisoned(&FILE) {
            file.file().text(line);
        }
    }

    /// Makes the run of the next commit replay a recording. A later commit of the program is
    /// refused: a recording is of one commit. The replay may begin at the given job of a DAG, or
    /// earlier.
    pub fn replay(&self, recording: &'static [u8], from: Option<(&'static str, u64)>) {
        let bytes = recording;
        edge::get().set_wish(EdgeMode::Replay { bytes, from });
    }

    /// Writes the rest of a run's recording. Returns the outcome of a replay, and how complete the
    /// recording is. `is_over` says that the run has not been ended before its time.
    ///
    /// See [`keep`](Self::keep).
    pub fn end_recording(&self, is_over: bool) -> (Option<ReplayOutcome>, Option<RecordingState>) {
        let outcome = edge::get().end_run(is_over);
        let left = unpoisoned(&LEFT).take();
        let end = |file: &mut BootRecord<File>| file.end_recording(left);
        (outcome, unpoisoned(&FILE).as_mut().and_then(end))
    }

    /// Writes the end of the record.
    ///
    /// # Errors
    ///
    /// Why the file could not be written.
    ///
    /// See [`keep`](Self::keep).
    pub fn end_record() -> io::Result<()> {
        let Some(file) = unpoisoned(&FILE).take() else {
            return Ok(());
        };
        let mut file = file.finish();
        file.flush();
        file.failure.map_or(Ok(()), Err)
    }
}

/// Warns that SCHED_FIFO is refused, and names the consequences.
fn no_privilege(top: i32, why: &io::Error) -> String {
    format!(
        "SCHED_FIFO is refused ({why}), so nothing is preempted, and other programs share the \
         cores; do run it as root, or `setcap cap_sys_nice+ep PROGRAM`, or allow `rtprio {top}` \
         in /etc/security/limits.conf"
    )
}

/// Checks the kernel's settings, including those of real-time classes if the run uses such a class,
/// and locks the memory.
pub(crate) fn look(processors: &[u32], is_real_time: bool) -> Vec<String> {
    let mut found = Vec::new();
    let setting = |name: &str| {
        read(&format!("/proc/sys/kernel/{name}"))?
            .parse::<i64>()
            .ok()
    };
    if let (Some(runtime), Some(period)) = (
        setting("sched_rt_runtime_us"),
        setting("sched_rt_period_us"),
    ) && is_real_time
        && runtime >= 0
        && runtime < period
    {
        found.push(format!(
            "the kernel may take {} of every {period} us from all SCHED_FIFO threads of a core; \
             do `sysctl -w kernel.sched_rt_runtime_us=-1` if they need it for so long at a stretch",
            period - runtime
        ));
    }
    if let Err(why) = sys::lock_memory() {
        found.push(format!(
            "memory is not locked ({why}), so a page fault can delay an instance; do raise the \
             limit (`ulimit -l unlimited`, or LimitMEMLOCK=infinity in the service)"
        ));
    }
    let slow = processors.iter().find_map(|processor| {
        let name = format!("/sys/devices/system/cpu/cpu{processor}/cpufreq/scaling_governor");
        let governor = read(&name)?;
        (governor != "performance").then_some((processor, governor))
    });
    if let Some((processor, governor)) = slow {
        found.push(format!(
            "processor {processor} changes its frequency (governor {governor}), so execution times \
             vary; do `cpupower frequency-set -g performance`"
        ));
    }
    found
}

fn read(name: &str) -> Option<String> {
    let text = fs::read_to_string(name).ok()?;
    Some(text.trim().to_owned())
}

/// The time between two looks for bytes to send.
const PERIOD: Duration = Duration::from_millis(1);

/// A connected wire. Dropping the connection sends the remaining bytes and ends it.
///
/// See [`Linux::connect`].
#[derive(Debug)]
pub struct Connection {
    has_ended: Arc<AtomicBool>,
    writer: Option<JoinHandle<()>>,
}

impl Linux {
    /// Connects a wire: bytes read from `input` arrive, until its end, and sent bytes go to
    /// `output`, until `output` fails. To be called after the commit and once a wire.
    ///
    /// ```
    /// use std::time::Duration;
    /// use fass::shared::{Received, Wire};
    /// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
    /// use linux::{Linux, Mechanism};
    ///
    /// let machine = Linux::new(1, Mechanism::Normal).expect("one processor is there");
    /// let (wire, dag, period) = (Wire::new("keys"), create_dag(), Duration::from_millis(2));
    /// dag.jobs(3).relative_deadline(period);
    /// let hear = |lines: Received<'_, u8>| println!("{} lines", lines.count());
    /// dag.period(period)
    ///     .using(wire.receiving(|line| line.first().copied()))
    ///     .source(hear)
    ///     .register(SubtaskAttributes::named("hear"));
    /// finish_create_dags(&[dag]).unwrap();
    /// let connection = machine.connect(&wire, &b"one\ntwo\n"[..], std::io::sink()).unwrap();
    /// machine.run().unwrap();
    /// drop(connection);
    /// ```
    ///
    /// # Errors
    ///
    /// The wire is connected already, or the system has no more threads.
    pub fn connect(
        &self,
        wire: &Wire,
        input: impl Read + Send + 'static,
        output: impl Write + Send + 'static,
    ) -> io::Result<Connection> {
        let end = Arc::new(end_of(wire)?);
        let has_ended = Arc::new(AtomicBool::new(false));
        let (own, ended) = (Arc::clone(&end), Arc::clone(&has_ended));
        let writer = thread::Builder::new().spawn(move || send(&own, output, &ended))?;
        let ended = Arc::clone(&has_ended);
        let connection = Connection {
            has_ended,
            writer: Some(writer),
        };
        // A read may block for ever, so nobody waits for this thread.
        thread::Builder::new().spawn(move || receive(&end, input, &ended))?;
        Ok(connection)
    }
}

/// Takes the device's end of a wire.
pub(crate) fn end_of(wire: &Wire) -> io::Result<DeviceEnd> {
    let why = || {
        let line = "has a device already; connect it once";
        let line = format!("wire `{}` {line}", wire.name());
        io::Error::new(ErrorKind::AlreadyExists, line)
    };
    DeviceEnd::of(wire).ok_or_else(why)
}

/// Reads input and lets the bytes arrive.
fn receive(wire: &DeviceEnd, mut input: impl Read, has_ended: &AtomicBool) {
    let mut bytes = [0; 4096];
    while !has_ended.load(Ordering::Relaxed) {
        match input.read(&mut bytes) {
            Ok(count @ 1..) => {
                if let Some((plan, dag)) = wire.arrive(&bytes[..count], fass::now_ns()) {
                    HOST.raise(plan, dag);
                }
            }
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Ok(0) | Err(_) => return,
        }
    }
}

/// Writes bytes waiting to be sent. Once the connection has ended, returns when none is left.
fn send(wire: &DeviceEnd, mut output: impl Write, has_ended: &AtomicBool) {
    let mut bytes = Vec::new();
    loop {
        // Asked before the bytes are taken: those sent before the end are all found below.
        let is_last = has_ended.load(Ordering::Acquire);
        bytes.extend(std::iter::from_fn(|| wire.depart()));
        if bytes.is_empty() {
            if is_last {
                return;
            }
            thread::sleep(PERIOD);
            continue;
        }
        if output
            .write_all(&bytes)
            .and_then(|()| output.flush())
            .is_err()
        {
            // From now on, sent bytes find no room in the device's end, and are counted.
            return;
        }
        bytes.clear();
    }
}

impl Drop for Connection {
    fn drop(&mut self) {
        self.has_ended.store(true, Ordering::Release);
        // A panic in the app's own writer is reported on the writer's thread.
        let _ = self.writer.take().map(JoinHandle::join);
    }
}
