//! Wires in async functions: waiting for a packet, or for the departure of bytes.
//!
//! To an async function a wire is two [devices](super::device), whose drivers are the arrival and
//! the departure of bytes. A *read* asks for the next packet; a *write* asks when the device has
//! taken the written bytes. Each takes one of the subtask's declared waits.
//!
//! # Guarantees
//!
//! - A read ends with the oldest packet not read before, or at its limit. A packet coming later
//!   stays for the next read.
//! - Written bytes go out when the wait has begun, not before. They still go out if the limit
//!   passes first, or the instance fails after the wait has begun.
//! - A read ends at once if the packet is already there, and a write if all bytes have gone; in a
//!   replay of recorded reads or writes, after the recorded time.
//!
//! # Limits
//!
//! - Bytes without room are lost, all bytes of the write together, and the write ends at its limit.

use alloc::boxed::Box;
use alloc::format;
use alloc::sync::Arc;
use core::sync::atomic::{AtomicU32, Ordering};

use recording::Recordable;

use super::dag::Dag;
use super::device::{
    AnswerSource, Asker, Device, DeviceDriver, DeviceUse, PendingAnswer, create_device,
};
use super::uses::{Uses, sealed};
use super::waiting::TimedOut;
use super::wire::Wire;
use crate::run::cell::SharedCell;
use crate::run::wire::{SendCompletion, SharedTaker, WireInput, WireOutput};

impl Wire {
    /// Returns the declaration that an async subtask reads packets, for [`Dag::using`]: `decode`
    /// turns a packet into a value.
    ///
    /// A modem is asked for its signal, and may be slow:
    ///
    /// ```
    /// use core::time::Duration;
    /// use fass::shared::{WireReader, Wire, WireWriter};
    /// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
    /// use virtual_time::VirtualTime;
    ///
    /// let (modem, ms) = (Wire::new("modem"), Duration::from_millis);
    /// let machine = VirtualTime::new().connect(&modem);
    /// let dag = create_dag();
    /// dag.name("signal").jobs(2).period(ms(20)).relative_deadline(ms(20));
    /// let mut answers = [Ok(17), Err(fass::shared::TimedOut)].into_iter();
    /// let ask = move |(input, output): (WireReader<u8>, WireWriter)| {
    ///     let expected = answers.next();
    ///     async move {
    ///         output.write(b"signal?\n").await.expect("it is quick");
    ///         assert_eq!(Some(input.read().await), expected);
    ///     }
    /// };
    /// let parse = |line: &[u8]| str::from_utf8(line).unwrap().parse().unwrap_or(0);
    /// dag.using((modem.reading(parse), modem.writing()))
    ///     .async_source(ask)
    ///     .register(SubtaskAttributes::named("ask").wait(ms(1)).wait(ms(5)));
    /// finish_create_dags(&[dag]).unwrap();
    ///
    /// machine.arrive_at(&modem, ms(3), b"17\n"); // to the second question there is no answer
    /// let responses = machine.run().jobs.into_iter().map(|job| job.response_time_ns());
    /// assert!(responses.eq([Some(3_000_000), Some(5_000_000)]));
    /// assert_eq!(machine.sent(&modem), b"signal?\nsignal?\n");
    /// ```
    ///
    /// # Panics
    ///
    /// If another subtask receives or reads on the wire.
    #[must_use = "a use has no effect until a subtask is registered with it"]
    #[track_caller]
    pub fn reading<T>(&self, decode: fn(&[u8]) -> T) -> ReadUse<T>
    where
        T: Send + Sync + 'static,
    {
        self.claim_in();
        // Packets stay where they arrive; the device only reports that there is one.
        let (device, driver) = create_device(self.name());
        let input = Arc::clone(&self.shared.incoming);
        let taker = input.taker().map(SharedTaker::new);
        let taker = Arc::new(taker.expect("the way in is claimed once"));
        driver.answer_from(Packets {
            input,
            taker: Arc::clone(&taker),
            decode,
        });
        self.shared.on_packet.set(telling(driver));
        ReadUse(device, taker)
    }

    /// Returns the declaration that an async subtask writes, for [`Dag::using`].
    ///
    /// See [`reading`](Self::reading).
    ///
    /// # Panics
    ///
    /// If another subtask sends or writes on the wire.
    #[must_use = "a use has no effect until a subtask is registered with it"]
    #[track_caller]
    pub fn writing(&self) -> WriteUse {
        self.claim_out();
        let (device, driver) = create_device(&format!("{} out", self.name()));
        driver.answer_from(AllGone(Arc::clone(&self.shared.outgoing)));
        self.shared.on_gone.set(telling(driver));
        WriteUse(device, self.clone())
    }
}

/// Makes the callback for the place where bytes arrive or depart, called when the wait for them may
/// end. If several cores call at once, the first call does the work for all, since a driver's end
/// is for one caller at a time.
fn telling<A: Send + Sync + 'static>(driver: DeviceDriver<(), A>) -> Box<dyn Fn() + Send + Sync> {
    let (driver, asked) = (SharedCell::new(driver), AtomicU32::new(0));
    Box::new(move || {
        let mut seen = 1;
        if asked.fetch_add(seen, Ordering::AcqRel) > 0 {
            return;
        }
        while seen > 0 {
            if let Some(mut driver) = driver.change() {
                driver.tell();
            }
            seen = asked.fetch_sub(seen, Ordering::AcqRel) - seen;
        }
    })
}

