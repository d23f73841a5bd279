//! Registering a subtask step by step: its function, its input and output topics, and its deadline.
//!
//! The paper's three functions ([`Dag::register_periodic_subtask`], [`Dag::register_subtask`],
//! [`Dag::register_sink_subtask`]) do the same in one line. The steps also cover cases beyond those
//! three: a subtask *using* an object besides its inputs ([`Dag::using`]), a subtask whose function
//! is *replaced* after a fault ([`Dag::restarting`]), the source of a *sporadic* DAG
//! ([`Dag::sporadic`]).
//!
//! # Untyped subtasks
//!
//! A function's tuples fix a graph at compile time, with at most 16 inputs and 16 outputs per
//! subtask. A graph read from a file, or generated, has neither limit: its subtasks are *untyped*.
//! An untyped subtask is a function of the job's number, and of its uses if there are any. Its
//! edges are added one by one ([`Dag::precede`](crate::Dag::precede)), in any number, and carry no
//! data.
//!
//! Most other things are as for typed subtasks; but the function of an untyped subtask cannot be
//! replaced after a fault. The commit verifies the same graph of the same model. Each edge has a
//! ring of slots, and a token passes through the ring for every job. An instance takes the tokens
//! of *its* job from all predecessors before the function is called (R2), and gives its own token
//! only after the function has returned (R3). So a platform starting an instance too early is
//! detected, as with typed subtasks.

use alloc::boxed::Box;
use alloc::rc::Rc;
use alloc::vec::Vec;
use core::cell::RefCell;
use core::fmt;
use core::time::Duration;

use sched_dag::SubtaskLabel;

use super::dag::Dag;
use crate::draft::{DagDraft, NamedTopics, SubtaskAttributes};
use crate::run::message::MessageType;
use crate::run::subtask::{MakeBody, defer, defer_untyped};
use crate::run::tuple::{VecToPubs, VecToSubs};

/// A subtask under construction, with a known function. [`register`](Self::register) ends the
/// construction.
///
/// Made by [`Dag::subtask`], [`Dag::source`], [`Dag::restarting`] and [`Dag::falling_back`], and by
/// the same methods of [`SubtaskBuilder`](crate::shared::SubtaskBuilder).
///
/// ```
/// use core::time::Duration;
/// use fass::{SubtaskAttributes, create_dag};
///
/// let named = SubtaskAttributes::named;
/// let dag = create_dag();
/// let count = dag.period(Duration::from_millis(10)).state("count", 0_u64);
/// dag.using(count.update())
///     .source(|count: &mut u64| {
///         *count += 1;
///         (*count,)
///     })
///     .writes(&["count"])
///     .register(named("counter"));
/// dag.subtask(|(count,): (u64,)| println!("{count}"))
///     .reads(&["count"])
///     .due(Duration::from_millis(5))
///     .register(named("print"));
/// ```
#[must_use = "it is a subtask of the DAG once it is registered"]
pub struct Subtask<'d> {
    dag: &'d Dag,
    body: BeginBody<'d>,
    /// Records the kind of the function in the draft, such as async or replaceable, when the
    /// subtask is registered.
    note: fn(&mut DagDraft, usize),
    reads: &'d [&'d str],
    writes: &'d [&'d str],
    /// Functions returning the types of the inputs and of the outputs: an image has little room.
    types: [fn() -> Vec<MessageType>; 2],
    due: Option<Duration>,
}

/// Makes the body of a subtask at registration, given the subtask's number. The uses are recorded
/// under that number, whichever subtasks are begun or registered meanwhile.
type BeginBody<'d> = Box<dyn FnOnce(&Dag, usize) -> MakeBody + 'd>;

/// Refuses declared waits of a subtask whose function is not async.
fn note_plain(draft: &mut DagDraft, subtask: usize) {
    let says =
        "states waits, and its function is not async; register an async one, or state no waits";
    draft.refuse_waits("cannot_wait", subtask, says);
}

