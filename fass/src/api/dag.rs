//! Building a DAG: the registering half of the paper's API.
//!
//! A [`Dag`] is a handle of a DAG under construction. Registering a subtask takes a function, the
//! names of the input and output topics, attributes, and the [uses](Dag::using) of shared objects.
//! A subtask has no other properties, and registration runs nothing. Registration does not report
//! faults of the DAG either: the commit reports all of them at once
//! ([`finish_create_dags`](crate::finish_create_dags)). A successful commit uses up the handle.
//!
//! Construction happens on one thread; a `Dag` cannot leave the thread.

use alloc::rc::Rc;
use core::cell::{RefCell, RefMut};
use core::time::Duration;

use sched_dag::{ClusterId, DagId, DagKey, OverrunPolicy, TaskSet};

use super::topics::{self, Topics};
use crate::draft::DagDraft;
use crate::draft::SubtaskAttributes;
use crate::run::tuple::{VecToPubs, VecToSubs};

/// Creates an empty DAG.
///
/// # Examples
///
/// See the [crate's first example](crate#a-first-dag).
///
/// ```
/// let dag = fass::create_dag();
/// dag.name("perception");
/// ```
#[must_use = "a DAG does nothing until it is committed with `finish_create_dags`"]
pub fn create_dag() -> Dag {
    Dag {
        draft: Rc::default(),
    }
}

/// A DAG under construction. Clones are handles of the same DAG.
///
/// ```
/// use fass::{Dag, create_dag};
///
/// fn one_shot(name: &str) -> Dag {
///     let dag = create_dag();
///     dag.name(name).jobs(1).in_flight(1);
///     dag
/// }
/// ```
///
/// # Panics
///
/// Every method that changes the DAG panics, at its caller's line, after the DAG's commit; the
/// methods that begin the registration of a subtask panic when it is registered. The verified graph
/// is the graph that runs, so a later addition would silently not run: a mistake in the program.
#[derive(Clone)]
pub struct Dag {
    pub(crate) draft: Rc<RefCell<DagDraft>>,
}

impl Dag {
    /// Names the DAG, for reports and error messages.
    #[track_caller]
    pub fn name(&self, name: &str) -> &Self {
        self.open().spec.name = name.into();
        self
    }

    /// Sets the time from the start of scheduling to the first release, of a sporadic DAG to its
    /// earliest first release; by default 0.
    #[track_caller]
    pub fn offset(&self, offset: Duration) -> &Self {
        self.open().set_offset(offset);
        self
    }

    /// Sets the greatest number of jobs in flight at once, at least 1.
    ///
    /// The number is also the number of slots of every edge. By default the commit chooses enough
    /// for the relative deadline, and 1 for a DAG whose subtasks share a state.
    #[track_caller]
    pub fn in_flight(&self, jobs: u32) -> &Self {
        self.open().spec.in_flight = Some(jobs);
        self
    }

    /// Sets the reaction to a release while the greatest number of jobs is in flight; by default
    /// the release queues.
    #[track_caller]
    pub fn overrun(&self, policy: OverrunPolicy) -> &Self {
        self.open().spec.overrun = policy;
        self
    }

    /// Puts the DAG into a cluster, counted from 0: the DAG runs only on the cores of that cluster.
    /// Where the platform states how its cores are divided, each DAG has to be in a cluster.
    ///
    /// Latest values and signals, shared between DAGs, may cross clusters.
    ///
    /// ```
    /// use core::time::Duration;
    /// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
    ///
    /// let machine = virtual_time::VirtualTime::new().cores(3).clusters(&[1, 2]);
    /// let period = Duration::from_millis(10);
    /// let dags = [("brakes", 0), ("vision", 1)].map(|(name, cluster)| {
    ///     let dag = create_dag();
    ///     dag.name(name).cluster(cluster).jobs(1).period(period).relative_deadline(period);
    ///     dag.register_untyped_subtask(|_job| (), SubtaskAttributes::named("tick"));
    ///     dag
    /// });
    /// finish_create_dags(&dags).unwrap();
    /// assert_eq!(machine.run().violations(), []);
    /// ```
    #[track_caller]
    pub fn cluster(&self, cluster: u32) -> &Self {
        self.open().spec.cluster = Some(ClusterId(cluster));
        self
    }

