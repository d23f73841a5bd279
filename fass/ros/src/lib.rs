//! A ROS 2 node: topics as wires of typed messages, which a Zenoh router carries.
//!
//! For our purposes a *node* is what `ros2 node list` shows: a name with topics, behind one session
//! with a router, as `rmw_zenoh` has it. A *message* is a [`recordable!`](recording::recordable!)
//! struct with the name and the hash that ROS 2 has for its type: the same value goes to a recording
//! and over the wire. A [`Publication`] and a [`Subscription`] are each a
//! [wire](fass::shared::Wire), and so DAGs use them, and tests feed them, as any wire.
//!
//! # What is guaranteed
//!
//! - Nothing is allocated after the commit: messages have their bytes in themselves.
//! - No length in a datagram is believed. A payload that is no value of the type is malformed, and
//!   counted; a text or list longer than its place is never cut.
//! - What is published while there is no session is lost, and counted as unsent.
//!
//! # What is not
//!
//! UDP loses datagrams, and nothing sends them again, whatever quality of service a topic has. Plain
//! Zenoh has no authenticity: whoever can send from the router's address commands the robot.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

extern crate alloc;

mod hop;
mod message;
mod node;
mod options;
mod rmw;
mod traffic;
mod types;

pub use fass::shared::ValueSender as Publisher;
pub use hop::{ClockOffset, Hop};
pub use message::{Message, from_cdr, to_cdr};
pub use node::{Node, Publication, Subscription};
pub use options::NodeOptions;
#[doc(hidden)]
pub use recording::recordable;
pub use recording::{List, Text};
pub use rmw::is_name;
pub use types::{builtin_interfaces, geometry_msgs, nav_msgs, sensor_msgs, std_msgs};
