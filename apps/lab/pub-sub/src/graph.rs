//! Topics, timers and subscriptions with their callbacks, as data.
//!
//! Some terms. A *callback* is an app's function for the time when a *timer* is due or a
//! *subscription* has a message. A *topic* hands each published message to all its subscriptions.
//! Each subscription queues up to its *depth*, and then drops the oldest message (`KEEP_LAST` in
//! ROS 2). A *group* is a number of callbacks excluding each other (a mutually exclusive callback
//! group; in ROS 2 all callbacks of a node by default). A *worker* executes callbacks; several
//! workers share a graph.
//!
//! Callbacks of a group never overlap, so they can own common state: a group is a single value. A
//! worker [takes](Graph::take) the value out of the graph, calls it while the graph is free for
//! others, and [gives it back](Graph::give_back); meanwhile no other worker can take it. The state
//! needs no lock, and in the end [`Graph::into_callbacks`] returns it.
//!
//! Workers take ready work in the order of ROS 2: timers before subscriptions, each in the order of
//! their registration. Also as in ROS 2, a timer served more than a period late skips the missed
//! times, and nothing makes the order fair: an earlier registration wins as long as it is ready.
//! Unlike ROS 2, a worker looks anew each time, instead of working off everything found ready at
//! one look.
//!
//! The graph guarantees that the callbacks of a group do not overlap, that a subscription's
//! messages come in the order of their publication, that dropped messages are counted, and that
//! nothing is allocated after registration. The graph has no clock: callers pass the times.
//!
//! Any number of workers share a graph under a lock, as in ROS 2's `MultiThreadedExecutor`. Each
//! worker takes a ready callback out of the graph, executes the callback while the graph is free,
//! gives it back, and waits when nothing is ready. A publishing callback wakes all waiting workers;
//! the first worker finds the message, the others wait again. (`apps/lab/join-latency` has such
//! workers.)

use alloc::collections::VecDeque;
use alloc::vec::Vec;

/// Topics, groups, timers and subscriptions. `M` is the type of all messages, `C` of all groups'
/// callbacks. Topics and groups are numbered from 0.
pub struct Graph<M, C> {
    /// The subscriptions of each topic.
    topics: Vec<Vec<usize>>,
    /// Each group's callbacks, unless a worker has taken them.
    groups: Vec<Option<C>>,
    timers: Vec<Timer>,
    subscriptions: Vec<Subscription<M>>,
    is_shut_down: bool,
}

struct Timer {
    group: usize,
    next_ns: u64,
    period_ns: u64,
}

struct Subscription<M> {
    topic: usize,
    group: usize,
    queue: VecDeque<M>,
    depth: usize,
    dropped: u64,
}

/// The next work of a worker.
pub enum NextCallback<M, C> {
    /// Call the callbacks of the group and give them back: for a message, given with its topic, or
    /// for the due timer.
    Call(usize, C, Option<(usize, M)>),
    /// Look again after a publication or a return of callbacks, or at the given time; `u64::MAX` is
    /// never.
    WaitUntil(u64),
    /// No more work: the graph was shut down.
    End,
}

impl<M, C> Graph<M, C> {
    /// Makes a graph with the given number of topics, without groups.
    pub fn new(topics: usize) -> Self {
        Self {
            topics: (0..topics).map(|_| Vec::new()).collect(),
            groups: Vec::new(),
            timers: Vec::new(),
            subscriptions: Vec::new(),
            is_shut_down: false,
        }
    }

    /// Adds a group with its callbacks.
    pub fn add_group(&mut self, callbacks: C) -> usize {
        self.groups.push(Some(callbacks));
        self.groups.len() - 1
    }

    /// Adds a timer to a group: due first at `first_ns`, then every `period_ns`.
    ///
    /// # Panics
    ///
    /// If the period is 0.
    pub fn add_timer(&mut self, group: usize, first_ns: u64, period_ns: u64) {
        assert!(period_ns > 0, "a timer's period is at least 1 ns");
        self.timers.push(Timer {
            group,
            next_ns: first_ns,
            period_ns,
        });
    }

