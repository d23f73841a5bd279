//! DAG files on the host: reading all formats, and what a run of one needs.
//!
//! The kernel reads one format, `docs/dag-file.md`. Here others become that one:
//!
//! - [`rd_gen`]: RD-Gen's YAML, by [`yaml`], with several rates split by [`rates`];
//! - [`stg`]: task graphs, from JSON;
//! - [`load()`]: whichever of them a file is, checked as the commit will check it;
//! - [`prepare()`]: what `./scripts/run --dag FILE` boots;
//! - [`batch`]: a folder of files, one boot each, in one table.
//!
//! Every message about a file begins `FILE:LINE:`, with a line of the file that was named,
//! whatever it became on the way to the guest.

pub mod batch;
mod load;
mod prepare;
pub mod rates;
pub mod rd_gen;
mod source_lines;
pub mod stg;
pub mod yaml;

pub use load::{Import, load};
pub(crate) use prepare::states_overheads;
pub use prepare::{Prepared, prepare};
