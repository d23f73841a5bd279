//! Protocols: the layer between the datagrams of one peer and several wires.
//!
//! A wire takes the packets of a device unchanged. A *protocol*, such as a router's, has messages
//! of its own, and its datagrams carry the packets of many wires. A platform drives the protocol:
//! the platform has the clock, the device, and the lock under which all methods are called.

use alloc::boxed::Box;
use alloc::string::String;
use alloc::sync::Arc;

use super::Buffer;
use crate::shared::DeviceEnd;

/// A protocol, driven by a platform: one peer, and one datagram at a time.
///
/// Interrupt handlers call the methods. So no method except [`begin`](Self::begin) may wait,
/// allocate or loop without a bound.
///
/// See [`Wire`](crate::shared::Wire).
pub trait Protocol: Send {
    /// Begins, before the commit: takes the device's ends of the protocol's wires, at most 64.
    /// Datagrams have at most `most_bytes` bytes. The completion of a sending instance calls
    /// `ready` when a wire has a packet to send.
    ///
    /// # Errors
    ///
    /// In words, for example if a wire has a device already.
    fn begin(&mut self, most_bytes: usize, ready: fn()) -> Result<Box<[Arc<DeviceEnd>]>, String>;

    /// Takes a datagram from the peer. Returns the wires with a new packet, as bits by their
    /// places: the platform [announces](DeviceEnd::announce) them, outside its lock.
    fn hear(&mut self, datagram: &[u8], now_ns: u64) -> u64;

    /// Passes the next outgoing datagram to `send`, if there is one. `send` may swap the buffer,
    /// and returns whether the datagram has gone; the method returns the same. A datagram that has
    /// not gone is passed again by the next call.
    fn send(&mut self, now_ns: u64, send: &mut dyn FnMut(&mut Buffer) -> bool) -> bool;

    /// Tells the protocol whether the device has a link, at the start of a run and after each
    /// change. After [`close`](Self::close) the protocol begins anew.
    fn set_link(&mut self, is_up: bool);

    /// Ends the session: later datagrams say goodbye to the peer.
    fn close(&mut self);

    /// Logs news for people once, such as the loss of a session. Not called in an instance.
    fn tell_news(&mut self) {}

    /// Calls `tell` for each of the protocol's counts, with the name of the count.
    fn counts(&self, tell: &mut dyn FnMut(&'static str, u64));
}
