//! The API for building DAGs: handles of DAGs, and of the objects used by subtasks.
//!
//! Calls are only recorded in a draft. Before the commit little is checked (a call that cannot be
//! recorded panics, such as a change of a committed DAG), and nothing runs.

/// Implements `Debug` for a handle: its type, and its object's name.
macro_rules! shown_as {
    ($Handle:ident $(<$($T:ident),+>)?, |$of:ident| $what:expr) => {
        impl $(<$($T),+>)? core::fmt::Debug for $Handle $(<$($T),+>)? {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                let $of = self;
                f.debug_tuple(stringify!($Handle)).field(&$what).finish()
            }
        }
    };
}

pub(crate) mod dag;
pub(crate) mod device;
pub(crate) mod latest;
pub(crate) mod lifecycle;
pub(crate) mod lock;
pub(crate) mod parameter;
pub(crate) mod record;
pub(crate) mod replaceable;
pub(crate) mod signal;
pub(crate) mod state;
pub(crate) mod subtask;
pub(crate) mod topics;
pub(crate) mod uses;
pub(crate) mod waiting;
pub(crate) mod wall_clock;
pub(crate) mod wire;
pub(crate) mod wire_waits;
