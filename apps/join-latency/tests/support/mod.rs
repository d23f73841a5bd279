//! Workers on the host's threads, for tests of what runs on them.

use std::sync::{Condvar, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use pub_sub::graph::{Callbacks, Graph, Host, work};

/// A graph shared by threads.
struct Threads<M, C> {
    graph: Mutex<Graph<M, C>>,
    version: Mutex<u64>,
    changed: Condvar,
    start: Instant,
}

/// Runs a graph by `workers` workers until it is shut down, and returns it.
pub(crate) fn run<M, C>(graph: Graph<M, C>, workers: usize) -> Graph<M, C>
where
    M: Clone + Send,
    C: Callbacks<M> + Send,
{
    let host = Threads {
        graph: Mutex::new(graph),
        version: Mutex::new(0),
        changed: Condvar::new(),
        start: Instant::now(),
    };
    thread::scope(|scope| {
        for _ in 0..workers {
            scope.spawn(|| work(&host));
        }
    });
    host.graph.into_inner().expect("no holder panics")
}

impl<M: Clone + Send, C: Callbacks<M> + Send> Host<M, C> for Threads<M, C> {
    fn now_ns(&self) -> u64 {
        self.start
            .elapsed()
            .as_nanos()
            .try_into()
            .expect("a short test")
    }

    fn with_graph<R>(&self, section: impl FnOnce(&mut Graph<M, C>) -> R) -> R {
        section(&mut self.graph.lock().expect("no holder panics"))
    }

    fn version(&self) -> u64 {
        *self.version.lock().expect("no holder panics")
    }

    fn wait(&self, seen: u64, until_ns: u64) {
        let limit = Duration::from_nanos(until_ns.saturating_sub(self.now_ns()));
        let limit = limit.min(Duration::from_secs(1));
        let version = self.version.lock().expect("no holder panics");
        drop(
            self.changed
                .wait_timeout_while(version, limit, |version| *version == seen),
        );
    }

    fn notify(&self) {
        *self.version.lock().expect("no holder panics") += 1;
        self.changed.notify_all();
    }
}
