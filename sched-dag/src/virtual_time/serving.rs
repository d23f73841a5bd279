//! Requests, and what they come to, in virtual time.

use alloc::vec::Vec;

use super::{VirtualTime, Workload, at, place};
use crate::lifecycle::{Change, Request};

impl VirtualTime {
    /// Serves a request at this instant.
    pub(super) fn serve(&mut self, request: Request, workload: &mut impl Workload) {
        let (clusters, now_ns) = (&mut self.clusters[..], self.now_ns);
        let mut changes = Vec::new();
        match (request, &mut self.lifecycle) {
            (Request::Signal(dag), _) => at(clusters, now_ns, dag).signal(dag, workload),
            (_, Some(lifecycle)) => lifecycle.serve(request, &mut changes),
            (_, None) => {}
        }
        for change in changes {
            match change {
                Change::Pause(dag) => at(clusters, now_ns, dag).pause(dag, workload),
                Change::Resume(dag) => at(clusters, now_ns, dag).resume(dag, workload),
                Change::Close(dag) => at(clusters, now_ns, dag).close(dag, workload),
                Change::Await(dag) => {
                    let cluster = &clusters[place(clusters, dag)];
                    if cluster.scheduler.in_flight(dag) > 0 {
                        self.waits = true;
                        break;
                    }
                }
                Change::Enter(mode) => {
                    self.waits = false;
                    workload.entered(mode);
                }
            }
        }
    }
}
