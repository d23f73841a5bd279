//! What can happen: the vocabulary of the journal.

use core::fmt;
use core::str::FromStr;

/// What has happened. Printed, and read, as its name in lower case.
///
/// ```
/// use sched_dag::journal::What;
///
/// assert_eq!(What::Suspend.to_string(), "suspend");
/// assert_eq!("suspend".parse(), Ok(What::Suspend));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum What {
    /// A job is released.
    Released,
    /// A job's release waits for an older job to end.
    Queued,
    /// A job's release does not happen.
    Skipped,
    /// A job starts no further instance.
    Aborted,
    /// A job's deadline has passed, and it is not complete.
    Missed,
    /// No instance of a job is left.
    Completed,
    /// All that an instance waits for has happened.
    Ready,
    /// An instance will not run.
    Cancelled,
    /// A core shall run the instance instead of what it runs.
    Request,
    /// The instance's function is called.
    Start,
    /// The instance loses its core.
    Suspend,
    /// The instance continues.
    Resume,
    /// The instance's function has returned.
    Finish,
    /// The instance was ended by a fault.
    Ended,
    /// A signal came, which lets a sporadic DAG's job be due.
    Signalled,
    /// A signal came while one was kept for the job, or no job was left.
    Dropped,
    /// A sporadic DAG's job that is being released was due: the event's time is the
    /// nominal release, which no grid tells.
    Due,
    /// A DAG starts no further instance, because of a fault or a stop. The event's job
    /// is 0 and means nothing.
    Stopped,
    /// The instance was ended by a fault, which has cut its job, and its subtask goes on
    /// with another function.
    Restarted,
    /// A DAG is paused: it releases no job from now on. As with the two that follow, the
    /// event's job is 0 and means nothing.
    Off,
    /// A DAG is resumed: what is due from now on is released.
    On,
    /// A DAG is closed: it releases no further job.
    Closed,
    /// The run enters a mode, whose number stands where the job's does. The event's DAG is 0
    /// and means nothing.
    Entered,
}

/// All of it, by number, as it is printed.
const WORDS: [(What, &str); 23] = [
    (What::Released, "released"),
    (What::Queued, "queued"),
    (What::Skipped, "skipped"),
    (What::Aborted, "aborted"),
    (What::Missed, "missed"),
    (What::Completed, "completed"),
    (What::Ready, "ready"),
    (What::Cancelled, "cancelled"),
    (What::Request, "request"),
    (What::Start, "start"),
    (What::Suspend, "suspend"),
    (What::Resume, "resume"),
    (What::Finish, "finish"),
    (What::Ended, "ended"),
    (What::Signalled, "signalled"),
    (What::Dropped, "dropped"),
    (What::Due, "due"),
    (What::Stopped, "stopped"),
    (What::Restarted, "restarted"),
    (What::Off, "off"),
    (What::On, "on"),
    (What::Closed, "closed"),
    (What::Entered, "entered"),
];

/// A text that is none of the words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UnknownWord;

impl What {
    /// Returns what has a number; the inverse of `as u8`.
    #[must_use]
    pub fn from_number(number: u8) -> Option<Self> {
        WORDS.get(usize::from(number)).map(|(what, _)| *what)
    }

    /// Returns the word.
    #[must_use]
    pub const fn word(self) -> &'static str {
        WORDS[self as usize].1
    }

    /// Reports whether it happens to a DAG as a whole, or to the run, and to no job.
    #[must_use]
    pub const fn is_of_dag(self) -> bool {
        matches!(
            self,
            Self::Stopped | Self::Off | Self::On | Self::Closed | Self::Entered
        )
    }

    /// Reports whether it happens to a job or a DAG, not to an instance.
    #[must_use]
    pub const fn is_of_job(self) -> bool {
        let is_of_instance = matches!(
            self,
            Self::Ready | Self::Cancelled | Self::Request | Self::Restarted
        );
        !is_of_instance && !self.is_of_machine()
    }

    /// Reports whether it happens on a core, not only in the scheduler's books.
    #[must_use]
    pub const fn is_of_machine(self) -> bool {
        matches!(
            self,
            Self::Start | Self::Suspend | Self::Resume | Self::Finish | Self::Ended
        )
    }
}

impl fmt::Display for What {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())
    }
}

impl FromStr for What {
    type Err = UnknownWord;

    fn from_str(text: &str) -> Result<Self, UnknownWord> {
        let known = WORDS.iter().find(|(_, word)| *word == text);
        known.map(|(what, _)| *what).ok_or(UnknownWord)
    }
}

#[cfg(test)]
mod tests {
    use alloc::string::ToString;

    use super::*;

    #[test]
    fn every_word_is_read_back_and_stands_at_its_number() {
        for (number, &(what, _)) in (0..).zip(&WORDS) {
            assert_eq!(what as u8, number);
            assert_eq!(What::from_number(number), Some(what));
            assert_eq!(what.to_string().parse(), Ok(what));
        }
        assert_eq!(What::from_number(23), None);
        assert_eq!("Start".parse::<What>(), Err(UnknownWord));
    }
}
