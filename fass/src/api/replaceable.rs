//! Registering a subtask whose function another one replaces after a fault.
//!
//! Where a DAG drops a job at a fault and goes on ([`Dag::survive_faults`]), the function that
//! failed cannot: what it had is given up as it is. So its next jobs are another
//! function's: one *made anew* by the same factory, or one to *fall back* on, which does the
//! work in a simpler way.

use alloc::boxed::Box;
use alloc::vec::Vec;
use core::fmt;
use core::time::Duration;

use sched_dag::{Activation, FaultLimit, OnFault};

use super::dag::Dag;
use super::signal::Signal;
use super::uses::{ResettableUses, Uses};
use super::using::Using;
use crate::draft::attributes::SubtaskAttributes;
use crate::run::replaceable::{Anew, Functions, Two};
use crate::run::tuple::{VecToPubs, VecToSubs};

/// A DAG whose next subtask has a function that can be replaced after a fault. Made by
/// [`Dag::restarting`] and [`Dag::falling_back`], or, of a subtask that uses states, by
/// [`Using::restarting`] and [`Using::falling_back`].
///
/// Its methods are those of [`Dag`], without the function. A source's function takes `()`.
///
/// # Examples
///
/// ```
/// use core::time::Duration;
/// use fass::{SubtaskAttributes, FaultLimit, create_dag, finish_create_dags};
/// use virtual_time::VirtualTime;
///
/// let machine = VirtualTime::new().contain_panics();
/// let dag = create_dag();
/// dag.name("odometry").jobs(6);
/// // At most 1 fault within 3 jobs, and 8 in all.
/// let limit = FaultLimit { faults: 1, window: 3, in_all: 8 };
/// dag.survive_faults(limit);
/// let period = Duration::from_millis(10);
/// let distance = dag.state("distance", 0_u32);
/// distance.reset_to(|| 0);
///
/// let mut steps = 0_u32..;
/// let wheel = SubtaskAttributes::named("wheel");
/// dag.register_periodic_subtask(move || (steps.next().unwrap(),), vec!["step"], period, wheel);
/// dag.using(distance.update())
///     .restarting(|| {
///         |distance: &mut u32, (step,): (u32,)| {
///             *distance += step;
///             assert!(step != 3, "the wheel slips");
///             (*distance,)
///         }
///     })
///     .register_subtask(vec!["step"], vec!["sum"], SubtaskAttributes::named("add"));
/// let sums = std::sync::Arc::new(std::sync::Mutex::new(Vec::new()));
/// let log = sums.clone();
/// let show = move |(sum,): (u32,)| log.lock().unwrap().push(sum);
/// dag.register_sink_subtask(show, vec!["sum"], period, SubtaskAttributes::named("show"));
/// finish_create_dags(&[dag]).unwrap();
///
/// let report = machine.run();
/// // Job 3 is lost, and what came before it is forgotten.
/// assert_eq!(*sums.lock().unwrap(), [0, 1, 3, 4, 9]);
/// assert_eq!((report.dag("odometry").statistics().failed, report.dag("odometry").statistics().completed), (1, 5));
/// ```
#[must_use = "register a subtask with it"]
pub struct Replaceable<'d, Args, Ret> {
    dag: &'d Dag,
    functions: Functions<Args, Ret>,
}

impl Dag {
    /// Lets the DAG go on after faults, within a limit: a fault costs the job only, where
    /// the subtask has another function. Without it a fault ends the DAG.
    ///
    /// See [`Replaceable`], and [`FaultLimit`] for the memory that it takes.
    #[track_caller]
    pub fn survive_faults(&self, limit: FaultLimit) -> &Self {
        self.open().spec.on_fault = OnFault::DropJob(limit);
        self
    }

    /// Begins the registration of a subtask whose function is made anew after a fault.
    ///
    /// The commit calls `make` for the function. The first instance after a fault calls it again,
    /// in its own time; a fault of `make` then ends the DAG.
    ///
    /// See [`Replaceable`].
    pub fn restarting<M, F, Args, Ret>(&self, make: M) -> Replaceable<'_, Args, Ret>
    where
        M: FnMut() -> F + Send + 'static,
        F: FnMut(Args) -> Ret + Send + 'static,
        Args: VecToSubs,
        Ret: VecToPubs,
    {
        Replaceable {
            dag: self,
            functions: Functions {
                alternatives: Box::new(Anew {
                    make,
                    present: None,
                    call: |f: &mut F, args| f(args),
                }),
                states: Vec::new(),
            },
        }
    }

