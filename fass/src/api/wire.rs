//! Wires: how bytes come in and go out while DAGs run.
//!
//! Here a *wire* is a path for packets between a device, such as a serial port or a network card,
//! and the functions of an app; a *packet* is a group of bytes that belong together. At most one
//! subtask receives on a wire, a source or an async subtask, and at most one sends. Only the
//! platform knows the device behind a wire, not the DAG: so the same functions run on the machine
//! and, with bytes given by a test, in virtual time.
//!
//! # Guarantees
//!
//! - An instance of the receiver gets the packets that found room, are complete at its start and
//!   have been taken by no earlier instance, each with the time of its last byte. If the receiver
//!   is the source of a sporadic DAG, each packet raises the DAG's signal.
//! - Bytes sent by an instance go out when the instance is complete (R3), all or nothing, in the
//!   order of jobs: as one packet, unless the instance [ends](Sender::end_packet) several. A
//!   failing instance sends nothing.
//! - Nobody waits, except an async function that [reads or writes](super::wire_waits). The device
//!   does not wait for the receiver, nor the sender for the device. Packets without room are lost;
//!   on the way out, all packets of an instance. Lost packets are always the newest: earlier
//!   packets stay. Losses are counted ([`Wire::counts`]).
//! - The decoder runs in the receiver's instance. A panic of the decoder is contained like a panic
//!   of the function.
//!
//! # Limits
//!
//! - A job of a sporadic DAG may find no packet: if the job before was about to start when the
//!   packet came, it took that as well.
//! - The delay of a sent byte until it leaves the device depends on the platform.

use alloc::boxed::Box;
use alloc::format;
use alloc::string::String;
use alloc::sync::Arc;
use core::fmt;
use core::net::SocketAddrV4;
use core::sync::atomic::{AtomicBool, Ordering};

use sched_dag::DagId;

use super::dag::Dag;
use super::parameter::Parameter;
use super::uses::{OutsideInput, Uses, sealed};
use crate::draft::part::PartKind;
use crate::run::cell::SetOnce;
use crate::run::effect::RequestTarget;
use crate::run::wire::buffer::Buffer;
use crate::run::wire::{Framing, PacketTaker, SendCompletion, WireInput, WireOutput};

/// A path for bytes into and out of a run. Clones are handles of the same wire.
///
/// # Examples
///
/// A DAG answering each number with its square:
///
/// ```
/// use core::fmt::Write;
/// use core::time::Duration;
/// use fass::shared::{Received, Sender, Wire};
/// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
/// use virtual_time::VirtualTime;
///
/// fn number(line: &[u8]) -> Option<u32> {
///     str::from_utf8(line).ok()?.parse().ok() // `None`: malformed
/// }
///
/// let wire = Wire::new("numbers");
/// let ms = Duration::from_millis;
/// let dag = create_dag();
/// dag.jobs(2);
/// dag.period(ms(10))
///     .using(wire.receiving(number))
///     .source(|numbers: Received<'_, u32>| (numbers.map(|number| number.value).collect::<Vec<_>>(),))
///     .writes(&["numbers"])
///     .register(SubtaskAttributes::named("receive"));
/// dag.using(wire.sending())
///     .subtask(|mut wire: Sender<'_>, (numbers,): (Vec<u32>,)| {
///         for number in numbers {
///             writeln!(wire, "{}", number * number).unwrap();
///         }
///     })
///     .reads(&["numbers"])
///     .due(ms(10))
///     .register(SubtaskAttributes::named("answer"));
///
/// let machine = VirtualTime::new().connect(&wire);
/// finish_create_dags(&[dag]).unwrap();
/// machine.arrive_at(&wire, ms(3), b"7\nseven\n8\n");
/// machine.run();
/// assert_eq!(machine.sent(&wire), b"49\n64\n");
/// assert_eq!(wire.counts().malformed, 1);
/// ```
#[derive(Clone)]
pub struct Wire {
    pub(super) shared: Arc<WireState>,
}

