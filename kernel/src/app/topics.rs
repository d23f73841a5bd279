//! Letting people look at an app's topics.

use super::machine_handle::Machine;
use crate::watch::background::live_run::{Kernel, TOPICS};
use executive::run::edge;
use front::shell::topics::Topics;

impl Machine {
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
        static ALL: Topics<Kernel> = Topics::new();
        if self.has_console() {
            edge::let_look();
            // Once is enough.
            let _ = TOPICS.set(&ALL);
        }
    }
}