    /// Begins the registration of a subtask that falls back on a second function after a
    /// fault of the first one. A fault of the second one ends the DAG.
    ///
    /// ```
    /// use fass::{SubtaskAttributes, create_dag};
    ///
    /// fn precise((points,): (u32,)) -> (u32,) { (points * points,) }
    /// fn rough((points,): (u32,)) -> (u32,) { (points,) }
    ///
    /// let dag = create_dag();
    /// let cluster = SubtaskAttributes::named("cluster");
    /// dag.falling_back(precise, rough).register_subtask(vec!["points"], vec!["objects"], cluster);
    /// ```
    pub fn falling_back<F, G, Args, Ret>(&self, first: F, second: G) -> Replaceable<'_, Args, Ret>
    where
        F: FnMut(Args) -> Ret + Send + 'static,
        G: FnMut(Args) -> Ret + Send + 'static,
        Args: VecToSubs,
        Ret: VecToPubs,
    {
        Replaceable {
            dag: self,
            functions: Functions {
                alternatives: Box::new(Two {
                    first: Some(first),
                    second,
                }),
                states: Vec::new(),
            },
        }
    }
}

// The bound is each method's own, so that the compiler says our sentence where it is not met.
impl<'d, U: Uses + 'static> Using<'d, U> {
    /// Works like [`Dag::restarting`]. The states that the subtask uses are reset, too, to
    /// what is given by [`State::reset_to`](crate::State::reset_to).
    ///
    /// See [`Replaceable`].
    #[track_caller]
    pub fn restarting<M, F, Args, Ret>(self, make: M) -> Replaceable<'d, Args, Ret>
    where
        U: ResettableUses,
        M: FnMut() -> F + Send + 'static,
        F: for<'a> FnMut(U::Borrowed<'a>, Args) -> Ret + Send + 'static,
        Args: VecToSubs,
        Ret: VecToPubs,
    {
        let (dag, mut held) = self.hold();
        let states = U::states(&held);
        let call = move |f: &mut F, args| f(U::borrow(&mut U::enter(&mut held)), args);
        Replaceable {
            dag,
            functions: Functions {
                alternatives: Box::new(Anew {
                    make,
                    present: None,
                    call,
                }),
                states,
            },
        }
    }

    /// Works like [`Dag::falling_back`]; states are reset as by
    /// [`restarting`](Self::restarting).
    ///
    /// ```
    /// use fass::{SubtaskAttributes, create_dag};
    ///
    /// let dag = create_dag();
    /// let map = dag.state("map", vec![0_u32; 64]);
    /// map.reset_to(|| vec![0; 64]);
    /// let refine = |map: &mut Vec<u32>, (point,): (u32,)| (map[point as usize],);
    /// let guess = |_: &mut Vec<u32>, (point,): (u32,)| (point,);
    /// let fill = SubtaskAttributes::named("fill");
    /// dag.using(map.update())
    ///     .falling_back(refine, guess)
    ///     .register_subtask(vec!["point"], vec!["height"], fill);
    /// ```
    #[track_caller]
    pub fn falling_back<F, G, Args, Ret>(self, first: F, second: G) -> Replaceable<'d, Args, Ret>
    where
        U: ResettableUses,
        F: for<'a> FnMut(U::Borrowed<'a>, Args) -> Ret + Send + 'static,
        G: for<'a> FnMut(U::Borrowed<'a>, Args) -> Ret + Send + 'static,
        Args: VecToSubs,
        Ret: VecToPubs,
    {
        let (dag, held) = self.hold();
        let states = U::states(&held);
        let second = wrap::<U, _, _, _>(U::another(&held), second);
        let first = Some(wrap::<U, _, _, _>(held, first));
        Replaceable {
            dag,
            functions: Functions {
                alternatives: Box::new(Two { first, second }),
                states,
            },
        }
    }
}

