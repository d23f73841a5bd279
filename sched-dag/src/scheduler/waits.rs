//! Waits: started instances that hold no core and are not eligible until an answer or a limit
//! comes.
//!
//! A subtask may wait between segments of its function: for a time, for a device, for bytes. Each
//! wait has a *limit*, so the wait ends even if a device never answers. The scenarios of the rules,
//! in `tests/scenarios/waits.txt`, bear their numbers:
//!
//! - **W1, waiting.** From the end of a segment to the end of its wait the instance is not eligible
//!   and holds no core. Waits do not queue: each instance has a timer and a limit of its own.
//! - **W2, the end.** Unless its job is cut (W6), a wait ends with its answer, and at its limit at
//!   the latest; an answer at the instant of the limit still counts. At that instant the instance
//!   is eligible again, with the old key, on any core allowed to execute the DAG.
//! - **W3, not a finish.** A wait releases no edge, completes no job, and the subtask's next
//!   instance stays behind the waiting instance (R2 to R4).
//! - **W4, one instant.** At one instant the ending segments come first, then the ending waits,
//!   including waits of 0 that have just begun, then the releases, then one dispatch.
//! - **W5, without preemption.** An instance that keeps its core keeps it to the end of its
//!   segment. A wait, even a wait of 0, gives up the core.
//! - **W6, cut jobs.** No instance of a cut job waits: the instance is cancelled when the job is
//!   cut, or where the instance would begin to wait.
//! - **W7, late answers.** An answer names a wait; any other wait ignores the answer.
//!
//! The beginning of a wait costs one heap operation of the timers, and so does the end.

use alloc::boxed::Box;
use alloc::vec::Vec;

use super::vertices::InstancePhase;
use super::{Decision, HandOff, Scheduler};
use crate::ids::{CoreId, DagId, Instance, Vertex};
use crate::journal::EventKind;
use crate::request::WaitId;
use crate::task_set::TaskSet;

/// The vertices that may wait, and the latest wait of each.
#[derive(Clone, Debug, Default, Hash)]
pub(super) struct WaitTable {
    /// Ascending.
    vertices: Box<[u32]>,
    latest: Box<[LatestWait]>,
}

#[derive(Clone, Copy, Debug, Hash)]
struct LatestWait {
    /// The job of the wait; `u64::MAX` for none.
    job: u64,
    /// The number among the waits of the instance, from 0 on.
    number: u32,
    has_timed_out: bool,
}

impl WaitTable {
    pub(super) fn new(task_set: &TaskSet) -> Self {
        let dags = (0..).map(DagId).zip(task_set.dags());
        let vertices: Vec<u32> = dags
            .flat_map(|(id, dag)| {
                let numbered = (task_set.first_vertex(id)..).zip(dag.subtasks());
                let waiting = numbered.filter(|(_, subtask)| !subtask.waits().is_empty());
                waiting.map(|(vertex, _)| vertex)
            })
            .collect();
        let none = LatestWait {
            job: u64::MAX,
            number: 0,
            has_timed_out: false,
        };
        Self {
            latest: vertices.iter().map(|_| none).collect(),
            vertices: vertices.into(),
        }
    }

    /// Returns the number of vertices that may wait. Each has a timer.
    pub(super) const fn len(&self) -> usize {
        self.vertices.len()
    }

    #[inline]
    fn place(&self, vertex: u32) -> usize {
        let place = self.vertices.binary_search(&vertex);
        place.expect("the subtask states its waits")
    }

    /// Numbers the wait an instance begins. Returns the vertex's place in `latest`.
    #[inline]
    fn begin(&mut self, vertex: u32, job: u64) -> usize {
        let place = self.place(vertex);
        let latest = &mut self.latest[place];
        latest.number = match latest.job == job {
            true => latest.number + 1,
            false => 0,
        };
        latest.job = job;
        place
    }
}

impl Scheduler {
    /// Begins the wait of a started instance (W1). The wait ends at `limit_ns` at the latest.
    #[cold]
    #[inline(never)]
    pub(super) fn begin_wait(&mut self, instance: Instance, limit_ns: u64) {
        let number = self.take_off(instance, "waits");
        let vertex = self.vertices.get_mut(number);
        vertex.phase = InstancePhase::Waiting;
        let jobs = &self.dags[vertex.dag.index()].jobs;
        let is_cut = jobs.job(vertex.progress).cut.is_some();
        let place = self.waits.begin(number, instance.job);
        // W6: in a cut job, the wait's answer would serve no purpose.
        if is_cut {
            self.cancel_wait(number);
            self.end_all();
            return;
        }
        self.set_limit(place, limit_ns);
    }

