//! Function-as-Subtask: DAG tasks written as plain functions.
//!
//! The API of the paper "Function-as-Subtask API Replacing Publish/Subscribe for OS-Native DAG
//! Scheduling". An app registers *functions* and names the *topics* between them. A function cannot
//! publish before returning, match messages, or wake anybody. An app is therefore a set of DAG
//! tasks in the sense of real-time theory, and the scheduler may treat the app as such a set.
//!
//! # Words
//!
//! A *DAG* (or task) is released periodically, or by signals; each release is a *job*, counted from
//! 0. A *subtask* is a function in the DAG: the function reads its argument tuple and writes its
//! result tuple, one *topic* for each element. One execution of a subtask, for one job, is an
//! *instance*. A *source* has no inputs and is ready at the release; a *sink* has no outputs.
//! `docs/glossary.md` lists the project's own words.
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
//! The crate root has the paper's names and everything every app needs. Values shared beyond the
//! edges are in [`shared`], a commit's answers in [`commit`], the messages of functions in
//! [`log`](mod@log). A machine installs itself through [`platform`], and records and replays
//! through [`edge`].
//!
//! # Guarantees
//!
//! - A function runs after all values of its job have arrived, and gets exactly the values of that
//!   job. Every value carries its job's number, and the reader finds the value by that number.
//! - A function's results become visible after the function has returned, all at once. Sending them
//!   never waits.
//! - Functions share other data only by declared and typed objects: a [`State`](shared::State)
//!   within a DAG, a [`Latest`](shared::Latest) value between DAGs, a [`Signal`](shared::Signal)
//!   for releasing a DAG, a [`Lock`](shared::Lock) for data outside the DAGs. The commit turns them
//!   into precedence, staleness (bounded for a periodic writer with a proven bound), a minimum
//!   distance of releases, or blocking.
//! - A function declares every influence on the run, too: pausing DAGs
//!   ([`Switch`](shared::Switch)), entering modes ([`ModeSwitch`](shared::ModeSwitch)) and ending
//!   the run ([`Shutdown`](shared::Shutdown)).
//! - While DAGs run, data from and to the outside passes a [`Wire`](shared::Wire), a
//!   [`Device`](shared::Device), a [`Parameter`](shared::Parameter) or a
//!   [`WallClock`](shared::WallClock).
//! - A function may be async and wait before returning. The subtask declares the number of waits,
//!   and a time limit for each. The function can wait for a time, a [`Device`](shared::Device) or a
//!   [`Wire`](shared::Wire), and has no core meanwhile.
//! - After the commit the crate allocates nothing and takes no lock, except the app's own
//!   [`Lock`](shared::Lock)s and, for recorded values, the lock of the platform's edge. Edges do no
//!   locked read-modify-write; states and latest values do one or two per use. (Functions and the
//!   `clone` of their messages may still allocate or lock.)
//! - [`finish_create_dags`] reports all faults of the verification at once. Given WCETs, the commit
//!   also bounds each DAG's response time, or reports the lack of a proof
//!   ([`Commit::answers`](commit::Commit::answers)).
//!
//! # Limits
//!
//! - The model does not cover data shared behind the scheduler's back (a mutex, a static); time
//!   waited there is execution time.
//! - A function that never returns needs a core forever, unless its budget ends it.
//!
//! # How the crate is built
//!
//! Top to bottom: [`Dag`] takes registrations. The commit verifies them with `sched-dag` and turns
//! each function into a [`SubtaskCode`](platform::SubtaskCode): one future, polled once per
//! instance; or, for a function with waits, one future per instance, polled once per turn. The
//! [`Platform`](platform::Platform) gets the [`Plan`](platform::Plan) and runs bodies on request of
//! its scheduler. Values travel in rings with a slot for each job that may be in flight. The crate
//! names no kernel and needs only `alloc`; its `unsafe` is in `run/cell` and `run/wire`.
//!
//! `docs/paper.md` relates the paper's figures 3 and 4 to the code.
#![cfg_attr(not(test), no_std)]

extern crate alloc;

mod api;
pub mod commit;
mod draft;
pub mod edge;
pub mod platform;
mod run;
pub mod shared {
    //! Values and events beyond the edges of a DAG, declared by every subtask with access to them.
    //!
    //! | shared | between | made by |
    //! |---|---|---|
    //! | [`State`] | subtasks of a DAG, from job to job | [`Dag::state`](crate::Dag::state) |
    //! | [`Latest`] value | DAGs | [`Dag::latest`](crate::Dag::latest) |
    //! | [`Signal`] | any code raising it, and a DAG | [`Dag::sporadic`](crate::Dag::sporadic) |
    //! | [`Wire`] | DAGs and the outside: bytes in packets | [`Wire::new`] |
    //! | [`Device`] | an asking async subtask, and a driver | [`create_device`] |
    //! | [`Lock`]ed data | subtasks without a common edge | [`Lock::new`] |
    //! | [`Parameter`] | DAGs and people who tune them | [`Parameter::new`] |
    //! | [`WallClock`] | DAGs and the world's time | [`WallClock::new`] |
    //! | [`Switch`] | subtasks and a DAG they switch | [`Dag::switching`](crate::Dag::switching) |
    //! | [`Modes`] | groups of DAGs, with one group running at a time | [`Modes::new`] |
    //! | [`Shutdown`] | all: when the run ends | [`shutting_down`] |
    //!
    //! [`Dag::using`](crate::Dag::using) registers a subtask with access to such an object.

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
