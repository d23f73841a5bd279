//! The DAG task model, its verification at commit, and its scheduler.
//!
//! # Words
//!
//! A *DAG* is a task: *subtasks*, and *precedence edges* between them without a cycle. A subtask
//! without predecessor is a *source*, a subtask without successor a *sink*. Every *period* T, from
//! an *offset* O on, the DAG releases a *job*: job k at its *nominal release time* r = O + kT. Job
//! k shall be complete at its *absolute deadline* r + D, where the *relative deadline* D may be
//! smaller than, equal to, or larger than T. Each sink may have a relative deadline of its own,
//! D_s <= D. The deadline of a subtask is the least D_s of the sinks reachable from the subtask; a
//! sink reaches itself. An *instance* is the part of one job done by one subtask: one execution of
//! the subtask's function.
//!
//! An instance is *ready* when it lacks only a core. A *dispatch* gives cores to ready instances:
//! it *starts* them, or *resumes* instances that were *preempted*. An instance *finishes* when its
//! function has returned, and a job is *complete* when all its instances have finished. From its
//! release until its last instance has ended, finished or not, the job is *in flight*.
//! `docs/glossary.md` lists the project's own words.
//!
//! # The rules
//!
//! The scenarios of each rule bear its number, in `tests/scenarios/rules.txt`.
//!
//! - **R1, release.** No instance of job k runs before r. The release times of a periodic DAG are
//!   always on the nominal grid, however late the driver or earlier jobs are.
//! - **R2, join.** An instance is ready exactly when its job is released, every predecessor in the
//!   same job has finished, and the same subtask's instance in the job released before has
//!   finished, failed or been cancelled. So a subtask does its jobs in sequence, while jobs of one
//!   DAG may overlap as in a pipeline. Nothing else delays the instance: no time passes between the
//!   last predecessor's finish and readiness.
//! - **R3, completion boundary.** All outgoing edges of an instance are released at a single
//!   instant, when the instance finishes. Nothing that happens within a function releases an edge.
//! - **R4, job completion.** A job finishes when its last sink does. The job meets its deadlines if
//!   each sink s finishes at or before r + D_s. A miss is noticed when the deadline has passed, not
//!   when the job ends.
//! - **R5, dispatch.** With preemption, at every instant the instances with the smallest keys run,
//!   as many as there are cores. An instance of a non-preemptive subtask, once started, keeps its
//!   core; without preemption, every started instance does. The key under static priority is
//!   (priority, DAG, job, subtask), where the smaller number is the higher priority. Under EDF the
//!   key is (absolute deadline, DAG, job, subtask), with the deadline of the subtask. An instance
//!   has the same key in every comparison. No core idles while an instance is ready. At each
//!   instant all completions come first, then all releases, then one dispatch.
//!
//! A core may have a list from a *table*: an order of subtasks over a common period of their DAGs.
//! The core must keep to its list. All other instances share the remaining time of the cores, as R5
//! says: in each cluster by itself, where a commit divides the cores, and in each group of cores,
//! where DAGs state affinities. Rules T1 to T4 are in `table.rs`, their scenarios in
//! `tests/scenarios/tables.txt`.
//!
//! A subtask may *wait* between *segments* of its function. The instance then holds no core, and is
//! not eligible until an answer arrives or the limit of the wait is reached. Rules W1 to W7 are in
//! `scheduler/waits.rs`, their scenarios in `tests/scenarios/waits.txt`.
//!
//! The jobs of a *sporadic* DAG are released by signals instead of the clock, at least T apart.
//! Rules S1 to S4 are in `scheduler/signals.rs`, their scenarios in `tests/scenarios/sharing.txt`.
//! From its release on, a sporadic job is like any other job.
//!
//! When a release is due and *blocked*, mostly because the DAG has its maximum number of jobs in
//! flight, the DAG's [`OverrunPolicy`] decides. The scenarios are in `tests/scenarios/overrun.txt`.
//!
//! A DAG can be *ended* early, by an instance that [fails](Moment::fail) or by a
//! [request](lifecycle::Request::End). An ended DAG starts nothing any more; the scheduler goes on
//! with the other DAGs. Rules E1 to E8 are in `scheduler/phase.rs`, their scenarios in
//! `tests/scenarios/ending.txt`. Rules D1 to D7, for faults that cost only a job, are in
//! `scheduler/phase.rs` too, their scenarios in `tests/scenarios/faults.txt`.
//!
//! # The parts, in the order of their use
//!
//! 1. [`DagSpec`]: an app's statement of a DAG. Any part of a spec may be wrong.
//! 2. [`verify()`]: finds all faults in one pass, and makes the [`TaskSet`], which is free of
//!    faults.
//! 3. [`analysis`]: bounds on response times, if WCETs are known.
//! 4. [`Scheduler`]: the rules as a pure state machine. A driver reports events with their times,
//!    and carries out the returned [`Decision`]s: the kernel with timers and interrupts, or
//!    [`virtual_time`] on the host.
//! 5. [`journal`]: the events of a run. [`law`]: the times and statistics of a run, and the rules
//!    for checking the run. [`chains`]: how long effects across DAGs take.
//!
//! # What each user may rely on
//!
//! - *Holders of a [`TaskSet`]*: acyclic graphs in the shapes allowed by the
//!   [`ConstructionPolicy`], indices in range, no period or deadline of 0, a number of jobs in
//!   flight of at least 1, and, for each job that will be due, times that fit 64 bits.
//! - *A driver*: apart from a growing [`Journal`], the scheduler allocates nothing after
//!   [`Scheduler::new`] and [`Scheduler::hear`] (asserted in `tests/it/allocation.rs`), does not
//!   recurse, and returns the time of the next necessary call from [`Scheduler::next_event_ns`].
//! - *A platform keeping values on edges*: at most [`Dag::in_flight`] jobs of a DAG are in flight,
//!   and no two of them have the same number modulo [`Dag::in_flight`]. A released instance ends
//!   exactly once, by a completion, by a failure or by
//!   [`EventKind::Cancelled`](journal::EventKind::Cancelled).
//! - *An app's author*: schedules that, core numbers apart, depend only on the times of a driver's
//!   calls, not on their number, nor on the order of completions; with the same execution times and
//!   call times, the same schedule on every driver. Faults and requests of one instant count in
//!   their order.
//!
//! Not guaranteed: that deadlines are met (ask [`analysis`]), that execution times stay below the
//! stated WCETs, or anything about the time spent by a driver itself.
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
