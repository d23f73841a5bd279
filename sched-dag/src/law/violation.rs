//! Violations visible in a journal: the rules, and one row for each kind of breach.
//!
//! A row has the breach's code, its rule, the time or event showing the breach, and the text: what
//! happened, where, and why it must not happen. The documentation of a row begins with the rule.
//!
//! The module also has the phrases for the texts of violations: names of DAGs and subtasks, and all
//! words depending on the kind of breach.

use core::fmt::{self, Display};

use DetectionTime::{At, By};
use Rule::{
    AndJoin, CompletionBoundary, Dispatch, JobCompletion, OneCore, OneLife, Release, Table, Waiting,
};

use super::sweep::{DispatchBreach, DispatchFault, DispatchState};
use crate::ids::{CoreId, DagId, Instance, named};
use crate::journal::{Event, EventKind};
use crate::task_set::{Subtask, TaskSet};
use crate::worded;
use crate::worded::texts;

texts! {
    /// A rule of the task model (stated in the [crate] documentation), or one of two rules for
    /// every machine, independent of the model. Its text is its name.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
    pub enum Rule {
        /// R1: jobs are released on the nominal grid, and nothing of a job runs before its release.
        Release = "R1 release";
        /// R2: an instance is ready exactly when all its conditions have been met.
        AndJoin = "R2 join";
        /// R3: a finish releases all instances waiting for nothing else, at once.
        CompletionBoundary = "R3 completion boundary";
        /// R4: a job is complete with its last instance, and meets its deadline or not.
        JobCompletion = "R4 completion";
        /// R5: of the instances that may use a core, those with the smallest keys run.
        Dispatch = "R5 dispatch";
        /// T1 to T4: a core runs the entries of its table, and members in the time left over.
        Table = "T1 table";
        /// W1 and W2: an instance takes the waits stated by its subtask, each within its limit.
        Waiting = "W1 waiting";
        /// An instance becomes ready, starts and finishes at most once, is suspended and resumed in
        /// turns, and is on one core at a time.
        OneLife = "one life";
        /// A core runs one instance at a time.
        OneCore = "one core";
    }
}

/// The time or event at which a violation shows.
#[derive(Clone, Copy)]
enum DetectionTime<'v> {
    /// At a time, in nanoseconds from the run's epoch.
    At(u64),
    /// At the time of an event; the text of the violation begins with the event.
    By(&'v Event),
}

