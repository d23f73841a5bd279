//! The times of events without a completion: for each DAG a release or a deadline, for each wait
//! its limit, and the next report of skips.
//!
//! # Release classes
//!
//! DAGs of one period and offset have their releases at the same instants. Many such DAGs form a
//! *release class*, whose members are in *lanes*: in two of them by their next release, of an even
//! job or an odd job, and in the third by the deadline of the job in flight. The order in a lane,
//! by DAG or by relative deadline, is known at the commit. So a lane is a set of bits, and has a
//! single timer in the heap, for its first member. A release moves a bit from lane to lane, and so
//! does the end of the job, however many members there are.
//!
//! All members of a lane count from the same release. A DAG with another event, as after an
//! overrun, is in the heap by itself, like DAGs without a class. So each DAG has its event at the
//! very instant its jobs ask for. Within an instant, a lane's members come in the order of the
//! DAGs.

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::hash::{Hash, Hasher};

use super::bits::BitSet;
use super::heap::IndexedHeap;
use super::jobs::TimerKind;
use crate::ids::{ClusterId, to_u32};
use crate::order::sorted_by_key;
use crate::task_set::TaskSet;

/// The timers of DAGs, by number, and behind those the timers of waits, of the skips, and of lanes.
#[derive(Clone, Debug)]
pub(super) struct Timers {
    heap: IndexedHeap<u64>,
    first_lane: usize,
    members: Box<[ClassMember]>,
    /// Class by class.
    lanes: Box<[ReleaseLane]>,
}

/// How many lanes a class has: a lane for each kind but the last.
const LANES: usize = TimerKind::Other as usize;

/// The least number of members of a class: the timers of fewer cost less in the heap.
const LEAST: usize = 16;

/// The mark for no class, and for no place in a lane.
const NONE: u32 = u32::MAX;

/// A DAG as a member of its class.
#[derive(Clone, Copy, Debug)]
struct ClassMember {
    /// The first lane of the class, if there is a class.
    lanes: u32,
    /// The DAG's place in each lane.
    places: [u32; LANES],
    /// The lane with the DAG; `Other`: the DAG is in the heap by itself, or not at all.
    lane: TimerKind,
}

#[derive(Clone, Debug)]
struct ReleaseLane {
    /// The release from where all members count.
    release_ns: u64,
    /// The place of the first member; the lane's timer is set to its event.
    first: u32,
    waiting: BitSet,
    /// By place, the time from the release to the event, and the DAG.
    order: Arc<[(u64, u32)]>,
}

impl Timers {
    /// Makes the timers of a cluster's DAGs, and of `others` behind those of all DAGs.
    pub(super) fn new(task_set: &TaskSet, cluster: ClusterId, others: usize) -> Self {
        let dags = task_set.dags();
        let none = ClassMember {
            lanes: NONE,
            places: [0; LANES],
            lane: TimerKind::Other,
        };
        let mut members: Box<[ClassMember]> = dags.iter().map(|_| none).collect();
        let mut lanes = Vec::new();
        let phase = |dag: usize| (dags[dag].period_ns(), dags[dag].offset_ns());
        let order = sorted_by_key(dags.len(), phase);
        let periodic: Vec<usize> = (order.into_iter())
            // A sporadic DAG is released by its signals, so it has no releases in common with
            // others.
            .filter(|&dag| !dags[dag].is_sporadic() && dags[dag].cluster() == cluster)
            .collect();
        let classes = periodic.chunk_by(|one, other| phase(*one) == phase(*other));
        for class in classes.filter(|class| class.len() >= LEAST) {
            // The earliest of the sinks' deadlines.
            let distance_ns = |place: usize| {
                let dag = &dags[class[place]];
                let sinks = dag.sinks().iter();
                let deadlines = sinks.map(|sink| dag.subtask(*sink).relative_deadline_ns());
                // One nanosecond later: a finish at the deadline itself is in time.
                deadlines.min().map_or(0, |ns| ns.saturating_add(1))
            };
            let by_dag = (0..class.len()).map(|place| (0, to_u32(class[place])));
            let by_deadline = sorted_by_key(class.len(), distance_ns).into_iter();
            let by_deadline = by_deadline.map(|at| (distance_ns(at), to_u32(class[at])));
            let (by_dag, by_deadline) = (by_dag.collect(), by_deadline.collect());
            // Two lanes of releases: while the members' jobs of one instant are released one by
            // one, some wait for that instant, and the others for the next.
            let orders: [Arc<[(u64, u32)]>; LANES] = [Arc::clone(&by_dag), by_dag, by_deadline];
            for (kind, order) in orders.iter().enumerate() {
                for (place, &(_, dag)) in (0..).zip(&**order) {
                    members[dag as usize].places[kind] = place;
                    members[dag as usize].lanes = to_u32(lanes.len());
                }
            }
            lanes.extend(orders.map(ReleaseLane::new));
        }
        let first_lane = dags.len() + others;
        Self {
            heap: IndexedHeap::new(first_lane + lanes.len()),
            first_lane,
            members,
            lanes: lanes.into(),
        }
    }

