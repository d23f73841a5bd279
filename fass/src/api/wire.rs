//! Wires: how bytes come in and go out while DAGs run.
//!
//! For our purposes a *wire* is a way for packets between a device, such as a serial port or a
//! network card, and the functions of an app; a *packet* is bytes that belong together. One source
//! receives on a wire, and one subtask sends on it. Which device it is the platform is told, not the
//! DAG: so the same functions run on the machine and, with bytes that a test gives, in virtual
//! time.
//!
//! # What is guaranteed
//!
//! - An instance of the receiver is given the packets that were whole by its start and that no
//!   earlier one has taken: those since the last job, with the time at which each was whole. If
//!   the receiver is the source of a sporadic DAG, each packet raises its signal.
//! - What an instance sends goes when it is complete (R3), all of it or nothing, in the order
//!   of jobs: as one packet, unless it ends [more](Sender::end_packet). Of an instance that fails
//!   nothing goes.
//! - Nobody waits, but an async function that [reads or writes](super::wire_waits): not the device
//!   for the receiver, nor the sender for the device. Packets without room are lost, on the way out
//!   all those of an instance, and the newest: earlier ones stay. Losses are counted
//!   ([`Wire::counts`]).
//! - The decoder runs in the receiver's instance. If it panics, that is contained as if
//!   the function had.
//!
//! # What is not
//!
//! - A job of a sporadic DAG may find no packet, if one came while the job before was about to
//!   start and was taken by that.
//! - How soon a byte that was sent leaves the device is the platform's.

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

/// A way for bytes in and out of a run. Clones are handles of the same wire.
///
/// # Examples
///
/// A DAG that answers each number with its square:
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
    /// Tells the subtask that waits for a packet, or for bytes to have gone, if there is one.
    pub(super) on_packet: SetOnce<Box<dyn Fn() + Send + Sync>>,
    pub(super) on_gone: SetOnce<Box<dyn Fn() + Send + Sync>>,
    is_received: AtomicBool,
    is_sent_on: AtomicBool,
    /// Whether a platform has the device's end.
    is_connected: AtomicBool,
    /// The signal that its packets raise, if a sporadic DAG begins with them.
    signal: SetOnce<Arc<RequestTarget>>,
    link: Parameter<bool>,
}

/// Options of a wire.
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
    /// Where packets end: lines, unless stated.
    pub framing: Framing,
    /// How many bytes a packet that comes has at most, a carriage return before a line feed
    /// included: 256 unless stated. (Those of [`Framing::Fixed`] have what that says.) One that is
    /// sent may have 1,984 at least, or what the device takes if that is less.
    pub longest_bytes: usize,
    /// For how many packets there is room on the way in, and for as many on the way out: 16 unless
    /// stated, and rounded up to a power of two. Each takes its bytes, and 2 KiB at least.
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

/// Counts of a wire. Packets are counted when they are whole, bytes without those that
/// the framing adds.
///
/// See [`Wire`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WireCounts {
    /// Packets that came, and found room.
    pub packets: u64,
    /// Their bytes.
    pub bytes: u64,
    /// Packets that came and found none.
    pub lost_packets: u64,
    /// Their bytes.
    pub lost_bytes: u64,
    /// Packets that were too long, or that the decoder refused; the latter found room.
    pub malformed: u64,
    /// Bytes that complete instances have sent.
    pub sent_bytes: u64,
    /// Bytes that they have sent and that found no room.
    pub unsent_bytes: u64,
}

impl Wire {
    /// Makes a wire whose packets are lines, with a name for reports.
    pub fn new(name: &str) -> Self {
        Self::with(name, WireOptions::default())
    }

    /// Makes a wire with a name for reports.
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

    /// Returns the use of the source that receives: `decode` says what a packet means, or
    /// `None` if it is malformed, which is counted. (A replay takes what a source wrote, so it
    /// needs no bytes; a subtask with inputs cannot receive.)
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

    /// Returns the use of the subtask that sends.
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