worded! {
    /// A breach of a rule in a journal.
    ///
    /// Its text contains the names of DAGs and subtasks if printed
    /// [`with_names`](Self::with_names).
    #[derive(Copy)]
    pub enum Violation[names: NamedSubject<'_>] -> (Rule, DetectionTime<'_>) {
        /// R1: an event of a job happened before the job's nominal release.
        BeforeRelease { event: Event, release_ns: u64 } = "before_release", (Release, By(event)),
            " before its release time {release_ns} ns";
        /// R1: an event of a job happened before the job's release was carried out.
        BeforeReleased { event: Event, released_ns: u64 } = "before_released", (Release, By(event)),
            " before its release was made at {released_ns} ns";
        /// R1: an event belongs to an unreleased job; later events of the job are not judged.
        NotReleased { event: Event } = "not_released", (Release, By(event)),
            " although its job was never released";
        /// R1: an event belongs to a job that is already over, as is a later job.
        Forgotten { event: Event } = "forgotten", (Release, By(event)),
            " although its job is over, and a later one, too";
        /// R1: no event says when a sporadic job was due.
        NotDue { event: Event } = "not_due", (Release, By(event)),
            ", and nothing says when it was due";
        /// R1: a job was released while its DAG was paused or closed.
        WhileOff { event: Event } = "while_off", (Release, By(event)),
            " although its DAG is paused or closed";
        /// R1: a sporadic job's release is less than one minimum inter-arrival time after the
        /// previous job's release, or before the offset.
        TooSoon { dag: DagId, job: u64, release_ns: u64, earliest_ns: u64 } =
            "too_soon", (Release, At(*release_ns)),
            "{} is due before {earliest_ns} ns, the earliest by its DAG's distance",
            names.job(*dag, *job);
        /// R1: a job was released after a later job.
        OutOfOrder { event: Event, later: u64 } = "out_of_order", (Release, By(event)),
            " after job {later}";
        /// R1: a job was released while the maximum number of jobs was in flight.
        TooMany { event: Event, in_flight: u32 } = "too_many", (Release, By(event)),
            " although {in_flight} jobs are in flight, the most there may be";
        /// R1: where times are exact, the release was not carried out at its nominal time or, after
        /// queueing, at the end of an older job.
        Unpunctual { event: Event, expected_ns: u64 } = "unpunctual", (Release, By(event)),
            ", which was due at {expected_ns} ns";
        /// R1: where times are exact, a queued release was carried out before any job had ended.
        StillQueued { event: Event } = "still_queued", (Release, By(event)),
            " although it waits, and no job has ended";
        /// R1: a job was released, queued or skipped once more, or after an event ruling this out.
        ReleasedAgain { event: Event, before: EventKind, before_ns: u64 } =
            "released_again", (Release, By(event)),
            " although it was {before} at {before_ns} ns";
        /// R2: an instance was ready, or started, before an awaited instance was over.
        BeforeJoin { event: Event, awaited: Instance, over: Option<(u64, CoreId)> } =
            "before_join", (AndJoin, By(event)),
            "; {}, {}", names.instance(*awaited), comes(event, *awaited, *over);
        /// R3: an instance became ready in a scheduler step not caused by any of its conditions.
        ReadyOutOfStep { event: Event, last_ns: u64, last_core: CoreId } =
            "ready_out_of_step", (CompletionBoundary, At(event.time_ns)),
            "{} in a step on core {} that nothing it waits for brought about; the last of that was \
             over at {last_ns} ns on core {}", names.event(event), event.core.0, last_core.0;
        /// R3: an instance became ready too late after the last of its conditions was met.
        ReadyLate { event: Event, since_ns: u64 } =
            "ready_late", (CompletionBoundary, At(event.time_ns)),
            "{} {} ns after the last of what it waits for was over at {since_ns} ns",
            names.event(event), event.time_ns.saturating_sub(*since_ns);
        /// R3: an instance never became ready although all its conditions were met.
        NeverReady { instance: Instance, since_ns: u64, core: CoreId } =
            "never_ready", (CompletionBoundary, At(*since_ns)),
            "{} is never ready although all that it waits for was over at {since_ns} ns on core {}",
            names.instance(*instance), core.0;
        /// R4: a job was aborted, missed or completed once more.
        EndedAgain { event: Event, before: EventKind, before_ns: u64 } =
            "ended_again", (JobCompletion, By(event)),
            " although it was {before} at {before_ns} ns";
        /// R4: a job was completed before all its instances were over.
        BeforeItsEnd { event: Event, awaited: Instance, over_ns: Option<u64> } =
            "before_its_end", (JobCompletion, By(event)),
            " although {} is {}", names.instance(*awaited), over(*over_ns);
        /// R4: a job was completed in a scheduler step that ended none of its instances.
        CompletedOutOfStep { event: Event, last_ns: u64, last_core: CoreId } =
            "completed_out_of_step", (JobCompletion, By(event)),
            " in a step on core {} that no instance of it brought about; the last of that was over \
             at {last_ns} ns on core {}", event.core.0, last_core.0;
        /// R4: a job was completed too late after its last instance.
        CompletedLate { event: Event, since_ns: u64 } =
            "completed_late", (JobCompletion, By(event)),
            " {} ns after all of it was over at {since_ns} ns",
            event.time_ns.saturating_sub(*since_ns);
        /// R4: a job is not completed although its last instance was over.
        NeverCompleted { dag: DagId, job: u64, over_ns: u64 } =
            "never_completed", (JobCompletion, At(*over_ns)),
            "{} is not completed although all of it was over at {over_ns} ns",
            names.job(*dag, *job);
        /// R4: a job is not completed although the run claims to have completed all jobs.
        Unfinished { dag: DagId, job: u64, end_ns: u64 } =
            "unfinished", (JobCompletion, At(*end_ns)),
            "{} is not completed although the run says that it is", names.job(*dag, *job);
        /// R4: a deadline was missed before it had passed.
        MissedEarly { event: Event, deadline_ns: u64 } = "missed_early", (JobCompletion, By(event)),
            " before its deadline {deadline_ns} ns has passed";
        /// R4: a job was missed although it finished in time.
        MissedInTime { event: Event, finish_ns: u64, deadline_ns: u64 } =
            "missed_in_time", (JobCompletion, By(event)),
            " although its last instance finished at {finish_ns} ns, by its deadline \
             {deadline_ns} ns";
        /// R4: where times are exact, a miss was noticed later than right after the deadline.
        MissedLate { event: Event, deadline_ns: u64 } = "missed_late", (JobCompletion, By(event)),
            " {} ns after its deadline at {deadline_ns} ns",
            event.time_ns.saturating_sub(*deadline_ns);
        /// R4: a job finished late without a miss.
        NotMissed { dag: DagId, job: u64, finish_ns: u64, deadline_ns: u64 } =
            "not_missed", (JobCompletion, At(*finish_ns)),
            "{} is not missed although its last instance finished at {finish_ns} ns, after its \
             deadline {deadline_ns} ns", names.job(*dag, *job);
        /// R4: a job did not finish, its deadline has passed, and no event notes the miss.
        NeverMissed { dag: DagId, job: u64, deadline_ns: u64, end_ns: u64 } =
            "never_missed", (JobCompletion, At(*end_ns)),
            "{} is not missed although its deadline {deadline_ns} ns has passed",
            names.job(*dag, *job);
        /// W1: a wait ended later than its limit allows.
        WaitBeyondLimit { event: Event, since_ns: u64, limit_ns: u64 } =
            "wait_beyond_limit", (Waiting, By(event)),
            ", which began at {since_ns} ns and has a limit of {limit_ns} ns";
        /// W1: an instance began more waits than its subtask states, or finished without a stated
        /// wait.
        OtherWaits { event: Event, waits: usize, stated: usize } =
            "other_waits", (Waiting, By(event)),
            " after {waits} waits, and its subtask states {stated}";
        /// R5: an instance waited although a core was idle, or ran an instance with a larger key
        /// that the waiting instance could have replaced.
        PassedOver(wrong: DispatchBreach) = "passed_over", (Dispatch, At(shown_ns(wrong))),
            "{}", names.passed_over(wrong);
        /// R5: an instance was on a core outside its cluster.
        OutsideItsCluster { event: Event } = "outside_its_cluster", (Dispatch, By(event)),
            ", outside its cluster";
        /// T1: an entry was on another core than its table states.
        OffItsCore { event: Event, core: CoreId } = "off_its_core", (Table, By(event)),
            ", and its table has it on core {}", core.0;
        /// T1, T3, T4: an instance ran on a core with a table before an entry that goes first.
        OutOfPlace { event: Event, first: Instance } = "out_of_place", (Table, By(event)),
            " and is out of the order that its table has for {}", names.instance(*first);
        /// T4: an instance without a table was on a core outside its DAG's affinity.
        OutsideItsAffinity { event: Event } = "outside_its_affinity", (Table, By(event)),
            ", to which its DAG has no affinity";
        /// R5: an instance lost the core that it keeps until its finish or next wait.
        LostItsCore { event: Event } = "lost_its_core", (Dispatch, By(event)),
            " although it keeps its core until it finishes";
        /// One life: an event does not follow from the previous state of its instance.
        OutOfTurn { event: Event, stage: DispatchState } = "out_of_turn", (OneLife, By(event)),
            " although it {}", does(*stage);
        /// One life: an event of an instance has an earlier time than the event before it.
        Backwards { event: Event, before: EventKind, before_ns: u64 } =
            "backwards", (OneLife, By(event)),
            " before its `{before}` at {before_ns} ns, which comes first";
        /// One life: an instance was cancelled although nothing had cut its job.
        CancelledUncut { event: Event } = "cancelled_uncut", (OneLife, By(event)),
            " although its job was not cut, nor its DAG ended";
        /// One life: a DAG went on after a fault beyond its limit (D1).
        FaultBeyondLimit { event: Event } = "fault_beyond_limit", (OneLife, By(event)),
            " although its DAG does not survive that fault";
        /// One core: an instance began on a core that still ran another instance.
        CoreNotFree { event: Event, occupant: Instance } =
            "core_not_free", (OneCore, At(event.time_ns)),
            "core {} runs {} while it still runs {}",
            event.core.0, names.subject(event), names.instance(*occupant);
    }
}

