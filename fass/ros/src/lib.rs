//! A ROS 2 node: topics as wires of typed messages, which a Zenoh router carries.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]
