//! Locks: data changed by instances in sections of their functions, one instance at a time.
//!
//! A DAG needs no lock: its values move along its edges, and its subtasks share data in a
//! [`State`](crate::shared::State). A lock protects data outside the DAGs, such as a driver's
//! registers changed by subtasks of several DAGs.
//!
//! Here a *section* is one call of [`Lock::with`]. Sections of one lock exclude each other, on all
//! cores. In the kernel waiting cores take turns. An instance in a section keeps its core there, up
//! to [`LONGEST_SECTION`], since otherwise it would block every core waiting for the lock; on Linux
//! it may lose its core. In the kernel a section thus delays all other work of its core. Hence a
//! lock declares its [longest section](Lock::longest), and a subtask the number of sections it
//! [enters](Lock::entering); the analysis charges for both.
//!
//! # Guarantees
//!
//! - An instance fails before entering a section if its subtask does not declare the lock, or if
//!   the instance has used up the declared sections.
//! - While a lock has no longest section, no DAG on the cores of its users has a bound.
//! - The [log](mod@crate::log) reports a section longer than declared and than any reported before:
//!   the bounds do not hold then. A section longer than [`LONGEST_SECTION`] may be preempted.
//!
//! # Limits
//!
//! - A fault in a section makes the lock unusable: the data may be half changed, and later sections
//!   fail.
//! - Sections do not nest, not even sections of different locks.

use alloc::sync::Arc;
use alloc::vec::Vec;
use core::mem::ManuallyDrop;
use core::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering::Relaxed};
use core::time::Duration;

use sched_dag::Instance;

use super::dag::Dag;
use super::uses::{ResettableUses, Uses, sealed};
use crate::platform::{expect_installed, installed};
use crate::run::cell::{ExclusiveCell, SetOnce};
use crate::run::lock_words::LockWords;
use crate::run::replaceable::Reset;

/// The longest time for which a section may delay the preemption of its core: 1 ms. (On Linux a
/// section delays no preemption.)
pub const LONGEST_SECTION: Duration = Duration::from_millis(1);

/// Data for use by one instance at a time.
///
/// ```
/// use core::time::Duration;
/// use fass::shared::Lock;
/// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
///
/// static SEEN: Lock<u64> = Lock::new("seen", 0).longest(Duration::from_micros(2));
///
/// let machine = virtual_time::VirtualTime::new();
/// let (dag, period) = (create_dag(), Duration::from_millis(10));
/// dag.jobs(3).period(period).relative_deadline(period);
/// dag.using(SEEN.entering(1))
///     .source(|()| SEEN.with(|seen| *seen += 1))
///     .register(SubtaskAttributes::named("look"));
/// finish_create_dags(&[dag]).unwrap();
/// machine.run();
/// assert_eq!(SEEN.with(|seen| *seen), 3);
/// ```
pub struct Lock<T> {
    name: &'static str,
    longest_ns: Option<u64>,
    /// The longest section already reported as too long.
    said_ns: AtomicU64,
    first_user: SetOnce<Arc<LockUser>>,
    words: LockWords,
    data: ExclusiveCell<T>,
}

/// A subtask entering sections, in the list of its lock.
struct LockUser {
    is_taken: AtomicBool,
    /// The latest instance: its plan, its DAG and subtask, and its job. After a fault the user,
    /// with these numbers, may outlive the plan's run.
    plan: AtomicU64,
    ids: AtomicU64,
    job: AtomicU64,
    /// The number of sections that the instance may still enter.
    left: AtomicU32,
    next: SetOnce<Arc<Self>>,
}

/// A subtask's declaration that its instances enter sections of a lock. Made by [`Lock::entering`].
/// See [`Lock`].
#[must_use = "a use has no effect until a subtask is registered with it"]
pub struct LockUse {
    name: &'static str,
    longest_ns: Option<u64>,
    permit: Arc<Permit>,
}

/// The permission of a subtask to enter sections. See [`Lock`].
pub struct Permit {
    user: Arc<LockUser>,
    sections: u32,
}

impl<T> Lock<T> {
    /// Makes a free lock. The analysis treats locks with the same name as one lock.
    pub const fn new(name: &'static str, data: T) -> Self {
        Self {
            name,
            longest_ns: None,
            said_ns: AtomicU64::new(0),
            first_user: SetOnce::new(),
            words: LockWords {
                state: AtomicU32::new(0),
                waiting: [const { AtomicU64::new(0) }; 4],
            },
            data: ExclusiveCell::new(data),
        }
    }

    /// Declares the longest duration of a section, interrupts during the section included.
    ///
    /// # Panics
    ///
    /// If the duration is longer than [`LONGEST_SECTION`].
    #[must_use]
    pub const fn longest(mut self, section: Duration) -> Self {
        assert!(
            section.as_nanos() <= LONGEST_SECTION.as_nanos(),
            "a section of more than 1 ms is preempted, and no bound holds; make it shorter"
        );
        self.longest_ns = Some(section.as_secs() * 1_000_000_000 + section.subsec_nanos() as u64);
        self
    }

    /// Declares that each instance of a subtask enters at most `sections` sections. Several
    /// declarations of one subtask add up.
    pub fn entering(&self, sections: u32) -> LockUse {
        let mut place = &self.first_user;
        let user = loop {
            place.set(Arc::default());
            // Nothing yet: another thread is setting the same place just now.
            let Some(user) = place.get() else { continue };
            // A dropped permit frees its user for the next one, so the list stays short.
            if !user.is_taken.swap(true, Relaxed) {
                break Arc::clone(user);
            }
            place = &user.next;
        };
        LockUse {
            name: self.name,
            longest_ns: self.longest_ns,
            permit: Arc::new(Permit { user, sections }),
        }
    }

