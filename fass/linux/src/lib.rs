//! Runs DAGs built with `fass` on Linux. The scheduler decides, and the kernel's scheduling classes
//! carry its decisions out.
//!
//! A *worker* is a thread running instances. Each core of the machine has one *active* worker,
//! pinned to the core's processor. The worker calls functions in place: when a completion hands its
//! core the next instance, the same thread goes on. The *release thread* sleeps until the
//! scheduler's next event, in case no idle worker handles the event first. When an instance loses
//! its core, its worker is *demoted* to a lower level of SCHED_FIFO or of our `sched_ext` policy,
//! and a *spare* worker takes the core over. `docs/linux.md` lists the setup steps, and says which
//! thread may delay which other.
//!
//! When the cores are divided into clusters, each cluster has its own scheduler, lock, workers,
//! journal and release thread. The release thread stays on the cluster's processors.
//!
//! # Guarantees
//!
//! - R1 to R4 of the task model hold, whatever Linux does to the threads: they depend only on the
//!   order in which the scheduler hears of events.
//!   [`violations`](sched_dag::engine::Run::violations) checks them.
//! - R5 holds as far as Linux runs the threads the scheduler wants: a decision takes effect when
//!   Linux has switched. [`dispatch_violations`](sched_dag::engine::Run::dispatch_violations)
//!   checks R5 within a stated bound.
//! - From the commit on, releases, preemptions and completions allocate nothing. A completion
//!   concerning only its own core makes no system calls except to read clocks, or to wake a
//!   sleeping sender of datagrams.
//! - No thread of a run holds the scheduler's lock below the level of the computing threads.
//! - If the program unwinds, a panic in a function ends only that function's DAG, or costs one of
//!   its jobs ([`Dag::survive_faults`](fass::Dag::survive_faults)), whatever its destructors do.
//! - However suddenly the program ends, no thread stays at a raised level.
//!
//! # Limits
//!
//! - Nothing is guaranteed about the time Linux itself takes, interrupts included.
//! - A demoted worker runs on while its core has nothing else to do, so a preempted instance may
//!   finish. If the worker were stopped, it could keep the allocator's lock from all others.
//! - When a function exceeds its budget, only its DAG is ended. The function's thread goes on, as a
//!   normal thread, until the function returns.
//! - An instance blocking in mid-function (reading a file, locking a mutex) leaves its core to
//!   workers demoted there, and to other programs. An async instance can ask
//!   [`blocking`](fn@blocking) to make such a call, and wait. A blocking non-preemptive instance
//!   leaves its core as well: if a worker demoted there finishes meanwhile, that end is reported
//!   only after the non-preemptive instance has ended, or when the scheduler wants the demoted one.
#![deny(unsafe_code)]

mod blocking;
mod budgets;
mod clock;
mod control;
mod edge;
mod level;
mod lock;
mod look_out;
mod machine;
mod office;
mod panics;
mod platform;
mod section;
mod state;
#[allow(
    unsafe_code,
    reason = "system calls that the standard library does not offer"
)]
mod sys;
mod team;
mod udp;
mod worker;

pub use blocking::{blocking, next_question};
pub use control::Control;
pub use end_signals::EndSignals;
pub use machine::{Connection, Linux, Mechanism, StartError, now_ns, own_core, processors};
pub use platform::{Counts, Run};
pub use state::Fault;
pub use team::is_of_run;
pub use udp::UdpConnection;
