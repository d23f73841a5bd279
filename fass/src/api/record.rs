//! Recording topics: choosing the values to be written down.

use alloc::format;
use alloc::rc::Rc;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::fmt;

use recording::{Channel, Recordable, Role, Schema};
use sched_dag::DagId;
use sched_dag::wcets::graph_hash;

use super::dag::Dag;
use super::latest::{SampleUse, writer, writer_of};
use super::state::StateOptions;
use crate::draft::DagDraft;
use crate::draft::fault::Fault;
use crate::draft::part::{self, CommitCheck, DraftPart, Drafts, PartKind, Planner};
use crate::edge::{self, Begin, ReplayHost};
use crate::platform::{expect_installed, record};
use crate::run::answers::AskedDevice;
use crate::run::latest::AnyLatest;
use crate::run::line::{ChannelState, LineOf, TopicEdge};
use crate::run::message::Message;
use crate::run::plan::Plan;
use crate::run::record::{
    AnyRecorded, Around, RecordedTopic, defer_replayed, finding, looking, narrow,
};

pub(super) static EDGE: TopicEdge = TopicEdge {
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
    /// A replay takes a source's recorded values instead of calling the source. So if one topic of
    /// a source is recorded, the commit refuses the DAG unless all topics of its sources are
    /// recorded, and, for its other subtasks, all topics sampled and all answers of devices. The
    /// values written by other subtasks are compared in a replay. Values sampled from the topic are
    /// recorded, too, and a replay gives them to the sampling subtasks. A recorded topic counts as
    /// read. `T` must be the writer's type, checked by the commit; a [`Unique`](crate::Unique)
    /// cannot be recorded.
    ///
    /// After its function has returned, a value is written into a buffer made at the commit. The
    /// platform gets the value when the instance is complete; a failing instance gives no outputs.
    /// A value of more than 4 KiB, or of more than twice the least size of its type if that is
    /// larger, is lost, and the recording says so.
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
        let latest: Rc<dyn AnyLatest> = Rc::<RecordedTopic<T>>::clone(&recorded);
        let recorded: Rc<dyn AnyRecorded> = recorded;
        let mut draft = self.open();
        draft.add(PartKind::Effect, latest);
        draft.add(PartKind::Recording, recorded);
        draft.add(PartKind::Recording, check_recorded as CommitCheck);
        draft.add(PartKind::Recording, plan_channels as Planner);
        drop(draft);
        self
    }
}

impl DraftPart for Rc<dyn AnyRecorded> {}

/// Opens the channels of all DAGs, before bodies are made, since only an open channel gets a tap.
fn plan_channels(drafts: &Drafts, plan: &mut Plan) {
    // Nobody records or replays: no channel is opened, and no value is copied.
    if !expect_installed().crosses() {
        return;
    }
    for (dag, draft) in (0..).map(DagId).zip(drafts) {
        let around = open_channels(drafts, dag, plan);
        let mut draft = draft.borrow_mut();
        if expect_installed().replays() {
            replay_sources(&mut draft);
        }
        // Last, so that the wrapper of a body encloses everything the body does.
        for (subtask, around) in around {
            draft.tie(move |dag| {
                let body = dag.bodies.swap_remove(subtask);
                let last = dag.bodies.len();
                dag.bodies.push(around(body));
                dag.bodies.swap(subtask, last);
            });
        }
    }
}