pub(super) struct WireState {
    name: String,
    pub(super) incoming: Arc<WireInput>,
    pub(super) outgoing: Arc<WireOutput>,
    /// Tells the subtask waiting for a packet, or for the departure of bytes, if there is such a
    /// subtask.
    pub(super) on_packet: SetOnce<Box<dyn Fn() + Send + Sync>>,
    pub(super) on_gone: SetOnce<Box<dyn Fn() + Send + Sync>>,
    is_received: AtomicBool,
    is_sent_on: AtomicBool,
    /// Whether a platform has the device's end.
    is_connected: AtomicBool,
    /// The signal raised by packets, if the receiver is the source of a sporadic DAG.
    signal: SetOnce<Arc<RequestTarget>>,
    link: Parameter<bool>,
}

/// Options of a wire: the end of packets, their length, and the room for them.
///
/// ```
/// use fass::shared::{Framing, Wire, WireOptions};
///
/// let gps = Wire::with("gps", WireOptions { longest_bytes: 82, ..WireOptions::default() });
/// let framing = Framing::Until(0); // as COBS has it
/// let motor = Wire::with("motor", WireOptions { framing, ..WireOptions::default() });
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WireOptions {
    /// The rule for the end of packets; lines by default.
    pub framing: Framing,
    /// The greatest length of an incoming packet in bytes, including a carriage return before a
    /// line feed; 256 by default. ([`Framing::Fixed`] states its own length.) An outgoing packet
    /// may always have 1,984 bytes, or the device's limit if that is less.
    pub longest_bytes: usize,
    /// The number of packets for which the wire has room, incoming and outgoing each; 16 by
    /// default, and rounded up to a power of two. Each place takes the memory of the longest
    /// packet, and at least 2 KiB.
    pub room: usize,
}

impl Default for WireOptions {
    fn default() -> Self {
        Self {
            framing: Framing::Lines,
            longest_bytes: 256,
            room: 16,
        }
    }
}

/// Counts of a wire. A packet is counted when its last byte is there. Bytes are counted without the
/// bytes added by the framing.
///
/// See [`Wire`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WireCounts {
    /// Packets that came, and found room.
    pub packets: u64,
    /// The bytes of `packets`.
    pub bytes: u64,
    /// Packets that came, and found no room.
    pub lost_packets: u64,
    /// The bytes of `lost_packets`.
    pub lost_bytes: u64,
    /// Packets too long, or refused by the decoder; refused packets had found room.
    pub malformed: u64,
    /// Bytes sent by complete instances.
    pub sent_bytes: u64,
    /// Bytes sent by complete instances that found no room on the wire.
    pub unsent_bytes: u64,
}

impl Wire {
    /// Makes a wire whose packets are lines, with a name for reports.
    pub fn new(name: &str) -> Self {
        Self::with(name, WireOptions::default())
    }

    /// Makes a wire with options, and a name for reports.
    ///
    /// See [`WireOptions`].
    pub fn with(name: &str, options: WireOptions) -> Self {
        Self {
            shared: Arc::new(WireState {
                name: name.into(),
                incoming: Arc::new(WireInput::new(
                    options.framing,
                    options.longest_bytes,
                    options.room,
                )),
                outgoing: Arc::new(WireOutput::new(options.longest_bytes, options.room)),
                on_packet: SetOnce::new(),
                on_gone: SetOnce::new(),
                is_received: AtomicBool::new(false),
                is_sent_on: AtomicBool::new(false),
                is_connected: AtomicBool::new(false),
                signal: SetOnce::new(),
                link: Parameter::new(&format!("{name}.link"), true, false..=true),
            }),
        }
    }

    /// Returns the declaration that a source receives on the wire, for [`Dag::using`]. `decode`
    /// turns a packet into a value, or returns `None` for a malformed packet, which is counted. (In
    /// a replay the recorded values replace the source, so no bytes are needed. A subtask with
    /// inputs cannot receive.)
    ///
    /// See [`Wire`].
    ///
    /// # Panics
    ///
    /// If another subtask receives on the wire.
    #[must_use = "a use has no effect until a subtask is registered with it"]
    #[track_caller]
    pub fn receiving<T>(&self, decode: fn(&[u8]) -> Option<T>) -> ReceiveUse<T> {
        self.claim_in();
        ReceiveUse {
            wire: self.clone(),
            decode,
        }
    }

    /// Returns the declaration that a subtask sends on the wire, for [`Dag::using`].
    ///
    /// See [`Wire`].
    ///
    /// # Panics
    ///
    /// If another subtask sends on the wire.
    #[must_use = "a use has no effect until a subtask is registered with it"]
    #[track_caller]
    pub fn sending(&self) -> SendUse {
        self.claim_out();
        SendUse(self.clone())
    }

