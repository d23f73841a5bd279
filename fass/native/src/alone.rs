//! One worker: it owns the scheduler, of all DAGs or of its cluster, so there is no lock.

use sched_dag::journal::What;
use sched_dag::{CoreId, HandOff, Instance, Scheduler, Vertex};

use crate::execute::{Execute, keep_signal};
use crate::others::Others;
use crate::reports::Reports;
use crate::watch::Watch;

const CORE: CoreId = CoreId(0);

/// Runs all jobs to their ends.
pub(crate) fn run<B: Execute, W: Watch>(
    scheduler: &mut Scheduler,
    reports: &mut Reports<&mut [B]>,
    others: impl Others,
) {
    let mut signals = Vec::with_capacity(scheduler.task_set().dags().len());
    let mut now_ns = 0;
    while let Some(event_ns) = others.next_ns(scheduler.next_event_ns(), now_ns + W::STEP_NS) {
        now_ns = event_ns.max(now_ns);
        let mut next = end_instant::<B, W>(scheduler, now_ns, reports, others);
        while let Some((vertex, job)) = next {
            let body = &mut reports.bodies[vertex.index()];
            body.run(job);
            now_ns += W::STEP_NS;
            body.complete(&mut |dag| keep_signal(&mut signals, dag));
            if !signals.is_empty() || others.have_knocked() {
                let instance = scheduler.instance_of(vertex);
                let mut moment = scheduler.at(now_ns);
                moment.complete(instance);
                for dag in signals.drain(..) {
                    if !others.send(dag) {
                        moment.signal(dag);
                    }
                }
                next = end_instant::<B, W>(scheduler, now_ns, reports, others);
                continue;
            }
            let done = scheduler.hand_off(now_ns, CORE, vertex);
            reports.act(scheduler);
            next = match done {
                HandOff::To(vertex, decision) => {
                    note_start::<W>(scheduler, decision.instance(), now_ns);
                    Some((vertex, decision.instance().job))
                }
                HandOff::Idle => None,
                HandOff::Open => end_instant::<B, W>(scheduler, now_ns, reports, others),
            };
        }
    }
}

/// Takes letters, releases, dispatches, and returns what the core shall run.
fn end_instant<B: Execute, W: Watch>(
    scheduler: &mut Scheduler,
    now_ns: u64,
    reports: &mut Reports<&mut [B]>,
    others: impl Others,
) -> Option<(Vertex, u64)> {
    let mut moment = scheduler.at(now_ns);
    others.take(|dag| moment.signal(dag));
    let decisions = moment.release_due().dispatch();
    // Without preemption one core gets at most one instance.
    let first = decisions.first().map(|decision| decision.instance());
    reports.act(scheduler);
    let instance = first?;
    note_start::<W>(scheduler, instance, now_ns);
    Some((scheduler.vertex(instance), instance.job))
}

/// Writes down that the core begins an instance, if that is wanted.
#[inline]
fn note_start<W: Watch>(scheduler: &mut Scheduler, instance: Instance, now_ns: u64) {
    if W::STEP_NS > 0 {
        (scheduler.log).on_core(CORE, What::Start, now_ns, instance);
    }
}