/// Makes a function that begins the uses, lends them for one call, and ends them.
fn wrap<U: ResettableUses + 'static, F, Args, Ret>(
    mut held: U::Held,
    mut f: F,
) -> impl FnMut(Args) -> Ret + Send
where
    F: for<'a> FnMut(U::Borrowed<'a>, Args) -> Ret + Send + 'static,
    Args: VecToSubs,
    Ret: VecToPubs,
{
    move |args: Args| f(U::borrow(&mut U::enter(&mut held)), args)
}

impl<Args: VecToSubs, Ret: VecToPubs> Replaceable<'_, Args, Ret> {
    /// Works like [`Dag::register_subtask`].
    ///
    /// See [`Replaceable`].
    #[track_caller]
    pub fn register_subtask(
        self,
        input_topics: Vec<&str>,
        output_topics: Vec<&str>,
        attributes: SubtaskAttributes,
    ) {
        let mut draft = self.dag.open();
        draft.register_replaceable(self.functions, &input_topics, &output_topics, attributes);
    }
}

impl<Ret: VecToPubs> Replaceable<'_, (), Ret> {
    /// Works like [`Dag::register_periodic_subtask`].
    ///
    /// ```
    /// # use core::time::Duration;
    /// # use fass::{SubtaskAttributes, create_dag};
    /// let dag = create_dag();
    /// let make = || {
    ///     let mut count = 0;
    ///     move |()| {
    ///         count += 1;
    ///         (count,)
    ///     }
    /// };
    /// let counter = SubtaskAttributes::named("counter");
    /// let period = Duration::from_millis(10);
    /// dag.restarting(make).register_periodic_subtask(vec!["count"], period, counter);
    /// ```
    #[track_caller]
    pub fn register_periodic_subtask(
        self,
        output_topics: Vec<&str>,
        period: Duration,
        attributes: SubtaskAttributes,
    ) {
        let mut draft = self.dag.open();
        let subtask = draft.register_replaceable(self.functions, &[], &output_topics, attributes);
        draft.set_period(Activation::Periodic, period, subtask);
    }

    /// Works like [`Dag::register_sporadic_subtask`].
    ///
    /// ```
    /// # use core::time::Duration;
    /// # use fass::{SubtaskAttributes, create_dag};
    /// let dag = create_dag();
    /// let answer = SubtaskAttributes::named("answer");
    /// let distance = Duration::from_millis(50);
    /// let button = dag.restarting(|| |()| (1,)).register_sporadic_subtask(vec!["press"], distance, answer);
    /// ```
    #[track_caller]
    #[must_use = "without its signal the DAG is never released"]
    pub fn register_sporadic_subtask(
        self,
        output_topics: Vec<&str>,
        min_inter_arrival: Duration,
        attributes: SubtaskAttributes,
    ) -> Signal {
        let mut draft = self.dag.open();
        let subtask = draft.register_replaceable(self.functions, &[], &output_topics, attributes);
        draft.set_period(Activation::Sporadic, min_inter_arrival, subtask);
        drop(draft);
        self.dag.signal()
    }
}

impl<Args: VecToSubs> Replaceable<'_, Args, ()> {
    /// Works like [`Dag::register_sink_subtask`].
    ///
    /// ```
    /// # use core::time::Duration;
    /// # use fass::{SubtaskAttributes, create_dag};
    /// let dag = create_dag();
    /// let print = SubtaskAttributes::named("print");
    /// let deadline = Duration::from_millis(10);
    /// dag.restarting(|| |(sum,): (i32,)| println!("{sum}"))
    ///     .register_sink_subtask(vec!["sum"], deadline, print);
    /// ```
    #[track_caller]
    pub fn register_sink_subtask(
        self,
        input_topics: Vec<&str>,
        relative_deadline: Duration,
        attributes: SubtaskAttributes,
    ) {
        let mut draft = self.dag.open();
        let subtask = draft.register_replaceable(self.functions, &input_topics, &[], attributes);
        draft.set_sink_deadline(relative_deadline, &subtask);
    }
}

impl<Args, Ret> fmt::Debug for Replaceable<'_, Args, Ret> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Replaceable").finish_non_exhaustive()
    }
}
