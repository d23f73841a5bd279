//! What a run and the machine that it runs on tell each other.

use std::cell::{Cell, RefCell};
use std::collections::BTreeMap;

use sched_dag::DagId;
use sched_dag::lifecycle::Request;

use crate::arrival::Arrival;
use crate::disturbed::{Fault, Late};
use crate::edge::Edge;
use crate::silent::Silent;
use crate::wires::Wires;

/// The time, the requests to come, and what is to become of a panic.
#[derive(Debug, Default)]
pub(crate) struct Surroundings {
    /// How long calls take that do not say.
    pub(crate) silent: Cell<Silent>,
    /// How late interrupts are.
    pub(crate) late: Cell<Late>,
    /// The calls that fail.
    pub(crate) faults: RefCell<Vec<Fault>>,
    /// What is recorded and replayed.
    pub(crate) edge: Edge,
    /// Bytes on their way in and out.
    pub(crate) wires: Wires,
    /// The job with whose end the run stops.
    pub(crate) until: Cell<Option<(DagId, u64)>>,
    /// Whether a panic of a function ends its DAG only.
    pub(crate) contains_panics: Cell<bool>,
    /// The time that functions are told: the start of the instance and what it
    /// has executed.
    pub(crate) now_ns: Cell<u64>,
    /// What the running function has executed; `None` outside functions.
    pub(crate) executed_ns: Cell<Option<u64>>,
    /// What is to come, by time and in the order in which it was made.
    arrivals: RefCell<BTreeMap<(u64, usize), Arrival>>,
}

impl Surroundings {
    /// Notes a signal to a DAG of the launched plan; in a replay all signals are recorded ones.
    pub(crate) fn signal_at(&self, time_ns: u64, dag: DagId) {
        if !self.edge.is_replay() {
            self.signal_of_replay_at(time_ns, dag);
        }
    }

    /// Notes a signal that is recorded, or one of a run that is no replay.
    pub(crate) fn signal_of_replay_at(&self, time_ns: u64, dag: DagId) {
        self.keep(time_ns, Arrival::Request(Request::Signal(dag)));
    }

    /// Notes what a completion asks for.
    pub(crate) fn request_at(&self, time_ns: u64, request: Request) {
        match request {
            Request::Signal(dag) => self.signal_at(time_ns, dag),
            _ => self.keep(time_ns, Arrival::Request(request)),
        }
    }

    /// Notes what comes at a time.
    pub(crate) fn keep(&self, time_ns: u64, arrival: Arrival) {
        let mut arrivals = self.arrivals.borrow_mut();
        let mut of_this_time = arrivals.range((time_ns, 0)..=(time_ns, usize::MAX));
        let last = of_this_time.next_back();
        let place = last.map_or(0, |(&(_, last), _)| last + 1);
        arrivals.insert((time_ns, place), arrival);
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
}
