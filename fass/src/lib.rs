//! Function-as-Subtask: DAG tasks written as plain functions.
//!
//! The API of the paper "Function-as-Subtask API Replacing Publish/Subscribe
//! for OS-Native DAG Scheduling". An app states *functions* and the *topics*
//! between them; it has no way to publish in mid-function, to match messages,
//! or to wake anybody. So an app is a set of DAG tasks in the sense of
//! real-time theory, and the scheduler may take it for one.
//!
//! # Words
//!
//! A *DAG* (or task) is released periodically; each release is a *job*, counted
//! from 0. A *subtask* is a function in the DAG: its argument tuple is what it
//! reads, its result tuple what it writes, one *topic* for each element. One
//! execution of a subtask, for one job, is an *instance*. A *source* reads
//! nothing and is started by the release, a *sink* writes nothing. `docs/glossary.md` has
//! the words that are our own.
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
//! # Where things are
//!
//! The root has what every app needs, and the paper's names. The values that subtasks share beyond
//! their edges are in [`shared`], a commit's answers in [`commit`], what functions say in
//! [`log`](mod@log); a machine below offers itself by [`platform`], and records and replays by
//! [`edge`].
//!
//! # What is guaranteed
//!
//! - A function runs when all values of its job have arrived, and gets exactly
//!   those: every value carries its job's number and is found by it.
//! - Nothing a function returns is seen before it has returned, and then all of
//!   it at once. Sending never waits.
//! - What functions share otherwise is stated and typed: a [`State`](shared::State) within a DAG,
//!   a [`Latest`](shared::Latest) value between DAGs, a [`Signal`](shared::Signal) that releases
//!   one. The commit turns it into precedence, bounded staleness, or a minimum distance of
//!   releases.
//! - What a function may change of the run is stated, too: which DAGs are paused
//!   ([`Switch`](shared::Switch)), and when it ends ([`Shutdown`](shared::Shutdown)).
//! - What comes from outside and goes there while DAGs run passes a [`Wire`](shared::Wire), or is
//!   a [`Parameter`](shared::Parameter).
//! - A function may be async, and wait in its midst: as often as is stated, each time until a limit
//!   at the latest, for a time, a [`Device`](shared::Device) or a [`Wire`](shared::Wire). Meanwhile it has no core.
//! - After the commit the crate allocates nothing and takes no lock. Edges do no
//!   locked read-modify-write; states and latest values do one or two a use. (What
//!   functions and their messages' `clone` do is theirs.)
//! - [`finish_create_dags`] reports everything that is wrong at once. Where
//!   WCETs are given, it also says by when each DAG's jobs are complete, or that
//!   it cannot prove it ([`Commit::answers`](commit::Commit::answers)).
//!
//! # What is not
//!
//! - What functions share behind the scheduler's back (a mutex, a static) is
//!   not in the model; time waited there is execution time.
//! - A function that never returns holds its core forever.
//!
//! # How it is built
//!
//! Top to bottom: [`Dag`] takes registrations; the commit verifies them with `sched-dag` and makes
//! of each function a [`SubtaskCode`](platform::SubtaskCode), one future that is polled once for
//! each instance, or, of a function that waits, one for each instance, polled once a turn; the [`Platform`](platform::Platform) gets the [`Plan`](platform::Plan) and runs
//! bodies when its scheduler says so. Values travel in rings that have a slot for each job that may
//! be in flight. The crate names no kernel and needs only `alloc`; its `unsafe` is in
//! `run/cell`.
//!
//! `docs/paper.md` relates the paper's figures 3 and 4 to this code.
#![cfg_attr(not(test), no_std)]

extern crate alloc;

mod api;
pub mod commit;
mod draft;
pub mod edge;
pub mod platform;
mod run;
pub mod shared {
    //! Values and events beyond the edges of a DAG, each stated by the subtasks that use it.
    //!
    //! | shared | between | made by |
    //! |---|---|---|
    //! | [`State`] | subtasks of a DAG, from job to job | [`Dag::state`](crate::Dag::state) |
    //! | [`Latest`] value | DAGs | [`Dag::latest`](crate::Dag::latest) |
    //! | [`Signal`] | a subtask or a driver, and the DAG that it releases | [`Dag::sporadic`](crate::Dag::sporadic) |
    //! | [`Wire`] | DAGs and the outside: bytes in packets | [`Wire::new`] |
    //! | [`Device`] | a subtask that asks and waits, and what answers | [`create_device`] |
    //! | [`Lock`]ed data | what else shares no edge | [`Lock::new`] |
    //! | [`Parameter`] | DAGs and people who tune them | [`Parameter::new`] |
    //! | [`WallClock`] | DAGs and the world's time | [`WallClock::new`] |
    //! | [`Switch`] | a DAG and those that pause and resume it | [`Dag::switching`](crate::Dag::switching) |
    //! | [`Modes`] | groups of DAGs, of which one runs | [`Modes::new`] |
    //! | [`Shutdown`] | all: when the run ends | [`shutting_down`] |
    //!
    //! A subtask that uses one is registered by [`Dag::using`](crate::Dag::using).

    pub use crate::api::device::{
        Asker, Device, DeviceDriver, DeviceUse, PendingAnswer, Ticket, create_device,
    };
    pub use crate::api::latest::{Latest, LatestUse, Sample};
    pub use crate::api::lifecycle::{
        Mode, ModeSwitch, ModeUse, Modes, Shutdown, ShutdownUse, Switch, SwitchUse, shutting_down,
    };
    pub use crate::api::lock::{LONGEST_SECTION, Lock, LockUse};
    pub use crate::api::parameter::{
        Parameter, ParameterError, ParameterUse, ParameterValue, Tunable,
    };
    pub use crate::api::signal::{Raiser, Signal, SignalUse};
    pub use crate::api::state::{State, StateRead, StateUpdate, StateValue};
    pub use crate::api::uses::{ResettableUses, SubtaskBuilder, Uses};
    pub use crate::api::waiting::TimedOut;
    pub use crate::api::wall_clock::{UnixTime, WallClock, WallClockUse};
    pub use crate::api::wire::{
        DeviceEnd, Packet, ReceiveUse, Received, SendUse, SendValuesUse, Sender, ValueSender, Wire,
        WireCounts, WireOptions,
    };
    pub use crate::api::wire_waits::{ReadUse, WireReader, WireWriter, WriteUse};
    pub use crate::run::wire::Framing;
}

pub use api::dag::{Dag, create_dag};
pub use api::subtask::{Subtask, UntypedSubtask};
pub use api::topics::Topics;
pub use commit::finish::finish_create_dags;
pub use draft::SubtaskAttributes;
pub use platform::clock::{Occupation, execute_for, now_ns};
pub use run::log;
pub use run::message::{Message, MessageType, Unique};
pub use run::topic::{Ports, Publisher, Subscriber};
pub use run::tuple::{MulRecv, MulSend, Publishers, Subscribers, VecToPubs, VecToSubs};
pub use run::turn::WaitFault;
pub use run::waiting::{sleep, until};
pub use sched_dag::{FaultLimit, OverrunPolicy, Policy, Preemption};