/// The received packets of a wire, as a source of answers.
struct Packets<T> {
    input: Arc<WireInput>,
    taker: Arc<SharedTaker>,
    decode: fn(&[u8]) -> T,
}

impl<T: Send + Sync> AnswerSource<T> for Packets<T> {
    fn is_there(&self) -> bool {
        !self.input.is_empty()
    }

    fn take(&self) -> Option<T> {
        self.taker
            .take(|packet| (self.decode)(packet.buffer.content()))
    }
}

/// The departure of all bytes of a wire, as a source of answers.
struct AllGone(Arc<WireOutput>);

impl AnswerSource<()> for AllGone {
    fn is_there(&self) -> bool {
        self.0.is_empty()
    }

    fn take(&self) -> Option<()> {
        Some(())
    }
}

/// The declaration that an async subtask reads. Made by [`Wire::reading`].
///
/// See [`Wire::reading`].
pub struct ReadUse<T>(Device<(), T>, Arc<SharedTaker>);

/// The declaration that an async subtask writes. Made by [`Wire::writing`].
///
/// See [`Wire::reading`].
#[derive(Debug)]
pub struct WriteUse(Device<(), ()>, Wire);

/// The handle with which an async function reads packets.
///
/// See [`Wire::reading`].
#[derive(Debug)]
pub struct WireReader<T>(Asker<(), T>);

/// The handle with which an async function writes bytes.
///
/// See [`Wire::reading`].
#[derive(Debug)]
pub struct WireWriter(Asker<(), ()>, Wire);

impl<T: Recordable + Send + Sync + 'static> ReadUse<T> {
    /// Records the packets read, for a replay to take, as for a [`Device`].
    ///
    /// See [`Device::record`].
    #[must_use = "the use itself is returned"]
    pub fn record(self) -> Self {
        self.0.record();
        self
    }
}

impl WriteUse {
    /// Records the duration of writes, for a replay, as for a [`Device`]. A replay writes the bytes
    /// all the same.
    ///
    /// See [`Device::record`].
    #[must_use = "the use itself is returned"]
    pub fn record(self) -> Self {
        self.0.record();
        self
    }
}

impl<T> WireReader<T> {
    /// Waits for the next packet, or until the limit of the wait.
    ///
    /// See [`Wire::reading`].
    ///
    /// # Errors
    ///
    /// [`TimedOut`] if no packet is there at the limit. [`within`](PendingAnswer::within) shortens
    /// the limit.
    ///
    /// # Panics
    ///
    /// With a [`WaitFault`](crate::WaitFault), when polled, if the wait differs from the subtask's
    /// declared waits.
    pub fn read(&self) -> PendingAnswer<'_, (), T> {
        self.0.ask(())
    }
}

impl WireWriter {
    /// Writes bytes, and waits until the device has taken the bytes, or until the limit of the
    /// wait.
    ///
    /// See [`Wire::reading`].
    ///
    /// # Errors
    ///
    /// [`TimedOut`] if the device has not taken the bytes by then; or if there was no room. Lost
    /// bytes are counted in [`Wire::counts`].
    ///
    /// # Panics
    ///
    /// With a [`WaitFault`](crate::WaitFault), if the wait differs from the subtask's declared
    /// waits.
    pub async fn write(&self, bytes: &[u8]) -> Result<(), TimedOut> {
        self.0.check_turn().await;
        let has_room = self.1.shared.outgoing.stage(bytes);
        // Lost bytes never depart, so there is no question to ask.
        self.0.ask_if(has_room.then_some(())).await
    }
}

shown_as!(ReadUse<T>, |of| of.0);

impl<T> sealed::Sealed for ReadUse<T> {}

impl<T: Send + Sync + 'static> Uses for ReadUse<T> {
    type Borrowed<'a> = WireReader<T>;
    type Held = (Asker<(), T>, Arc<SharedTaker>);
    type Guard<'a> = &'a Asker<(), T>;

    fn hold(self, dag: &Dag, subtask: usize) -> Self::Held {
        (self.0.asking().hold(dag, subtask), self.1)
    }

    fn enter((asker, taker): &mut Self::Held) -> Self::Guard<'_> {
        taker.begin_instance();
        asker
    }

    fn borrow<'a, 'g>(guard: &'a mut Self::Guard<'g>) -> Self::Borrowed<'a> {
        WireReader(DeviceUse::borrow(guard))
    }
}

impl sealed::Sealed for WriteUse {}

impl Uses for WriteUse {
    type Borrowed<'a> = WireWriter;
    type Held = WireWriter;
    type Guard<'a> = &'a WireWriter;

    fn hold(self, dag: &Dag, subtask: usize) -> WireWriter {
        // First: the question whether the bytes have gone comes after they are on their way.
        let effect = SendCompletion(Arc::clone(&self.1.shared.outgoing));
        dag.draft.borrow_mut().act(subtask, Box::new(effect));
        WireWriter(self.0.asking().hold(dag, subtask), self.1)
    }

    fn enter(held: &mut WireWriter) -> &WireWriter {
        held.1.shared.outgoing.begin_instance();
        held
    }

    fn borrow<'a, 'g>(guard: &'a mut Self::Guard<'g>) -> Self::Borrowed<'a> {
        WireWriter(DeviceUse::borrow(&mut &guard.0), guard.1.clone())
    }
}
