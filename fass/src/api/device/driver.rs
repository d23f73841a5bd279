//! The driver's end of a device: takes questions, and answers them.

use alloc::boxed::Box;
use alloc::sync::Arc;
use core::sync::atomic::{AtomicU32, Ordering, fence};

use sched_dag::Instance;
use sched_dag::lifecycle::WaitId;

use super::{AnswerSource, DeviceCell, Question};
use crate::platform;

/// The driver's end of a device. Made by [`create_device`](super::create_device).
///
/// There is only one, so a device has a single driver at any time.
///
/// See [`Ticket`].
pub struct DeviceDriver<Q, A> {
    pub(super) cell: Arc<DeviceCell<Q, A>>,
    /// The number of the question taken last.
    pub(super) taken: u64,
}

/// The identity of a question, needed for answering the question.
///
/// ```
/// use core::time::Duration;
/// use fass::shared::{Asker, create_device};
/// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
/// use virtual_time::VirtualTime;
///
/// let machine = VirtualTime::new();
/// let ms = Duration::from_millis;
/// let (sonar, mut driver) = create_device::<(), u32>("sonar");
/// let dag = create_dag();
/// dag.name("depth").jobs(1).period(ms(20)).relative_deadline(ms(20));
/// let ping = |sonar: Asker<(), u32>| async move {
///     assert_eq!(sonar.ask(()).await, Ok(7));
/// };
/// let ping = dag.using(sonar.asking()).async_source(ping);
/// ping.register(SubtaskAttributes::named("ping").wait(ms(9)));
/// finish_create_dags(&[dag]).unwrap();
///
/// assert!(driver.question().is_none());
/// machine.run_for(ms(4));
/// let (ticket, ()) = driver.question().unwrap();
/// assert_eq!(ticket.job(), 0);
/// assert_eq!(driver.answer(ticket, 7), Ok(()));
/// assert_eq!(driver.answer(ticket, 8), Err(8)); // it has its answer
/// assert_eq!(machine.run().jobs[0].response_time_ns(), Some(4_000_000));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ticket {
    number: u64,
    /// The number of the plan.
    plan: u64,
    wait: WaitId,
}

impl Ticket {
    /// Returns the job of the asking instance.
    pub const fn job(&self) -> u64 {
        self.wait.instance.job
    }
}

impl<Q, A> DeviceDriver<Q, A> {
    /// Takes the question waiting for its answer. Returns `None` if there is none, if it was taken
    /// before, or if the asking end has just given it up.
    ///
    /// See [`Ticket`].
    pub fn question(&mut self) -> Option<(Ticket, Q)> {
        let number = self.cell.posted.load(Ordering::Acquire);
        if number == 0 || number == self.taken {
            return None;
        }
        let is_it = |question: &mut Question<Q>| question.number == number;
        // The other place has a question that is staged, or was given up.
        let mut places = self.cell.questions.iter();
        let found = places.find_map(|place| place.change()?.take_if(is_it))?;
        self.taken = number;
        let (target, subtask) = self.cell.asking.get()?;
        let ((plan, dag), (job, number)) = (target.get()?, found.wait);
        let (subtask, count) = (*subtask, found.number);
        let ticket = Ticket {
            number: count,
            plan,
            wait: WaitId {
                instance: Instance { dag, job, subtask },
                number,
            },
        };
        Some((ticket, found.question))
    }

    /// Answers a question, and so ends the wait for the answer.
    ///
    /// See [`Ticket`].
    ///
    /// # Errors
    ///
    /// Gives `answer` back if the question has one already, if the limit of the wait has passed, or
    /// if no instance waits for an answer any more.
    pub fn answer(&mut self, ticket: Ticket, answer: A) -> Result<(), A> {
        let (cell, number) = (&self.cell, ticket.number);
        // Until this question is posted the answer's place belongs to the asking end, whose older
        // answer may still be there.
        if cell.posted.load(Ordering::Acquire) != number {
            return Err(answer);
        }
        let Some(mut place) = cell.answer.change() else {
            return Err(answer);
        };
        // As for a question: dropping the older answer may panic, so not inside the place.
        let older = place.replace((number, answer));
        drop(place);
        drop(older);
        if self.end_wait(ticket) {
            return Ok(());
        }
        // The answer is too late, or the question was given up just now; nobody else writes to the
        // place.
        let mut place = self.cell.answer.change();
        let taken = place.as_mut().and_then(|place| place.take());
        taken.map_or(Ok(()), |(_, taken)| Err(taken))
    }

    /// Ends the wait for an answer already in its place. Reports whether an instance was waiting.
    fn end_wait(&self, ticket: Ticket) -> bool {
        let (cell, platform) = (&self.cell, platform::expect_installed());
        let now_ns = platform.now_ns();
        // Without a core the asking end learns only later that its wait has ended.
        if now_ns > cell.last_ns.load(Ordering::Relaxed) {
            return false;
        }
        if cell.answers.get().is_some_and(|answers| answers.is_open()) {
            let posted_ns = cell.posted_ns.load(Ordering::Relaxed);
            // Stored before `decide`, which hands this time to the asking end along with the
            // answer.
            let took_ns = now_ns.saturating_sub(posted_ns);
            cell.took_ns.store(took_ns, Ordering::Relaxed);
        }
        let decided = cell.decide(ticket.number);
        // Only the end deciding the question tells the scheduler, so at most once.
        if decided {
            platform.answer(ticket.plan, ticket.wait);
        }
        decided
    }

    /// Makes the asking end take its answers from `source`.
    pub(in crate::api) fn answer_from(&self, source: impl AnswerSource<A> + 'static) {
        self.cell.source.set(Box::new(source));
    }

    /// Ends a wait for an answer, if there is one, after the answer has come to its source.
    pub(in crate::api) fn tell(&mut self) {
        // Pairs with the fence at posting: either this side sees a question coming now, or the
        // asking end sees the answer.
        fence(Ordering::SeqCst);
        if let Some((ticket, _)) = self.question() {
            self.end_wait(ticket);
        }
    }

    /// Returns a word that changes with every question from now on. On a platform with threads, a
    /// driver's thread may sleep on the word.
    ///
    /// ```
    /// let (_sonar, driver) = fass::shared::create_device::<(), u32>("sonar");
    /// assert!(std::sync::Arc::ptr_eq(&driver.bell(), &driver.bell()));
    /// ```
    #[must_use]
    pub fn bell(&self) -> Arc<AtomicU32> {
        let bell = &self.cell.bell;
        let _ = bell.get().is_some() || bell.set(Arc::default());
        bell.get().cloned().unwrap_or_default()
    }

    /// Reports whether the device can still be asked.
    ///
    /// ```
    /// let (sonar, driver) = fass::shared::create_device::<(), u32>("sonar");
    /// assert!(driver.is_used());
    /// drop(sonar);
    /// assert!(!driver.is_used());
    /// ```
    pub fn is_used(&self) -> bool {
        // One of the handles is the driver's own.
        Arc::strong_count(&self.cell) > 1
    }
}

shown_as!(DeviceDriver<Q, A>, |of| of.cell.name);