    /// Begins the wait of the instance `core` was given last, whose turn has ended at `now_ns`, and
    /// gives the core the first instance in line. Returns `None`, with nothing changed, if more is
    /// to be decided at this instant (the module `dispatch` explains the conditions): then the
    /// driver ends the turn, and the instant, the usual way. A time before the latest instant
    /// counts as that instant.
    ///
    /// If the wait is of no time and the instance is the first in line, the core goes on with the
    /// instance, and neither the wait nor its end is recorded. No answer may come at this instant.
    ///
    /// # Panics
    ///
    /// If the subtask states no waits.
    #[inline]
    pub fn wait_shortly(
        &mut self,
        now_ns: u64,
        core: CoreId,
        vertex: Vertex,
        limit_ns: u64,
    ) -> Option<HandOff> {
        let instant_ns = self.log.now_ns.max(now_ns);
        let waiting = self.vertices.get_mut(vertex.0);
        let job = self.dags[waiting.dag.index()].jobs.job(waiting.progress);
        let is_alone = self.fresh == 0 && instant_ns < self.quiet_until_ns && job.cut.is_none();
        // An instance that keeps its core has kept the core from its list's entries until now.
        let is_alone = is_alone && (waiting.is_preemptible || !self.ready.lists.has(core));
        if !is_alone || waiting.phase != InstancePhase::Running(core) {
            return None;
        }
        let (key, instance) = (self.cores.running(core)?, waiting.present_instance());
        let place = self.waits.begin(vertex.0, instance.job);
        (self.log.now_ns, self.log.here) = (instant_ns, core);
        let limit_ns = now_ns.saturating_add(limit_ns);
        // Counted from the time of the core, which may lie before the instant: then the wait may be
        // over.
        if limit_ns > instant_ns {
            waiting.phase = InstancePhase::Waiting;
            self.log.on_this(EventKind::Wait, now_ns, instance);
            self.set_limit(place, limit_ns);
        } else {
            // W4: the wait ends at its begin, and the instance then competes for its own core.
            self.waits.latest[place].has_timed_out = true;
            let is_first = |first| key < first;
            let is_next = match waiting.line.is_cluster() {
                true => self.ready.is_empty() || self.ready.peek().is_none_or(is_first),
                false => self.ready.peek_in(waiting.line).is_none_or(is_first),
            };
            if is_next {
                let decision = Decision::new(EventKind::Resume, core, instance);
                return Some(HandOff::To(vertex, decision));
            }
            waiting.phase = InstancePhase::Preempted;
            self.log.on_this(EventKind::Wait, now_ns, instance);
            self.log.of_instance(EventKind::Wake, instance);
            self.ready.insert(waiting, key);
        }
        let Some(first) = self.give_first(core, vertex.0) else {
            self.cores.free(core);
            return Some(HandOff::Idle);
        };
        Some(self.hand_off(core, first))
    }

    /// Reports whether any subtask states waits. In most sets none does.
    #[inline]
    pub const fn has_waits(&self) -> bool {
        self.waits.len() > 0
    }

    /// Ends the wait with the earliest limit, if the limit has come by `now_ns`, and gives the
    /// instance an idle core. Returns `None` if the next event is not such a limit, if no core is
    /// idle, if the instance belongs to another line than the cluster's, or if more is to be
    /// decided at this instant; in this last case the wait may have been ended. After `None`, the
    /// driver takes the step the usual way. No request may be pending.
    #[inline]
    pub fn wake_shortly(&mut self, now_ns: u64, here: CoreId) -> Option<(CoreId, Vertex)> {
        let (limit_ns, timer) = self.timers.peek()?;
        // The event due first may be of a DAG: a release or a deadline is for the whole step.
        let place = timer.checked_sub(self.dags.len())?;
        // While a core is idle, the cluster's line is empty; but the idle core may belong to
        // another line. The last timer belongs to no wait.
        let line = self.vertices.get(*self.waits.vertices.get(place)?).line;
        let is_elsewhere = !line.is_cluster();
        if self.fresh != 0 || limit_ns > now_ns || !self.cores.any_idle() || is_elsewhere {
            return None;
        }
        (self.log.now_ns, self.log.here) = (self.log.now_ns.max(now_ns), here);
        self.end_wait(place, true);
        // Another limit, a release or a deadline is due at this instant: the whole step serves all.
        if self.log.now_ns >= self.quiet_until_ns {
            return None;
        }
        self.fresh = 0;
        let (key, core) = (self.ready.pop()?, self.cores.take_idle()?);
        let _ = self.give(core, key);
        Some((core, Vertex(key.vertex())))
    }

