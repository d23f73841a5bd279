//! The platform as seen by `fass`: one for the program, one machine a thread.
//!
//! The installed platform itself has no state. It passes every request on to the calling thread's
//! current machine.

use std::cell::{Cell, RefCell};
use std::net::SocketAddrV4;
use std::rc::{Rc, Weak};
use std::sync::OnceLock;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};
use std::thread;
use std::time::Duration;

use fass::Occupation;
use fass::edge::{Begin, BootRecord, RecordedValue};
use fass::log::{Level, LogLine, set_level};
use fass::platform::{Clock, LaunchError, LockWords, Plan, Platform, RunConfig, at_edge};
use fass::shared::{DeviceDriver, Wire};
use recording::{Channel, Entry, EntryKind};
use sched_dag::lifecycle::{Request, WaitId};
use sched_dag::{DagId, Instance, JobOutcome};

use crate::job::JobShown;
use crate::machine::{Arrival, Machine, RunError, SentPacket, Session};
use crate::report::Report;
use crate::{VirtualTime, nanoseconds};

thread_local! {
    static CURRENT: RefCell<Weak<Machine>> = const { RefCell::new(Weak::new()) };
    static IS_IN_SECTION: Cell<bool> = const { Cell::new(false) };
}

/// A lock section; a panic ends the section, too.
struct Held<'l>(&'l LockWords);

impl Drop for Held<'_> {
    fn drop(&mut self) {
        self.0.state.store(0, Release);
        IS_IN_SECTION.set(false);
    }
}

/// The clock of functions. Its answers are recorded.
static TOLD: Clock = || {
    let machine = expect_current();
    let running = machine.running.get();
    machine.edge.answer_ns(running, machine.now_ns.get())
};

/// Makes a machine and installs it as this thread's current machine.
pub(crate) fn make_current() -> Rc<Machine> {
    static IS_OURS: OnceLock<bool> = OnceLock::new();
    assert!(
        IS_OURS.get_or_init(|| fass::platform::install(&HostPlatform).is_ok()),
        "another platform is installed; virtual time must be the program's only platform"
    );
    set_level(Some(Level::Debug));
    let machine = Rc::new(Machine::default());
    CURRENT.set(Rc::downgrade(&machine));
    machine
}

impl VirtualTime {
    /// Returns the record of everything run since the commit: the model, the values of the topics
    /// named by [`Dag::record`](fass::Dag::record), signals, skipped or cut jobs, and the events of
    /// the schedule with their times; after [`keep_latest`](Self::keep_latest), only the inputs of
    /// the last jobs. Empty if nothing was committed, or a run has failed.
    ///
    /// See [`Dag::record`](fass::Dag::record).
    pub fn recording(&self) -> Vec<u8> {
        let session = self.machine.session.borrow();
        session.as_ref().map_or(Vec::new(), Session::recording)
    }

    /// Returns the inputs and outputs of a job's subtasks.
    pub(crate) fn show(&self, report: &Report, dag: DagId, job: u64) -> JobShown {
        let edge = &self.machine.edge;
        let mut shown = JobShown {
            unmet_fault: edge.of_replay(|replay| replay.unmet_fault(Some((dag, job)))),
            ..JobShown::new(report, &self.recording(), dag, job)
        };
        // A replay goes on behind a fault, as the fault's cuts are recorded; the job was lost.
        let is_lost = self.has_failed(dag, job) && shown.unmet_fault.is_none();
        if let Some(times) = shown.times.as_mut().filter(|_| is_lost) {
            times.times.outcome = Some(JobOutcome::Failed);
        }
        shown
    }

