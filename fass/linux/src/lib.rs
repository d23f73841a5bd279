//! Runs DAGs built with `fass` on Linux: the scheduler decides, and the kernel's classes
//! carry it out.
//!
//! For our purposes a *worker* is a thread that runs instances. Each core of the machine
//! has an *active* worker, pinned to its processor, which calls functions in place: from a
//! completion that hands its core the next instance the same thread goes on. The *release
//! thread* sleeps until the scheduler's next event. A worker whose instance loses its core
//! is *demoted* to a lower level of SCHED_FIFO, and a *spare* one takes its place.
//! `docs/linux.md` says what to set up, and who may delay what.
//!
//! Where the cores are divided all that is so for each cluster by itself: it has a scheduler, a
//! lock, a release thread that keeps to its processors, workers and a journal.
//!
//! # What is guaranteed
//!
//! - R1 to R4 of the task model, whatever Linux does to the threads: they hold by the order
//!   of what the scheduler is told. [`violations`](sched_dag::engine::Run::violations) checks them.
//! - R5 as far as Linux runs the threads that it is told to: a decision takes effect when it
//!   has switched. [`dispatch_violations`](sched_dag::engine::Run::dispatch_violations)
//!   checks it within a stated bound.
//! - From the commit on, nothing is allocated for a release, a preemption or a completion;
//!   a completion that concerns its own core makes no system call but to read clocks.
//! - No thread holds the scheduler's lock below the level of what computes.
//! - A panic in a function ends its DAG alone, in a program that unwinds, whatever its destructors
//!   do.
//! - No end of the program, however sudden, leaves anything at a raised level.
//!
//! # What is not
//!
//! - Anything about the time that Linux itself takes, interrupts included.
//! - A demoted worker runs on while its core has nothing else, so it may finish what was
//!   preempted. Were it stopped, it could keep the allocator's lock from all others.
//! - A function whose budget is exceeded is not ended, only its DAG is: its thread goes
//!   on, as a normal one, until the function returns.
//! - An instance that blocks in mid-function (reads a file, locks a mutex) leaves its core to
//!   what was demoted there, and to other programs; an async one can ask for such a call
//!   ([`blocking`](fn@blocking)), and wait. So does a non-preemptive one: what was
//!   demoted there and ends meanwhile is reported when that one has ended, or when it is wanted.
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
