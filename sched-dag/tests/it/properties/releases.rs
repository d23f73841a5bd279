//! Releases, which the law does not judge, held against the rules: which jobs of a DAG are
//! released, wait, are
//! skipped or aborted, what is answered to requests and faults, and what is counted.
//!
//! The rules are those of overruns, P (pauses), C (closings), S (signals), E1 to E3, D1 and D2.
//! All of it follows from what was asked and from what the scheduler tells of the DAG's jobs; when
//! a job is complete or has missed its deadline, the law judges.

use std::collections::{BTreeSet, VecDeque};

use sched_dag::journal::EventKind;
use sched_dag::{
    Activation, DagId, DagPhase, DagSpec, DagStatistics, DriverNotice, OnFault, OverrunPolicy,
    Scheduler,
};

/// The kinds of reports that are judged here, and that of ended waits.
pub(crate) const SAID: [EventKind; 14] = [
    EventKind::Released,
    EventKind::Queued,
    EventKind::Skipped,
    EventKind::Aborted,
    EventKind::Missed,
    EventKind::Completed,
    EventKind::DagEnded,
    EventKind::Off,
    EventKind::On,
    EventKind::Closed,
    EventKind::Restarted,
    EventKind::Signalled,
    EventKind::Dropped,
    EventKind::Wake,
];

/// A job in flight.
#[derive(Clone, Hash)]
struct Job {
    number: u64,
    is_cut: bool,
}

/// The jobs of one DAG.
#[derive(Clone, Default, Hash)]
pub(crate) struct Releases {
    /// Of each job that was or may be due, when.
    due_ns: Vec<u64>,
    /// The first one that is not dealt with.
    next: u64,
    waiting: VecDeque<u64>,
    in_flight: VecDeque<Job>,
    missed: BTreeSet<u64>,
    /// Whether another one has been aborted or skipped for the next one.
    has_made_room: bool,
    phase: DagPhase,
    resumed_ns: u64,
    /// The jobs of the faults that were survived.
    survived: Vec<u64>,
    /// The answer that the scheduler owes to the latest request.
    owed: Option<EventKind>,
    counted: DagStatistics,
}

impl Releases {
    pub(crate) fn new(spec: &DagSpec) -> Self {
        let (period_ns, jobs) = (spec.period_ns.unwrap_or(0), spec.jobs.unwrap_or(0));
        let due = (0..jobs).map(|job| spec.offset_ns + period_ns * job);
        Self {
            due_ns: match spec.activation {
                Activation::Periodic => due.collect(),
                Activation::Sporadic => Vec::new(),
            },
            ..Self::default()
        }
    }

    /// Takes note of what is asked: the answer, if anything comes of it.
    pub(crate) fn ask(&mut self, answer: EventKind) {
        let is_open = self.phase < DagPhase::Closed;
        let comes = match answer {
            EventKind::Off => self.phase == DagPhase::Running,
            EventKind::On => self.phase == DagPhase::Paused,
            EventKind::Closed => is_open,
            EventKind::Signalled => true,
            _ => self.phase < DagPhase::Ended,
        };
        self.owed = comes.then_some(answer);
    }

    /// Takes note of a fault of a job, after which the DAG goes on if it may (D1).
    pub(crate) fn fault(&mut self, spec: &DagSpec, job: u64, is_replaceable: bool) {
        let before = &self.survived;
        let survives = match spec.on_fault {
            OnFault::EndDag => false,
            OnFault::DropJob(limit) => {
                let nth = before.iter().rev().nth(limit.faults as usize - 1);
                before.len() < limit.in_all as usize
                    && nth.is_none_or(|nth| nth + limit.window <= job)
            }
        };
        self.counted.faults += 1;
        self.ask(match survives && is_replaceable {
            true => EventKind::Restarted,
            false => EventKind::DagEnded,
        });
    }