    /// Subscribes a group to a topic, with a queue of `depth` messages.
    ///
    /// # Panics
    ///
    /// If the depth is 0 or the topic does not exist.
    pub fn subscribe(&mut self, group: usize, topic: usize, depth: usize) {
        assert!(depth > 0, "a subscription queues at least 1 message");
        self.topics[topic].push(self.subscriptions.len());
        self.subscriptions.push(Subscription {
            topic,
            group,
            queue: VecDeque::with_capacity(depth),
            depth,
            dropped: 0,
        });
    }

    /// Publishes a message: queues it in each of the topic's subscriptions.
    ///
    /// # Panics
    ///
    /// If the topic does not exist.
    pub fn publish(&mut self, topic: usize, message: M)
    where
        M: Clone,
    {
        for &index in &self.topics[topic] {
            self.subscriptions[index].push(message.clone());
        }
    }

    /// Takes ready work and returns it, or returns the time to wait for.
    pub fn take(&mut self, now_ns: u64) -> NextCallback<M, C> {
        if self.is_shut_down {
            return NextCallback::End;
        }
        for timer in self.timers.iter_mut().filter(|timer| timer.is_due(now_ns)) {
            if let Some(callbacks) = self.groups[timer.group].take() {
                timer.serve(now_ns);
                return NextCallback::Call(timer.group, callbacks, None);
            }
        }
        for subscription in &mut self.subscriptions {
            let group = &mut self.groups[subscription.group];
            if group.is_some()
                && let Some(message) = subscription.queue.pop_front()
                && let Some(callbacks) = group.take()
            {
                let message = Some((subscription.topic, message));
                return NextCallback::Call(subscription.group, callbacks, message);
            }
        }
        // A due timer has a busy group: the worker giving the group back sees the timer.
        let to_come = self.timers.iter().filter(|timer| !timer.is_due(now_ns));
        let next_ns = to_come.map(|timer| timer.next_ns).min();
        NextCallback::WaitUntil(next_ns.unwrap_or(u64::MAX))
    }

    /// Takes a group's callbacks back, and returns whether another callback of the group is ready
    /// and waits for them.
    ///
    /// # Panics
    ///
    /// If the group does not exist.
    pub fn give_back(&mut self, group: usize, callbacks: C, now_ns: u64) -> bool {
        self.groups[group] = Some(callbacks);
        let mut timers = self.timers.iter();
        let mut subscriptions = self.subscriptions.iter();
        timers.any(|timer| timer.group == group && timer.is_due(now_ns))
            || subscriptions.any(|one| one.group == group && !one.queue.is_empty())
    }

    /// Ends the taking of callbacks, for good.
    pub fn shut_down(&mut self) {
        self.is_shut_down = true;
    }

    /// Returns the number of messages dropped by all subscriptions together.
    pub fn dropped(&self) -> u64 {
        self.subscriptions.iter().map(|one| one.dropped).sum()
    }

    /// Returns the callbacks of all groups, in order, without callbacks still taken by a worker.
    pub fn into_callbacks(self) -> impl Iterator<Item = C> {
        self.groups.into_iter().flatten()
    }
}

impl Timer {
    const fn is_due(&self, now_ns: u64) -> bool {
        self.next_ns <= now_ns
    }

    /// Moves on to the next time not in the past.
    fn serve(&mut self, now_ns: u64) {
        let behind = now_ns.saturating_sub(self.next_ns.saturating_add(self.period_ns));
        let periods = 1 + behind.div_ceil(self.period_ns);
        self.next_ns = (self.next_ns).saturating_add(self.period_ns.saturating_mul(periods));
    }
}

impl<M> Subscription<M> {
    fn push(&mut self, message: M) {
        if self.queue.len() == self.depth {
            self.queue.pop_front();
            self.dropped += 1;
        }
        self.queue.push_back(message);
    }
}

#[cfg(test)]
mod tests {
    use super::{Graph, NextCallback};

    /// Callbacks that are only a name.
    type Names = Graph<u32, &'static str>;

