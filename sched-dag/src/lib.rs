//! The DAG task model, its verification at commit, and its scheduler.
//!
//! # Words
//!
//! A *DAG* is a task: *subtasks*, and *precedence edges* between them that form
//! no cycle. A subtask without predecessor is a *source*, one without successor
//! a *sink*. Every *period* T, from an *offset* O on, the DAG releases a *job*:
//! job k at its *nominal release time* r = O + kT. Job k shall be complete at
//! its *absolute deadline* r + D, where the *relative deadline* D may be smaller
//! than, equal to, or larger than T. Each sink may have a relative deadline of its own,
//! D_s <= D; a subtask's is the least D_s of the sinks that it reaches, and a sink reaches
//! itself. An *instance* is the part of one job that
//! one subtask does: one execution of its function.
//!
//! An instance is *ready* when nothing but cores holds it back. A *dispatch*
//! gives cores to ready instances: it *starts* them, or *resumes* those that
//! were *preempted*. An instance *finishes* when its function has returned, and
//! a job is *complete* when all its instances have finished; until then, from
//! its release on, it is *in flight*. `docs/glossary.md` has our own words.
//!
//! # The rules
//!
//! Each rule has scenarios that bear its number, in `tests/scenarios/rules.txt`.
//!
//! - **R1, release.** No instance of job k runs before r. The release times are
//!   those of the nominal grid, whatever delayed the driver or the jobs before.
//! - **R2, join.** An instance is ready exactly when its job is released, every
//!   predecessor in the same job has finished, and the same subtask's instance
//!   in the job released before has finished. So a subtask does one job after
//!   the other, while jobs of one DAG may overlap as in a pipeline. Nothing else
//!   delays it; from the last predecessor's finish to being ready no time passes.
//! - **R3, completion boundary.** All outgoing edges of an instance are released
//!   at one instant, when it finishes. Nothing that happens within a function
//!   releases an edge.
//! - **R4, job completion.** A job finishes when the last of its sinks does. It
//!   meets its deadlines if each sink s finishes at or before r + D_s. A miss is
//!   noticed when the deadline has passed, not when the job ends.
//! - **R5, dispatch.** With preemption, at every instant the instances with the
//!   smallest keys run, as many as there are cores; but one of a non-preemptive
//!   subtask, once started, keeps its core, and without preemption every one
//!   does. The key under static priority is (priority, DAG, job, subtask), where
//!   the smaller number is the higher priority; under EDF it is (absolute
//!   deadline, DAG, job, subtask), the deadline being the subtask's. It is the same in every comparison. No core
//!   idles while an instance is ready. At one instant all completions come
//!   first, then all releases, then one dispatch.
//!
//! A core may have a list of a *table*: an order of subtasks over a common period of their DAGs, which
//! the core keeps to. All other instances share what is left, as R5 says. The rules T1 to T4 stand in
//! `table.rs`, their scenarios in `tests/scenarios/tables.txt`.
//!
//! A subtask may *wait*, between *segments* of its function: then its instance holds no core, and is
//! not eligible until an answer or the wait's limit comes. The rules W1 to W7 stand in
//! `scheduler/waits.rs`, their scenarios in `tests/scenarios/waits.txt`.
//!
//! A *sporadic* DAG's jobs are released by signals instead of the clock, at least
//! T apart: the rules S1 to S4 stand in `scheduler/signals.rs`, their scenarios in
//! `tests/scenarios/sharing.txt`. From its release on its job is a job like others.
//!
//! The fate of a release that finds as many jobs in flight as the DAG may
//! have is the DAG's [`OverrunPolicy`]; its scenarios are in `tests/scenarios/overrun.txt`.
//!
//! A DAG can be *ended* before its time, by an instance that [fails](Moment::fail)
//! or by a [request](lifecycle::Request::End): it starts nothing any more, and the others are
//! scheduled on. The rules E1 to E8 for that stand in `scheduler/phase.rs`,
//! their scenarios in `tests/scenarios/ending.txt`; those for a fault that costs only its job, D1 to D7,
//! in `scheduler/phase.rs` and `tests/scenarios/faults.txt`.
//!
//! # The parts, in the order of their use
//!
//! 1. [`DagSpec`]: what an app states. It may be wrong in every way.
//! 2. [`verify()`]: finds every fault at once, and makes the [`TaskSet`], which
//!    has none.
//! 3. [`analysis`]: bounds on response times, if WCETs are known.
//! 4. [`Scheduler`]: the rules as a pure state machine. A driver tells it
//!    what has happened and when, and carries its [`Decision`]s out: the
//!    kernel with timers and interrupts, or [`virtual_time`] on the host.
//! 5. [`journal`]: what happened in a run. [`law`]: its times and statistics, and the rules that it
//!    is held against. [`chains`]: how long effects take that cross DAGs.
//!
//! # What each user may rely on
//!
//! - *Holders of a [`TaskSet`]*: acyclic graphs in the shapes that the
//!   [`ConstructionPolicy`] allows, indices in range, no period or deadline of 0,
//!   a number of jobs in flight of at least 1, and, for each job that will be
//!   due, times that fit 64 bits.
//! - *A driver*: the scheduler allocates nothing after [`Scheduler::new`]
//!   (asserted in `tests/it/allocation.rs`), does not recurse, and says in
//!   [`Scheduler::next_event_ns`] when it needs to be called again.
//! - *A platform that keeps values on edges*: at most [`Dag::in_flight`] jobs of
//!   a DAG are in flight, and no two of them have the same number modulo that.
//!   An instance that was released ends exactly once, by a completion, by a
//!   failure or by [`EventKind::Cancelled`](journal::EventKind::Cancelled).
//! - *An app's author*: schedules that, core numbers apart, do not depend on the
//!   number or the order of a driver's calls, only on their times; with the same
//!   execution times, the same schedule on every driver.
//!
//! Not guaranteed: that deadlines are met (ask [`analysis`]), that execution
//! times stay below the WCETs stated, or anything about time that a driver
//! spends itself.
#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