    /// Reports whether a job has failed in the replayed run.
    pub(crate) fn has_failed(&self, dag: DagId, job: u64) -> bool {
        let is_it = |entry: Entry<'_>| {
            entry.what == EntryKind::Fault && (entry.dag.into(), entry.job) == (dag.0, job)
        };
        let edge = &self.machine.edge;
        edge.of_replay(|replay| replay.events().any(is_it))
    }

    /// Runs to the end, for a duration, or until a job has ended. Meanwhile this machine is the
    /// thread's current machine, even if another was made later.
    pub(crate) fn run_until(
        &self,
        duration: Option<Duration>,
        until: Option<(&str, u64)>,
    ) -> Result<Report, RunError> {
        self.with_session(|session| session.run(duration, until))
    }

    /// Runs a part of the session.
    pub(crate) fn with_session<R>(
        &self,
        run: impl FnOnce(&mut Session) -> Result<R, RunError>,
    ) -> Result<R, RunError> {
        let kept = &self.machine.session;
        let mut session = kept.take().ok_or(RunError::NothingToRun)?;
        let newest = CURRENT.replace(Rc::downgrade(&self.machine));
        let result = run(&mut session);
        CURRENT.set(newest);
        // A failed session is not put back: its functions cannot continue.
        if let Ok(_) | Err(RunError::Endless { .. } | RunError::NoSuchDag { .. }) = result {
            kept.replace(Some(session));
        }
        result
    }

    /// Connects a wire: [`sent`](Self::sent) returns the bytes sent on the wire.
    ///
    /// See [`Wire`].
    ///
    /// # Panics
    ///
    /// If the wire has a device already; likewise in [`arrive_at`](Self::arrive_at).
    pub fn connect(self, wire: &Wire) -> Self {
        let place = self.machine.place_of(wire);
        self.machine.wires.borrow_mut()[place].1 = Some(Vec::new());
        self
    }

    /// Lets bytes arrive on a wire at a time of the run, counted from the start of scheduling; at
    /// once if the time has passed.
    ///
    /// See [`Wire`].
    pub fn arrive_at(&self, wire: &Wire, time: Duration, bytes: &[u8]) {
        self.keep_bytes(wire, time, bytes, None);
    }

    /// Lets a peer's packet arrive, as from a network; otherwise like
    /// [`arrive_at`](Self::arrive_at).
    ///
    /// ```
    /// use core::time::Duration;
    /// use fass::shared::{Framing, Packet, Received, Sender, Wire, WireOptions};
    /// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
    /// use virtual_time::VirtualTime;
    ///
    /// let (ms, named) = (Duration::from_millis, SubtaskAttributes::named);
    /// let wire = Wire::with("ping", WireOptions { framing: Framing::Chunks, ..WireOptions::default() });
    /// let machine = VirtualTime::new().connect(&wire);
    /// let dag = create_dag();
    /// dag.relative_deadline(ms(5)).sporadic(ms(10));
    /// dag.using(wire.receiving(|bytes| bytes.first().copied()))
    ///     .source(|all: Received<'_, u8>| (all.collect::<Vec<_>>(),))
    ///     .writes(&["numbers"])
    ///     .register(named("hear"));
    /// let answer = |mut wire: Sender<'_>, (numbers,): (Vec<Packet<u8>>,)| {
    ///     for number in numbers {
    ///         wire.to(number.from);
    ///         wire.send(&[number.value + 1]);
    ///         wire.end_packet();
    ///     }
    /// };
    /// dag.using(wire.sending()).subtask(answer).reads(&["numbers"]).register(named("answer"));
    /// finish_create_dags(&[dag]).unwrap();
    ///
    /// let [one, two] = ["10.0.0.1:7", "10.0.0.2:7"].map(|peer| peer.parse().unwrap());
    /// machine.packet_at(&wire, ms(1), one, &[1]);
    /// machine.packet_at(&wire, ms(1), two, &[2]);
    /// machine.run();
    /// assert_eq!(machine.sent_packets(&wire), [(vec![2], Some(one)), (vec![3], Some(two))]);
    /// ```
    pub fn packet_at(&self, wire: &Wire, time: Duration, from: SocketAddrV4, bytes: &[u8]) {
        self.keep_bytes(wire, time, bytes, Some(from));
    }

    fn keep_bytes(&self, wire: &Wire, time: Duration, bytes: &[u8], from: Option<SocketAddrV4>) {
        let at_ns = nanoseconds(time).max(self.machine.now_ns.get());
        let place = self.machine.place_of(wire);
        let end = Rc::clone(&self.machine.wires.borrow()[place].0);
        self.machine
            .keep(at_ns, Arrival::Bytes(end, bytes.to_vec(), from));
    }

    /// Lets a device answer its questions. `answer` gets the question and the asking job, and
    /// returns the answers with their delays after the question. A device that never answers
    /// returns none; among several answers to one question, the first to come counts.
    ///
    /// See [`Device`](fass::shared::Device).
    pub fn answers<Q, A, Answers>(
        &self,
        driver: DeviceDriver<Q, A>,
        mut answer: impl FnMut(Q, u64) -> Answers + 'static,
    ) where
        Q: Send + Sync + 'static,
        A: Send + Sync + 'static,
        Answers: IntoIterator<Item = (Duration, A)>,
    {
        let driver = Rc::new(RefCell::new(driver));
        let look = move |machine: &Machine, now_ns: u64| {
            let Some((ticket, question)) = driver.borrow_mut().question() else {
                return;
            };
            for (after, answer) in answer(question, ticket.job()) {
                let driver = Rc::clone(&driver);
                // A late answer is given back.
                let give = move || _ = driver.borrow_mut().answer(ticket, answer);
                let at_ns = now_ns.saturating_add(nanoseconds(after));
                machine.keep(at_ns, Arrival::Answer(Box::new(give)));
            }
        };
        self.machine.devices.borrow_mut().push(Box::new(look));
    }

    /// Returns all bytes sent so far by complete instances on a connected wire.
    ///
    /// See [`Wire`].
    ///
    /// # Panics
    ///
    /// If the wire is not connected.
    pub fn sent(&self, wire: &Wire) -> Vec<u8> {
        let packets = self.sent_packets(wire).into_iter();
        packets.flat_map(|(bytes, _)| bytes).collect()
    }

    /// Returns the sent packets one by one, with each packet's addressee, if stated by the sender.
    ///
    /// See [`packet_at`](Self::packet_at).
    ///
    /// # Panics
    ///
    /// If the wire is not connected.
    pub fn sent_packets(&self, wire: &Wire) -> Vec<SentPacket> {
        let wires = self.machine.wires.borrow();
        let of_wire = wires.iter().find(|(end, _)| end.wire() == wire);
        of_wire
            .and_then(|(_, sent)| {
                Some(
                    sent.as_ref()?
                        .iter()
                        .map(|(_, sent)| sent.clone())
                        .collect(),
                )
            })
            .unwrap_or_else(|| {
                let name = wire.name();
                panic!("wire `{name}` is not connected; call `connect` before the run");
            })
    }
}