    /// Restricts the DAG to the given cores of its cluster, counted from 0, in any order. An empty
    /// list means all cores.
    ///
    /// Any two DAGs of a cluster have the same affinity or no core in common; otherwise the commit
    /// reports a fault, as for a core that does not exist. Cores left idle by DAGs with an affinity
    /// execute no other DAGs.
    ///
    /// ```
    /// use core::time::Duration;
    /// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
    ///
    /// let machine = virtual_time::VirtualTime::new().cores(3);
    /// let period = Duration::from_millis(10);
    /// let dags = [("brakes", &[0][..]), ("vision", &[1, 2])].map(|(name, cores)| {
    ///     let dag = create_dag();
    ///     dag.name(name).affinity(cores).jobs(1).period(period).relative_deadline(period);
    ///     dag.register_untyped_subtask(|_job| (), SubtaskAttributes::named("tick"));
    ///     dag
    /// });
    /// finish_create_dags(&dags).unwrap();
    /// assert_eq!(machine.run().violations(), []);
    /// ```
    #[track_caller]
    pub fn affinity(&self, cores: &[u32]) -> &Self {
        self.open().spec.affinity = cores.into();
        self
    }

    /// Sets the number of jobs, skipped jobs included; afterwards the DAG is finished. By default
    /// the DAG runs until a fault ends the DAG, or something ends the run.
    #[track_caller]
    pub fn jobs(&self, jobs: u64) -> &Self {
        self.open().spec.jobs = Some(jobs);
        self
    }

    /// Demands a proof: the commit fails unless a test bounds the response time of this DAG by its
    /// relative deadline.
    ///
    /// A proof needs the WCETs of all subtasks of the DAG, and of all DAGs that may delay the DAG,
    /// and the longest sections of the locks used on its cores. Other DAGs of the commit need no
    /// proof of their own. Without the demand the commit only reports the answer; see
    /// [`Commit::answers`](crate::commit::Commit::answers).
    ///
    /// ```
    /// use core::time::Duration;
    /// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
    ///
    /// # let machine = virtual_time::VirtualTime::new();
    /// let dag = create_dag();
    /// dag.name("brakes").demand_proof();
    /// let period = Duration::from_millis(10);
    /// let source = SubtaskAttributes::named("sense").wcet(Duration::from_millis(6));
    /// dag.register_periodic_subtask(|| (1,), ["pedal"], period, source);
    /// let sink = SubtaskAttributes::named("brake").wcet(Duration::from_millis(6));
    /// dag.register_sink_subtask(|(_,): (i32,)| (), ["pedal"], period, sink);
    ///
    /// let error = finish_create_dags(&[dag]).unwrap_err();
    /// assert_eq!(error.faults()[0].code(), "not_proven");
    /// ```
    #[track_caller]
    pub fn demand_proof(&self) -> &Self {
        self.open().demands_proof = true;
        self
    }

    /// Registers a source: a function without arguments, called for every released job. Jobs are
    /// due at multiples of `period` after the offset. The sources of a DAG have one period.
    ///
    /// `output_topics` names one topic for each element of `Ret`.
    ///
    /// ```
    /// use core::time::Duration;
    /// use fass::{SubtaskAttributes, create_dag};
    ///
    /// let dag = create_dag();
    /// let mut count = 0;
    /// dag.register_periodic_subtask(
    ///     move || {
    ///         count += 1; // a closure may keep state from job to job
    ///         (count,)
    ///     },
    ///     ["count"],
    ///     Duration::from_millis(10),
    ///     SubtaskAttributes::named("counter"),
    /// );
    /// ```
    #[track_caller]
    pub fn register_periodic_subtask<F, Ret>(
        &self,
        mut f: F,
        output_topics: impl Topics,
        period: Duration,
        attributes: SubtaskAttributes,
    ) where
        F: FnMut() -> Ret + Send + 'static,
        Ret: VecToPubs,
    {
        let source = self
            .subtask(move |()| f())
            .writes(topics::of_outputs::<Ret, _>(&output_topics));
        let subtask = source.register_labelled(attributes);
        self.open().set_period(period, subtask);
    }

