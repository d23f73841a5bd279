//! What a run and the machine that it runs on tell each other.

use std::cell::{Cell, RefCell};
use std::collections::BTreeMap;

use fass::Wire;
use fass::log::Line;
use sched_dag::lifecycle::Request;
use sched_dag::{DagId, Instance};

use crate::edge::Edge;
use crate::settings::Settings;

/// The time, what crosses the edge of the run, and what is to come.
#[derive(Debug, Default)]
pub(crate) struct Surroundings {
    pub(crate) settings: RefCell<Settings>,
    /// What is recorded and replayed.
    pub(crate) edge: Edge,
    /// The wires that are connected, and what has been sent on each.
    pub(crate) connected: RefCell<Vec<(Wire, Vec<u8>)>>,
    /// The time that functions are told: the start of the instance and what it
    /// has executed.
    pub(crate) now_ns: Cell<u64>,
    /// What the running function has executed; `None` outside functions.
    pub(crate) executed_ns: Cell<Option<u64>>,
    /// The instance of the running function.
    pub(crate) running: Cell<Option<Instance>>,
    /// The lines of the log so far.
    pub(crate) logs: RefCell<Vec<Line>>,
    /// What is to come, by time and in the order in which it was made.
    arrivals: RefCell<BTreeMap<(u64, u64), Arrival>>,
    /// How much of that there has been.
    count: Cell<u64>,
}

/// Something that comes from outside of the scheduler at an instant.
#[derive(Debug)]
pub(crate) enum Arrival {
    Request(Request),
    Bytes(Wire, Vec<u8>),
}

impl Surroundings {
    /// Notes a signal to a DAG of the launched plan; in a replay all signals are recorded ones.
    pub(crate) fn signal_at(&self, time_ns: u64, dag: DagId) {
        if !self.edge.is_replay() {
            self.keep(time_ns, Arrival::Request(Request::Signal(dag)));
        }
    }

    /// Notes the next signal of a replay, which comes not before `now_ns`. One follows when the one
    /// before it has led to something, for else it would be dropped where functions take longer
    /// than they took.
    pub(crate) fn follow_signal(&self, dag: DagId, now_ns: u64) {
        let next_ns = self.edge.of_replay(|replay| replay.next_signal_ns(dag));
        if let Some(time_ns) = next_ns {
            self.keep(time_ns.max(now_ns), Arrival::Request(Request::Signal(dag)));
        }
    }

    /// Notes what comes at a time.
    pub(crate) fn keep(&self, time_ns: u64, arrival: Arrival) {
        let place = self.count.get();
        self.count.set(place + 1);
        self.arrivals.borrow_mut().insert((time_ns, place), arrival);
    }

    /// Returns the time of the next request, or of bytes that may raise a signal.
    pub(crate) fn next_request_ns(&self) -> Option<u64> {
        let arrivals = self.arrivals.borrow();
        arrivals.first_key_value().map(|(&(time_ns, _), _)| time_ns)
    }

    /// Takes the next request that is due by `now_ns`.
    pub(crate) fn take_request(&self, now_ns: u64) -> Option<Request> {
        loop {
            self.next_request_ns().filter(|&at_ns| at_ns <= now_ns)?;
            let ((at_ns, _), arrival) = self.arrivals.borrow_mut().pop_first()?;
            match arrival {
                Arrival::Request(request) => return Some(request),
                Arrival::Bytes(wire, bytes) => {
                    if let Some((_, dag)) = wire.arrive(&bytes, at_ns) {
                        self.signal_at(now_ns, dag);
                    }
                }
            }
        }
    }

    /// Takes what has been sent on wires.
    pub(crate) fn collect(&self) {
        for (wire, sent) in self.connected.borrow_mut().iter_mut() {
            sent.extend(std::iter::from_fn(|| wire.depart()));
        }
    }
}