    /// Returns the declaration that a subtask sends values, each as one packet, for [`Dag::using`]:
    /// `encode` writes a value into the packet's place, and returns the length of the value in
    /// bytes. If the length is more than the place, the instance's packets are lost.
    ///
    /// ```
    /// use fass::shared::{ValueSender, Wire};
    ///
    /// fn encode(value: &u32, place: &mut [u8]) -> usize {
    ///     if let Some(place) = place.first_chunk_mut() {
    ///         *place = value.to_le_bytes();
    ///     }
    ///     4
    /// }
    /// fn square(mut out: ValueSender<'_, u32>, (number,): (u32,)) {
    ///     out.put(&(number * number));
    /// }
    /// let wire = Wire::new("squares");
    /// let dag = fass::create_dag();
    /// let sink = dag.using(wire.sending_values(encode)).subtask(square).reads(&["number"]);
    /// ```
    ///
    /// # Panics
    ///
    /// If another subtask sends on the wire.
    #[must_use = "a use has no effect until a subtask is registered with it"]
    #[track_caller]
    pub fn sending_values<T>(&self, encode: fn(&T, &mut [u8]) -> usize) -> SendValuesUse<T> {
        SendValuesUse(self.sending(), encode)
    }

    /// Claims the way in.
    #[track_caller]
    pub(super) fn claim_in(&self) {
        self.claim(&self.shared.is_received, "receives");
    }

    /// Claims the way out.
    #[track_caller]
    pub(super) fn claim_out(&self) {
        self.claim(&self.shared.is_sent_on, "sends");
    }

    #[track_caller]
    fn claim(&self, is_taken: &AtomicBool, does: &str) {
        assert!(
            // Relaxed: the flag refuses a second subtask, and hands nothing over.
            !is_taken.swap(true, Ordering::Relaxed),
            "another subtask {does} on wire `{}`; let that one do it, or make another wire",
            self.name()
        );
    }

    /// Returns the state of the wire's link, readable by a DAG like any [`Parameter`]: `true` while
    /// the cable is plugged in, and there is an address. A serial port always has a link, and so
    /// has a wire never connected.
    ///
    /// ```
    /// use fass::shared::Wire;
    ///
    /// let wire = Wire::new("commands");
    /// assert!(wire.link().value());
    /// wire.link().set(false).unwrap(); // as a test may
    /// ```
    pub fn link(&self) -> &Parameter<bool> {
        &self.shared.link
    }

    /// Returns the wire's name.
    pub fn name(&self) -> &str {
        &self.shared.name
    }

    /// Returns the counts of the wire so far.
    pub fn counts(&self) -> WireCounts {
        let WireState {
            incoming, outgoing, ..
        } = &*self.shared;
        WireCounts {
            packets: incoming.packets.get(),
            bytes: incoming.bytes.get(),
            lost_packets: incoming.lost.get(),
            lost_bytes: incoming.lost_bytes.get(),
            malformed: incoming.too_long.get() + incoming.refused.get(),
            sent_bytes: outgoing.sent.get(),
            unsent_bytes: outgoing.lost.get(),
        }
    }
}

/// The device's end of a wire. There is only one, and the platform takes it when connecting the
/// wire: so a function with a handle of the wire cannot take bytes from the DAG that owns it.
///
/// ```compile_fail,E0599
/// let wire = fass::shared::Wire::new("numbers");
/// let _ = wire.depart(); // a handle is no device
/// ```
#[derive(Debug)]
pub struct DeviceEnd(Wire);

impl DeviceEnd {
    /// Takes the device's end of the wire; returns `None` while somebody has the end. After a drop
    /// the end can be taken again.
    pub fn of(wire: &Wire) -> Option<Self> {
        let is_taken = wire.shared.is_connected.swap(true, Ordering::Acquire);
        (!is_taken).then(|| Self(wire.clone()))
    }

    /// Returns the wire.
    pub fn wire(&self) -> &Wire {
        &self.0
    }