    /// Registers a subtask between a source and a sink: a function from a tuple of inputs to a
    /// tuple of outputs.
    ///
    /// `input_topics` names one topic for each element of `Args`, `output_topics` one for each
    /// element of `Ret`.
    ///
    /// ```
    /// use fass::{SubtaskAttributes, create_dag};
    ///
    /// create_dag().register_subtask(
    ///     |(left, right): (i32, i32)| (left + right, left * right),
    ///     ["left", "right"],
    ///     ["sum", "product"],
    ///     SubtaskAttributes::named("combine"),
    /// );
    /// ```
    ///
    /// The compiler refuses a function taking its inputs as separate arguments:
    ///
    /// ```compile_fail,E0593
    /// # use fass::{SubtaskAttributes, create_dag};
    /// create_dag().register_subtask(
    ///     |left: i32, right: i32| (left + right,), // should be `|(left, right): (i32, i32)|`
    ///     ["left", "right"],
    ///     ["sum"],
    ///     SubtaskAttributes::named("combine"),
    /// );
    /// ```
    #[track_caller]
    pub fn register_subtask<F, Args, Ret>(
        &self,
        f: F,
        input_topics: impl Topics,
        output_topics: impl Topics,
        attributes: SubtaskAttributes,
    ) where
        F: FnMut(Args) -> Ret + Send + 'static,
        Args: VecToSubs,
        Ret: VecToPubs,
    {
        self.subtask(f)
            .reads(topics::of_inputs::<Args, _>(&input_topics))
            .writes(topics::of_outputs::<Ret, _>(&output_topics))
            .register(attributes);
    }

    /// Registers a sink: a function without results, to be finished by `relative_deadline` after
    /// the release. The job is complete with its last sink.
    ///
    /// `input_topics` names one topic for each element of `Args`. In a DAG with several sinks
    /// ([`finish_create_dags_with`](crate::commit::finish_create_dags_with)), each sink has its own
    /// deadline.
    ///
    /// ```
    /// use core::time::Duration;
    /// use fass::{SubtaskAttributes, create_dag};
    ///
    /// create_dag().register_sink_subtask(
    ///     |(sum,): (i32,)| println!("{sum}"),
    ///     ["sum"],
    ///     Duration::from_millis(10),
    ///     SubtaskAttributes::named("print"),
    /// );
    /// ```
    #[track_caller]
    pub fn register_sink_subtask<F, Args>(
        &self,
        f: F,
        input_topics: impl Topics,
        relative_deadline: Duration,
        attributes: SubtaskAttributes,
    ) where
        F: FnMut(Args) + Send + 'static,
        Args: VecToSubs,
    {
        self.subtask(f)
            .reads(topics::of_inputs::<Args, _>(&input_topics))
            .due(relative_deadline)
            .register(attributes);
    }

    /// Sets the time between two nominal releases of a periodic DAG. Needed where no source states
    /// a period: for a DAG of untyped subtasks, or with a [`source`](Self::source).
    #[track_caller]
    pub fn period(&self, period: Duration) -> &Self {
        self.open().replace_period(period);
        self
    }

    /// Sets the time from a nominal release to the deadline of the job, for example for a DAG of
    /// untyped subtasks. The deadline holds for each sink without its own. (A typed sink states its
    /// own deadline, possibly shorter.)
    #[track_caller]
    pub fn relative_deadline(&self, relative_deadline: Duration) -> &Self {
        self.open().set_dag_deadline(relative_deadline);
        self
    }

    /// Borrows the draft for a change.
    #[track_caller]
    pub(crate) fn open(&self) -> RefMut<'_, DagDraft> {
        let draft = self.draft.borrow_mut();
        assert!(
            !draft.is_committed,
            "dag `{}` is committed and cannot be changed; build a new DAG and commit that",
            draft.spec.name
        );
        draft
    }
}

shown_as!(Dag, |of| of.draft.borrow().spec.name);

/// Identifies a committed DAG by its handle, in every call with a DAG as an argument.
///
/// ```
/// use core::time::Duration;
/// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
/// use virtual_time::VirtualTime;
///
/// let machine = VirtualTime::new();
/// let dag = create_dag();
/// dag.jobs(2).relative_deadline(Duration::from_millis(5));
/// let tick = SubtaskAttributes::named("tick");
/// dag.register_periodic_subtask(|| (), [], Duration::from_millis(5), tick);
/// finish_create_dags(&[dag.clone()]).unwrap();
/// assert_eq!(machine.run().dag(&dag).statistics().completed, 2);
/// ```
impl DagKey for Dag {
    #[track_caller]
    fn find_in(&self, task_set: &TaskSet) -> DagId {
        let draft = self.draft.borrow();
        let id = draft.target.get().map(|(_, id)| id);
        let is_it = |id: &DagId| {
            let dag = task_set.dags().get(id.index());
            dag.is_some_and(|dag| dag.name() == draft.spec.name)
        };
        match id.filter(is_it) {
            Some(id) => id,
            None => panic!(
                "dag `{}` is none of this run; ask by a handle that was committed for it",
                draft.spec.name
            ),
        }
    }
}