    /// Waits until nobody uses the data and lends the data to `section`.
    ///
    /// The app's main function needs no declaration, since no run goes on then.
    ///
    /// # Panics
    ///
    /// If the caller's subtask does not declare the lock, or the calling instance has entered all
    /// declared sections; if the caller is no instance while a run goes on; if it is in a section
    /// already; or if a fault has ended a section of this lock.
    #[track_caller]
    pub fn with<R>(&self, section: impl FnOnce(&mut T) -> R) -> R {
        let (platform, name) = (expect_installed(), self.name);
        match platform.running() {
            Some(running) => self.admit(running),
            None => assert!(
                !platform.is_in_run(),
                "lock `{name}`: a thread that is no instance enters a section while a run goes on; \
                 enter it in a subtask, or before or after the run"
            ),
        }
        let (mut section, mut result) = (Some(section), None);
        let took_ns = platform.section(&self.words, &mut || {
            // A section ended by a fault never releases its claim of the data, so a later `change`
            // fails.
            if let (Some(section), Some(data)) = (section.take(), self.data.change()) {
                // Where panics unwind, too, the claim has to stay: so it is given back by hand
                // below.
                let mut data = ManuallyDrop::new(data);
                result = Some(section(&mut data));
                drop(ManuallyDrop::into_inner(data));
            }
        });
        let Some(took_ns) = took_ns else {
            panic!("lock `{name}`: the caller is in a section already; end that first")
        };
        let Some(result) = result else {
            panic!("lock `{name}`: a fault has ended a section, and its data may be half changed")
        };
        self.judge(took_ns);
        result
    }

    #[track_caller]
    fn admit(&self, running: (u64, Instance)) {
        let (mut next, mut is_stated) = (self.first_user.get(), false);
        while let Some(user) = next {
            if user.is_of(running) {
                is_stated = true;
                // Not an exchange: the entry belongs to this instance alone (R2). With no section
                // left, the search goes on, as the subtask may state the lock twice.
                let left = user.left.load(Relaxed);
                if left > 0 {
                    user.left.store(left - 1, Relaxed);
                    return;
                }
            }
            next = user.next.get();
        }
        let fault = match is_stated {
            true => "enters more sections than it states; state them all",
            false => "enters a section and has not stated that",
        };
        let name = self.name;
        panic!("lock `{name}`: the subtask {fault}, by `dag.using(lock.entering(N))`")
    }

    fn judge(&self, took_ns: u64) {
        let longest_ns = self.longest_ns.unwrap_or(u64::MAX);
        // Only a new longest section is reported, so repeated overruns do not flood the log.
        if took_ns > longest_ns && self.said_ns.fetch_max(took_ns, Relaxed) < took_ns {
            let text = "a section has taken longer than its lock states, so no bound holds";
            let lock = self.name;
            crate::log!(
                Error,
                text,
                lock = lock,
                took_ns = took_ns,
                longest_ns = longest_ns
            );
        }
    }
}

/// Stands for no instance.
const NOBODY: u64 = u64::MAX;

fn ids(instance: Instance) -> u64 {
    u64::from(instance.dag.0) << 32 | u64::from(instance.subtask.0)
}

impl LockUser {
    fn is_of(&self, (plan, instance): (u64, Instance)) -> bool {
        self.ids.load(Relaxed) == ids(instance)
            && self.job.load(Relaxed) == instance.job
            && self.plan.load(Relaxed) == plan
    }
}

impl Default for LockUser {
    fn default() -> Self {
        Self {
            is_taken: AtomicBool::new(false),
            plan: AtomicU64::new(0),
            ids: AtomicU64::new(NOBODY),
            job: AtomicU64::new(0),
            left: AtomicU32::new(0),
            next: SetOnce::new(),
        }
    }
}

impl Drop for Permit {
    fn drop(&mut self) {
        self.user.ids.store(NOBODY, Relaxed);
        self.user.is_taken.store(false, Relaxed);
    }
}

impl sealed::Sealed for LockUse {}

impl Uses for LockUse {
    type Borrowed<'a> = ();
    type Held = Arc<Permit>;
    type Guard<'a> = ();

    fn hold(self, dag: &Dag, subtask: usize) -> Arc<Permit> {
        dag.draft.borrow_mut().spec.locks.push(sched_dag::LockUse {
            subtask,
            lock: self.name.into(),
            longest_ns: self.longest_ns,
            sections: self.permit.sections,
            is_shared: false,
        });
        self.permit
    }

    fn enter(held: &mut Arc<Permit>) {
        if let Some((plan, instance)) = installed().and_then(|platform| platform.running()) {
            let Permit { user, sections } = &**held;
            user.left.store(*sections, Relaxed);
            user.plan.store(plan, Relaxed);
            user.job.store(instance.job, Relaxed);
            user.ids.store(ids(instance), Relaxed);
        }
    }

    fn borrow((): &mut ()) {}
}

impl ResettableUses for LockUse {
    fn another(held: &Arc<Permit>) -> Arc<Permit> {
        Arc::clone(held)
    }

    fn states(_: &Arc<Permit>) -> Vec<Arc<dyn Reset>> {
        Vec::new()
    }
}

shown_as!(Lock<T>, |of| of.name);
shown_as!(LockUse, |of| of.name);
