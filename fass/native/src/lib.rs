//! Runs DAGs on the host's threads, job after job, as fast as they go.
//!
//! For our purposes a *worker* is a thread that is pinned to one processor and
//! stands for one core of the model. The workers run the very functions of an app
//! under the very scheduler of the kernel, on real silicon: so the scheduler can
//! be compared with libraries that run task graphs on threads. It is meant for
//! measuring, and for looking for races between functions.
//!
//! # Time
//!
//! The scheduler's clock is *not* the host's. It stands still while anything runs,
//! and jumps to the next release when nothing does: jobs follow one another back to
//! back, whatever their periods, and no clock is read on the way from a completion
//! to its successor. So no deadline is missed, and no job waits, is skipped or aborted.
//! [`fass::now_ns`] is the host's clock, for functions that measure.
//!
//! In a run that is *recorded* the scheduler's clock goes on, by 1 ns at each
//! completion: there jobs can be late, and overruns happen as their policies say.
//!
//! # Clusters
//!
//! Where the workers are divided each cluster has a scheduler of its own, a lock if it has
//! several workers, and a clock. What a cluster does from a release to a completion touches
//! nothing that another one writes: so their clocks have nothing to do with each other, and one
//! may be done before another has begun. A signal to another cluster counts when that takes it,
//! in its next step; a latest value, as soon as it is shown.
//!
//! # What is guaranteed
//!
//! - R2, R3 and R5 of the task model, by the same scheduler as everywhere else; R1 on
//!   the scheduler's clock. [`Native::run_recorded`] writes a run down and checks it.
//! - What a function has written is visible to the functions of its successors,
//!   whichever worker runs them.
//! - R5 within each cluster.
//! - Signals and latest values take effect with the completion that leaves them, before
//!   the scheduler hears of it; a signal to another cluster is never lost, and nobody waits for
//!   it to be taken; what was sent to cancelled instances is dropped.
//! - After the start nothing is allocated but by the functions themselves.
//!
//! # What is not
//!
//! - Nothing is preempted: a host's thread cannot give up a function in its middle.
//!   Each subtask is non-preemptive.
//! - The host may take a worker's processor away at any time. Workers that wait poll;
//!   after some thousand rounds they yield, in case there are fewer processors.
//! - A panic in a function ends the run with that panic. It does not end one DAG, and
//!   nothing else does: no DAG is stopped or paused.
//! - Signals come from subtasks only, not from outside.
#![forbid(unsafe_code)]

mod alone;
mod cluster;
mod execute;
mod mailbox;
mod others;
mod pin;
mod platform;
mod recorder;
mod relax;
mod report;
mod reports;
mod run;
mod start;
mod team;
mod watch;

pub use pin::{Pinning, processors};
pub use platform::Native;
pub use report::{Recorded, Report};
pub use run::{Closure, Setting, run, run_recorded};
pub use start::worker;