    /// Passes to the wire the bytes that arrived at `now_ns`, on the clock of [`crate::now_ns`]. If
    /// a packet is complete and a sporadic DAG receives the packets, returns the arguments for
    /// [`Platform::raise`](crate::platform::Platform::raise).
    ///
    /// An interrupt handler may call the method.
    pub fn arrive(&self, bytes: &[u8], now_ns: u64) -> Option<(u64, DagId)> {
        let is_whole = self.0.shared.incoming.arrive(bytes, now_ns);
        is_whole.then(|| self.announce()).flatten()
    }

    /// Passes a packet from a peer to the wire, by swapping its buffer for a buffer of the wire.
    /// Returns `true` if the packet is on the wire and has to be [announced](Self::announce). Where
    /// packets are lines, a line feed at the end is no part of the packet.
    ///
    /// See [`arrive`](Self::arrive).
    #[must_use]
    pub fn swap_in(&self, packet: &mut Buffer, from: SocketAddrV4, now_ns: u64) -> bool {
        let incoming = &self.0.shared.incoming;
        incoming.swap(packet, Some(from), now_ns)
    }

    /// Passes a packet to the wire by copying its bytes. Counts a packet that is too long or finds
    /// no room.
    ///
    /// See [`swap_in`](Self::swap_in).
    #[must_use]
    pub fn copy_in(&self, packet: &[u8], now_ns: u64) -> bool {
        self.0.shared.incoming.arrive(packet, now_ns)
    }

    /// Ends a subtask's wait for a packet, if there is one, and returns the arguments for
    /// [`Platform::raise`](crate::platform::Platform::raise), like [`arrive`](Self::arrive). The
    /// caller must not hold a lock of the device, because the wait may end at once.
    ///
    /// See [`swap_in`](Self::swap_in).
    pub fn announce(&self) -> Option<(u64, DagId)> {
        if let Some(tell) = self.0.shared.on_packet.get() {
            tell();
        }
        self.released()
    }

    /// Reports whether a packet, or the rest of a packet, is waiting for departure.
    pub fn has_bytes_to_go(&self) -> bool {
        !self.0.shared.outgoing.is_empty()
    }

    /// Connects a device of packets with at most `most_bytes` bytes each. The completion of a
    /// sending instance calls `ready` when packets are to be sent. `ready` must not block.
    ///
    /// See [`swap_out`](Self::swap_out).
    pub fn begin_packets(&self, most_bytes: usize, ready: fn()) {
        self.0.shared.outgoing.begin_packets(most_bytes, ready);
    }

    /// Returns the DAG released by packets, with its plan's number, once there is one.
    ///
    /// See [`announce`](Self::announce).
    #[must_use]
    pub fn released(&self) -> Option<(u64, DagId)> {
        self.0.shared.signal.get()?.get()
    }

    /// Sets whether the device has a link.
    ///
    /// See [`Wire::link`].
    pub fn set_link(&self, is_up: bool) {
        // Any truth value is in the range.
        let _ = self.0.shared.link.set(is_up);
    }

    /// Passes the oldest outgoing packet, and its addressee, to `send`. `send` may swap the buffer,
    /// and returns whether the packet has gone; the method returns the same. Afterwards call
    /// [`tell_gone`](Self::tell_gone) to end a subtask's wait.
    ///
    /// See [`depart`](Self::depart).
    pub fn swap_out(&self, send: impl FnOnce(&mut Buffer, Option<SocketAddrV4>) -> bool) -> bool {
        let outgoing = &self.0.shared.outgoing;
        outgoing.take_packet(|packet| send(&mut packet.buffer, packet.peer))
    }

    /// Ends a subtask's wait for departure, if there is one and nothing is left to go. The caller
    /// must not hold a lock of the device.
    ///
    /// See [`swap_out`](Self::swap_out).
    pub fn tell_gone(&self) {
        let is_last = !self.has_bytes_to_go();
        if let Some(tell) = self.0.shared.on_gone.get().filter(|_| is_last) {
            tell();
        }
    }

    /// Takes the next outgoing byte, if there is one.
    #[must_use]
    pub fn depart(&self) -> Option<u8> {
        let byte = self.0.shared.outgoing.take_byte()?;
        self.tell_gone();
        Some(byte)
    }
}

impl Drop for DeviceEnd {
    fn drop(&mut self) {
        self.0.shared.is_connected.store(false, Ordering::Release);
    }
}

