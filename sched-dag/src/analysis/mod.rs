//! Analysis at commit: will every job meet its deadline?
//!
//! [`answer()`] gives each DAG of a commit a *bound*: no job of it ever takes
//! longer from its nominal release to its last finish, whatever the offsets,
//! with any execution times up to the WCETs. All tests here are *sufficient*:
//! a DAG without a bound is "not proven", which is not "infeasible". Refusing
//! what is not proven is the app's choice.
//!
//! # The parts
//!
//! | module | what | source |
//! |---|---|---|
//! | `task`, `graph` | length, volume, bottom levels | |
//! | `width` | largest antichain, by matching | Dilworth; Hopcroft and Karp |
//! | `cover` | the most work of disjoint chains, by a flow | Ahuja 1993 |
//! | `multi_path` | one job of a DAG at a time, alone or among others | derived here |
//! | `intra_task` | one DAG alone, by its subtasks' priorities | He 2019 |
//! | `workload`, `interference` | what other DAGs execute meanwhile | Melani 2015, extended |
//! | `set` | the equations of all DAGs, solved exactly | |
//! | `non_preemptive` | subtasks that keep their core | derived here |
//! | `one_core` | response times and demand on one core | Joseph and Pandya 1986; Baruah 1990 |
//! | `pipelined` | overlapping jobs, `R > T` | derived here |
//! | `capacity`, `bonifaci` | utilisation tests | Li 2014; Bonifaci 2013 |
//! | `federated` | dedicated cores | Li 2014; Baruah 2015 |
//! | `sinks` | sinks with deadlines of their own | derived here |
//! | `judge`, `relation`, `answer`, `overheads` | the verdict at commit | |
//! | `assign` | the commit's own clusters | Li 2014 |
//! | `fixed_order` | orders that the commit fixes | Graham 1969 |
//! | `witness` | what it takes to check the bounds | |
//!
//! A sporadic DAG counts as one of its minimum inter-arrival time. No test here
//! uses that releases lie on a grid: their papers' model is the sporadic one, and
//! the equations count the jobs that fit into a window at that distance. What is
//! *certain* to go wrong is not said of sporadic DAGs, except by a path that is
//! longer than the deadline, since their signals may stay away.
//!
//! Each module cites its paper and states its assumptions and the traps that it
//! avoids. The functions for single tests take [`Task`]s in priority order and
//! stand for themselves; [`answer()`] knows which of them apply.
//!
//! # Words
//!
//! `m` is the number of cores, `T` the period, `D` the relative deadline, `R` a
//! response-time bound, `volume` and `length` are as in [`Task`]. A DAG
//! *outranks* another where its instances win a core over the other's.
//!
//! # What is guaranteed
//!
//! - *Integers only*: 64-bit times, 128-bit products; divisions round so that
//!   the result stays a bound, and an overflow is an error or "not proven".
//! - *No recursion*, and every loop has a limit; a limit reached is "not
//!   proven" ([`Reason::Limit`]), never a guess. Time is near linear in
//!   subtasks and edges for a DAG of more than [`SUBTASK_LIMIT`] subtasks, and quadratic in the
//!   number of DAGs.
//! - *Evidence*: the property test in `tests/analysis` simulates thousands of
//!   random sets and compares each observed response time with its bound.
//!
//! # What is not
//!
//! - A WCET that is exceeded voids the bounds of every DAG.
//! - Time that the platform takes is covered as far as [`Overheads`] says.
//! - The cores must be identical and serve these DAGs only. Where they are divided, each
//!   cluster is analysed by itself.
//! - The form of overlapping jobs rests on the argument given in its module and on that
//!   evidence, not on a reviewed proof. The multi-path bound is proven in
//!   `docs/multi-path-bound.md`.

mod answer;
mod assign;
mod bursts;
mod cover;
mod federated;
mod fixed_order;
mod interference;
mod intra_task;
mod judge;
mod multi_path;
mod multi_path_sets;
mod non_preemptive;
mod one_core;
mod overheads;
mod pipelined;
mod ratio;
mod relation;
mod set;
mod task;
mod utilisation;
mod width;
mod witness;
mod workload;

pub use answer::{Answer, DagBound, NotProven, Reason, Settings, Test};
pub use assign::{NotAssigned, Unassigned, assign};
pub use cover::covers;
pub use federated::{Federation, federated};
pub use fixed_order::fix_orders;
pub use interference::Clip;
pub use intra_task::{PATH_LIMIT, intra_task};
pub use judge::answer;
pub use multi_path::multi_path;
pub use multi_path_sets::{multi_path_edf, multi_path_fp};
pub use overheads::{OverheadSource, Overheads};
pub use pipelined::Refusal;
pub use task::{Task, TaskError};
pub use utilisation::{bonifaci_dm, bonifaci_edf, gedf_capacity, grm_capacity};
pub use width::{SUBTASK_LIMIT, parallelism, width};
pub use witness::witness;