impl Dag {
    /// Begins the registration of a source: a function without inputs, called for every released
    /// job (in a replay, only if its topics are not recorded). A separate call sets when the DAG is
    /// released: [`period`](Self::period) or [`sporadic`](Self::sporadic).
    ///
    /// See [`Subtask`].
    pub fn source<F, Ret>(&self, mut f: F) -> Subtask<'_>
    where
        F: FnMut() -> Ret + Send + 'static,
        Ret: VecToPubs,
    {
        self.subtask(move |()| f())
    }

    /// Begins the registration of a subtask: a function from a tuple of inputs to a tuple of
    /// outputs.
    ///
    /// See [`Subtask`].
    pub fn subtask<F, Args, Ret>(&self, f: F) -> Subtask<'_>
    where
        F: FnMut(Args) -> Ret + Send + 'static,
        Args: VecToSubs,
        Ret: VecToPubs,
    {
        Subtask::new::<Args, Ret>(self, move |_, _| defer(f))
    }
}

impl<'d> Subtask<'d> {
    pub(super) fn new<Args: VecToSubs, Ret: VecToPubs>(
        dag: &'d Dag,
        body: impl FnOnce(&Dag, usize) -> MakeBody + 'd,
    ) -> Self {
        Self {
            dag,
            body: Box::new(body),
            note: note_plain,
            reads: &[],
            writes: &[],
            types: [Args::input_types, Ret::output_types],
            due: None,
        }
    }

    pub(super) fn noted_by(self, note: fn(&mut DagDraft, usize)) -> Self {
        Self { note, ..self }
    }

    /// Names the input topics, one for each element of the function's argument tuple.
    pub fn reads(self, topics: &'d [&'d str]) -> Self {
        Self {
            reads: topics,
            ..self
        }
    }

    /// Names the output topics, one for each element of the function's result tuple.
    pub fn writes(self, topics: &'d [&'d str]) -> Self {
        Self {
            writes: topics,
            ..self
        }
    }

    /// Sets the relative deadline of the subtask, as a sink: the time from a release to the latest
    /// finish. Needed where the deadline differs from the DAG's
    /// [`relative_deadline`](Dag::relative_deadline).
    pub fn due(self, relative_deadline: Duration) -> Self {
        Self {
            due: Some(relative_deadline),
            ..self
        }
    }

    /// Registers the subtask.
    ///
    /// See [`Subtask`]. The commit reports all faults of the subtask.
    #[track_caller]
    pub fn register(self, attributes: SubtaskAttributes) {
        let _ = self.register_labelled(attributes);
    }

    /// Registers the subtask, and returns its name in messages.
    #[inline(never)]
    #[track_caller]
    pub(super) fn register_labelled(self, attributes: SubtaskAttributes) -> SubtaskLabel {
        let number = self.dag.open().spec.subtasks.len();
        let body = (self.body)(self.dag, number);
        let mut draft = self.dag.open();
        let [inputs, outputs] = self.types.map(|types| types());
        let ends = NamedTopics {
            inputs: (self.reads, &inputs),
            outputs: (self.writes, &outputs),
        };
        let subtask = draft.register(body, ends, attributes);
        (self.note)(&mut draft, subtask.id.index());
        if let Some(due) = self.due {
            draft.set_sink_deadline(due, &subtask);
        }
        subtask
    }
}

impl fmt::Debug for Subtask<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Subtask").finish_non_exhaustive()
    }
}

/// A handle of a subtask without types, for naming the ends of edges. Made by
/// [`Dag::register_untyped_subtask`](crate::Dag::register_untyped_subtask).
///
/// ```
/// use fass::{SubtaskAttributes, UntypedSubtask, create_dag};
///
/// let dag = create_dag();
/// let subtasks: Vec<UntypedSubtask> = (0..40)
///     .map(|_| dag.register_untyped_subtask(|_job| (), SubtaskAttributes::default()))
///     .collect();
/// for earlier in &subtasks[..39] {
///     dag.precede(earlier, &subtasks[39]); // a join of 39
/// }
/// ```
#[derive(Clone)]
pub struct UntypedSubtask {
    pub(crate) draft: Rc<RefCell<DagDraft>>,
    /// The subtask's position in its DAG.
    pub(crate) subtask: usize,
}

shown_as!(UntypedSubtask, |of| of.subtask);

