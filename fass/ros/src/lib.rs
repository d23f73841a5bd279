//! A ROS 2 node: topics as wires of typed messages, carried by a Zenoh router.
//!
//! For our purposes a *node* is an entry of `ros2 node list`: a name with topics, behind one
//! session with a router, as in `rmw_zenoh`. A *message* is a
//! [`recordable!`](recording::recordable!) struct with the name and the hash of its ROS 2 type: the
//! same value goes into a recording and over the wire. A [`Publication`] and a [`Subscription`] are
//! each a [wire](fass::shared::Wire), so DAGs use them, and tests feed them, like any wire.
//!
//! # Guarantees
//!
//! - Nothing is allocated after the commit: messages store their bytes inline.
//! - No length in a datagram is trusted. A payload that does not fit the type is malformed, and
//!   counted; a text or list longer than its place is never cut.
//! - Messages published without a session are lost, and counted as unsent.
//!
//! # Limits
//!
//! UDP loses datagrams, and nothing sends them again, whatever the topic's quality of service.
//! Plain Zenoh has no authenticity: whoever can send from the router's address commands the robot.

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
