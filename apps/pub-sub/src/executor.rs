//! Workers that execute a graph's callbacks, as ROS 2's `MultiThreadedExecutor` does.
//!
//! Any number of workers call [`work`] with the same [`Host`]. Each takes a ready
//! callback out of the graph, executes it while the graph is free, gives it back, and
//! waits when nothing is ready. The host is what they run on: it has the one graph
//! under a lock, a clock, and something to wait for. So the same loop runs on
//! threads, as in the tests of `join-latency`, and on a machine's cores.
//!
//! A callback that publishes wakes all workers that wait; the first finds the
//! message, the others wait again.

use crate::graph::{Call, Callbacks, Context, Graph, Next, TopicId};

/// What workers run on.
pub trait Host<M, C>: Sync {
    /// Returns the time in nanoseconds.
    fn now_ns(&self) -> u64;

    /// Lends the graph to one worker at a time, for a short section.
    fn with_graph<R>(&self, section: impl FnOnce(&mut Graph<M, C>) -> R) -> R;

    /// Returns the number of notices given so far.
    fn version(&self) -> u64;

    /// Waits until the version is not `seen`, or until a time, `u64::MAX` forever.
    /// May return early.
    fn wait(&self, seen: u64, until_ns: u64);

    /// Raises the version, so that all workers that wait look again.
    fn notify(&self);
}

/// Executes callbacks until the graph is shut down.
pub fn work<M: Clone, C: Callbacks<M>, H: Host<M, C>>(host: &H) {
    let context = OnHost(host, core::marker::PhantomData);
    loop {
        let seen = host.version();
        let now_ns = host.now_ns();
        match host.with_graph(|graph| graph.take(now_ns)) {
            Next::Call(group, mut callbacks, call) => {
                execute(&mut callbacks, call, &context);
                let now_ns = host.now_ns();
                if host.with_graph(|graph| graph.give_back(group, callbacks, now_ns)) {
                    host.notify();
                }
            }
            Next::WaitUntil(until_ns) => host.wait(seen, until_ns),
            Next::End => return,
        }
    }
}

fn execute<M>(callbacks: &mut impl Callbacks<M>, call: Call<M>, context: &dyn Context<M>) {
    callbacks.call(call, context);
}

/// What a callback sees of the host.
struct OnHost<'a, H, C>(&'a H, core::marker::PhantomData<fn() -> C>);

impl<M: Clone, C, H: Host<M, C>> Context<M> for OnHost<'_, H, C> {
    fn now_ns(&self) -> u64 {
        self.0.now_ns()
    }

    fn publish(&self, topic: TopicId, message: M) {
        self.0.with_graph(|graph| graph.publish(topic, message));
        self.0.notify();
    }

    fn dropped(&self) -> u64 {
        self.0.with_graph(|graph| graph.dropped())
    }

    fn shut_down(&self) {
        self.0.with_graph(Graph::shut_down);
        self.0.notify();
    }
}
