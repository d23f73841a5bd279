//! What a machine does for an app besides runs.
//!
//! An image has the code of those services alone that its app asks for.

use alloc::boxed::Box;

use fass::{Tunable, Wire};

use super::ending::Ending;
use super::machine::{Machine, System};
use crate::options::UsageError;
use crate::report::Resources;
use crate::shell::parameters::Parameters;
use crate::shell::topics::Topics;
use crate::shell::{PARAMETERS, TOPICS};

/// The margin if nobody states one, in hundredths.
const MARGIN_PERCENT: u64 = 20;

impl<S: System> Machine<S> {
    /// Connects a wire to the second serial port (COM2, at I/O port 0x2f8): what is sent goes
    /// there in the runs to come, and what it gets arrives. If the word `input=` says that the
    /// end of the loader's module is a script of bytes and times, these arrive instead, in each
    /// run. To be called before [`Options::finish`](crate::options::Options::finish), which
    /// otherwise refuses that word, and before [`module`](Self::module).
    ///
    /// The port is looked at every millisecond. Core 0 sends when it has nothing else to do.
    /// After each run a line says what the wire has counted. On Linux the wire's ends are standard
    /// input (`input=-`) and a file (`output=FILE`).
    ///
    /// # Errors
    ///
    /// [`Ending::Usage`] if there is no such port, or neither end is named; [`Ending::Failure`] if
    /// it has a wire already.
    ///
    /// ```no_run
    /// use fass::{Received, SubtaskAttributes, Wire, create_dag, finish_create_dags};
    ///
    /// fn listen(machine: &kernel::Machine) -> Result<(), kernel::Ending> {
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
    pub fn connect(&self, wire: &Wire) -> Result<(), Ending> {
        self.system.connect(wire, &self.options, &self.module)
    }

    /// Lets people look at topics at the console: `echo TOPIC` shows values of those that are
    /// recorded ([`Dag::record`](fass::Dag::record)) as they are completed, `hz TOPIC` says how
    /// often any topic was written lately. To be called before the commit. Without a console it
    /// does nothing.
    ///
    /// ```no_run
    /// fn app(machine: &kernel::Machine) -> Result<(), kernel::Ending> {
    ///     machine.show_topics();
    ///     machine.options().finish(&[])?;
    ///     // build DAGs, record topics, commit
    ///     machine.run().map(drop)
    /// }
    /// ```
    pub fn show_topics(&self) {
        if self.has_console() {
            self.system.let_look();
            // Once is enough.
            TOPICS.set(Box::leak(Box::new(Topics::<S::Run>::new())));
        }
    }

    /// Lets people set parameters: at the console by `set NAME VALUE`, before the first run by the
    /// word `set=NAME=VALUE,...` of the command line, which `./scripts/run --set` and `--params`
    /// make. To be called before [`Options::finish`](crate::options::Options::finish), which
    /// otherwise refuses that word.
    ///
    /// # Errors
    ///
    /// [`Ending::Usage`] in one line, if the word names no parameter, or no value of its type and
    /// range; [`Ending::Failure`] if two have one name, or it was called before.
    ///
    /// ```no_run
    /// use fass::Parameter;
    ///
    /// fn gain(machine: &kernel::Machine) -> Result<Parameter<f64>, kernel::Ending> {
    ///     let gain = Parameter::new("gain", 0.5, 0.0..=2.0);
    ///     machine.offer(&[&gain])?;
    ///     machine.options().finish(&[])?;
    ///     Ok(gain)
    /// }
    /// ```
    pub fn offer(&self, parameters: &[&dyn Tunable]) -> Result<(), Ending> {
        let offered = Parameters::new(parameters).map_err(Ending::Failure)?;
        if let Some(word) = self.options.text("set") {
            offered.set_all(word)?;
        }
        match PARAMETERS.set(Box::leak(Box::new(offered))) {
            true => Ok(()),
            false => Err(Ending::Failure(
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
    /// fn take_part(machine: &kernel::Machine) -> Result<(), kernel::Ending> {
    ///     machine.offer_overheads()?;
    ///     machine.options().finish(&["overheads", "overheads_margin"])?;
    ///     // build and commit DAGs
    ///     machine.run().map(drop)
    /// }
    /// ```
    pub fn offer_overheads(&self) -> Result<(), Ending> {
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
    #[must_use]
    pub fn resources(&self) -> Resources {
        let (contexts, contexts_free) = S::contexts();
        Resources {
            heap_bytes: S::memory().in_use_bytes,
            contexts,
            contexts_free,
        }
    }

    /// Prints how much memory the run has needed, as a `memory` machine line.
    ///
    /// See [`Machine`].
    pub fn report_memory(&self) {
        S::memory().report();
    }
}
