//! A violation in words.

use core::fmt;

use super::sweep::{Blame, Stage, Wrong};
use super::{Rule, Violation};
use crate::ids::{DagId, Instance};
use crate::journal::{Event, What};
use crate::task_set::TaskSet;

impl Violation {
    /// Returns its text with the names of the model that was run, instead of numbers.
    #[must_use]
    pub const fn with_names(self, task_set: &TaskSet) -> impl fmt::Display {
        Words {
            violation: self,
            names: Names(Some(task_set)),
        }
    }
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let words = Words {
            violation: *self,
            names: Names(None),
        };
        words.fmt(f)
    }
}

/// Writes the rule's name, such as `R2 join`.
impl fmt::Display for Rule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Release => "R1 release",
            Self::AndJoin => "R2 join",
            Self::CompletionBoundary => "R3 completion boundary",
            Self::JobCompletion => "R4 completion",
            Self::Dispatch => "R5 dispatch",
            Self::OneLife => "one life",
            Self::OneCore => "one core",
        })
    }
}

/// Writes a job or an instance with the names that it has, for people.
#[derive(Clone, Copy)]
struct Names<'a>(Option<&'a TaskSet>);

struct Words<'a> {
    violation: Violation,
    names: Names<'a>,
}

impl Names<'_> {
    fn job(self, dag: DagId, job: u64) -> impl fmt::Display {
        let name = self.0.map_or("", |task_set| task_set.dag(dag).name());
        fmt::from_fn(move |f| match name {
            "" => write!(f, "dag {} job {job}", dag.0),
            name => write!(f, "dag `{name}` job {job}"),
        })
    }

    fn instance(self, instance: Instance) -> impl fmt::Display {
        let Instance { dag, job, subtask } = instance;
        let name = self
            .0
            .map_or("", |task_set| task_set.dag(dag).subtask(subtask).name());
        fmt::from_fn(move |f| {
            match name {
                "" => write!(f, "subtask {} of ", subtask.0)?,
                name => write!(f, "subtask `{name}` of ")?,
            }
            write!(f, "{}", self.job(dag, job))
        })
    }
}

impl Words<'_> {
    /// Writes an event, such as "dag `x` job 1 is released" or "subtask `a` of dag `x` job
    /// 1 starts on core 0".
    fn what(&self, event: &Event, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(instance) = event.instance() else {
            let job = self.names.job(event.dag, event.job);
            return write!(f, "{job} is {}", event.what);
        };
        let does = match event.what {
            What::Ready => "is ready",
            What::Start => "starts",
            What::Suspend => "is suspended",
            What::Resume => "is resumed",
            What::Finish => "finishes",
            What::Cancelled => "is cancelled",
            What::Restarted => "is replaced",
            _ => "is ended",
        };
        write!(f, "{} {does}", self.names.instance(instance))?;
        match self.violation {
            Violation::OutOfStep { .. } | Violation::Late { .. } => Ok(()),
            _ => write!(f, " on core {}", event.core.0),
        }
    }

    fn passed_over(&self, wrong: &Wrong, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *wrong {
            Wrong::Waits {
                waiting,
                length_ns,
                blame,
                ..
            } => {
                let waiting = self.names.instance(waiting);
                write!(f, "{waiting} should run and waits {length_ns} ns while ")?;
                match blame {
                    Blame::Runs(running, core) => {
                        write!(f, "core {} runs {}", core.0, self.names.instance(running))
                    }
                    Blame::Idle(Some(core)) => write!(f, "core {} is idle", core.0),
                    Blame::Idle(None) => f.write_str("a core is idle"),
                }
            }
            Wrong::OutOfTurn {
                started,
                core,
                first,
                since_ns,
                ..
            } => write!(
                f,
                "{} starts on core {} and keeps it, although {} waits since {since_ns} ns and \
                 goes first",
                self.names.instance(started),
                core.0,
                self.names.instance(first)
            ),
        }
    }

    /// Writes what is wrong with an event, after the event itself.
    fn why(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.violation {
            Violation::BeforeRelease { release_ns, .. } => {
                write!(f, " before its release time {release_ns} ns")
            }
            Violation::BeforeReleased { released_ns, .. } => {
                write!(f, " before its release was made at {released_ns} ns")
            }
            Violation::NotReleased { is_over, .. } => match is_over {
                true => f.write_str(" although its job is over, and a later one, too"),
                false => f.write_str(" although its job was never released"),
            },
            Violation::NotDue { .. } => f.write_str(", and nothing says when it was due"),
            Violation::WhileOff { .. } => f.write_str(" although its DAG is paused or closed"),
            Violation::OutOfOrder { later, .. } => write!(f, " after job {later}"),
            Violation::TooMany { in_flight, .. } => {
                write!(
                    f,
                    " although {in_flight} jobs are in flight, the most there may be"
                )
            }
            Violation::Unpunctual { expected_ns, .. } => match expected_ns {
                Some(expected_ns) => write!(f, ", which was due at {expected_ns} ns"),
                None => f.write_str(" although it waits, and no job has ended"),
            },
            Violation::Again {
                before, before_ns, ..
            } => write!(f, " although it was {before} at {before_ns} ns"),
            Violation::BeforeJoin {
                event,
                awaited,
                over,
            } => {
                write!(f, "; {}, ", self.names.instance(awaited))?;
                let verb = if awaited.job == event.job {
                    f.write_str("which it waits for, ")?;
                    "finishes"
                } else {
                    f.write_str("the job before, ")?;
                    "is over"
                };
                match over {
                    Some((ns, core)) => write!(f, "{verb} only at {ns} ns on core {}", core.0),
                    None => write!(f, "{verb} later or never"),
                }
            }
            Violation::OutOfStep {
                event,
                last_ns,
                last_core,
            } => {
                let what = match event.what {
                    What::Ready => "nothing it waits for",
                    _ => "no instance of it",
                };
                write!(
                    f,
                    " in a step on core {} that {what} brought about; the last of that was over \
                     at {last_ns} ns on core {}",
                    event.core.0, last_core.0
                )
            }
            Violation::Late { event, since_ns } => {
                let late_ns = event.time_ns.saturating_sub(since_ns);
                let what = match event.what {
                    What::Ready => "the last of what it waits for was over",
                    What::Missed => "its deadline",
                    _ => "all of it was over",
                };
                write!(f, " {late_ns} ns after {what} at {since_ns} ns")
            }
            Violation::BeforeItsEnd {
                awaited, over_ns, ..
            } => {
                let awaited = self.names.instance(awaited);
                match over_ns {
                    Some(over_ns) => write!(f, " although {awaited} is over only at {over_ns} ns"),
                    None => write!(f, " although {awaited} is not over"),
                }
            }
            Violation::MissedEarly { deadline_ns, .. } => {
                write!(f, " before its deadline {deadline_ns} ns has passed")
            }
            Violation::MissedInTime {
                finish_ns,
                deadline_ns,
                ..
            } => write!(
                f,
                " although its last instance finished at {finish_ns} ns, by its deadline \
                 {deadline_ns} ns"
            ),
            Violation::OutOfTurn { stage, .. } => {
                f.write_str(" although it ")?;
                match stage {
                    Stage::Absent => f.write_str("never was ready"),
                    Stage::Ready => f.write_str("is ready and has not started"),
                    Stage::Running(core) => write!(f, "runs on core {}", core.0),
                    Stage::Suspended => f.write_str("is suspended"),
                    Stage::Over => f.write_str("is over already"),
                }
            }
            Violation::Backwards {
                before, before_ns, ..
            } => write!(
                f,
                " before its `{before}` at {before_ns} ns, which comes first"
            ),
            Violation::CancelledUncut { .. } => {
                f.write_str(" although its job was not cut, nor its DAG ended")
            }
            Violation::FaultBeyondLimit { .. } => {
                f.write_str(" although its DAG does not survive that fault")
            }
            Violation::OutsideItsCluster { .. } => f.write_str(", outside its cluster"),
            Violation::LostItsCore { .. } => {
                f.write_str(" although it keeps its core until it finishes")
            }
            _ => Ok(()),
        }
    }
}