impl Dag {
    /// Registers a subtask without types, for a graph known only at run time: a function of the
    /// job's number, with any number of edges.
    ///
    /// [`precede`](Self::precede) adds the edges. A subtask without an edge leading to it is a
    /// source. [`period`](Self::period) and [`relative_deadline`](Self::relative_deadline) set the
    /// DAG's times. The guarantees are the same as for typed subtasks: the function is called after
    /// all predecessors of its job are complete, and successors follow after the function has
    /// returned.
    ///
    /// ```
    /// use core::time::Duration;
    /// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
    ///
    /// let machine = virtual_time::VirtualTime::new();
    /// let dag = create_dag();
    /// dag.jobs(3).period(Duration::from_millis(10));
    /// dag.relative_deadline(Duration::from_millis(10));
    /// let wcets_ms = [1, 4, 2, 3];
    /// let edges = [(0, 1), (0, 2), (1, 3), (2, 3)];
    ///
    /// let work = |ms| {
    ///     let time = Duration::from_millis(ms);
    ///     move |_job| fass::execute_for(time, fass::Occupation::Hold)
    /// };
    /// let register = |ms| dag.register_untyped_subtask(work(ms), SubtaskAttributes::default());
    /// let subtasks = wcets_ms.map(register);
    /// for (earlier, later) in edges {
    ///     dag.precede(&subtasks[earlier], &subtasks[later]);
    /// }
    /// finish_create_dags(&[dag]).unwrap();
    /// assert_eq!(machine.run().jobs.len(), 3);
    /// ```
    #[track_caller]
    pub fn register_untyped_subtask<F>(&self, f: F, attributes: SubtaskAttributes) -> UntypedSubtask
    where
        F: FnMut(u64) + Send + 'static,
    {
        let mut draft = self.open();
        let ends = NamedTopics::default();
        let subtask = draft.register(defer_untyped(f), ends, attributes);
        let subtask = subtask.id.index();
        note_plain(&mut draft, subtask);
        UntypedSubtask {
            subtask,
            draft: Rc::clone(&self.draft),
        }
    }

    /// Adds an edge: in each job, `later` starts only after `earlier` is complete.
    ///
    /// See [`register_untyped_subtask`](Self::register_untyped_subtask). The commit reports all
    /// faults of the graph.
    ///
    /// # Panics
    ///
    /// Also if `earlier` or `later` is a subtask of another DAG: there are no edges between DAGs.
    #[track_caller]
    pub fn precede(&self, earlier: &UntypedSubtask, later: &UntypedSubtask) -> &Self {
        for end in [earlier, later] {
            assert!(
                Rc::ptr_eq(&end.draft, &self.draft),
                "{end:?} is a subtask of another DAG; an edge joins two subtasks of one"
            );
        }
        let edge = (earlier.subtask, later.subtask);
        self.open().spec.edges.push(edge);
        self
    }

    /// Sets the relative deadline of an untyped sink: the time from a release to the sink's latest
    /// finish, where that is shorter than the DAG's deadline. (A typed sink states its deadline at
    /// registration.)
    ///
    /// ```
    /// use core::time::Duration;
    /// use fass::{SubtaskAttributes, create_dag};
    ///
    /// let dag = create_dag();
    /// dag.period(Duration::from_millis(10)).relative_deadline(Duration::from_millis(10));
    /// let [plan, act, log] = ["plan", "act", "log"]
    ///     .map(|name| dag.register_untyped_subtask(|_job| (), SubtaskAttributes::named(name)));
    /// dag.precede(&plan, &act).precede(&plan, &log);
    /// dag.sink_deadline(&act, Duration::from_millis(2)); // `log` has 10 ms
    /// ```
    ///
    /// # Panics
    ///
    /// Also if `sink` is a subtask of another DAG.
    #[track_caller]
    pub fn sink_deadline(&self, sink: &UntypedSubtask, relative_deadline: Duration) -> &Self {
        assert!(
            Rc::ptr_eq(&sink.draft, &self.draft),
            "{sink:?} is a subtask of another DAG; call its own DAG's `sink_deadline`"
        );
        let mut draft = self.open();
        let label = draft.label(sink.subtask);
        draft.set_sink_deadline(relative_deadline, &label);
        drop(draft);
        self
    }
}