    #[inline]
    fn set_limit(&mut self, place: usize, limit_ns: u64) {
        self.timers.set(self.dags.len() + place, limit_ns);
        // A new time can only make the earliest earlier, so the heap need not be asked.
        self.quiet_until_ns = self.quiet_until_ns.min(limit_ns);
        // The platform's alarm may have to come earlier.
        self.log.has_job_event = true;
    }

    /// Takes the answer for a wait (W7).
    pub(super) fn answer(&mut self, wait: WaitId) {
        let number = self.vertex(wait.instance).0;
        let vertex = self.vertices.get(number);
        // W7: the limit was first, or the job was cut; the subtask may do another job by now.
        if vertex.phase != InstancePhase::Waiting || vertex.job != wait.instance.job {
            return;
        }
        let place = self.waits.place(number);
        // The instance may wait again by now: the answer to an earlier wait must not end this wait.
        if self.waits.latest[place].number == wait.number {
            self.end_wait(place, false);
        }
    }

    /// Ends the wait whose limit has come. `timer` is the wait's number, behind the timers of the
    /// DAGs.
    #[cold]
    #[inline]
    pub(super) fn time_out(&mut self, timer: usize) {
        self.end_wait(timer - self.dags.len(), true);
    }

    /// Ends all waits whose limit has come, before a release of this instant cuts a job (W4).
    pub(super) fn time_out_due(&mut self) {
        for place in 0..self.waits.len() {
            let limit_ns = self.timers.time_of(self.dags.len() + place);
            if limit_ns.is_some_and(|limit_ns| limit_ns <= self.log.now_ns) {
                self.end_wait(place, true);
            }
        }
    }

    /// Makes a waiting instance eligible again (W2).
    #[inline]
    fn end_wait(&mut self, place: usize, has_timed_out: bool) {
        let number = self.waits.vertices[place];
        self.waits.latest[place].has_timed_out = has_timed_out;
        self.timers.remove(self.dags.len() + place);
        self.quiet_until_ns = self.timers.earliest_ns();
        let vertex = self.vertices.get_mut(number);
        // Like a preempted instance, the instance has started and is in line for a core.
        vertex.phase = InstancePhase::Preempted;
        let job = self.dags[vertex.dag.index()].jobs.job(vertex.progress);
        let key = self.ready.key(number, vertex, || job);
        self.ready.insert(vertex, key);
        self.log.of_instance(EventKind::Wake, vertex.instance(job));
        self.fresh += 1;
    }

    /// Cancels the waiting instances of a DAG, in the job with a sequence number (in all jobs if
    /// `u64::MAX`). The caller tells their successors by [`end_all`](Self::end_all).
    pub(super) fn cancel_waits(&mut self, dag: DagId, sequence: u64) {
        for place in 0..self.waits.len() {
            let number = self.waits.vertices[place];
            let vertex = self.vertices.get(number);
            let is_meant = sequence == u64::MAX || vertex.progress == sequence;
            if vertex.dag == dag && vertex.phase == InstancePhase::Waiting && is_meant {
                self.cancel_wait(number);
            }
        }
    }

    /// Cancels a waiting instance of a cut job.
    fn cancel_wait(&mut self, number: u32) {
        let place = self.waits.place(number);
        self.timers.remove(self.dags.len() + place);
        self.quiet_until_ns = self.timers.earliest_ns();
        let vertex = self.vertices.get_mut(number);
        vertex.phase = InstancePhase::Absent;
        let instance = vertex.present_instance();
        self.log.of_instance(EventKind::Cancelled, instance);
        self.ending.push(number);
    }

    /// Returns the release time of the job of a vertex's instance, in nanoseconds.
    pub(crate) fn release_ns(&self, vertex: Vertex) -> u64 {
        let vertex = self.vertices.get(vertex.0);
        let jobs = &self.dags[vertex.dag.index()].jobs;
        jobs.job(vertex.progress).release_ns
    }

    /// Returns the latest wait of a vertex, and whether the wait has ended by its limit.
    ///
    /// # Panics
    ///
    /// If the subtask states no waits.
    pub fn latest_wait(&self, vertex: Vertex) -> (WaitId, bool) {
        let latest = self.waits.latest[self.waits.place(vertex.0)];
        // When a cut job does not wait (W6), the subtask may have the next job's instance by now.
        let instance = Instance {
            job: latest.job,
            ..self.instance_of(vertex)
        };
        let number = latest.number;
        let wait = WaitId { instance, number };
        (wait, latest.has_timed_out)
    }
}
