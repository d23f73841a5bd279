//! A set in the real scheduler, through commit and virtual time.

use sched_dag::lifecycle::Request;
use sched_dag::virtual_time::VirtualTime;

use crate::Outcome;
use crate::record::outcome;
use crate::set::Set;
use crate::support::{Script, scheduler};

/// Runs a set and returns what happened, or why that contradicts itself.
pub(crate) fn replay(set: &Set) -> Result<Outcome, String> {
    let signals = set.signals().into_iter();
    let run = Script::new(|instance| set.execution_ns(instance))
        .failing(|instance| set.fails(instance))
        .replacing(|instance| set.is_replaceable(instance))
        .asking(signals.map(|(at_ns, dag)| (at_ns, Request::Signal(dag))))
        .run(VirtualTime::new(scheduler(&set.specs(), set.options)));
    outcome(set, run.scheduler(), &run.events, &[])
}
