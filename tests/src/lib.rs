//! Support of the boot tests, above the host tool's library.
//!
//! A test describes and boots a [`Guest`], looks at its output by [`said`], boots like a PC by
//! [`stick`], in Bochs by [`bochs`], and starts a router by [`peer`]. [`markdown`] and
//! [`fault_page`] read pages for comparison with the code. [`workload`] computes the behaviour of
//! the baseline's policies by their rules. The tutorials' examples are this crate's doctests.

#![forbid(unsafe_code)]

mod altered;
pub mod bochs;
pub mod fault_page;
pub mod file;
pub mod guest;
pub mod guide;
pub mod markdown;
pub mod peer;
pub mod said;
pub mod stick;
pub mod workload;

use std::process::Command;

use tool::system;
use views::protocol::Transcript;

pub use guest::Guest;
pub use said::{Members, Said, lawful_runs};

/// Runs an app, or a DAG file, by `./scripts/run` with words, on any platform they name, and
/// returns its output.
///
/// # Panics
///
/// Panics if the run fails.
pub fn run(app: &str, words: &[&str]) -> Transcript {
    let mut command = Command::new(system::workspace().join("scripts/run"));
    // On Linux a panic's backtrace counts as its instance's time, which a budget limits.
    command.env_remove("RUST_BACKTRACE");
    let option = if app.ends_with(".dag") {
        "--dag"
    } else {
        "--app"
    };
    let output = command.args([option, app]).args(words).output();
    let output = output.expect("the command can be run");
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(
        output.status.success(),
        "{said}{}",
        String::from_utf8_lossy(&output.stderr)
    );
    Transcript::read(&said)
}

/// The guide's examples, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../../docs/guide.md")]
mod guide_examples {}

/// As above, of the page about bytes in and out.
#[cfg(doctest)]
#[doc = include_str!("../../docs/wires.md")]
mod wire_examples {}

/// As above, of the page for owners of a ROS 2 graph.
#[cfg(doctest)]
#[doc = include_str!("../../docs/from-ros-2.md")]
mod ros_examples {}

/// As above, of the page about nodes of ROS 2.
#[cfg(doctest)]
#[doc = include_str!("../../docs/ros.md")]
mod node_examples {}
