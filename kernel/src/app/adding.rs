//! Runs whose DAGs an app changes: more are added, others removed.

use executive::machine::turns;
use executive::run::{additions, execution, heartbeat};

use super::ending::Ending;
use super::machine_handle::{Machine, soon_ns};
use crate::report::run::Run;
use crate::watch::background::session::PERIOD_NS;

impl Machine {
    /// Works like [`run`](Self::run), and calls `background` again and again meanwhile: there, and
    /// nowhere else, DAGs can be added to the run ([`Commit::add`](fass::Commit::add)) and removed
    /// ([`Commit::remove`](fass::Commit::remove)), as long as the cores are not divided.
    ///
    /// It is called in core 0's background: when that core has nothing else to do, and at least
    /// every 20 ms as far as it has time; never if instances always keep it. They preempt it, and
    /// what it takes delays none, but for the switch to the new DAGs. It may allocate, which
    /// counts in [`Run::allocations`]. A panic in it ends the run, as one in the app's function.
    ///
    /// The journal keeps the room that it had at the commit, which is that of a run without end
    /// if a DAG has no last job.
    ///
    /// # Errors
    ///
    /// As [`run`](Self::run).
    ///
    /// ```no_run
    /// use fass::{Commit, Dag};
    ///
    /// /// Runs DAGs, and one more in the second half of the time.
    /// fn run(machine: &kernel::Machine, mut commit: Commit, later: Dag) -> Result<(), kernel::Ending> {
    ///     let mut later = Some(later);
    ///     machine.run_with(|| {
    ///         if fass::now_ns() > 5_000_000_000
    ///             && let Some(dag) = later.take()
    ///             && let Err(error) = commit.add(&[dag])
    ///         {
    ///             kernel::println!("{error}"); // all goes on as it was
    ///         }
    ///     })?;
    ///     Ok(())
    /// }
    /// ```
    pub fn run_with(&self, mut background: impl FnMut()) -> Result<Run, Ending> {
        additions::allow();
        let heartbeat_ns = heartbeat::own_heartbeat_ns();
        heartbeat::set_own_heartbeat(heartbeat_ns.min(PERIOD_NS));
        let run = self.run_beside(soon_ns(), &mut || {
            let_others_on(|| {
                execution::let_go();
                background();
            });
        });
        heartbeat::set_own_heartbeat(heartbeat_ns);
        execution::forget_removals();
        run
    }
}

/// Does something long in the background, which takes turns meanwhile, where there are any; each
/// heartbeat makes it do so anew.
fn let_others_on(act: impl FnOnce()) {
    let heartbeat_ns = heartbeat::own_heartbeat_ns();
    if turns::let_background_compute(true) {
        heartbeat::set_own_heartbeat(turns::TURN_NS);
    }
    act();
    if turns::let_background_compute(false) {
        heartbeat::set_own_heartbeat(heartbeat_ns);
    }
}
