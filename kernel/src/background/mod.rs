//! What core 0 does for people while a run goes on, when it has nothing else to do.
//!
//! It prints progress, the status if the command line asks for it, and holds the
//! console's conversation. All this is core 0's background, which is suspended
//! whenever the core has an instance to run: it delays nothing but itself.

mod listener;
mod progress;
mod status;

use crate::console::session::{self, Session};
use crate::worker;
use listener::Listener;
use progress::Progress;
use sched_dag::DagId;
use status::Status;

/// What the command line says about the background.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Wishes {
    /// Whether there is a console, and whether it sends back what is typed.
    pub(crate) console: Option<Echo>,
    /// The time between two lines of kind `status`; 0: none.
    pub(crate) status_ns: u64,
    /// What each byte of input raises: a plan's number and a sporadic DAG of it.
    pub(crate) input: Option<(u64, DagId)>,
}

impl Wishes {
    /// Adds what bytes of input raise.
    pub(crate) const fn with_input(self, input: Option<(u64, DagId)>) -> Self {
        Self { input, ..self }
    }
}

/// Whether the console sends back what is typed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Echo {
    /// It does, for a terminal that does not show it by itself.
    On,
    /// It does not.
    Off,
}

/// The background of one run.
#[derive(Debug)]
pub(crate) struct Background {
    progress: Progress,
    status: Option<Status>,
    session: Option<Session>,
    listener: Option<Listener>,
    /// The heartbeat that the core had before, if it has another one now.
    heartbeat_before_ns: Option<u64>,
}

impl Background {
    /// Begins the background of a run of `total` jobs; 0: no one knows how many.
    pub(crate) fn begin(wishes: Wishes, total: u64) -> Self {
        let periods = [
            (wishes.console.is_some() || wishes.input.is_some()).then_some(session::PERIOD_NS),
            Some(wishes.status_ns).filter(|&period_ns| period_ns > 0),
        ];
        let period_ns = periods.into_iter().flatten().min();
        let period_ns = period_ns.filter(|&period_ns| period_ns < worker::HEARTBEAT_NS);
        Self {
            heartbeat_before_ns: period_ns.map(worker::set_own_heartbeat),
            progress: Progress::new(total),
            status: (wishes.status_ns > 0).then(|| Status::begin(wishes.status_ns, total)),
            session: wishes.console.map(|echo| Session::new(echo == Echo::On)),
            // What a person says to the console is no event.
            listener: (wishes.input.filter(|_| wishes.console.is_none())).map(Listener::new),
        }
    }

    /// Does what is due.
    pub(crate) fn step(&mut self) {
        self.progress.print_when_due();
        if let Some(status) = &mut self.status {
            status.print_when_due();
        }
        if let Some(session) = &mut self.session {
            session.step();
        }
        if let Some(listener) = &self.listener {
            listener.step();
        }
    }

    /// Ends it. Reports whether a person has asked for the machine to shut down.
    pub(crate) fn end(self) -> bool {
        if let Some(before_ns) = self.heartbeat_before_ns {
            worker::set_own_heartbeat(before_ns);
        }
        self.session
            .is_some_and(|session| session.is_shutting_down())
    }
}
