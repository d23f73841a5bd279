//! Connecting an app's wire to the machine.

use alloc::format;

use fass::Wire;

use super::machine_handle::Machine;
use crate::options::UsageError;
use crate::watch::background::wire::{self, Refusal};
use front::app::ending::Ending;

impl Machine {
    /// Connects a wire to the second serial port (COM2, at I/O port 0x2f8): what is sent goes
    /// there in the runs to come, and what it gets arrives. If the word `input=` says that the
    /// end of the loader's module is a script of bytes and times, these arrive instead, in each
    /// run. To be called before [`Options::finish`](crate::options::Options::finish), which
    /// otherwise refuses that word, and before [`module`](Self::module).
    ///
    /// The port is looked at every millisecond. Core 0 sends when it has nothing else to do.
    /// After each run a line says what the wire has counted.
    ///
    /// # Errors
    ///
    /// [`Ending::Usage`] if there is no such port, [`Ending::Failure`] if it has a wire already.
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
    ///     let receiving = dag.using(wire.receiving(|line| line.first().copied()));
    ///     let hear = |keys: Received<'_, u8>| kernel::println!("{} lines", keys.count());
    ///     let attributes = SubtaskAttributes::named("hear");
    ///     let _raised = receiving.register_sporadic_subtask(hear, Vec::new(), ms(50), attributes);
    ///     finish_create_dags(&[dag])?;
    ///     machine.run().map(drop)
    /// }
    /// ```
    pub fn connect(&self, wire: &Wire) -> Result<(), Ending> {
        let bytes = self.options.number("input", 0..=1 << 32, 0)?;
        let bytes = usize::try_from(bytes).unwrap_or(usize::MAX);
        let mut script = None;
        if bytes > 0 {
            let module = self.module.get().unwrap_or_default();
            let parts = (module.len().checked_sub(bytes)).map(|own| module.split_at(own));
            let (own, input) =
                parts.ok_or_else(|| UsageError::new("`input`: the module is shorter"))?;
            self.module.set(Some(own).filter(|own| !own.is_empty()));
            script = Some(input);
        }
        wire::connect(wire, script).map_err(|refusal| match refusal {
            Refusal::NoPort => Ending::Usage(UsageError::new(format!(
                "wire `{}` has no device, as there is no second serial port; give --input FILE or \
                 --output FILE",
                wire.name()
            ))),
            Refusal::Taken => Ending::Failure(format!(
                "wire `{}` finds the second serial port taken; connect one wire",
                wire.name()
            )),
        })
    }
}