impl fmt::Display for Words<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { violation, names } = self;
        write!(f, "at {} ns, {}: ", violation.time_ns(), violation.rule())?;
        match *violation {
            Violation::PassedOver(wrong) => self.passed_over(&wrong, f),
            Violation::CoreNotFree { event, occupant } => {
                let core = event.core.0;
                write!(f, "core {core} runs ")?;
                if let Some(instance) = event.instance() {
                    write!(f, "{} ", names.instance(instance))?;
                }
                write!(f, "while it still runs {}", names.instance(occupant))
            }
            Violation::TooSoon {
                dag,
                job,
                earliest_ns,
                ..
            } => write!(
                f,
                "{} is due before {earliest_ns} ns, the earliest by its DAG's distance",
                names.job(dag, job)
            ),
            Violation::NeverReady {
                instance,
                since_ns,
                core,
            } => write!(
                f,
                "{} is never ready although all that it waits for was over at {since_ns} ns on \
                 core {}",
                names.instance(instance),
                core.0
            ),
            Violation::NeverCompleted {
                dag, job, over_ns, ..
            } => {
                write!(f, "{} is not completed although ", names.job(dag, job))?;
                match over_ns {
                    Some(over_ns) => write!(f, "all of it was over at {over_ns} ns"),
                    None => f.write_str("the run says that it is"),
                }
            }
            Violation::NotMissed {
                dag,
                job,
                finish_ns,
                deadline_ns,
                ..
            } => {
                write!(f, "{} is not missed although its ", names.job(dag, job))?;
                match finish_ns {
                    Some(finish_ns) => write!(
                        f,
                        "last instance finished at {finish_ns} ns, after its deadline \
                         {deadline_ns} ns"
                    ),
                    None => write!(f, "deadline {deadline_ns} ns has passed"),
                }
            }
            Violation::BeforeRelease { event, .. }
            | Violation::BeforeReleased { event, .. }
            | Violation::NotReleased { event, .. }
            | Violation::NotDue { event }
            | Violation::WhileOff { event }
            | Violation::OutOfOrder { event, .. }
            | Violation::TooMany { event, .. }
            | Violation::Unpunctual { event, .. }
            | Violation::Again { event, .. }
            | Violation::BeforeJoin { event, .. }
            | Violation::OutOfStep { event, .. }
            | Violation::Late { event, .. }
            | Violation::BeforeItsEnd { event, .. }
            | Violation::MissedEarly { event, .. }
            | Violation::MissedInTime { event, .. }
            | Violation::OutOfTurn { event, .. }
            | Violation::Backwards { event, .. }
            | Violation::CancelledUncut { event }
            | Violation::FaultBeyondLimit { event }
            | Violation::OutsideItsCluster { event }
            | Violation::LostItsCore { event } => {
                self.what(&event, f)?;
                self.why(f)
            }
        }
    }
}
