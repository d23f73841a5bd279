//! What the boot tests share, above the host tool's library: a [`Guest`] that a test
//! describes and boots, [`stick`] for what it boots from as a PC does, [`altered`] for other
//! processors and boards, [`bochs`], where it is not QEMU that boots it, [`markdown`] and
//! [`fault_page`] for pages that are held to their word, and the tutorials, whose examples are
//! this crate's doctests.

#![forbid(unsafe_code)]

pub mod altered;
pub mod bochs;
pub mod fault_page;
pub mod guest;
pub mod guide;
pub mod markdown;
pub mod stick;

pub use guest::Guest;

/// The guide's examples, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../../docs/guide.md")]
mod guide_examples {}

/// As above, of the page about bytes in and out.
#[cfg(doctest)]
#[doc = include_str!("../../docs/wires.md")]
mod wire_examples {}

/// As above, of the page for those who have a ROS 2 graph.
#[cfg(doctest)]
#[doc = include_str!("../../docs/from-ros-2.md")]
mod ros_examples {}
