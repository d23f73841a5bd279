//! The running half: a body for each subtask, and the edges between bodies.
//!
//! A *body* holds a function with its ends of the topics. A *ring* is one edge, with a slot for
//! each job in flight. An *effect* is an action of a completion beyond the DAG. Nothing in here
//! knows how a DAG is built or verified, and nothing allocates after the commit.

pub(crate) mod answers;
#[allow(unsafe_code, reason = "the cells of slots, and the waker of turns")]
pub(crate) mod cell;
pub(crate) mod effect;
pub(crate) mod gate;
pub(crate) mod latest;
pub(crate) mod line;
pub(crate) mod lock_words;
pub mod log;
pub(crate) mod message;
pub(crate) mod plan;
pub(crate) mod record;
pub(crate) mod replaceable;
pub(crate) mod subtask;
pub(crate) mod topic;
pub(crate) mod tuple;
pub(crate) mod turn;
pub(crate) mod waiting;
#[allow(unsafe_code, reason = "the claim of an instance that a fault ended")]
pub(crate) mod wire;
