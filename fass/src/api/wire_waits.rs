//! Wires that an async function waits for: for a packet, or until bytes have gone.
//!
//! To such a function a wire is two [devices](super::device), whose driver is where its bytes arrive
//! and depart. A *read* is a question for the next packet, and a *write* one for the time at which
//! the device has taken what was written. Each takes one wait of those that the subtask states.
//!
//! # What is guaranteed
//!
//! - A read ends with the oldest packet that no earlier one has got, or at its limit. What comes
//!   after that stays for the next read.
//! - What is written is on its way when its wait has begun, not before; it stays so if the limit
//!   passes first, or the instance fails after the wait.
//! - Both take no time if the packet is there, or all has gone.
//!
//! # What is not
//!
//! - Bytes that find no room are lost, all those of a write, and that ends at its limit.

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
    /// Returns the use of the async subtask that reads: `decode` says what a packet means.
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
    /// If another subtask receives on the wire, or reads.
    #[must_use = "a use has no effect until a subtask is registered with it"]
    #[track_caller]
    pub fn reading<T>(&self, decode: fn(&[u8]) -> T) -> ReadUse<T>
    where
        T: Send + Sync + 'static,
    {
        self.claim_in();
        // Packets stay where they arrive; the device only says when there is one.
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

    /// Returns the use of the async subtask that writes.
    ///
    /// See [`reading`](Self::reading).
    ///
    /// # Panics
    ///
    /// If another subtask sends on the wire, or writes.
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

/// Makes what the place where bytes arrive, or depart, does when the wait for them may end. Of several
/// cores that do so at once the first one does for all.
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

/// The packets of a wire.
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

/// Nothing of a wire that is to go.
struct AllGone(Arc<WireOutput>);

impl AnswerSource<()> for AllGone {
    fn is_there(&self) -> bool {
        self.0.is_empty()
    }

    fn take(&self) -> Option<()> {
        Some(())
    }
}

/// The use of a wire by the async subtask that reads. Made by [`Wire::reading`].
///
/// See [`Wire::reading`].
pub struct ReadUse<T>(Device<(), T>, Arc<SharedTaker>);

/// The use of a wire by the async subtask that writes. Made by [`Wire::writing`].
///
/// See [`Wire::reading`].
#[derive(Debug)]
pub struct WriteUse(Device<(), ()>, Wire);

/// The handle by which an async function reads packets.
///
/// See [`Wire::reading`].
#[derive(Debug)]
pub struct WireReader<T>(Asker<(), T>);

/// The handle by which an async function writes bytes.
///
/// See [`Wire::reading`].
#[derive(Debug)]
pub struct WireWriter(Asker<(), ()>, Wire);

impl<T: Recordable + Send + Sync + 'static> ReadUse<T> {
    /// Records what is read, and a replay takes that, as of a [`Device`].
    ///
    /// See [`Device::record`].
    #[must_use = "the use itself is returned"]
    pub fn record(self) -> Self {
        self.0.record();
        self
    }
}

impl WriteUse {
    /// Records how long writing takes, and a replay takes that, as of a [`Device`]. It writes all the
    /// same.
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
    /// [`TimedOut`] if none is there by then. With [`within`](PendingAnswer::within) that is sooner.
    ///
    /// # Panics
    ///
    /// With a [`WaitFault`](crate::WaitFault), when it is polled, if the wait is not as stated.
    pub fn read(&self) -> PendingAnswer<'_, (), T> {
        self.0.ask(())
    }
}

impl WireWriter {
    /// Writes bytes, and waits until the device has taken them, or until the limit of the wait.
    ///
    /// See [`Wire::reading`].
    ///
    /// # Errors
    ///
    /// [`TimedOut`] if it has not by then; or there was no room for them, and they are lost, which
    /// [`Wire::counts`] tells.
    ///
    /// # Panics
    ///
    /// With a [`WaitFault`](crate::WaitFault), if the wait is not as stated.
    pub async fn write(&self, bytes: &[u8]) -> Result<(), TimedOut> {
        self.0.check_turn().await;
        let has_room = self.1.shared.outgoing.stage(bytes);
        // What is lost nobody takes.
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
        // First: whether it has gone is asked when it is on its way.
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
