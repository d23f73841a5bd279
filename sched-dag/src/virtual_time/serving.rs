//! Requests, and what they come to, in virtual time.

use alloc::vec::Vec;

use super::cluster::Now;
use super::{VirtualTime, Workload};
use crate::engine::Body;
use crate::ids::DagId;
use crate::lifecycle::{Change, Request};

impl<B: Body> VirtualTime<B> {
    /// Serves a request at this instant.
    pub(super) fn serve(&mut self, request: Request, now: &mut Now<'_, impl Workload<B>>) {
        let mut changes = Vec::new();
        match (request, &mut self.lifecycle) {
            (Request::Signal(dag), _) => _ = self.change(dag, request, now),
            (_, Some(lifecycle)) => lifecycle.serve(request, &mut changes),
            (_, None) => {}
        }
        // Between clusters the journals know no order within an instant; what is entered comes
        // after what has led to it.
        let mut latest = 0;
        for change in changes {
            let (dag, request) = match change {
                Change::Pause(dag) => (dag, Request::Pause(dag)),
                Change::Resume(dag) => (dag, Request::Resume(dag)),
                Change::Close(dag) => (dag, Request::Close(dag)),
                Change::Await(dag) if self.scheduler_of(dag).in_flight(dag) == 0 => continue,
                Change::Await(_) => {
                    self.waits = true;
                    break;
                }
                Change::Enter(mode) => {
                    self.waits = false;
                    self.clusters[latest].tell(now, |moment| moment.entered(mode));
                    continue;
                }
            };
            latest = self.change(dag, request, now).unwrap_or(latest);
        }
    }

    /// Has the cluster of a DAG serve a request, and returns its place if anything has changed.
    fn change(
        &mut self,
        dag: DagId,
        request: Request,
        now: &mut Now<'_, impl Workload<B>>,
    ) -> Option<usize> {
        let place = self.place(dag);
        let cluster = &mut self.clusters[place];
        let before = cluster.engine.scheduler.log.journal.written();
        cluster.tell(now, |moment| moment.serve(request));
        let is_written = cluster.engine.scheduler.log.journal.written() > before;
        is_written.then_some(place)
    }
}
