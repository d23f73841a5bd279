//! The log: lines that functions say while they run, for people.
//!
//! [`log!`](crate::log!) copies a *line* into a ring of fixed size, and goes on. Nothing is
//! allocated, nobody is waited for, and no text is made: that is left to the platform, which
//! [takes](LogLine::take) lines when it has nothing else to do. Where the ring is full, the new
//! line
//! is left out and counted.
//!
//! # What is guaranteed
//!
//! - A line of a level that is off costs a load and a comparison; its fields are not computed.
//! - A line is no result. It is shown although its instance fails later, for it may say why.
//!
//! # What is not
//!
//! - Lines of several cores come in about the order in which they were said; their times tell.
//! - An instance that is ended by its budget in the middle of a line takes the line's place with
//!   it: one of 64, until the next boot.

use core::array;
use core::fmt::{self, Display, Formatter};
use core::mem;
use core::sync::atomic::{AtomicU8, AtomicU32, AtomicUsize, Ordering};

use recording::Part;
use sched_dag::{Instance, TaskSet};

use super::cell::SharedCell;

/// The most fields of a line. See [`log!`](crate::log!).
pub const FIELDS: usize = 4;

/// How many lines can wait.
const PLACES: usize = 64;

/// How much a line matters.
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
    /// Something may not.
    Warn,
    /// The course of events.
    Info,
    /// Details that help to find a mistake.
    Debug,
}

/// The level that is on; 0: none.
static LEVEL: AtomicU8 = AtomicU8::new(Level::Info as u8);

/// The lines that wait.
static RING: [SharedCell<LogSlot>; PLACES] = [const { SharedCell::new(LogSlot::Empty) }; PLACES];

/// A place for a line. Its representation has zeros where it is empty, which those of an `Option`
/// are
/// not: so an image does not hold the ring.
#[repr(u8)]
#[expect(clippy::large_enum_variant, reason = "nothing is allocated")]
enum LogSlot {
    Empty,
    Full(LogLine),
}

/// How many these are, so that a look at an empty ring is short.
static WAITING: AtomicU32 = AtomicU32::new(0);

/// The place behind the one that was filled last, where the next one is likely free, counted on and
/// on.
static FILLED: AtomicUsize = AtomicUsize::new(0);

/// The place behind the one that was emptied last, where the oldest line likely is, counted too.
static EMPTIED: AtomicUsize = AtomicUsize::new(0);

/// How many lines had no room since one was taken.
static LEFT_OUT: AtomicU32 = AtomicU32::new(0);

/// Has lines up to this level said from now on, or none.
///
/// See [`Level`].
pub fn set_level(most: Option<Level>) {
    LEVEL.store(most.map_or(0, |level| level as u8), Ordering::Relaxed);
}

impl Level {
    /// Reports whether lines of this level are said.
    #[inline]
    pub fn is_on(self) -> bool {
        self as u8 <= LEVEL.load(Ordering::Relaxed)
    }

    /// Returns its name in lines and on the command line.
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

/// A line that was said.
///
/// ```standalone_crate
/// use fass::log::LogLine;
///
/// assert!(LogLine::take().is_none(), "nothing was said");
/// ```
#[derive(Clone, Copy, Debug)]
pub struct LogLine {
    /// How much it matters.
    pub level: Level,
    /// Its text, without the fields.
    pub text: &'static str,
    fields: [Option<Field>; FIELDS],
    /// The function that makes a value's text: code that a program which says nothing does not
    /// have.
    write: fn(&Part<'static>, &mut Formatter<'_>) -> fmt::Result,
    /// The instance that has said it, if one has.
    pub instance: Option<Instance>,
    /// When, on the time of the run, or of the one before if none goes on.
    pub at_ns: u64,
    /// How many lines had no room since the one that was taken before.
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

    /// Has it wait until it is taken, for platforms ([`Platform::log`](crate::platform::Platform::log)).
    pub fn keep(self) {
        let fill = |place: &mut LogSlot| {
            matches!(place, LogSlot::Empty).then(|| *place = LogSlot::Full(self))
        };
        let kept = find(&FILLED, fill);
        let count = kept.map_or(&LEFT_OUT, |()| &WAITING);
        count.fetch_add(1, Ordering::Relaxed);
    }

    /// Takes the oldest line that waits, to show it.
    ///
    /// Platforms do so, and programs that have one without such a service. See [`LogLine`].
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

    /// Returns the keys and the values of its fields; these are JSON.
    pub fn fields(&self) -> impl Iterator<Item = (&'static str, impl Display)> {
        let fields = self.fields.iter().flatten();
        fields.map(|(key, value)| (*key, fmt::from_fn(|f| (self.write)(value, f))))
    }

    /// Returns the names of its DAG and its subtask, and the instance, if it is of one of these
    /// DAGs.
    pub fn names<'t>(&self, task_set: Option<&'t TaskSet>) -> Option<(&'t str, &'t str, Instance)> {
        let instance = self.instance?;
        let dag = task_set?.dags().get(instance.dag.index())?;
        let subtask = dag.subtasks().get(instance.subtask.index())?;
        Some((dag.name(), subtask.name(), instance))
    }

    /// Returns the line for people.
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

/// Goes round the places from `next` on, and moves it behind the first one that `fits`. Nobody
/// waits:
/// a place that somebody else uses is passed over.
fn find<T>(next: &AtomicUsize, fits: impl Fn(&mut LogSlot) -> Option<T>) -> Option<T> {
    let first = next.load(Ordering::Relaxed);
    (first..first + PLACES).find_map(|number| {
        let found = fits(&mut *RING[number % PLACES].change()?)?;
        // One that was slow does not set back what others have moved on.
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
