//! Values and events beyond the edges of a DAG, each stated by the subtasks that use it.
//!
//! | shared | between | made by |
//! |---|---|---|
//! | [`State`] | subtasks of a DAG, from job to job | [`Dag::state`](crate::Dag::state) |
//! | [`Latest`] value | DAGs | [`Dag::latest`](crate::Dag::latest) |
//! | [`Signal`] | a subtask or a driver, and the DAG that it releases | [`Dag::sporadic`](crate::Dag::sporadic) |
//! | [`Wire`] | DAGs and the outside: bytes in packets | [`Wire::new`] |
//! | [`Device`] | a subtask that asks and waits, and what answers | [`create_device`] |
//! | [`Parameter`] | DAGs and people who tune them | [`Parameter::new`] |
//! | [`Switch`] | a DAG and those that pause and resume it | [`Dag::switching`](crate::Dag::switching) |
//! | [`Modes`] | groups of DAGs, of which one runs | [`Modes::new`] |
//! | [`Shutdown`] | all: when the run ends | [`shutting_down`] |
//!
//! A subtask that uses one is registered by [`Dag::using`](crate::Dag::using).

pub use crate::api::device::{
    Asker, Device, DeviceDriver, DeviceUse, PendingAnswer, Ticket, TimedOut, create_device,
};
pub use crate::api::latest::{Latest, LatestUse, Sample};
pub use crate::api::lifecycle::{
    Mode, ModeSwitch, ModeUse, Modes, Shutdown, ShutdownUse, Switch, SwitchUse, shutting_down,
};
pub use crate::api::parameter::{Parameter, ParameterError, ParameterUse, ParameterValue, Tunable};
pub use crate::api::signal::{Raiser, Signal, SignalUse};
pub use crate::api::state::{State, StateRead, StateUpdate, StateValue};
pub use crate::api::uses::{ResettableUses, SubtaskBuilder, Uses};
pub use crate::api::wire::{
    Packet, ReceiveUse, Received, SendUse, Sender, Wire, WireCounts, WireOptions,
};
pub use crate::api::wire_waits::{ReadUse, WireReader, WireWriter, WriteUse};
pub use crate::run::wire::Framing;