    /// Takes what is ready, as (name, message with its topic).
    fn take(graph: &mut Names, now_ns: u64) -> Option<(&'static str, Option<(usize, u32)>)> {
        match graph.take(now_ns) {
            NextCallback::Call(_, name, message) => Some((name, message)),
            NextCallback::WaitUntil(_) | NextCallback::End => None,
        }
    }

    #[test]
    fn timers_come_before_subscriptions_and_both_in_order() {
        let (mut graph, topic) = (Names::new(1), 0);
        let groups = ["a", "b", "c"].map(|name| graph.add_group(name));
        graph.subscribe(groups[2], topic, 3);
        graph.subscribe(groups[0], topic, 3);
        graph.add_timer(groups[1], 10, 5);
        graph.publish(topic, 7);
        let names = core::iter::from_fn(|| take(&mut graph, 10)).map(|(name, _)| name);
        assert_eq!(names.collect::<Vec<_>>(), ["b", "c", "a"]);
    }

    #[test]
    fn callbacks_of_a_group_exclude_each_other() {
        let (mut graph, topics) = (Names::new(2), [0, 1]);
        let group = graph.add_group("both");
        for topic in topics {
            graph.subscribe(group, topic, 2);
        }
        graph.publish(topics[1], 1);
        graph.publish(topics[0], 2);
        let (name, message) = take(&mut graph, 0).unwrap();
        assert_eq!(message, Some((topics[0], 2)));
        assert!(matches!(graph.take(0), NextCallback::WaitUntil(u64::MAX)));
        assert!(graph.give_back(group, name, 0), "another one waits");
        let (name, message) = take(&mut graph, 0).unwrap();
        assert_eq!(message, Some((topics[1], 1)));
        assert!(!graph.give_back(group, name, 0));
    }

    #[test]
    fn a_full_queue_drops_its_oldest_message() {
        let (mut graph, topic) = (Names::new(1), 0);
        let group = graph.add_group("slow");
        graph.subscribe(group, topic, 2);
        for number in 1..=5 {
            graph.publish(topic, number);
        }
        assert_eq!(graph.dropped(), 3);
        for number in [4, 5] {
            let (name, message) = take(&mut graph, 0).unwrap();
            assert_eq!(message, Some((topic, number)));
            graph.give_back(group, name, 0);
        }
        assert_eq!(take(&mut graph, 0), None);
    }

    #[test]
    fn a_timer_keeps_its_grid_and_skips_what_it_missed() {
        let mut graph = Names::new(0);
        let group = graph.add_group("timer");
        graph.add_timer(group, 100, 10);
        assert!(matches!(graph.take(99), NextCallback::WaitUntil(100)));
        // Served late by less than a period, exactly one, and more.
        for (now_ns, next_ns) in [(103, 110), (120, 120), (165, 170), (170, 180)] {
            let (name, message) = take(&mut graph, now_ns).unwrap();
            let next = graph.timers[0].next_ns;
            assert_eq!((message, next), (None, next_ns), "at {now_ns}");
            graph.give_back(group, name, now_ns);
        }
    }

    #[test]
    fn a_worker_learns_of_a_timer_whose_group_is_busy() {
        let mut graph = Names::new(0);
        let group = graph.add_group("timer");
        graph.add_timer(group, 0, 10);
        let (name, _) = take(&mut graph, 0).unwrap();
        assert!(matches!(graph.take(5), NextCallback::WaitUntil(10)));
        assert!(matches!(graph.take(10), NextCallback::WaitUntil(u64::MAX)));
        assert!(graph.give_back(group, name, 10), "it is due by now");
    }

    #[test]
    fn nothing_is_taken_after_the_shutdown() {
        let mut graph = Names::new(0);
        let group = graph.add_group("timer");
        graph.add_timer(group, 0, 10);
        graph.shut_down();
        assert!(matches!(graph.take(0), NextCallback::End));
        assert_eq!(graph.into_callbacks().collect::<Vec<_>>(), ["timer"]);
    }
}
