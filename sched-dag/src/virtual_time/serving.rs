//! Requests, and what they come to, in virtual time.

use alloc::vec::Vec;

use super::cluster::Cluster;
use super::{VirtualTime, Workload, place};
use crate::engine::Body;
use crate::ids::DagId;
use crate::lifecycle::{Change, Request};
use crate::scheduler::Moment;

impl<B: Body> VirtualTime<B> {
    /// Serves a request at this instant.
    pub(super) fn serve(&mut self, request: Request, workload: &mut impl Workload<B>) {
        let (clusters, now_ns) = (&mut self.clusters[..], self.now_ns);
        let mut changes = Vec::new();
        // Between clusters the journals know no order within an instant; what is entered comes
        // after what has led to it.
        let mut latest = 0;
        match (request, &mut self.lifecycle) {
            (Request::Signal(dag), _) => {
                each(clusters, now_ns, dag, workload, |moment| moment.signal(dag))
            }
            (_, Some(lifecycle)) => lifecycle.serve(request, &mut changes),
            (_, None) => {}
        }
        for change in changes {
            let before: Vec<u64> = clusters.iter().map(written).collect();
            match change {
                Change::Pause(dag) => {
                    each(clusters, now_ns, dag, workload, |moment| moment.pause(dag))
                }
                Change::Resume(dag) => {
                    each(clusters, now_ns, dag, workload, |moment| moment.resume(dag))
                }
                Change::Close(dag) => {
                    each(clusters, now_ns, dag, workload, |moment| moment.close(dag))
                }
                Change::Await(dag) => {
                    let cluster = &clusters[place(clusters, dag)];
                    if cluster.engine.scheduler.in_flight(dag) > 0 {
                        self.waits = true;
                        break;
                    }
                }
                Change::Enter(mode) => {
                    self.waits = false;
                    let first = &mut clusters[latest];
                    first.tell(now_ns, workload, |moment| moment.entered(mode));
                }
            }
            let mut pairs = clusters.iter().zip(&before);
            latest = (pairs.position(|(now, before)| written(now) > *before)).unwrap_or(latest);
        }
    }
}

/// Makes a change at an instant of the cluster that runs a DAG.
fn each<B: Body>(
    clusters: &mut [Cluster<B>],
    now_ns: u64,
    dag: DagId,
    workload: &mut impl Workload<B>,
    change: impl FnOnce(&mut Moment<'_>),
) {
    let cluster = &mut clusters[place(clusters, dag)];
    cluster.tell(now_ns, workload, change);
}

fn written<B: Body>(cluster: &Cluster<B>) -> u64 {
    cluster.engine.scheduler.log.journal.written()
}