extern crate alloc;

pub mod analysis;
pub mod chains;
pub mod engine;
mod fnv;
mod graph;
mod ids;
pub mod journal;
mod kept;
mod key;
pub mod law;
pub mod lifecycle;
mod nearest;
mod order;
pub mod placement;
mod policies;
mod policy;
mod request;
mod scheduler;
mod spec;
mod table;
mod table_times;
mod task_set;
mod topic;
mod verify;
pub mod virtual_time;
pub mod wcets;
mod worded;

pub use crate::policy::{AssignmentReason, AttemptFailure, CoreDivision, LendingAttempt};
pub use ids::{ClusterId, CoreId, DagId, Instance, ModeId, SubtaskId, Vertex};
pub use kept::Journal;
pub use key::{DagKey, SubtaskKey};
pub use nearest::{nearest, nearest_of};
pub use order::sorted_by_key;
pub use policies::{Policy, SchedulerOptions};
pub use policy::{
    Activation, FaultLimit, JobOutcome, OnFault, OverrunPolicy, Preemption, Priority,
};
pub use scheduler::{
    DagPhase, DagSnapshot, DagStatistics, Decision, DriverNotice, EventLog, HandOff, Moment,
    SKIPS_A_STEP, SKIPS_EVERY_NS, Scheduler, SchedulerQuery, TurnEnd, Unwritten,
};
pub use spec::{
    DagSpec, LatestSpec, LockUse, MOST_WAITS, STACK_BYTES, StateSpec, StateUser, SubtaskSpec,
    TopicPort, Wait,
};
pub use table::{CoreList, ENTRY_LIMIT, Table, TableEntry};
pub use task_set::{Dag, StatePrecedence, Subtask, TaskSet};
pub use topic::Topic;
pub use verify::{
    CommitOptions, ConstructionPolicy, CountLimit, DagFault, DagLabel, ListFault, MAX_ARITY,
    MOST_FAULTS, OverflowingTime, RejectedDags, SubtaskLabel, TopicSide, VerifiedDags, Warning,
    verify, write_faults,
};
