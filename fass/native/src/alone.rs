//! One worker: it owns the scheduler, so there is no lock.

use sched_dag::{CoreId, HandOff, Scheduler, Vertex};

use crate::execute::Execute;
use crate::watch::Watch;

const CORE: CoreId = CoreId(0);

/// Runs all jobs to their ends.
pub(crate) fn run<B: Execute, W: Watch>(
    scheduler: &mut Scheduler,
    bodies: &mut [B],
    watch: &mut W,
) {
    let mut signals = Vec::with_capacity(scheduler.task_set().dags().len());
    let mut now_ns = 0;
    while let Some(event_ns) = scheduler.next_event_ns() {
        now_ns = event_ns.max(now_ns);
        watch.instant(now_ns);
        let mut next = end_instant(scheduler, now_ns, watch);
        while let Some((vertex, job)) = next {
            let body = &mut bodies[vertex.index()];
            body.run(job);
            now_ns += W::STEP_NS;
            body.complete(&mut |dag| signals.push(dag));
            if W::STEP_NS > 0 {
                watch.instant(now_ns);
                watch.finished(scheduler.instance_of(vertex), CORE);
            }
            if !signals.is_empty() {
                let instance = scheduler.instance_of(vertex);
                let mut moment = scheduler.at(now_ns);
                moment.complete(instance, watch);
                for dag in signals.drain(..) {
                    moment.signal(dag, watch);
                }
                next = end_instant(scheduler, now_ns, watch);
                continue;
            }
            next = match scheduler.hand_off(now_ns, CORE, vertex, watch) {
                HandOff::To(vertex, decision) => {
                    watch.started(decision.instance(), CORE);
                    Some((vertex, decision.instance().job))
                }
                HandOff::Idle => None,
                HandOff::Open => end_instant(scheduler, now_ns, watch),
            };
        }
    }
}

/// Releases, dispatches, and returns what the core shall run.
fn end_instant(
    scheduler: &mut Scheduler,
    now_ns: u64,
    watch: &mut impl Watch,
) -> Option<(Vertex, u64)> {
    let decisions = scheduler.at(now_ns).release_due(watch).dispatch();
    // Without preemption one core gets at most one instance.
    let instance = decisions.first()?.instance();
    watch.started(instance, CORE);
    Some((scheduler.vertex(instance), instance.job))
}
