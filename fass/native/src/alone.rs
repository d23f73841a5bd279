//! One worker: it owns the scheduler, so there is no lock.

use sched_dag::{CoreId, HandOff, Scheduler, Vertex};

use crate::execute::{Execute, keep_signal};
use crate::reports::Reports;
use crate::watch::Watch;

const CORE: CoreId = CoreId(0);

/// Runs all jobs to their ends.
pub(crate) fn run<B: Execute, W: Watch>(
    scheduler: &mut Scheduler,
    reports: &mut Reports<W, &mut [B]>,
) {
    let mut signals = Vec::with_capacity(scheduler.task_set().dags().len());
    let mut now_ns = 0;
    while let Some(event_ns) = scheduler.next_event_ns() {
        now_ns = event_ns.max(now_ns);
        reports.watch.instant(now_ns);
        let mut next = end_instant(scheduler, now_ns, reports);
        while let Some((vertex, job)) = next {
            let body = &mut reports.bodies[vertex.index()];
            body.run(job);
            now_ns += W::STEP_NS;
            body.complete(&mut |dag| keep_signal(&mut signals, dag));
            if W::STEP_NS > 0 {
                reports.watch.instant(now_ns);
                reports.watch.finished(scheduler.instance_of(vertex), CORE);
            }
            if !signals.is_empty() {
                let instance = scheduler.instance_of(vertex);
                let mut moment = scheduler.at(now_ns);
                moment.complete(instance, reports);
                for dag in signals.drain(..) {
                    moment.signal(dag, reports);
                }
                next = end_instant(scheduler, now_ns, reports);
                continue;
            }
            next = match scheduler.hand_off(now_ns, CORE, vertex, reports) {
                HandOff::To(vertex, decision) => {
                    reports.watch.started(decision.instance(), CORE);
                    Some((vertex, decision.instance().job))
                }
                HandOff::Idle => None,
                HandOff::Open => end_instant(scheduler, now_ns, reports),
            };
        }
    }
}

/// Releases, dispatches, and returns what the core shall run.
fn end_instant<B: Execute, W: Watch>(
    scheduler: &mut Scheduler,
    now_ns: u64,
    reports: &mut Reports<W, &mut [B]>,
) -> Option<(Vertex, u64)> {
    let decisions = scheduler.at(now_ns).release_due(reports).dispatch();
    // Without preemption one core gets at most one instance.
    let instance = decisions.first()?.instance();
    reports.watch.started(instance, CORE);
    Some((scheduler.vertex(instance), instance.job))
}
