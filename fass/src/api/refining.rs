//! Optional work: a subtask that makes its result better while its time lasts.
//!
//! The *mandatory part* of such a subtask computes a result from its inputs. Its *optional part*
//! is *refinements*, one after another, each of which makes a better result of the best one so
//! far. When the optional part has executed for as long as it may, the refinement that runs is
//! *cut*: preempted, and never gone on with. The best result is sent. (Imprecise computation:
//! J. W. S. Liu et al., Algorithms for Scheduling Imprecise Computations, IEEE Computer 24(5),
//! 1991, doi:10.1109/2.76287.)
//!
//! - **O1, order.** In each job the mandatory part runs first, to its end. The first refinement
//!   begins with its result.
//! - **O2, whole results.** Each refinement gets the inputs and the best result. What it returns
//!   is the best result from then on; `None` ends the optional part. Nothing is sent before the
//!   optional part has ended, and then the best result.
//! - **O3, the cut.** The optional part executes for its time at most. Time in which it is
//!   suspended does not count. The refinement that runs then is cut.
//! - **O4, no fault.** A cut ends no job and no DAG, and the subtask's next instance is as any
//!   other. The budget counts the mandatory part alone.
//! - **O5, what is charged.** To the commit the WCET of the subtask is the one stated and the
//!   time of its optional part.
//! - **O6, faults.** A refinement that panics or does what the processor stops is a fault of the
//!   instance, as it would be of the mandatory part.
//! - **O7, platforms.** One that cannot cut refuses the commit.
//!
//! The scheduler knows nothing of all this: to it the instance executes, and finishes.

use alloc::boxed::Box;
use alloc::format;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::fmt;
use core::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use core::time::Duration;

use sched_dag::DagLabel;

use super::dag::Dag;
use crate::draft::Draft;
use crate::draft::attributes::SubtaskAttributes;
use crate::platform::{self, LaunchError};
use crate::run::tuple::{VecToPubs, VecToSubs};

/// A DAG whose next subtask refines its result. Made by [`Dag::refining`].
///
/// See [`Dag::refining`].
#[must_use = "register a subtask with it"]
pub struct Refining<'d, Args, Ret> {
    dag: &'d Dag,
    optional: Duration,
    function: Box<dyn FnMut(Args) -> Ret + Send>,
    refinements: Refinements,
}

/// What has become of the refinements of a subtask so far, in all jobs. Clones are handles of
/// the same.
///
/// See [`Dag::refining`].
#[derive(Clone, Debug, Default)]
pub struct Refinements(Arc<Counts>);

#[derive(Debug, Default)]
struct Counts {
    complete: AtomicU64,
    cut: AtomicU64,
}

impl Refinements {
    /// Returns how many refinements have given a better result.
    ///
    /// See [`Dag::refining`].
    #[must_use]
    pub fn complete(&self) -> u64 {
        self.0.complete.load(Ordering::Relaxed)
    }

    /// Returns how many refinements have been cut: at most one for each job.
    ///
    /// See [`Dag::refining`].
    #[must_use]
    pub fn cut(&self) -> u64 {
        self.0.cut.load(Ordering::Relaxed)
    }
}

