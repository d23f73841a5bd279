//! Recording topics: stating which values shall be written down.

use alloc::rc::Rc;

use recording::Recordable;

use super::dag::Dag;
use crate::draft::checks::check_recorded;
use crate::edge::{self, Begin, ReplayHost};
use crate::platform::{expect_installed, record};
use crate::run::line::TopicEdge;
use crate::run::message::Message;
use crate::run::record::RecordedTopic;

pub(super) static EDGE: TopicEdge = TopicEdge {
    crosses: || expect_installed().crosses(),
    has_results: || expect_installed().results_cross(),
    open: |dag, graph, channels| expect_installed().open_channels(dag, graph, channels, BEGIN),
    record,
    replays: || expect_installed().replays(),
    replay: |channel, job, take| expect_installed().replay(channel, job, take),
};

const BEGIN: Begin = |wish, shows| {
    let host = ReplayHost {
        raise: |plan, dag| expect_installed().raise(plan, dag),
        now_ns: || expect_installed().now_ns(),
    };
    let crossing = wish.map(|wish| edge::new_crossing(wish, host));
    (crossing, shows.then(edge::begin_echo))
};

impl Dag {
    /// Records the values of a topic, where the platform records.
    ///
    /// A replay takes the values that a source wrote, in place of calling it. So if one topic of a
    /// source is recorded, the commit refuses the DAG unless all topics of its sources are, and
    /// all that its other subtasks sample. A replay compares the values that other subtasks write.
    /// The values that subtasks sample of the topic are recorded, too, and given to them in a
    /// replay. A topic that is recorded counts as read. The type must be the
    /// writer's, which the commit checks; a [`Unique`](crate::Unique) cannot be recorded.
    ///
    /// A value is written down when its function has returned, into a buffer that is made at the
    /// commit, and is given to the platform when the instance is complete. One that takes more
    /// than 4 KiB, or twice the least of its type if that is more, is lost, which the recording
    /// says.
    ///
    /// ```
    /// use core::time::Duration;
    /// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
    /// use virtual_time::VirtualTime;
    ///
    /// fn commit(mut input: u32) {
    ///     let dag = create_dag();
    ///     dag.name("demo").jobs(3).record::<u32>("count").record::<u64>("square");
    ///     let period = Duration::from_millis(10);
    ///     let source = move || {
    ///         input += 1;
    ///         (input,)
    ///     };
    ///     let named = SubtaskAttributes::named;
    ///     dag.register_periodic_subtask(source, ["count"], period, named("count"));
    ///     let square = |(count,): (u32,)| (u64::from(count) * u64::from(count),);
    ///     dag.register_subtask(square, ["count"], ["square"], named("square"));
    ///     dag.register_sink_subtask(|_: (u64,)| (), ["square"], period, named("sink"));
    ///     finish_create_dags(&[dag]).unwrap();
    /// }
    ///
    /// let machine = VirtualTime::new();
    /// commit(7);
    /// machine.run();
    /// let recording = machine.recording();
    ///
    /// let machine = VirtualTime::new().replay(&recording).unwrap();
    /// commit(70); // it is not called
    /// let report = machine.run();
    /// assert_eq!((report.compared, report.divergence), (3, None));
    /// ```
    #[track_caller]
    pub fn record<T: Message + Recordable>(&self, topic: &str) -> &Self {
        let recorded = Rc::new(RecordedTopic::<T>::new(topic, &EDGE));
        let mut draft = self.open();
        draft.latest.push(Rc::<RecordedTopic<T>>::clone(&recorded));
        draft.recorded.push(recorded);
        draft.check_recorded = Some(check_recorded);
        self
    }
}