impl Violation {
    /// Returns the broken rule.
    pub const fn rule(&self) -> Rule {
        self.columns().0
    }

    /// Returns when the violation shows, in nanoseconds from the run's epoch.
    pub const fn time_ns(&self) -> u64 {
        match self.columns().1 {
            At(time_ns) => time_ns,
            By(event) => event.time_ns,
        }
    }

    /// Returns the text with the names of the model instead of numbers.
    pub fn with_names(self, task_set: &TaskSet) -> impl fmt::Display {
        fmt::from_fn(move |f| self.tell(NamedSubject(Some(task_set)), f))
    }

    fn tell(&self, names: NamedSubject<'_>, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (rule, shown) = self.columns();
        write!(f, "at {} ns, {rule}: ", self.time_ns())?;
        if let By(event) = shown {
            write!(f, "{}", names.on_its_core(event))?;
        }
        self.words(names, f)
    }
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.tell(NamedSubject(None), f)
    }
}

/// Writes a job or an instance for people, with its name if it has one.
#[derive(Clone, Copy)]
pub(super) struct NamedSubject<'a>(pub(super) Option<&'a TaskSet>);

impl NamedSubject<'_> {
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

    /// Writes the instance or the job of an event.
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
                EventKind::Start => f.write_str("starts"),
                EventKind::Suspend => f.write_str("is suspended"),
                EventKind::Resume => f.write_str("is resumed"),
                EventKind::Finish => f.write_str("finishes"),
                EventKind::Wait => f.write_str("begins to wait"),
                EventKind::Wake => f.write_str("ends its wait"),
                EventKind::Restarted => f.write_str("is replaced"),
                what => write!(f, "is {what}"),
            }
        })
    }

    /// Writes an event, and the core of its instance.
    fn on_its_core(self, event: &Event) -> impl Display {
        fmt::from_fn(move |f| {
            write!(f, "{}", self.event(event))?;
            match event.subtask {
                Some(_) => write!(f, " on core {}", event.core.0),
                None => Ok(()),
            }
        })
    }

    pub(super) fn passed_over(self, wrong: &DispatchBreach) -> impl Display {
        fmt::from_fn(move |f| match *wrong {
            DispatchBreach::Waits {
                waiting,
                length_ns,
                blame,
                ..
            } => {
                let waiting = self.instance(waiting);
                write!(f, "{waiting} should run and waits {length_ns} ns while ")?;
                match blame {
                    DispatchFault::Runs(running, core) => {
                        write!(f, "core {} runs {}", core.0, self.instance(running))
                    }
                    DispatchFault::Idle(Some(core)) => write!(f, "core {} is idle", core.0),
                    DispatchFault::Idle(None) => f.write_str("a core is idle"),
                }
            }
            DispatchBreach::OutOfTurn {
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
const fn shown_ns(wrong: &DispatchBreach) -> u64 {
    match *wrong {
        DispatchBreach::Waits { since_ns, .. } => since_ns,
        DispatchBreach::OutOfTurn { at_ns, .. } => at_ns,
    }
}

/// Returns the words for the relation of an awaited instance to an event's job, and for when and
/// where the awaited instance is over.
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

/// Returns the words for an instance that is over too late, or not over.
pub(super) fn over(over_ns: Option<u64>) -> impl Display {
    fmt::from_fn(move |f| match over_ns {
        Some(over_ns) => write!(f, "over only at {over_ns} ns"),
        None => f.write_str("not over"),
    })
}

/// Returns the words for an instance at a stage.
pub(super) fn does(stage: DispatchState) -> impl Display {
    fmt::from_fn(move |f| match stage {
        DispatchState::Absent => f.write_str("never was ready"),
        DispatchState::Ready => f.write_str("is ready and has not started"),
        DispatchState::Running(core) => write!(f, "runs on core {}", core.0),
        DispatchState::Suspended => f.write_str("is suspended"),
        DispatchState::Waiting => f.write_str("waits"),
        DispatchState::Over => f.write_str("is over already"),
    })
}
