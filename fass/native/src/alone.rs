//! One worker: it owns the scheduler, of all DAGs or of its cluster, so there is no lock.

use sched_dag::{CoreId, HandOff, Scheduler, Vertex};

use crate::execute::{Execute, keep_signal};
use crate::others::Others;
use crate::reports::Reports;
use crate::watch::Watch;

const CORE: CoreId = CoreId(0);

/// Runs all jobs to their ends.
pub(crate) fn run<B: Execute, W: Watch>(
    scheduler: &mut Scheduler,
    reports: &mut Reports<W, &mut [B]>,
    others: impl Others,
) {
    let mut signals = Vec::with_capacity(scheduler.task_set().dags().len());
    let mut now_ns = 0;
    while let Some(event_ns) = others.next_ns(scheduler.next_event_ns(), now_ns + W::STEP_NS) {
        now_ns = event_ns.max(now_ns);
        reports.watch.instant(now_ns);
        let mut next = end_instant(scheduler, now_ns, reports, others);
        while let Some((vertex, job)) = next {
            let body = &mut reports.bodies[vertex.index()];
            body.run(job);
            now_ns += W::STEP_NS;
            body.complete(&mut |dag| keep_signal(&mut signals, dag));
            if W::STEP_NS > 0 {
                reports.watch.instant(now_ns);
                reports.watch.finished(scheduler.instance_of(vertex), CORE);
            }
            if !signals.is_empty() || others.have_knocked() {
                let instance = scheduler.instance_of(vertex);
                let mut moment = scheduler.at(now_ns);
                moment.complete(instance, reports);
                for dag in signals.drain(..) {
                    if !others.send(dag) {
                        moment.signal(dag, reports);
                    }
                }
                next = end_instant(scheduler, now_ns, reports, others);
                continue;
            }
            next = match scheduler.hand_off(now_ns, CORE, vertex, reports) {
                HandOff::To(vertex, decision) => {
                    reports.watch.started(decision.instance(), CORE);
                    Some((vertex, decision.instance().job))
                }
                HandOff::Idle => None,
                HandOff::Open => end_instant(scheduler, now_ns, reports, others),
            };
        }
    }
}

/// Takes letters, releases, dispatches, and returns what the core shall run.
fn end_instant<B: Execute, W: Watch>(
    scheduler: &mut Scheduler,
    now_ns: u64,
    reports: &mut Reports<W, &mut [B]>,
    others: impl Others,
) -> Option<(Vertex, u64)> {
    let mut moment = scheduler.at(now_ns);
    others.take(|dag| moment.signal(dag, reports));
    let decisions = moment.release_due(reports).dispatch();
    // Without preemption one core gets at most one instance.
    let instance = decisions.first()?.instance();
    reports.watch.started(instance, CORE);
    Some((scheduler.vertex(instance), instance.job))
}