impl PartialEq for Wire {
    /// Reports whether both are handles of the same wire.
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.shared, &other.shared)
    }
}

shown_as!(Wire, |of| of.name());

/// The declaration that a source receives on a wire. Made by [`Wire::receiving`].
///
/// See [`Wire`].
pub struct ReceiveUse<T> {
    wire: Wire,
    decode: fn(&[u8]) -> Option<T>,
}

/// The declaration that a subtask sends on a wire. Made by [`Wire::sending`].
///
/// See [`Wire`].
#[derive(Debug)]
pub struct SendUse(Wire);

/// The declaration that a subtask sends values on a wire. Made by [`Wire::sending_values`].
///
/// See [`Wire`].
#[derive(Debug)]
pub struct SendValuesUse<T>(SendUse, fn(&T, &mut [u8]) -> usize);

/// The packets received by an instance, the oldest first. Packets not taken stay for the next
/// instance.
///
/// See [`Wire`].
pub struct Received<'a, T> {
    held: &'a mut PacketReceiver<T>,
    mark: usize,
}

/// A received packet: its value, and the time of its last byte.
///
/// See [`Wire`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Packet<T> {
    /// The value decoded from the packet's bytes.
    pub value: T,
    /// The time of the packet's last byte in nanoseconds, on the clock of [`crate::now_ns`].
    pub received_ns: u64,
    /// The sender of the packet; `None` where the device has no peers.
    pub from: Option<SocketAddrV4>,
}

/// The handle with which a function sends: bytes, or text by [`core::fmt::Write`].
///
/// See [`Wire`].
#[derive(Debug)]
pub struct Sender<'a>(&'a Wire);

/// The handle with which a function sends values. See [`Wire::sending_values`].
#[derive(Debug)]
pub struct ValueSender<'a, T>(&'a Wire, fn(&T, &mut [u8]) -> usize);

impl<T> ValueSender<'_, T> {
    /// Sends a value as one packet, when this instance is complete.
    ///
    /// See [`Wire::sending_values`].
    pub fn put(&mut self, value: &T) {
        let Self(wire, encode) = self;
        let outgoing = &wire.shared.outgoing;
        outgoing.stage_packet(|place| encode(value, place));
    }
}

impl<T> Iterator for Received<'_, T> {
    type Item = Packet<T>;

    fn next(&mut self) -> Option<Packet<T>> {
        let PacketReceiver {
            wire,
            decode,
            taker,
        } = &mut *self.held;
        // The loop ends: each pass takes a packet, and only packets up to the mark are taken.
        loop {
            let packet = taker.take(self.mark, |packet| {
                decode(packet.buffer.content()).map(|value| Packet {
                    value,
                    received_ns: packet.time_ns,
                    from: packet.peer,
                })
            });
            match packet? {
                Some(packet) => return Some(packet),
                None => wire.shared.incoming.refuse(),
            }
        }
    }
}

impl<T> Received<'_, T> {
    /// Shows `look` the bytes of the next packet in their place, with the packet's time and sender,
    /// without decoding or copying. Returns `None` if there is no packet left.
    ///
    /// ```
    /// use fass::shared::Received;
    ///
    /// fn longest(mut packets: Received<'_, ()>) -> (usize,) {
    ///     let lengths = std::iter::from_fn(|| packets.look(|bytes, _time_ns, _from| bytes.len()));
    ///     (lengths.max().unwrap_or(0),)
    /// }
    /// ```
    pub fn look<R>(
        &mut self,
        look: impl FnOnce(&[u8], u64, Option<SocketAddrV4>) -> R,
    ) -> Option<R> {
        (self.held.taker).take(self.mark, |packet| {
            look(packet.buffer.content(), packet.time_ns, packet.peer)
        })
    }
}