    /// Reports whether the rules allow what the scheduler tells.
    pub(crate) fn takes(&mut self, spec: &DagSpec, notice: &DriverNotice, now_ns: u64) -> bool {
        let DriverNotice { event, at_ns } = *notice;
        let job = event.job;
        let counted = &mut self.counted;
        match event.what {
            EventKind::Released | EventKind::Queued | EventKind::Skipped => {
                let is_right = self.is_right(spec, event.what, job, now_ns);
                let is_at = at_ns == self.due_ns.get(index(job)).copied();
                self.settle(event.what, job);
                return is_right && is_at;
            }
            EventKind::Aborted => {
                let is_first = self.uncut().next().is_some_and(|it| it.number == job);
                let is_right = is_first && self.has_to_make_room(spec, now_ns);
                self.has_made_room = true;
                self.counted.aborts += 1;
                return self.cut(job) && is_right;
            }
            EventKind::Missed => {
                counted.misses += 1;
                counted.consecutive_misses += 1;
                let most = &mut counted.most_consecutive_misses;
                *most = counted.consecutive_misses.max(*most);
                return self.missed.insert(job);
            }
            EventKind::Completed => {
                let Some(ended) = self.in_flight.pop_front() else {
                    return false;
                };
                counted.completed += u64::from(!ended.is_cut);
                if !ended.is_cut && !self.missed.contains(&job) {
                    counted.consecutive_misses = 0;
                }
                return ended.number == job;
            }
            EventKind::DagEnded => {
                self.phase = DagPhase::Ended;
                counted.cut_short += self.in_flight.iter().filter(|it| !it.is_cut).count() as u64;
                self.uncut().for_each(|it| it.is_cut = true);
                self.counted.dropped += self.waiting.drain(..).len() as u64;
            }
            EventKind::Restarted => {
                counted.restarts += 1;
                counted.failed += 1;
                self.survived.push(job);
                self.counted.failed -= u64::from(!self.cut(job));
            }
            EventKind::Off => self.phase = DagPhase::Paused,
            EventKind::On => (self.phase, self.resumed_ns) = (DagPhase::Running, now_ns),
            EventKind::Closed => self.phase = DagPhase::Closed,
            EventKind::Signalled | EventKind::Dropped => {
                let due_ns = self.signal(spec, now_ns);
                let is_kept = event.what == EventKind::Signalled;
                let is_owed = self.owed.take() == Some(EventKind::Signalled);
                return is_owed && due_ns == at_ns && due_ns.is_some() == is_kept;
            }
            _ => return false,
        }
        self.owed.take() == Some(event.what)
    }

    /// S1 to S3: returns when the job is due that a signal brings, if it brings one.
    fn signal(&mut self, spec: &DagSpec, now_ns: u64) -> Option<u64> {
        self.counted.signals += 1;
        let is_kept = self.phase < DagPhase::Closed
            && self.waiting.is_empty()
            && self.due_ns.len() == index(self.next)
            && Some(self.next) < spec.jobs;
        if !is_kept {
            self.counted.dropped_signals += 1;
            return None;
        }
        let last_ns = self.due_ns.last();
        let earliest_ns = last_ns.map_or(spec.offset_ns, |ns| ns + spec.period_ns.unwrap_or(0));
        self.due_ns.push(now_ns.max(earliest_ns));
        self.due_ns.last().copied()
    }

    /// The first job that is due and not released, if one is.
    fn first(&self, now_ns: u64) -> Option<u64> {
        let next_ns = self.next_ns().filter(|&ns| ns <= now_ns);
        (self.waiting.front().copied()).or_else(|| next_ns.map(|_| self.next))
    }

    fn next_ns(&self) -> Option<u64> {
        let is_open = self.phase < DagPhase::Closed;
        (self.due_ns.get(index(self.next)).copied()).filter(|_| is_open)
    }

    fn has_room(&self, spec: &DagSpec, job: u64) -> bool {
        let oldest = self.in_flight.front();
        oldest.is_none_or(|oldest| job < oldest.number + u64::from(spec.in_flight.unwrap_or(1)))
    }

    /// Reports whether the next job is due and needs another one's room, for the first time.
    fn has_to_make_room(&self, spec: &DagSpec, now_ns: u64) -> bool {
        let first = self.first(now_ns);
        spec.overrun == OverrunPolicy::Abort
            && self.next_ns().is_some_and(|ns| ns <= now_ns)
            && first.is_some_and(|first| !self.has_room(spec, first))
            && !self.has_made_room
    }