    /// Returns the use of the subtask that sends values, each as one packet: `encode` writes a value
    /// into the packet's place, and returns how many bytes it has. If these are more than the place,
    /// the instance's packets are lost.
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
            !is_taken.swap(true, Ordering::Relaxed),
            "another subtask {does} on wire `{}`; let that one do it, or make another wire",
            self.name()
        );
    }

    /// Returns the state of its link, for a DAG to read as any [`Parameter`]: whether the cable is in,
    /// and there is an address. A serial port always has a link.
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

/// The device's end of a wire. There is one, which the platform takes as it connects the wire:
/// so a function that holds a handle takes no byte of the DAG that the wire belongs to.
///
/// ```compile_fail,E0599
/// let wire = fass::shared::Wire::new("numbers");
/// let _ = wire.depart(); // a handle is no device
/// ```
#[derive(Debug)]
pub struct DeviceEnd(Wire);

impl DeviceEnd {
    /// Takes the device's end of the wire; returns `None` while somebody has it. Dropped, it can
    /// be taken again.
    pub fn of(wire: &Wire) -> Option<Self> {
        let is_taken = wire.shared.is_connected.swap(true, Ordering::Acquire);
        (!is_taken).then(|| Self(wire.clone()))
    }

    /// Returns the wire.
    pub fn wire(&self) -> &Wire {
        &self.0
    }

    /// Takes bytes that have arrived at `now_ns`, on the clock of [`crate::now_ns`]. Returns
    /// what [`Platform::raise`](crate::platform::Platform::raise) is to be told, if a packet is whole
    /// and a sporadic DAG receives it.
    ///
    /// It may be called in an interrupt handler.
    pub fn arrive(&self, bytes: &[u8], now_ns: u64) -> Option<(u64, DagId)> {
        let is_whole = self.0.shared.incoming.arrive(bytes, now_ns);
        is_whole.then(|| self.announce()).flatten()
    }

    /// Takes a packet in a buffer, from a peer, by swapping the buffer for one of the wire's. Reports
    /// whether the packet is there, to be [announced](Self::announce). Where packets are lines, a line
    /// feed at the end is no part of the packet.
    ///
    /// See [`arrive`](Self::arrive).
    #[must_use]
    pub fn swap_in(&self, packet: &mut Buffer, from: SocketAddrV4, now_ns: u64) -> bool {
        let incoming = &self.0.shared.incoming;
        incoming.swap(packet, Some(from), now_ns)
    }

    /// Takes a packet by a copy of its bytes, and counts one that is too long or finds no room.
    ///
    /// See [`swap_in`](Self::swap_in).
    #[must_use]
    pub fn copy_in(&self, packet: &[u8], now_ns: u64) -> bool {
        self.0.shared.incoming.arrive(packet, now_ns)
    }

    /// Ends the wait for a packet, if there is one, and returns what
    /// [`Platform::raise`](crate::platform::Platform::raise) is to be told, as
    /// [`arrive`](Self::arrive) does. Under no lock of the device's: the wait may be ended at once.
    ///
    /// See [`swap_in`](Self::swap_in).
    pub fn announce(&self) -> Option<(u64, DagId)> {
        if let Some(tell) = self.0.shared.on_packet.get() {
            tell();
        }
        self.released()
    }

    /// Reports whether there is a packet to go, or the rest of a packet.
    pub fn has_bytes_to_go(&self) -> bool {
        !self.0.shared.outgoing.is_empty()
    }

    /// Begins as a device of packets, of so many bytes at most. `ready` is called when there are some
    /// to go, in the completion of the sending instance. It
    /// must not block.
    ///
    /// See [`swap_out`](Self::swap_out).
    pub fn begin_packets(&self, most_bytes: usize, ready: fn()) {
        self.0.shared.outgoing.begin_packets(most_bytes, ready);
    }

