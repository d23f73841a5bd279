//! Modes: named sets of DAGs, one of which runs, and the functions that change it.
//!
//! `sched-dag/src/lifecycle.rs` has the rules, M1 to M7.

use alloc::rc::Rc;
use alloc::vec::Vec;
use core::fmt;
use core::sync::atomic::{AtomicU8, Ordering};

use sched_dag::ModeId;

use super::dag::Dag;
use super::lifecycle::{ask, lifecycle};
use super::uses::{Uses, implement_asking, sealed};
use crate::draft::Draft;
use crate::draft::modes::{self, ModeDraft};
use crate::run::request::{AT_ONCE, Of, WHEN_IDLE, Wish};

/// The modes of a run: sets of DAGs, one of which runs at a time.
///
/// A DAG that is in some mode is paused in all others; one that is in none runs in every mode. A
/// run begins in the mode that is made first. Functions enter modes, by their completions. Clones
/// are handles of the same modes.
///
/// # Examples
///
/// A drone that flies, and then lands:
///
/// ```
/// use core::time::Duration;
/// use fass::{Entrance, Modes, SubtaskAttributes, create_dag, finish_create_dags};
/// use virtual_time::VirtualTime;
///
/// let machine = VirtualTime::new();
/// let ms = Duration::from_millis;
/// let ticking = |name: &str| {
///     let dag = create_dag();
///     dag.name(name).jobs(6).period(ms(10)).relative_deadline(ms(10));
///     dag.register_untyped_subtask(|_job| (), SubtaskAttributes::named("step"));
///     dag
/// };
/// let (cruise, descend) = (ticking("cruise"), ticking("descend"));
/// let modes = Modes::new();
/// modes.mode("flight", &[&cruise]);
/// let landing = modes.mode("landing", &[&descend]);
///
/// let battery = create_dag(); // in no mode, so it runs in both
/// battery.name("battery").jobs(3).relative_deadline(ms(25));
/// let mut charge = 3;
/// let watch = move |mut landing: Entrance<'_>| {
///     charge -= 1;
///     if charge == 1 {
///         landing.when_idle(); // asked for when this instance is complete
///     }
/// };
/// battery
///     .period(ms(25))
///     .using(landing.entering())
///     .source(watch)
///     .register(SubtaskAttributes::named("watch"));
///
/// finish_create_dags(&[cruise, descend, battery]).unwrap();
/// let report = machine.run();
/// assert_eq!(report.violations(), []);
/// assert_eq!(report.dag("cruise").statistics().released, 3); // at 0, 10 and 20 ms
/// assert_eq!(report.dag("descend").statistics().released, 3); // at 30, 40 and 50 ms
/// ```
#[derive(Clone, Default)]
pub struct Modes {
    modes: modes::Modes,
}

/// A mode. Clones are handles of the same one. Made by [`Modes::mode`].
///
/// See [`Modes`].
#[derive(Clone)]
pub struct Mode {
    modes: modes::Modes,
    number: ModeId,
}

/// The use of a mode by a subtask that may enter it: the function gets an [`Entrance`]. Made by
/// [`Mode::entering`].
///
/// See [`Modes`].
#[derive(Debug)]
pub struct Entering(Mode);

/// What a function enters a mode with.
///
/// See [`Modes`].
#[derive(Debug)]
pub struct Entrance<'a> {
    wish: &'a AtomicU8,
}

impl Entrance<'_> {
    /// Enters the mode when this instance is complete. Jobs of the old mode that are in flight
    /// go on next to those of the new.
    ///
    /// See [`Modes`].
    pub fn at_once(&mut self) {
        self.wish.store(AT_ONCE, Ordering::Relaxed);
    }

    /// Asks for the mode when this instance is complete. From then on the DAGs that leave release
    /// nothing, and the mode is entered when none of them has a job in flight.
    ///
    /// See [`Modes`].
    pub fn when_idle(&mut self) {
        self.wish.store(WHEN_IDLE, Ordering::Relaxed);
    }
}

impl Modes {
    /// Makes a handle without modes. A commit has those of one handle.
    ///
    /// See [`Modes`].
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Makes a mode in which these DAGs run, and no other ones that are in some mode. The first
    /// mode is the one in which the run begins.
    ///
    /// # Panics
    ///
    /// If one of the DAGs is committed.
    ///
    /// See [`Modes`].
    #[track_caller]
    pub fn mode(&self, name: &str, dags: &[&Dag]) -> Mode {
        let mut named = Vec::with_capacity(dags.len());
        for dag in dags {
            let mut draft = dag.open();
            draft.modes.push(Rc::clone(&self.modes));
            draft.check_modes = Some(modes::check);
            draft.lifecycle = Some(lifecycle);
            named.push((Rc::downgrade(&dag.draft), draft.spec.name.clone()));
        }
        let mut modes = self.modes.borrow_mut();
        let number = ModeId(u32::try_from(modes.len()).unwrap_or(u32::MAX));
        modes.push(ModeDraft {
            name: name.into(),
            dags: named,
        });
        Mode {
            modes: Rc::clone(&self.modes),
            number,
        }
    }
}

impl Mode {
    /// Returns the use of a subtask, of any DAG, that may enter the mode.
    ///
    /// See [`Modes`].
    #[must_use = "a use has no effect until a subtask is registered with it"]
    pub fn entering(&self) -> Entering {
        Entering(self.clone())
    }
}

implement_asking!(Entering, Entrance, |entering, draft, subtask| {
    draft.modes.push(entering.0.modes);
    draft.check_modes = Some(modes::check);
    ask(draft, subtask, Of::Mode(entering.0.number))
});

impl fmt::Debug for Modes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let modes = self.modes.borrow();
        f.debug_set()
            .entries(modes.iter().map(|mode| &mode.name))
            .finish()
    }
}

impl fmt::Debug for Mode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Mode").field(&self.number.0).finish()
    }
}
