//! What an app builds DAGs with: handles of DAGs, and of what subtasks use.
//!
//! Everything said here is noted in a draft; nothing is judged before the commit, and
//! nothing runs.

pub(crate) mod dag;
pub(crate) mod latest;
pub(crate) mod lifecycle;
pub(crate) mod parameter;
pub(crate) mod record;
pub(crate) mod replaceable;
pub(crate) mod signal;
pub(crate) mod state;
pub(crate) mod subtask;
pub(crate) mod uses;
pub(crate) mod wire;