    /// Returns the DAG that packets release, once there is one.
    ///
    /// See [`announce`](Self::announce).
    #[must_use]
    pub fn released(&self) -> Option<(u64, DagId)> {
        self.0.shared.signal.get()?.get()
    }

    /// Says whether the device has a link.
    ///
    /// See [`Wire::link`].
    pub fn set_link(&self, is_up: bool) {
        // Any truth value is in the range.
        let _ = self.0.shared.link.set(is_up);
    }

    /// Hands over the oldest packet to go, and its addressee. `send` may swap the buffer, and reports
    /// whether the packet has gone, as does this. Behind that the end of the wait is
    /// [told](Self::tell_gone).
    ///
    /// See [`depart`](Self::depart).
    pub fn swap_out(&self, send: impl FnOnce(&mut Buffer, Option<SocketAddrV4>) -> bool) -> bool {
        let outgoing = &self.0.shared.outgoing;
        outgoing.take_packet(|packet| send(&mut packet.buffer, packet.peer))
    }

    /// Ends the wait until all has gone, if there is one and nothing is left to go. Under no lock of
    /// the device's.
    ///
    /// See [`swap_out`](Self::swap_out).
    pub fn tell_gone(&self) {
        let is_last = !self.has_bytes_to_go();
        if let Some(tell) = self.0.shared.on_gone.get().filter(|_| is_last) {
            tell();
        }
    }

    /// Takes the next byte that is to go, if there is one.
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
    /// Reports whether both are handles of one wire.
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.shared, &other.shared)
    }
}

shown_as!(Wire, |of| of.name());

/// The use of a wire by the subtask that receives. Made by [`Wire::receiving`].
///
/// See [`Wire`].
pub struct ReceiveUse<T> {
    wire: Wire,
    decode: fn(&[u8]) -> Option<T>,
}

/// The use of a wire by the subtask that sends. Made by [`Wire::sending`].
///
/// See [`Wire`].
#[derive(Debug)]
pub struct SendUse(Wire);

/// The use of a wire by the subtask that sends values. Made by [`Wire::sending_values`].
///
/// See [`Wire`].
#[derive(Debug)]
pub struct SendValuesUse<T>(SendUse, fn(&T, &mut [u8]) -> usize);

/// The packets that an instance is given, the oldest first. Those that it does not take stay
/// for the next one.
///
/// See [`Wire`].
pub struct Received<'a, T> {
    held: &'a mut PacketReceiver<T>,
    mark: usize,
}

/// A received packet: its value, and when it was whole.
///
/// See [`Wire`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Packet<T> {
    /// The value that the decoder has made of its bytes.
    pub value: T,
    /// When its last byte came, on the clock of [`crate::now_ns`].
    pub received_ns: u64,
    /// Whom it is from; `None` where the device knows of no peers.
    pub from: Option<SocketAddrV4>,
}

/// The handle by which a function sends: bytes, or text by [`core::fmt::Write`].
///
/// See [`Wire`].
#[derive(Debug)]
pub struct Sender<'a>(&'a Wire);

/// The handle by which a function sends values. See [`Wire::sending_values`].
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
        // Each turn takes a packet, and there are no more than up to the mark.
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
    /// Has `look` see the bytes of the next packet in their place, with the packet's time and sender:
    /// nothing is decoded, or copied. `None` if there is no more.
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

    /// Ends the packet: later bytes are another packet's. Otherwise all bytes of an instance are one
    /// packet. To a device of bytes there is no difference.
    ///
    /// See [`Sender::to`].
    pub fn end_packet(&mut self) {
        self.0.shared.outgoing.end_packet();
    }

    /// Addresses this packet, and those after. Without an address the device decides: for the stated
    /// peer, or else for the last sender.
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

/// The receiving end of a wire, which its subtask keeps.
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
            if dag.verified.is_sporadic() {
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
        // That of an instance that a fault has ended.
        held.taker.give_back();
        held
    }

    fn borrow<'a, 'g>(guard: &'a mut Self::Guard<'g>) -> Self::Borrowed<'a> {
        Received {
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