    /// Returns the earliest time and its timer.
    #[inline]
    pub(super) fn peek(&self) -> Option<(u64, usize)> {
        let (event_ns, timer) = self.heap.peek()?;
        match timer.checked_sub(self.first_lane) {
            Some(lane) => Some((event_ns, self.lanes[lane].dag())),
            None => Some((event_ns, timer)),
        }
    }

    /// Returns the earliest time, `u64::MAX` if there is none.
    #[inline]
    pub(super) fn earliest_ns(&self) -> u64 {
        self.heap.peek().map_or(u64::MAX, |(event_ns, _)| event_ns)
    }

    /// Returns the time of a timer, if set.
    pub(super) fn time_of(&self, timer: usize) -> Option<u64> {
        match self.members.get(timer) {
            Some(member) if member.lane != TimerKind::Other => {
                let place = member.places[member.lane as usize];
                Some(self.lanes[member.lane_of(member.lane)].event_ns(place))
            }
            _ => self.heap.key_of(timer),
        }
    }

    /// Sets the timer of a wait, or of the skips.
    #[inline]
    pub(super) fn set(&mut self, timer: usize, event_ns: u64) {
        self.heap.set(timer, event_ns);
    }

    /// Stops the timer of a wait, or of the skips.
    #[inline]
    pub(super) fn remove(&mut self, timer: usize) {
        self.heap.remove(timer);
    }

    /// Sets the timer of a DAG to its next event, or stops it.
    #[inline(always)]
    pub(super) fn set_dag(&mut self, dag: usize, event: Option<(u64, TimerKind)>) {
        if self.members[dag].lanes != NONE {
            return self.set_member(dag, event);
        }
        match event {
            Some((event_ns, _)) => self.heap.set(dag, event_ns),
            None => self.heap.remove(dag),
        }
    }

    // `cold` makes this a call, which leaves the caller its registers, but compiled with the
    // caller's optimization.
    #[cold]
    #[inline]
    fn set_member(&mut self, dag: usize, event: Option<(u64, TimerKind)>) {
        let member = &mut self.members[dag];
        let from = member.lane;
        if from == TimerKind::Other {
            self.heap.remove(dag);
        } else {
            let (number, place) = (member.lane_of(from), member.places[from as usize]);
            let lane = &mut self.lanes[number];
            // Usually a deadline is not before the next release, so the release stays the next
            // event.
            if let Some((event_ns, kind)) = event
                && kind == from
                && event_ns == lane.event_ns(place)
            {
                return;
            }
            member.lane = TimerKind::Other;
            if lane.leave(place) {
                let timer = self.first_lane + number;
                match lane.first {
                    NONE => self.heap.remove(timer),
                    // All releases of a lane are at the same time.
                    first if from == TimerKind::Deadline => {
                        self.heap.set(timer, lane.event_ns(first))
                    }
                    _ => {}
                }
            }
        }
        let Some((event_ns, kind)) = event else {
            return;
        };
        if kind != TimerKind::Other {
            let (number, place) = (member.lane_of(kind), member.places[kind as usize]);
            let lane = &mut self.lanes[number];
            if let Some(is_first) = lane.join(place, event_ns) {
                member.lane = kind;
                if is_first {
                    self.heap.set(self.first_lane + number, event_ns);
                }
                return;
            }
        }
        self.heap.set(dag, event_ns);
    }
}

impl ClassMember {
    /// Returns the number of a lane of the class.
    #[inline]
    fn lane_of(&self, kind: TimerKind) -> usize {
        self.lanes as usize + kind as usize
    }
}

