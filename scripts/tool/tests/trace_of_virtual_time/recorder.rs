//! A set in the real scheduler and virtual time, and the trace that a kernel leaves.
//!
//! The requests that a kernel makes of cores are imitated.

use std::sync::Arc;

use sched_dag::journal::{Event, What};
use sched_dag::virtual_time::{ExecutionTimes, VirtualTime};
use sched_dag::{Scheduler, TaskSet};
use tool::trace::commit::Committed;
use tool::trace::model::Run;

use crate::random::Random;
use crate::set::Set;
use crate::support::commit;

/// Runs a set to its end, and returns what a trace tells of that.
pub(crate) fn record(set: &Set) -> Run {
    let task_set = commit(&set.specs(), set.options);
    let scheduler = Scheduler::new(Arc::clone(&task_set), set.options);
    let mut run = VirtualTime::new(scheduler).recording();
    let _ = run.run(&mut ExecutionTimes(|instance| set.execution_ns(instance)));
    Run {
        number: 0,
        line: 1,
        options: set.options,
        usual_bound_ns: 0,
        task_set: TaskSet::clone(&task_set),
        committed: Committed::default(),
        events: with_requests(&run.events()),
        lost: 0,
        complete: true,
    }
}

/// Loses the oldest events.
pub(crate) fn lose(run: &mut Run, random: &mut Random) {
    if !run.events.is_empty() {
        let lost = random.below(run.events.len());
        run.events.drain(..lost);
        run.lost = u64::try_from(lost).expect("few events");
        run.complete = lost == 0;
    }
}

/// Adds that what starts or goes on where an instance was suspended was requested there.
fn with_requests(events: &[Event]) -> Vec<Event> {
    let mut suspended = None;
    let mut all = Vec::new();
    for event in events {
        match event.what {
            What::Suspend => suspended = Some(event.core),
            What::Start | What::Resume if suspended.take() == Some(event.core) => {
                let what = What::Request;
                all.push(Event { what, ..*event });
            }
            _ => {}
        }
        all.push(*event);
    }
    all
}