impl Dag {
    /// Begins the registration of a subtask that refines its result for `optional` of execution
    /// time in each job.
    ///
    /// `mandatory` makes a result of the inputs. `refine` makes a better one of the inputs and the
    /// best result so far, and is called again and again, until it returns `None` or its time
    /// is over; then the best result is sent. What is not complete by then is lost, and nothing
    /// else. A result is [`Copy`], so that nothing that is cut owns it.
    ///
    /// The [WCET](SubtaskAttributes::wcet) and the [budget](SubtaskAttributes::budget) are stated
    /// of the mandatory part alone; the commit adds `optional` to the WCET.
    ///
    /// # Safety
    ///
    /// A refinement is cut at any instruction. Its frames on the stack are overwritten then, and
    /// nothing in them is dropped. So `refine`, and all that it calls:
    ///
    /// 1. has nothing on the stack that others look at later, such as a pinned value that is
    ///    in somebody's list;
    /// 2. leaves what outlives it valid at each instruction: it changes statics, and what the
    ///    inputs share, by atomics, or within a `kernel::Lock` (a cut waits until that is left).
    ///
    /// Functions that compute with values of their own fulfil both. Besides, what a refinement
    /// has allocated when it is cut stays allocated, and so does a lock of its own making; that is no
    /// danger to memory, but does not end well in a DAG that runs for days. So it had better
    /// allocate nothing.
    ///
    /// ```
    /// use core::time::Duration;
    /// use fass::{Occupation, SubtaskAttributes, create_dag, execute_for, finish_create_dags};
    /// use virtual_time::VirtualTime;
    ///
    /// const fn ms(ms: u64) -> Duration {
    ///     Duration::from_millis(ms)
    /// }
    ///
    /// let machine = VirtualTime::new();
    /// let dag = create_dag();
    /// dag.jobs(3);
    /// let read = SubtaskAttributes::named("read");
    /// dag.register_periodic_subtask(|| (2.0,), vec!["square"], ms(20), read);
    ///
    /// // Newton's method: a rough root, and one step that makes it better.
    /// let rough = |&(square,): &(f64,)| (square,);
    /// let step = |&(square,): &(f64,), &(root,): &(f64,)| {
    ///     execute_for(ms(2), Occupation::Spin);
    ///     Some(((root + square / root) / 2.0,))
    /// };
    /// let root = SubtaskAttributes::named("root").wcet(ms(1));
    /// // SAFETY: it has nothing but numbers.
    /// let refinements = unsafe { dag.refining(ms(9), rough, step) }
    ///     .register_subtask(vec!["square"], vec!["root"], root);
    ///
    /// let near = |(root,): (f64,)| assert!((root - 2.0_f64.sqrt()).abs() < 1e-9);
    /// dag.register_sink_subtask(near, vec!["root"], ms(20), SubtaskAttributes::named("use"));
    /// finish_create_dags(&[dag]).unwrap();
    /// machine.run();
    /// assert_eq!((refinements.complete(), refinements.cut()), (3 * 4, 3));
    /// ```
    pub unsafe fn refining<M, R, Args, Ret>(
        &self,
        optional: Duration,
        mut mandatory: M,
        refine: R,
    ) -> Refining<'_, Args, Ret>
    where
        M: FnMut(&Args) -> Ret + Send + 'static,
        R: Fn(&Args, &Ret) -> Option<Ret> + Send + 'static,
        Args: VecToSubs,
        Ret: VecToPubs + Copy,
    {
        let refinements = Refinements::default();
        let counts = Arc::clone(&refinements.0);
        let most_ns = u64::try_from(optional.as_nanos()).unwrap_or(u64::MAX);
        let function = move |args: Args| {
            // The best result is in one place, and the next one comes into the other.
            let mut results = [mandatory(&args); 2];
            let complete = AtomicUsize::new(0);
            let mut refine_all = || {
                loop {
                    let done = complete.load(Ordering::Relaxed);
                    let [even, odd] = &mut results;
                    let (best, next) = if done.is_multiple_of(2) {
                        (even, odd)
                    } else {
                        (odd, even)
                    };
                    let Some(better) = refine(&args, best) else {
                        return;
                    };
                    *next = better;
                    // With this store it is whole; a cut comes before or after it.
                    complete.store(done + 1, Ordering::Release);
                }
            };
            // SAFETY: `refine` may be given up (the conditions of `refining`), and what is
            // around it here owns nothing: results are `Copy`, and the one that is half written
            // is not looked at again.
            let was_cut = platform::expect_installed()
                .cutter()
                .is_some_and(|cut| unsafe { cut(most_ns, &mut refine_all) });
            let done = complete.load(Ordering::Acquire);
            (counts.complete).fetch_add(done as u64, Ordering::Relaxed);
            (counts.cut).fetch_add(u64::from(was_cut), Ordering::Relaxed);
            results[done % 2]
        };
        Refining {
            dag: self,
            optional,
            function: Box::new(function),
            refinements,
        }
    }
}

impl<Args: VecToSubs, Ret: VecToPubs> Refining<'_, Args, Ret> {
    /// Works like [`Dag::register_subtask`], and returns what counts the refinements.
    ///
    /// See [`Dag::refining`].
    #[track_caller]
    pub fn register_subtask(
        self,
        input_topics: Vec<&str>,
        output_topics: Vec<&str>,
        mut attributes: SubtaskAttributes,
    ) -> Refinements {
        // What the commit is to know of it is here, and nowhere below.
        attributes.wcet = (attributes.wcet).map(|wcet| wcet.saturating_add(self.optional));
        let mut draft = self.dag.open();
        let label = draft.register(self.function, &input_topics, &output_topics, attributes);
        draft.refines.get_or_insert((label.id.index(), check));
        self.refinements
    }
}

/// Refuses a subtask that refines where the platform cannot cut.
fn check(draft: &Draft, subtask: usize, dag: &DagLabel) -> Result<(), LaunchError> {
    // That there is none at all is a fault of its own.
    if platform::installed().is_none_or(|platform| platform.cutter().is_some()) {
        return Ok(());
    }
    let subtask = draft.label(subtask);
    Err(LaunchError::new(format!(
        "{subtask} of {dag} refines its result, and this platform cuts no refinement; on the \
         machine turn the kernel's feature `refining` on, or register the mandatory function alone"
    )))
}

impl<Args, Ret> fmt::Debug for Refining<'_, Args, Ret> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Refining")
            .field("optional", &self.optional)
            .finish_non_exhaustive()
    }
}