impl ReleaseLane {
    fn new(order: Arc<[(u64, u32)]>) -> Self {
        Self {
            release_ns: 0,
            first: NONE,
            waiting: BitSet::new(order.len()),
            order,
        }
    }

    /// Returns the time of the event of the member at a place.
    #[inline]
    fn event_ns(&self, place: u32) -> u64 {
        self.release_ns + self.order[place as usize].0
    }

    /// Takes the member at a place out, and reports whether it was the first.
    #[inline(always)]
    fn leave(&mut self, place: u32) -> bool {
        self.waiting.remove(place as usize);
        let was_first = self.first == place;
        if was_first {
            self.first = match self.waiting.is_empty() {
                true => NONE,
                false => to_u32(self.waiting.first()),
            };
        }
        was_first
    }

    /// Adds the member at a place, and reports whether it is the first now. Returns `None`, with
    /// nothing changed, if the other members count from another release.
    #[inline(always)]
    fn join(&mut self, place: u32, event_ns: u64) -> Option<bool> {
        let release_ns = event_ns - self.order[place as usize].0;
        // An empty lane counts from any release.
        if self.release_ns != release_ns && self.first != NONE {
            return None;
        }
        self.waiting.insert(place as usize);
        let is_first = place < self.first;
        if is_first {
            (self.first, self.release_ns) = (place, release_ns);
        }
        Some(is_first)
    }

    /// Returns the first member.
    #[inline]
    fn dag(&self) -> usize {
        self.order[self.first as usize].1 as usize
    }
}

impl Hash for Timers {
    /// Hashes the times alone: lanes and the order of a heap decide only the order of DAGs within
    /// an instant.
    fn hash<H: Hasher>(&self, state: &mut H) {
        for timer in 0..self.first_lane {
            self.time_of(timer).hash(state);
        }
    }
}

#[cfg(test)]
mod tests {
    use alloc::vec;

    use random::Random;

    use super::*;
    use crate::{CommitOptions, DagSpec, Policy, Priority, SubtaskSpec, verify};

    #[test]
    fn the_earliest_event_is_known_whatever_lane_has_it() {
        const DAGS: usize = 100;
        let deadline_ns = |dag: usize| (dag as u64 * 37) % 50 + 1;
        let spec = |dag| DagSpec {
            period_ns: Some(100 - dag as u64 % 3 / 2),
            relative_deadline_ns: Some(deadline_ns(dag)),
            subtasks: vec![SubtaskSpec {
                priority: Some(Priority(0)),
                ..SubtaskSpec::default()
            }],
            ..DagSpec::default()
        };
        let specs: Vec<DagSpec> = (0..DAGS).map(spec).collect();
        let options = CommitOptions::new(Policy::StaticPriority, 1);
        let task_set = verify(&specs, &options).expect("they are right").task_set;
        let mut timers = Timers::new(&task_set, ClusterId(0), 1);
        assert_eq!(timers.lanes.len(), 2 * LANES);
        let (mut random, mut times_ns, mut in_lanes) = (Random::new(1), [None; DAGS], 0);
        for _ in 0..20_000 {
            let (dag, job) = (random.index(DAGS), random.within(1..=4_u64));
            let late_ns = 100 * job + deadline_ns(dag) + 1;
            let event = match random.within(0..=4) {
                0 => None,
                1 => Some((late_ns, TimerKind::Deadline)),
                2 => Some((late_ns + random.within(0..=9), TimerKind::Deadline)),
                3 => Some((random.within(0..=500), TimerKind::Other)),
                _ if job % 2 == 0 => Some((100 * job, TimerKind::EvenRelease)),
                _ => Some((100 * job, TimerKind::OddRelease)),
            };
            timers.set_dag(dag, event);
            times_ns[dag] = event.map(|(event_ns, _)| event_ns);
            let found = timers.peek();
            assert_eq!(
                found.map(|(ns, _)| ns),
                times_ns.iter().copied().flatten().min()
            );
            assert!(found.is_none_or(|(ns, dag)| times_ns[dag] == Some(ns)));
            assert!((0..DAGS).all(|dag| timers.time_of(dag) == times_ns[dag]));
            in_lanes += usize::from(timers.members[dag].lane != TimerKind::Other);
        }
        assert!(in_lanes > 2_000, "{in_lanes}");
    }
}
