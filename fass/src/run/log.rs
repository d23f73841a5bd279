//! The log: lines for people, written by functions while they run.
//!
//! On a machine and on Linux, [`log!`](crate::log!) copies a *line* into a ring of fixed size, and
//! continues. There the call neither allocates, waits nor formats text: the platform does the rest,
//! and [takes](LogLine::take) lines when it has nothing else to do. If the ring is full, the new
//! line is left out and counted. Virtual time has no ring, and keeps all lines for its report.
//!
//! # Guarantees
//!
//! - A line of a level that is off costs a load and a comparison; its fields are not computed.
//! - A line is no result. It is shown even if its instance fails later, as it may tell why.
//!
//! # No guarantees
//!
//! - Lines of several cores come only roughly in the order of their writing; their times tell the
//!   order.
//! - An instance ended by its budget in the middle of a line takes the line's place with it: one of
//!   64, until the next boot.

use core::array;
use core::fmt::{self, Display, Formatter};
use core::mem;
use core::sync::atomic::{AtomicU8, AtomicU32, AtomicUsize, Ordering};

use recording::Part;
use sched_dag::{Instance, TaskSet};

use super::cell::SharedCell;

/// The greatest number of fields in a line. See [`log!`](crate::log!).
pub const FIELDS: usize = 4;

/// The number of lines that can wait.
const PLACES: usize = 64;

/// The importance of a line.
///
/// ```standalone_crate
/// use fass::log::{Level, set_level};
///
/// assert!(Level::Info.is_on() && !Level::Debug.is_on()); // by default
/// set_level(Some(Level::Warn));
/// assert!(Level::Error.is_on() && !Level::Info.is_on());
/// set_level(None);
/// assert!(!Level::Error.is_on());
/// assert_eq!(Level::Error.word(), "error");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    /// Something does not work.
    Error = 1,
    /// Something may not work.
    Warn,
    /// The course of events.
    Info,
    /// Details for finding a mistake.
    Debug,
}

/// The most detailed level shown; 0: none.
static LEVEL: AtomicU8 = AtomicU8::new(Level::Info as u8);

/// The waiting lines.
static RING: [SharedCell<LogSlot>; PLACES] = [const { SharedCell::new(LogSlot::Empty) }; PLACES];

/// A place for a line. An empty place is represented by zeros, so an image need not contain the
/// ring. An empty `Option` would have another representation.
#[repr(u8)]
#[expect(clippy::large_enum_variant, reason = "nothing is allocated")]
enum LogSlot {
    Empty,
    Full(LogLine),
}

/// The number of waiting lines, so a look at an empty ring is short.
static WAITING: AtomicU32 = AtomicU32::new(0);

/// The place after the one filled last, where the next place is likely free. Counted up without
/// end.
static FILLED: AtomicUsize = AtomicUsize::new(0);

/// The place after the one emptied last, where the oldest line likely is. Counted up, too.
static EMPTIED: AtomicUsize = AtomicUsize::new(0);

/// The number of lines without room since the last one taken.
static LEFT_OUT: AtomicU32 = AtomicU32::new(0);

/// Enables lines up to this level from now on; `None`: no lines.
///
/// See [`Level`].
pub fn set_level(most: Option<Level>) {
    LEVEL.store(most.map_or(0, |level| level as u8), Ordering::Relaxed);
}

impl Level {
    /// Reports whether lines of this level are written.
    #[inline]
    pub fn is_on(self) -> bool {
        self as u8 <= LEVEL.load(Ordering::Relaxed)
    }

    /// Returns the level's name in lines and on the command line.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Error => "error",
            Self::Warn => "warn",
            Self::Info => "info",
            Self::Debug => "debug",
        }
    }
}

/// The key and the value of a field. See [`log!`](crate::log!).
pub type Field = (&'static str, Part<'static>);

/// A written line.
///
/// ```standalone_crate
/// use fass::log::LogLine;
///
/// assert!(LogLine::take().is_none(), "nothing was said");
/// ```
#[derive(Clone, Copy, Debug)]
pub struct LogLine {
    /// The importance of the line.
    pub level: Level,
    /// The text, without the fields.
    pub text: &'static str,
    fields: [Option<Field>; FIELDS],
    /// The function formatting a field's value. A program writing no lines does not contain such
    /// code.
    write: fn(&Part<'static>, &mut Formatter<'_>) -> fmt::Result,
    /// The instance writing the line, if any.
    pub instance: Option<Instance>,
    /// The time of the line, in ns since the start of the present run, or of the last run if none
    /// goes on.
    pub at_ns: u64,
    /// The number of lines without room since the line taken before.
    pub left_out: u32,
}

impl LogLine {
    pub(crate) fn new(level: Level, text: &'static str, fields: &[Field]) -> Self {
        Self {
            level,
            text,
            fields: array::from_fn(|place| fields.get(place).copied()),
            write: Part::fmt,
            instance: None,
            at_ns: 0,
            left_out: 0,
        }
    }

