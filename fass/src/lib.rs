//! Function-as-Subtask: DAG tasks written as plain functions.
//!
//! The API of the paper "Function-as-Subtask API Replacing Publish/Subscribe
//! for OS-Native DAG Scheduling". An app states *functions* and the *topics*
//! between them; it has no way to publish in mid-function, to match messages,
//! or to wake anybody. What remains is a DAG task in the sense of real-time
//! theory, and the scheduler may take it for one.
//!
//! # Words
//!
//! A *DAG* (or task) is released periodically; each release is a *job*, counted
//! from 0. A *subtask* is a function in the DAG: its argument tuple is what it
//! reads, its result tuple what it writes, one *topic* for each element. One
//! execution of a subtask, for one job, is an *instance*. A *source* reads
//! nothing and is started by the release, a *sink* writes nothing. `docs/glossary.md` has
//! all words.
//!
//! # A first DAG
//!
//! ```
//! use core::time::Duration;
//! use fass::{SubtaskAttributes, create_dag, finish_create_dags};
//! use virtual_time::VirtualTime;
//!
//! let machine = VirtualTime::new().cores(2); // on bare metal: the kernel
//!
//! let dag = create_dag();
//! dag.name("vision").jobs(3);
//! let mut frame = 0;
//! dag.register_periodic_subtask(
//!     move || {
//!         frame += 1;
//!         (frame,)
//!     },
//!     ["frame"],
//!     Duration::from_millis(25),
//!     SubtaskAttributes::named("camera"),
//! );
//! dag.register_subtask(
//!     |(frame,): (i32,)| (frame * 10,),
//!     ["frame"],
//!     ["edges"],
//!     SubtaskAttributes::named("detect edges"),
//! );
//! dag.register_subtask(
//!     |(frame,): (i32,)| (frame * 100,),
//!     ["frame"],
//!     ["colours"],
//!     SubtaskAttributes::named("detect colours"),
//! );
//! dag.register_sink_subtask(
//!     |(edges, colours): (i32, i32)| assert_eq!(edges * 10, colours), // always of one job
//!     ["edges", "colours"],
//!     Duration::from_millis(25),
//!     SubtaskAttributes::named("fuse"),
//! );
//! finish_create_dags(&[dag]).unwrap();
//!
//! let report = machine.run();
//! assert_eq!(report.jobs.len(), 3);
//! ```
//!
//! # What is guaranteed
//!
//! - A function runs when all values of its job have arrived, and gets exactly
//!   those: every value carries its job's number and is found by it.
//! - Nothing a function returns is seen before it has returned, and then all of
//!   it at once. Sending never waits.
//! - What functions share otherwise is stated and typed: a [`State`] within a DAG, a
//!   [`Latest`] value between DAGs, a [`Signal`] that releases one. The commit turns
//!   it into precedence, bounded staleness, or a minimum distance of releases.
//! - What a function may change of the run is stated, too: which DAGs rest ([`Switch`]), and
//!   when it ends ([`Shutdown`]).
//! - What comes from outside and goes there while DAGs run passes a [`Wire`], or is a
//!   [`Parameter`].
//! - After the commit the crate allocates nothing and takes no lock. Edges do no
//!   locked read-modify-write; states and latest values do one or two a use. (What
//!   functions and their messages' `clone` do is theirs.)
//! - [`finish_create_dags`] reports everything that is wrong at once. Where
//!   WCETs are given, it also says by when each DAG's jobs are complete, or that
//!   it cannot prove it ([`Commit::answers`]).
//!
//! # What is not
//!
//! - What functions share behind the scheduler's back (a mutex, a static) is
//!   not in the model; time waited there is execution time.
//! - A function that never returns holds its core forever.
//!
//! # How it is built
//!
//! Top to bottom: [`Dag`] takes registrations; the commit verifies them with
//! `sched-dag` and makes of each function a [`SubtaskCode`], one future that is polled
//! once for each instance; the [`Platform`] gets the [`Plan`] and runs bodies
//! when its scheduler says so. Values travel in rings that have a slot for each
//! job that may be in flight. The crate names no kernel and needs only `alloc`;
//! its `unsafe` is in `run/cell/mod.rs`.
//!
//! `docs/paper-map.md` relates the paper's figures 3 and 4 to this code.
#![cfg_attr(not(test), no_std)]

extern crate alloc;

mod api;
mod commit;
mod draft;
pub mod edge;
mod platform;
mod run;

pub use api::dag::{Dag, create_dag};
pub use api::latest::{Latest, LatestUse, Sample};
pub use api::lifecycle::{
    Mode, ModeSwitch, ModeUse, Modes, Shutdown, ShutdownUse, Switch, SwitchUse, shutting_down,
};
pub use api::parameter::{Parameter, ParameterError, ParameterUse, ParameterValue, Tunable};
pub use api::signal::{Raiser, Signal, SignalUse};
pub use api::state::{State, StateRead, StateUpdate, StateValue};
pub use api::subtask::{Subtask, UntypedSubtask};
pub use api::topics::Topics;
pub use api::uses::{ResettableUses, SubtaskBuilder, Uses};
pub use api::wire::{Packet, ReceiveUse, Received, SendUse, Sender, Wire, WireCounts, WireOptions};
pub use commit::answer::{ClusterPlacement, Commit, DagAnswer, EndToEnd, SinkAnswer, Verdict};
pub use commit::{assign_clusters, finish_create_dags, finish_create_dags_with};
pub use draft::SubtaskAttributes;
pub use draft::fault::{CommitError, Fault, UnprovenDag};
pub use edge::latest::LatestJobs;
#[doc(hidden)]
pub use platform::say;
pub use platform::{
    AlreadyInstalled, Clock, LaunchError, Occupation, Platform, RunConfig, execute_for, install,
    now_ns, set_clock,
};
pub use recording::Channel;
pub use run::cell::SetOnce;
pub use run::latest::Staleness;
pub use run::line::RecordedValue;
pub use run::log;
pub use run::message::{Message, MessageType, Unique};
pub use run::plan::{Plan, ReplacementCode, SubtaskCode, SubtaskRunner};
pub use run::topic::{Ports, Publisher, Subscriber};
pub use run::tuple::{MulRecv, MulSend, Publishers, Subscribers, VecToPubs, VecToSubs};
pub use run::wire::Framing;
pub use sched_dag::analysis::{NotProvenReason, OverheadSource, Overheads, SchedulabilityTest};
pub use sched_dag::lifecycle::Request;
pub use sched_dag::wcets::{WcetFault, WcetSource};
pub use sched_dag::{
    AssignmentReason, ClusterId, ConstructionPolicy, CoreDivision, CountLimit, FaultLimit,
    OverrunPolicy, Policy, Preemption, SubtaskOrder, Warning,
};
