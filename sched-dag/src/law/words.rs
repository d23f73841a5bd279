//! The phrases of the texts of violations: how they name DAGs and subtasks, and all that
//! depends on what is wrong.

use core::fmt::{self, Display};

use super::sweep::{Blame, Stage, Wrong};
use crate::ids::{CoreId, DagId, Instance, named};
use crate::journal::{Event, What};
use crate::task_set::{Subtask, TaskSet};

/// Writes a job or an instance with the names that it has, for people.
#[derive(Clone, Copy)]
pub(super) struct Names<'a>(pub(super) Option<&'a TaskSet>);

impl Names<'_> {
    pub(super) fn job(self, dag: DagId, job: u64) -> impl Display {
        let name = self.0.map_or("", |task_set| task_set.dag(dag).name());
        let dag = named("dag", dag.0, name);
        fmt::from_fn(move |f| write!(f, "{dag} job {job}"))
    }

    pub(super) fn instance(self, instance: Instance) -> impl Display {
        let Instance { dag, job, subtask } = instance;
        let model = self.0.map(|task_set| task_set.dag(dag).subtask(subtask));
        let subtask = named("subtask", subtask.0, model.map_or("", Subtask::name));
        fmt::from_fn(move |f| write!(f, "{subtask} of {}", self.job(dag, job)))
    }

    /// Writes the instance or the job that an event happens to.
    pub(super) fn subject(self, event: &Event) -> impl Display {
        fmt::from_fn(move |f| match event.instance() {
            Some(instance) => write!(f, "{}", self.instance(instance)),
            None => write!(f, "{}", self.job(event.dag, event.job)),
        })
    }

    /// Writes an event, such as "dag `x` job 1 is released" or "subtask `a` of dag `x` job 1
    /// starts".
    pub(super) fn event(self, event: &Event) -> impl Display {
        fmt::from_fn(move |f| {
            write!(f, "{} ", self.subject(event))?;
            match event.what {
                What::Start => f.write_str("starts"),
                What::Suspend => f.write_str("is suspended"),
                What::Resume => f.write_str("is resumed"),
                What::Finish => f.write_str("finishes"),
                What::Restarted => f.write_str("is replaced"),
                what => write!(f, "is {what}"),
            }
        })
    }

    /// Writes an event, and on which core an instance was at it.
    pub(super) fn on_its_core(self, event: &Event) -> impl Display {
        fmt::from_fn(move |f| {
            write!(f, "{}", self.event(event))?;
            match event.subtask {
                Some(_) => write!(f, " on core {}", event.core.0),
                None => Ok(()),
            }
        })
    }

    pub(super) fn passed_over(self, wrong: &Wrong) -> impl Display {
        fmt::from_fn(move |f| match *wrong {
            Wrong::Waits {
                waiting,
                length_ns,
                blame,
                ..
            } => {
                let waiting = self.instance(waiting);
                write!(f, "{waiting} should run and waits {length_ns} ns while ")?;
                match blame {
                    Blame::Runs(running, core) => {
                        write!(f, "core {} runs {}", core.0, self.instance(running))
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
                self.instance(started),
                core.0,
                self.instance(first)
            ),
        })
    }
}

/// Returns when a breach of R5 shows.
pub(super) const fn shown_ns(wrong: &Wrong) -> u64 {
    match *wrong {
        Wrong::Waits { since_ns, .. } => since_ns,
        Wrong::OutOfTurn { at_ns, .. } => at_ns,
    }
}

/// Returns what an awaited instance is to that of an event, and when and where it is over.
pub(super) fn comes(event: &Event, awaited: Instance, over: Option<(u64, CoreId)>) -> impl Display {
    fmt::from_fn(move |f| {
        f.write_str(match awaited.job == event.job {
            true => "which it waits for, finishes ",
            false => "the job before, is over ",
        })?;
        match over {
            Some((ns, core)) => write!(f, "only at {ns} ns on core {}", core.0),
            None => f.write_str("later or never"),
        }
    })
}

/// Returns that an instance is over too late, or not.
pub(super) fn over(over_ns: Option<u64>) -> impl Display {
    fmt::from_fn(move |f| match over_ns {
        Some(over_ns) => write!(f, "over only at {over_ns} ns"),
        None => f.write_str("not over"),
    })
}

/// Returns what an instance at a stage does.
pub(super) fn does(stage: Stage) -> impl Display {
    fmt::from_fn(move |f| match stage {
        Stage::Absent => f.write_str("never was ready"),
        Stage::Ready => f.write_str("is ready and has not started"),
        Stage::Running(core) => write!(f, "runs on core {}", core.0),
        Stage::Suspended => f.write_str("is suspended"),
        Stage::Over => f.write_str("is over already"),
    })
}
