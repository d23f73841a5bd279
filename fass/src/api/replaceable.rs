//! Registering a subtask whose function is replaced by another function after a fault.
//!
//! A DAG can drop a job at a fault and go on ([`Dag::survive_faults`]), but the failed function
//! cannot go on: its data is abandoned in an unknown state. So another function does the next jobs:
//! either a function *made anew* by the same factory, or a function to *fall back* on, doing the
//! work in a simpler way.

use alloc::boxed::Box;
use alloc::format;
use alloc::sync::Arc;
use alloc::vec::Vec;

use sched_dag::{FaultLimit, OnFault};

use super::dag::Dag;
use super::subtask::Subtask;
use super::uses::{ResettableUses, SubtaskBuilder, Uses};
use crate::draft::DagDraft;
use crate::draft::fault::Fault;
use crate::draft::part::{CheckedDag, DraftPart, PartKind};
use crate::run::replaceable::Reset;
use crate::run::replaceable::{Alternatives, FallbackPair, RemadeFunction, defer};
use crate::run::tuple::{VecToPubs, VecToSubs};

impl Dag {
    /// Lets the DAG go on after faults, within a limit: a fault costs only its job, where the
    /// subtask has another function. Without this call, beyond the limit, or in any other subtask,
    /// a fault ends the DAG.
    ///
    /// See [`restarting`](Self::restarting), and [`FaultLimit`] for the memory needed.
    #[track_caller]
    pub fn survive_faults(&self, limit: FaultLimit) -> &Self {
        let mut draft = self.open();
        // Checked once, however often the app calls the method.
        if draft.spec.on_fault == OnFault::EndDag {
            draft.add(PartKind::Replacement, |of: &CheckedDag<'_>| {
                let says = "drops a job at a fault and goes on, and no subtask of it has another \
                            function for that; register one by `restarting` or `falling_back`";
                let fault = Fault::Worded {
                    code: "nothing_replaceable",
                    text: format!("{} {says}", of.label),
                };
                (!of.draft.has::<Replaceable>()).then_some(fault)
            });
        }
        draft.spec.on_fault = OnFault::DropJob(limit);
        drop(draft);
        self
    }

    /// Begins the registration of a subtask whose function is made anew after a fault.
    ///
    /// The commit calls `make` to get the function. The first instance after a fault calls `make`
    /// again, as a part of its own execution time; a fault of `make` in that call ends the DAG.
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
    /// dag.register_periodic_subtask(move || (steps.next().unwrap(),), ["step"], period, wheel);
    /// dag.using(distance.update())
    ///     .restarting(|| {
    ///         |distance: &mut u32, (step,): (u32,)| {
    ///             *distance += step;
    ///             assert!(step != 3, "the wheel slips");
    ///             (*distance,)
    ///         }
    ///     })
    ///     .reads(&["step"])
    ///     .writes(&["sum"])
    ///     .register(SubtaskAttributes::named("add"));
    /// let sums = std::sync::Arc::new(std::sync::Mutex::new(Vec::new()));
    /// let log = sums.clone();
    /// let show = move |(sum,): (u32,)| log.lock().unwrap().push(sum);
    /// dag.register_sink_subtask(show, ["sum"], period, SubtaskAttributes::named("show"));
    /// finish_create_dags(&[dag]).unwrap();
    ///
    /// let report = machine.run();
    /// // Job 3 is lost, and what came before it is forgotten.
    /// assert_eq!(*sums.lock().unwrap(), [0, 1, 3, 4, 9]);
    /// assert_eq!((report.dag("odometry").statistics().failed, report.dag("odometry").statistics().completed), (1, 5));
    /// ```
    pub fn restarting<M, F, Args, Ret>(&self, make: M) -> Subtask<'_>
    where
        M: FnMut() -> F + Send + 'static,
        F: FnMut(Args) -> Ret + Send + 'static,
        Args: VecToSubs,
        Ret: VecToPubs,
    {
        Subtask::with_replacement(self, |_, _| {
            let call = |f: &mut F, args| f(args);
            let present = None;
            (
                Box::new(RemadeFunction {
                    make,
                    present,
                    call,
                }),
                Vec::new(),
            )
        })
    }

    /// Begins the registration of a subtask falling back on a second function after a fault of the
    /// first. A fault of the second ends the DAG.
    ///
    /// ```
    /// use fass::{SubtaskAttributes, create_dag};
    ///
    /// fn precise((points,): (u32,)) -> (u32,) { (points * points,) }
    /// fn rough((points,): (u32,)) -> (u32,) { (points,) }
    ///
    /// let dag = create_dag();
    /// let cluster = SubtaskAttributes::named("cluster");
    /// dag.falling_back(precise, rough)
    ///     .reads(&["points"])
    ///     .writes(&["objects"])
    ///     .register(cluster);
    /// ```
    pub fn falling_back<F, G, Args, Ret>(&self, first: F, second: G) -> Subtask<'_>
    where
        F: FnMut(Args) -> Ret + Send + 'static,
        G: FnMut(Args) -> Ret + Send + 'static,
        Args: VecToSubs,
        Ret: VecToPubs,
    {
        let first = Some(first);
        Subtask::with_replacement(self, |_, _| {
            (Box::new(FallbackPair { first, second }), Vec::new())
        })
    }
}