/// Numbers all recorded topics of a DAG, the samples of its subtasks from such topics, the recorded
/// answers of devices, and its recorded states; tells the platform, and appends their lines to the
/// plan. Returns the wrappers needed around subtasks.
#[allow(clippy::too_many_lines, reason = "one order, to be seen whole")]
fn open_channels(drafts: &Drafts, dag: DagId, plan: &mut Plan) -> Vec<(usize, Around)> {
    let draft = &*drafts[dag.index()].borrow();
    let (verified, lines) = (plan.task_set.dag(dag), &mut plan.lines);
    let first = lines.len();
    let mut channels = Vec::new();
    let mut open =
        |subtask, role, topic: &str, (schema, line): (Schema, Arc<ChannelState>), state| {
            line.set_number(narrow(lines.len()));
            lines.push(LineOf {
                dag,
                subtask,
                role,
                line,
                state,
            });
            channels.push(Channel {
                dag: narrow(dag.index()),
                subtask: narrow(subtask),
                role,
                topic: topic.into(),
                schema,
            });
        };
    let has_results = expect_installed().results_cross();
    let topics = draft.all::<Rc<dyn AnyRecorded>>();
    for (topic, subtask) in topics.filter_map(|of| Some((of, writer(verified, of.topic())?))) {
        let role = match draft.spec.subtasks[subtask].inputs.is_empty() {
            true => Role::Source,
            false => Role::Result,
        };
        // Where nobody compares results, only inputs are kept.
        if has_results || role != Role::Result {
            open(subtask, role, topic.topic(), topic.line(), None);
        }
    }
    let mut around = Vec::new();
    for SampleUse(subtask, latest, sampler) in draft.all() {
        let writer = writer_of(drafts, latest).map(|writer| drafts[writer].borrow());
        let topic = writer
            .as_ref()
            .and_then(|writer| recorded(writer, latest.topic()));
        // A topic of another type, or an unrecorded topic, has no probe.
        let probe = topic.and_then(|topic| topic.probe(&**latest, *sampler));
        if let Some((probe, schema, line)) = probe {
            let way = (schema, Arc::clone(&line));
            open(*subtask, Role::Sample, latest.topic(), way, None);
            let look = move |job| probe.note_job(job);
            around.push((*subtask, looking(line, look)));
        }
    }
    for AskedDevice(subtask, device) in draft.all() {
        if let Some((schema, line)) = device.line() {
            let way = (schema, Arc::clone(&line));
            open(*subtask, Role::Answer, device.name(), way, None);
            around.push((*subtask, finding(line)));
        }
    }
    for options in draft.all::<Rc<StateOptions>>() {
        let Some(kept) = options.kept.borrow().clone() else {
            continue;
        };
        let state = &draft.spec.states[options.position];
        let changes = |subtask: &usize| {
            let mut users = state.users.iter();
            users.any(|user| user.updates && user.subtask == *subtask)
        };
        // The users take turns in topological order.
        let order = verified.topological_order().iter();
        // The first user changing the state sees the value left by the job before.
        if let Some(subtask) = order.map(|subtask| subtask.index()).find(changes) {
            let line = Arc::new(ChannelState::new(&EDGE));
            let way = (kept.state.schema(), Arc::clone(&line));
            let of_state = Some(Arc::clone(&kept));
            open(subtask, Role::State, &state.name, way, of_state);
            let found = Arc::clone(&line);
            let look = move |job| kept.keep(&line, job);
            around.push((subtask, looking(found, look)));
        }
    }
    // One call for each DAG, so that the platform sees all its channels together.
    if !channels.is_empty() {
        let hash = graph_hash(&draft.spec);
        let is_read = expect_installed().open_channels(dag, hash, &channels, BEGIN);
        for (of, channel) in lines[first..].iter().zip(&channels) {
            of.line.open(is_read, channel.schema.least_bytes());
        }
    }
    around
}

/// Replaces the functions of recorded sources, since a replay does not call them.
fn replay_sources(draft: &mut DagDraft) {
    for subtask in 0..draft.make_bodies.len() {
        let source = &draft.spec.subtasks[subtask];
        let outputs = source.outputs.iter();
        // The commit has made sure that either all outputs are recorded, or none.
        let outputs = outputs.filter_map(|port| recorded(draft, &port.topic).cloned());
        let outputs: Vec<_> = outputs.collect();
        if source.inputs.is_empty() && !outputs.is_empty() {
            draft.make_bodies[subtask] = defer_replayed(outputs);
        }
    }
}

/// Adds a fault for each value missing from the recording but needed by a replay. In each DAG with
/// a recorded source, those are the other topics of the sources, and, for all other subtasks, the
/// answers of devices and the sampled topics.
fn check_recorded(drafts: &Drafts, faults: &mut Vec<Fault>) {
    for (id, draft) in (0..).map(DagId).zip(drafts) {
        let draft = draft.borrow();
        let dag = part::label(drafts, id);
        let mut add = |code, subtask, says: fmt::Arguments<'_>| {
            let text = format!("{} of {dag} {says}", draft.label(subtask));
            faults.push(Fault::Worded { code, text });
        };
        let is_source = |subtask: usize| draft.spec.subtasks[subtask].inputs.is_empty();
        let sources = (0..draft.spec.subtasks.len()).filter(|subtask| is_source(*subtask));
        let written = sources.flat_map(|subtask| {
            let outputs = draft.spec.subtasks[subtask].outputs.iter();
            outputs.map(move |port| (subtask, &*port.topic))
        });
        let (kept, others): (Vec<_>, Vec<_>) =
            written.partition(|(_, topic)| recorded(&draft, topic).is_some());
        let Some((_, first)) = kept.first() else {
            continue;
        };
        for (subtask, topic) in others {
            let says = format_args!(
                "writes topic `{topic}`, which is not recorded, and a replay would not call it, for \
                 topic `{first}` of a source is; record all topics of the sources, or none"
            );
            add("source_partly_recorded", subtask, says);
        }
        for AskedDevice(subtask, device) in draft.all() {
            if !is_source(*subtask) && device.line().is_none() {
                let says = format_args!(
                    "asks device `{}`, whose answers are not recorded, and a replay could not give \
                     them, though topic `{first}` of a source is; record both, or neither",
                    device.name()
                );
                add("answers_not_recorded", *subtask, says);
            }
        }
        for SampleUse(subtask, latest, _) in draft.all() {
            let (topic, writer) = (latest.topic(), writer_of(drafts, latest));
            let is_lacking = |of: usize| recorded(&drafts[of].borrow(), topic).is_none();
            if !is_source(*subtask) && writer.is_some_and(is_lacking) {
                let says = format_args!(
                    "samples topic `{topic}`, which is not recorded, and a replay could not give it \
                     the same, though topic `{first}` of a source is; record both, or neither"
                );
                add("sample_not_recorded", *subtask, says);
            }
        }
    }
}

fn recorded<'d>(draft: &'d DagDraft, topic: &str) -> Option<&'d Rc<dyn AnyRecorded>> {
    let mut all = draft.all::<Rc<dyn AnyRecorded>>();
    all.find(|recorded| recorded.topic() == topic)
}