/// The installed platform, without state of its own.
struct HostPlatform;

impl Platform for HostPlatform {
    fn terms(&self) -> RunConfig {
        let terms = |machine: Rc<Machine>| machine.settings.borrow().terms.clone();
        // Without a machine, the defaults of a new machine.
        current().map(terms).unwrap_or_default()
    }

    fn now_ns(&self) -> u64 {
        expect_current().now_ns.get()
    }

    fn clock(&self) -> &'static Clock {
        &TOLD
    }

    fn execute_for(&self, duration: Duration, _how: Occupation) {
        let machine = expect_current();
        let Some(executed_ns) = machine.executed_ns.get() else {
            panic!("`execute_for` is called outside a subtask; call it in a subtask's function");
        };
        // The driver reports a sum that does not fit as a finish beyond the last possible time.
        let ns = nanoseconds(duration);
        (machine.executed_ns).set(Some(executed_ns.saturating_add(ns)));
        // Time passes for this function alone: it is called at the instant of its start, and the
        // scheduler learns its duration after it has returned.
        let now_ns = &machine.now_ns;
        now_ns.set(now_ns.get().saturating_add(ns));
    }

    fn raise(&self, plan: u64, dag: DagId) {
        let machine = expect_current();
        assert!(
            machine.executed_ns.get().is_none(),
            "a subtask raises a signal that it was not registered with; register it by \
             `dag.using(signal.raising())`"
        );
        machine.raise_at(machine.now_ns.get(), (plan, dag));
    }

    fn answer(&self, plan: u64, wait: WaitId) {
        let machine = expect_current();
        if machine.plan.get() == Some(plan) {
            let answer = Arrival::Request(Request::Answer(wait));
            machine.keep(machine.now_ns.get(), answer);
        }
    }

    fn running(&self) -> Option<(u64, Instance)> {
        let machine = current()?;
        machine.plan.get().zip(machine.running.get())
    }

    fn section(&self, lock: &LockWords, section: &mut dyn FnMut()) -> Option<u64> {
        if IS_IN_SECTION.replace(true) {
            return None;
        }
        let (free, taken) = (0, 1);
        // Functions take turns; another machine's thread may have the lock, and will give the lock
        // back.
        while (lock.state.compare_exchange(free, taken, Acquire, Relaxed)).is_err() {
            thread::yield_now();
        }
        let _held = Held(lock);
        let executed_ns = || Some(current()?.executed_ns.get().unwrap_or(0));
        let entered_ns = executed_ns();
        section();
        Some(executed_ns().unwrap_or(0) - entered_ns.unwrap_or(0))
    }

    fn crosses(&self) -> bool {
        true
    }

    fn open_channels(&self, dag: DagId, graph: u64, channels: &[Channel], _: Begin) -> bool {
        let machine = expect_current();
        // Topics of a second plan, soon to be refused, do not belong to this run.
        if !machine.has_launched.get() {
            machine.edge.open(dag, graph, channels);
        }
        false
    }

    fn record(&self, value: &RecordedValue<'_>) {
        expect_current().edge.record(value);
    }

    fn replays(&self) -> bool {
        current().is_some_and(|machine| machine.edge.is_replay())
    }

    fn replay(&self, channel: u16, job: u64, take: &mut dyn FnMut(&[u8])) {
        expect_current().edge.lend(channel, job, take);
    }

    fn log(&self, mut line: LogLine) {
        if let Some(machine) = current() {
            line.instance = machine.running.get();
            line.at_ns = machine.now_ns.get();
            machine.logs.borrow_mut().push(line);
        }
    }

    fn launch(&self, mut plan: Plan) -> Result<(), LaunchError> {
        let Some(machine) = current() else {
            return Err(LaunchError::new(
                "this thread has no `VirtualTime`; make one on the thread that commits",
            ));
        };
        if machine.has_launched.replace(true) {
            return Err(LaunchError::new(
                "this `VirtualTime` has a plan already; commit all DAGs in one call, \
                 or make a new `VirtualTime`",
            ));
        }
        let settings = machine.settings.borrow();
        let faults = settings.faults.iter();
        let mut absent = faults.filter_map(|fault| fault.absent(&plan.task_set));
        if let Some((dag, subtask)) = absent.next() {
            return Err(LaunchError::new(format!(
                "subtask `{subtask}` of dag `{dag}`, which is to fail, is not in the commit; \
                 name one that is"
            )));
        }
        let launched = machine.edge.launch(&mut plan, settings.most_jobs);
        launched.map_err(LaunchError::new)?;
        let mut record = BootRecord::new(Vec::new());
        at_edge::launch(self, &mut plan, Some(&mut record))?;
        machine.edge.committed.replace(Some(record));
        machine.plan.set(Some(plan.number));
        let session = Session::new(plan, settings.terms.scheduler, &machine);
        (machine.session).replace(Some(session.map_err(LaunchError::new)?));
        Ok(())
    }
}

fn current() -> Option<Rc<Machine>> {
    CURRENT.with_borrow(Weak::upgrade)
}

fn expect_current() -> Rc<Machine> {
    current().expect("this thread has no `VirtualTime`; make one on the thread that commits")
}
