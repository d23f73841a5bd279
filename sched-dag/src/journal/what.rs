//! What can happen: the vocabulary of the journal.

use core::fmt;
use core::str::FromStr;

/// To what an event happens.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Object {
    /// A job as a whole.
    Job,
    /// A DAG, or the run.
    Dag,
    /// An instance, in the scheduler's books only.
    Instance,
    /// An instance, on a core.
    Core,
}

/// Makes the vocabulary of its table: to add an event is to add a row.
macro_rules! events {
    ($($(#[$doc:meta])+ $name:ident = $word:literal, $object:ident;)+) => {
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
            $($(#[$doc])+ $name,)+
        }

        /// All of it, by number: the word, and to what it happens.
        const EVENTS: &[(What, &str, Object)] = &[$((What::$name, $word, Object::$object),)+];
    };
}

events! {
    /// A job is released.
    Released = "released", Job;
    /// A job's release waits for an older job to end.
    Queued = "queued", Job;
    /// A job's release does not happen.
    Skipped = "skipped", Job;
    /// A job starts no further instance.
    Aborted = "aborted", Job;
    /// A job's deadline has passed, and it is not complete.
    Missed = "missed", Job;
    /// No instance of a job is left.
    Completed = "completed", Job;
    /// All that an instance waits for has happened.
    Ready = "ready", Instance;
    /// An instance will not run.
    Cancelled = "cancelled", Instance;
    /// A core shall run the instance instead of what it runs.
    Request = "request", Instance;
    /// The instance's function is called.
    Start = "start", Core;
    /// The instance loses its core.
    Suspend = "suspend", Core;
    /// The instance continues.
    Resume = "resume", Core;
    /// The instance's function has returned.
    Finish = "finish", Core;
    /// The instance was ended by a fault.
    Ended = "ended", Core;
    /// A signal came, which lets a sporadic DAG's job be due.
    Signalled = "signalled", Job;
    /// A signal came while one was kept for the job, or no job was left.
    Dropped = "dropped", Job;
    /// A sporadic DAG's job that is being released was due: the event's time is the
    /// nominal release, which no grid tells.
    Due = "due", Job;
    /// A DAG starts no further instance, because of a fault or a stop. The event's job
    /// is 0 and means nothing.
    Stopped = "stopped", Dag;
    /// The instance was ended by a fault, which has cut its job, and its subtask goes on
    /// with another function.
    Restarted = "restarted", Instance;
    /// A DAG is paused: it releases no job from now on. As with the two that follow, the
    /// event's job is 0 and means nothing.
    Off = "off", Dag;
    /// A DAG is resumed: what is due from now on is released.
    On = "on", Dag;
    /// A DAG is closed: it releases no further job.
    Closed = "closed", Dag;
    /// The run enters a mode, whose number stands where the job's does. The event's DAG is 0
    /// and means nothing.
    Entered = "entered", Dag;
}

/// A text that is none of the words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UnknownWord;

impl What {
    /// Returns what has a number; the inverse of `as u8`.
    #[must_use]
    pub fn from_number(number: u8) -> Option<Self> {
        EVENTS.get(usize::from(number)).map(|(what, ..)| *what)
    }

    /// Returns the word.
    #[must_use]
    pub const fn word(self) -> &'static str {
        EVENTS[self as usize].1
    }

    /// Reports whether it happens to a DAG as a whole, or to the run, and to no job.
    #[must_use]
    pub const fn is_of_dag(self) -> bool {
        matches!(EVENTS[self as usize].2, Object::Dag)
    }

    /// Reports whether it happens to a job or a DAG, not to an instance.
    #[must_use]
    pub const fn is_of_job(self) -> bool {
        matches!(EVENTS[self as usize].2, Object::Job | Object::Dag)
    }

    /// Reports whether it happens on a core, not only in the scheduler's books.
    #[must_use]
    pub const fn is_of_machine(self) -> bool {
        matches!(EVENTS[self as usize].2, Object::Core)
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
        let known = EVENTS.iter().find(|(_, word, _)| *word == text);
        known.map(|(what, ..)| *what).ok_or(UnknownWord)
    }
}

#[cfg(test)]
mod tests {
    use alloc::string::ToString;

    use super::*;

    #[test]
    fn every_word_is_read_back_and_stands_at_its_number() {
        for (number, &(what, ..)) in (0..).zip(EVENTS) {
            assert_eq!(what as u8, number);
            assert_eq!(What::from_number(number), Some(what));
            assert_eq!(what.to_string().parse(), Ok(what));
        }
        assert_eq!(What::from_number(23), None);
        assert_eq!("Start".parse::<What>(), Err(UnknownWord));
    }
}