    fn is_right(&self, spec: &DagSpec, what: EventKind, job: u64, now_ns: u64) -> bool {
        let Some(first) = self.first(now_ns) else {
            return false;
        };
        let is_next = job == self.next && self.next_ns().is_some_and(|ns| ns <= now_ns);
        let has_room = self.has_room(spec, first);
        let is_off = self.phase > DagPhase::Running
            || is_next && self.next_ns().is_some_and(|ns| ns < self.resumed_ns);
        match (what, spec.overrun) {
            (EventKind::Released, _) => job == first && has_room && !is_off,
            (EventKind::Skipped, _) if is_off => job == first,
            (EventKind::Skipped, OverrunPolicy::Skip) => is_next && !has_room,
            (EventKind::Skipped, OverrunPolicy::Abort) => {
                let is_all_cut = self.in_flight.iter().all(|it| it.is_cut);
                job == first && is_all_cut && self.has_to_make_room(spec, now_ns)
            }
            (EventKind::Queued, OverrunPolicy::Queue) => is_next && !has_room && !is_off,
            (EventKind::Queued, OverrunPolicy::Abort) => {
                is_next && !has_room && !is_off && self.has_made_room
            }
            _ => false,
        }
    }

    /// Takes note of what has become of a job that was due.
    fn settle(&mut self, what: EventKind, job: u64) {
        match job == self.next {
            true => (self.next, self.has_made_room) = (job + 1, false),
            false => {
                self.has_made_room |= self.phase == DagPhase::Running && what == EventKind::Skipped;
                self.waiting.pop_front();
            }
        }
        match what {
            EventKind::Released => {
                let is_cut = false;
                self.counted.released += 1;
                self.in_flight.push_back(Job {
                    number: job,
                    is_cut,
                });
            }
            EventKind::Queued => {
                self.counted.queued += 1;
                self.waiting.push_back(job);
            }
            _ => self.counted.skips += 1,
        }
    }

    fn uncut(&mut self) -> impl Iterator<Item = &mut Job> {
        self.in_flight.iter_mut().filter(|it| !it.is_cut)
    }

    /// Reports whether a job must not start anything (E3, and as D2 and overruns say).
    pub(crate) fn is_cut(&self, job: u64) -> bool {
        let mut in_flight = self.in_flight.iter();
        in_flight.any(|it| it.number == job && it.is_cut)
    }

    /// Cuts a job. Reports whether it was in flight and was not cut.
    fn cut(&mut self, job: u64) -> bool {
        let found = self.uncut().find(|it| it.number == job);
        found.map(|it| it.is_cut = true).is_some()
    }

    /// Holds a scheduler against this after an instant. Returns in what it differs.
    pub(crate) fn difference(&self, id: DagId, of: &Scheduler, spec: &DagSpec) -> Option<String> {
        let now_ns = of.now_ns();
        let waiting = self.waiting.len() as u64;
        let in_flight = self.in_flight.len() as u64;
        let none_ahead = self.phase >= DagPhase::Closed || Some(self.next) == spec.jobs;
        let is_over = waiting + in_flight == 0 && none_ahead;
        let expected = (self.counted, self.phase, waiting, in_flight, is_over);
        let happened = (
            *of.statistics(id),
            of.phase(id),
            of.waiting(id),
            of.in_flight(id),
            of.is_over(id),
        );
        let is_left = self.next_ns().is_some_and(|ns| ns <= now_ns);
        let may_begin = self
            .waiting
            .front()
            .is_some_and(|&job| self.has_room(spec, job));
        if let Some(owed) = self.owed {
            return Some(format!("nothing says {owed} of {id:?}"));
        }
        if is_left || may_begin {
            return Some(format!("{id:?} has a job left that is due"));
        }
        (expected != happened).then(|| format!("expected {expected:?}, happened {happened:?}"))
    }
}

fn index(job: u64) -> usize {
    usize::try_from(job).expect("few jobs")
}