impl Sender<'_> {
    /// Sends bytes, when this instance is complete.
    ///
    /// See [`Wire`].
    pub fn send(&mut self, bytes: &[u8]) {
        self.0.shared.outgoing.stage(bytes);
    }

    /// Ends the packet: later bytes belong to another packet. Otherwise all bytes of an instance
    /// are one packet. A device of bytes sees no difference.
    ///
    /// See [`Sender::to`].
    pub fn end_packet(&mut self) {
        self.0.shared.outgoing.end_packet();
    }

    /// Sets the addressee of this packet and later packets. Without an addressee the device
    /// decides: the stated peer, or else the last sender.
    ///
    /// ```
    /// use fass::shared::{Packet, Sender};
    ///
    /// /// Answers each question, to the one who has asked.
    /// fn answer(mut wire: Sender<'_>, (questions,): (Vec<Packet<u8>>,)) {
    ///     for question in questions {
    ///         wire.to(question.from);
    ///         wire.send(&[question.value * 2]);
    ///         wire.end_packet();
    ///     }
    /// }
    /// ```
    pub fn to(&mut self, peer: Option<SocketAddrV4>) {
        self.0.shared.outgoing.address(peer);
    }
}

impl fmt::Write for Sender<'_> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.send(text.as_bytes());
        Ok(())
    }
}

/// The receiving end of a wire, kept by its subtask.
///
/// See [`Wire`].
#[doc(hidden)]
pub struct PacketReceiver<T> {
    wire: Wire,
    decode: fn(&[u8]) -> Option<T>,
    taker: PacketTaker,
}

impl<T> sealed::Sealed for ReceiveUse<T> {}

impl<T: 'static> Uses for ReceiveUse<T> {
    type Borrowed<'a> = Received<'a, T>;
    type Held = PacketReceiver<T>;
    type Guard<'a> = &'a mut PacketReceiver<T>;

    fn hold(self, dag: &Dag, subtask: usize) -> Self::Held {
        let takes = format!("receives on wire `{}`", self.wire.name());
        let mut draft = dag.draft.borrow_mut();
        draft.add(PartKind::Input, OutsideInput { subtask, takes });
        let shared = Arc::clone(&self.wire.shared);
        draft.tie(move |dag| {
            // Packets for a periodic DAG wait for the job released by the clock.
            if dag.verified.is_sporadic() {
                // Cannot fail: one subtask receives on a wire, and its DAG is committed once.
                let _ = shared.signal.set(Arc::clone(dag.target));
            }
        });
        drop(draft);
        let taker = self.wire.shared.incoming.taker();
        PacketReceiver {
            taker: taker.expect("the way in is claimed once"),
            wire: self.wire,
            decode: self.decode,
        }
    }

    fn enter(held: &mut Self::Held) -> Self::Guard<'_> {
        // A fault may have ended the last instance with a packet still taken.
        held.taker.give_back();
        held
    }

    fn borrow<'a, 'g>(guard: &'a mut Self::Guard<'g>) -> Self::Borrowed<'a> {
        Received {
            // A fixed mark: a device sending faster than the function reads cannot prolong the
            // instance.
            mark: guard.taker.mark(),
            held: guard,
        }
    }
}

impl sealed::Sealed for SendUse {}

impl Uses for SendUse {
    type Borrowed<'a> = Sender<'a>;
    type Held = Wire;
    type Guard<'a> = &'a Wire;

    fn hold(self, dag: &Dag, subtask: usize) -> Self::Held {
        let effect = SendCompletion(Arc::clone(&self.0.shared.outgoing));
        dag.draft.borrow_mut().act(subtask, Box::new(effect));
        self.0
    }

    fn enter(held: &mut Self::Held) -> Self::Guard<'_> {
        held.shared.outgoing.begin_instance();
        held
    }

    fn borrow<'a, 'g>(guard: &'a mut Self::Guard<'g>) -> Self::Borrowed<'a> {
        Sender(guard)
    }
}

impl<T> sealed::Sealed for SendValuesUse<T> {}

impl<T: 'static> Uses for SendValuesUse<T> {
    type Borrowed<'a> = ValueSender<'a, T>;
    type Held = (Wire, fn(&T, &mut [u8]) -> usize);
    type Guard<'a> = (&'a Wire, fn(&T, &mut [u8]) -> usize);

    fn hold(self, dag: &Dag, subtask: usize) -> Self::Held {
        (self.0.hold(dag, subtask), self.1)
    }

    fn enter((wire, encode): &mut Self::Held) -> Self::Guard<'_> {
        (SendUse::enter(wire), *encode)
    }

    fn borrow<'a, 'g>((wire, encode): &'a mut Self::Guard<'g>) -> Self::Borrowed<'a> {
        ValueSender(wire, *encode)
    }
}
