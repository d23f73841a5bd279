//! Protocols: what stands between the datagrams of one peer and several wires.
//!
//! A wire takes the packets of a device as they are. A *protocol*, such as that of a router, has
//! messages of its own, and its datagrams carry the packets of many wires. A platform drives it: the
//! platform has the clock, the device and the lock under which all methods are called.

use alloc::boxed::Box;
use alloc::string::String;
use alloc::sync::Arc;

use super::Buffer;
use crate::shared::DeviceEnd;

/// A protocol, driven by a platform: one peer, and one datagram at a time.
///
/// Its methods are called in interrupts, so none waits, allocates or loops without a bound, but
/// [`begin`](Self::begin).
///
/// See [`Wire`](crate::shared::Wire).
pub trait Protocol: Send {
    /// Begins, before the commit: takes the devices' ends of its wires, 64 at most. Datagrams have
    /// so many bytes at most. `ready` is called when a wire has a packet to go, in the completion of
    /// the sending instance.
    ///
    /// # Errors
    ///
    /// In words, such as that a wire has a device already.
    fn begin(&mut self, most_bytes: usize, ready: fn()) -> Result<Box<[Arc<DeviceEnd>]>, String>;

    /// Takes a datagram of the peer's. Returns the wires that have got a packet, as bits by their
    /// places: the platform [announces](DeviceEnd::announce) these, outside its lock.
    fn hear(&mut self, datagram: &[u8], now_ns: u64) -> u64;

    /// Hands over the next datagram to go, if there is one. `send` reports whether it has gone, as
    /// does this; one that has not is handed over again. `send` may swap the buffer.
    fn send(&mut self, now_ns: u64, send: &mut dyn FnMut(&mut Buffer) -> bool) -> bool;

    /// Says whether the device has a link, at the start of a run and when that changes. After
    /// [`close`](Self::close) it begins anew.
    fn set_link(&mut self, is_up: bool);

    /// Ends: what is sent afterwards says goodbye to the peer.
    fn close(&mut self);

    /// Says in the log what people should know, such as that a session was lost, once. Not in an
    /// instance.
    fn tell_news(&mut self) {}

    /// Tells what it has counted, each count with its name.
    fn counts(&self, tell: &mut dyn FnMut(&'static str, u64));
}