// The bound is on each method, so that the compiler shows our own message where the bound is not
// met.
impl<'d, U: Uses + 'static> SubtaskBuilder<'d, U> {
    /// Works like [`Dag::restarting`]. The states used by the subtask are reset, too, to the value
    /// provided by [`State::reset_to`](crate::shared::State::reset_to).
    ///
    /// See [`Dag::restarting`].
    #[track_caller]
    pub fn restarting<M, F, Args, Ret>(self, make: M) -> Subtask<'d>
    where
        U: ResettableUses,
        M: FnMut() -> F + Send + 'static,
        F: for<'a> FnMut(U::Borrowed<'a>, Args) -> Ret + Send + 'static,
        Args: VecToSubs,
        Ret: VecToPubs,
    {
        Subtask::with_replacement(self.dag, |dag, subtask| {
            let mut held = self.uses.hold(dag, subtask);
            let (states, present) = (U::states(&held), None);
            let call = move |f: &mut F, args| f(U::borrow(&mut U::enter(&mut held)), args);
            (
                Box::new(RemadeFunction {
                    make,
                    present,
                    call,
                }),
                states,
            )
        })
    }

    /// Works like [`Dag::falling_back`]; states are reset as by [`restarting`](Self::restarting).
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
    ///     .reads(&["point"])
    ///     .writes(&["height"])
    ///     .register(fill);
    /// ```
    #[track_caller]
    pub fn falling_back<F, G, Args, Ret>(self, first: F, second: G) -> Subtask<'d>
    where
        U: ResettableUses,
        F: for<'a> FnMut(U::Borrowed<'a>, Args) -> Ret + Send + 'static,
        G: for<'a> FnMut(U::Borrowed<'a>, Args) -> Ret + Send + 'static,
        Args: VecToSubs,
        Ret: VecToPubs,
    {
        Subtask::with_replacement(self.dag, |dag, subtask| {
            let held = self.uses.hold(dag, subtask);
            let states = U::states(&held);
            let second = wrap::<U, _, _, _>(U::another(&held), second);
            let first = Some(wrap::<U, _, _, _>(held, first));
            (Box::new(FallbackPair { first, second }), states)
        })
    }
}

/// Wraps a function to begin the uses, lend them for one call, and end them.
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

/// The functions of a subtask, and the states reset together with them.
type Replacement<Args, Ret> = (Box<dyn Alternatives<Args, Ret>>, Vec<Arc<dyn Reset>>);

/// The number of a subtask whose function is replaced after a fault.
pub(super) struct Replaceable(pub(super) usize);

impl DraftPart for Replaceable {}

/// Records a subtask with a replaceable function.
fn note_replaceable(draft: &mut DagDraft, subtask: usize) {
    // The first such subtask stands for all in the check.
    if !draft.has::<Replaceable>() {
        draft.add(PartKind::Replacement, move |of: &CheckedDag<'_>| {
            let says = "has another function for after a fault, and a fault ends the dag; let the dag \
                        survive faults by `survive_faults`, or register one function";
            // A fault ends the DAG, so the function would never be replaced.
            let is_in_vain = of.draft.spec.on_fault == OnFault::EndDag;
            is_in_vain.then(|| of.fault("replaced_in_vain", subtask, says))
        });
    }
    draft.add(PartKind::Replacement, Replaceable(subtask));
    let says = "states waits, and has another function for after a fault, which could not have the \
                place of a future that the fault has ended; register an async one alone, or state no \
                waits";
    draft.refuse_waits("replaceable_waits", subtask, says);
}

impl<'d> Subtask<'d> {
    /// Begins the registration of a subtask with functions of which one replaces the other.
    fn with_replacement<Args: VecToSubs, Ret: VecToPubs>(
        dag: &'d Dag,
        begin: impl FnOnce(&Dag, usize) -> Replacement<Args, Ret> + 'd,
    ) -> Self {
        let begin = move |dag: &Dag, subtask| {
            let (alternatives, states) = begin(dag, subtask);
            defer(alternatives, states)
        };
        Self::new::<Args, Ret>(dag, begin).noted_by(note_replaceable)
    }
}