    /// Keeps the line until it is taken. For platforms
    /// ([`Platform::log`](crate::platform::Platform::log)).
    pub fn keep(self) {
        let fill = |place: &mut LogSlot| {
            matches!(place, LogSlot::Empty).then(|| *place = LogSlot::Full(self))
        };
        let kept = find(&FILLED, fill);
        let count = kept.map_or(&LEFT_OUT, |()| &WAITING);
        count.fetch_add(1, Ordering::Relaxed);
    }

    /// Takes the oldest waiting line, to show it.
    ///
    /// Called by platforms, and by programs whose platform shows no lines. See [`LogLine`].
    #[must_use]
    pub fn take() -> Option<Self> {
        if WAITING.load(Ordering::Relaxed) == 0 {
            return None;
        }
        let line = find(&EMPTIED, |place| {
            match mem::replace(place, LogSlot::Empty) {
                LogSlot::Empty => None,
                LogSlot::Full(line) => Some(line),
            }
        })?;
        WAITING.fetch_sub(1, Ordering::Relaxed);
        let left_out = LEFT_OUT.swap(0, Ordering::Relaxed);
        Some(Self { left_out, ..line })
    }

    /// Returns the keys and the values of the fields; the values are JSON.
    pub fn fields(&self) -> impl Iterator<Item = (&'static str, impl Display)> {
        let fields = self.fields.iter().flatten();
        fields.map(|(key, value)| (*key, fmt::from_fn(|f| (self.write)(value, f))))
    }

    /// Returns the names of the line's DAG and subtask, and the instance, if the line belongs to
    /// one of these DAGs.
    pub fn names<'t>(&self, task_set: Option<&'t TaskSet>) -> Option<(&'t str, &'t str, Instance)> {
        let instance = self.instance?;
        let dag = task_set?.dags().get(instance.dag.index())?;
        let subtask = dag.subtasks().get(instance.subtask.index())?;
        Some((dag.name(), subtask.name(), instance))
    }

    /// Returns the line as text for people.
    ///
    /// See [`log!`](crate::log!).
    pub fn shown<'s>(&'s self, task_set: Option<&'s TaskSet>) -> impl Display + 's {
        fmt::from_fn(move |f| {
            write!(f, "{} ", self.level.word())?;
            if let Some((dag, subtask, Instance { job, .. })) = self.names(task_set) {
                write!(f, "{dag}/{subtask}[{job}] ")?;
            }
            write!(f, "{} ns: {}", self.at_ns, self.text)?;
            self.fields()
                .try_for_each(|(key, value)| write!(f, " {key}={value}"))
        })
    }
}

/// Goes round the places from `next` on, and moves `next` past the first place that `fits`. Nobody
/// waits: a place in use by somebody else is passed over.
fn find<T>(next: &AtomicUsize, fits: impl Fn(&mut LogSlot) -> Option<T>) -> Option<T> {
    let first = next.load(Ordering::Relaxed);
    // A single round: the call ends even if others fill or empty places all the time.
    (first..first + PLACES).find_map(|number| {
        let found = fits(&mut *RING[number % PLACES].change()?)?;
        // A slow caller does not set back the progress of others.
        next.fetch_max(number + 1, Ordering::Relaxed);
        Some(found)
    })
}

#[cfg(test)]
mod tests {
    use core::iter;
    use std::thread::{self, ScopedJoinHandle};

    use super::*;

    /// Has a line kept that can be told from others: by its time.
    fn keep(at_ns: u64) {
        let line = LogLine::new(Level::Warn, "camera late", &[]);
        LogLine { at_ns, ..line }.keep();
    }

    fn taken() -> impl Iterator<Item = (u64, u32)> {
        iter::from_fn(LogLine::take).map(|line| (line.at_ns, line.left_out))
    }

    #[test]
    fn lines_come_in_order_and_those_that_have_no_room_are_counted() {
        (0..66).for_each(keep);
        assert!(taken().take(2).eq([(0, 2), (1, 0)]));
        keep(66);
        assert!(taken().eq((2..64).chain([66]).map(|at_ns| (at_ns, 0))));

        // As by an instance that was ended in the middle of a line.
        core::mem::forget(RING[1].change());
        for first in (0..640).step_by(63) {
            (first..first + 64).for_each(keep);
            assert!(taken().map(|(at_ns, _)| at_ns).eq(first..first + 63));
        }

        let (lines, mut count) = (if cfg!(miri) { 100 } else { 50_000 }, 0);
        let mut take = || count += taken().map(|(_, left_out)| 1 + left_out).sum::<u32>();
        thread::scope(|scope| {
            let write = || (0..lines).for_each(keep);
            let writers = [scope.spawn(write), scope.spawn(write)];
            while !writers.iter().all(ScopedJoinHandle::is_finished) {
                take();
            }
        });
        take();
        count += LEFT_OUT.swap(0, Ordering::Relaxed);
        assert_eq!(u64::from(count), 2 * lines);
    }
}
