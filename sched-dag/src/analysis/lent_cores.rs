//! Lent cores: the time a table takes from its cores, and response times in the rest.
//!
//! On the cores of a table nothing wins over its entries. The time left is *lent* to a *group*:
//! some cores, and DAGs as *members*, ordered by deadline, the more urgent first. Each core of a
//! group executes ready subtasks of its members while no entry executes there. This is a summary;
//! `docs/bounds.md`, "Tables", has the proofs.
//!
//! *Busy time.* Let a stretch without idle time in the table begin at `t`. Take the entries with a
//! start at `t` or later: suppose all entries released by `t` are there at once, and the others
//! arrive at their releases. `busy(r)` is the most work of these entries, over all `t`, that a core
//! executes in the `r` after `t` if it never idles with work pending. The table executes no more in
//! any window of length `r`. The times in the table would give no bound, because an entry that ends
//! early brings later entries forward. So `r - busy(r)` is the core's supply bound function (I.
//! Shin, I. Lee, RTSS 2003).
//!
//! *One core.* There a member executes as one sequence of its volume. Its response time is the
//! least `r` with `r >= volume + sum of (r / T_h) volume_h (ceiling) + busy(r)`, over the more
//! urgent members h.
//!
//! *Several cores.* The form of `multi_path` applies, and each core of the group adds its table as
//! interference on one core at a time. `r` is proven on `q` cores if for some `j < q`
//!
//! - `(q - j) x >= B_j + sum of busy(r) + sum of W_h(r)`, or
//! - `(q - j) x >= max(1, B_j) + sum of min(busy(r), x) + sum of W_h(r) clipped to x`.
//!
//! *Long steps* (bursts, in `workload`) take `E(r)` from every core. The entries of a table of one
//! DAG are then late by as much, and `t` with them; `E(r)`, or `(q - j) E(r)`, is added on the
//! right. On several cores the right side also contains the time for moving members away from cores
//! claimed by entries.
//!
//! Assumes: a right table; members with each job complete by the next release; preemptible subtasks
//! without waits; and bounds kept by all more urgent members. Members may be sporadic.
//!
//! Traps: entries under way or overdue when the window begins; and `max(1, ..)`, as in
//! `multi_path`.

use alloc::vec::Vec;

use super::cover::parallelism_covers_and_parts;
use super::task::Task;
use super::workload::{InterferingWorkload, WorkloadBursts, WorkloadSegment};
use crate::ids::{DagId, to_u32};
use crate::order::sorted;
use crate::table::{CoreList, Table};

/// The time supplied by one core besides the entries of its table.
///
/// See "Tables" in `docs/bounds.md`. In a window starting with a stretch of the table, the core is
/// at first busy without a break. From `full_ns` on, the busy time repeats by laps. Within a lap it
/// is the maximum of all *ramps*: `w - idle`, up to `top`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CoreSupply {
    lap_ns: u64,
    /// The work of one lap.
    work_ns: u64,
    full_ns: u64,
    /// For each ramp, the idle time in a window and the most work; both ascending.
    ramps: Vec<(u64, u64)>,
    /// The number of entries in a lap.
    starts: usize,
    /// The longest time from an entry's release to its start, plus its WCET (which includes its
    /// charge) and the lateness, in nanoseconds.
    waiting_ns: u64,
}

/// An entry, with its WCET alone.
#[derive(Clone, Copy, Debug)]
pub(super) struct SuppliedEntry {
    /// Relative to the beginning of the lap; negative: before the lap.
    pub(super) release_ns: i64,
    pub(super) start_ns: u64,
    pub(super) wcet_ns: u64,
}

impl CoreSupply {
    /// A core without a table.
    pub(super) const FREE: Self = Self {
        lap_ns: 1,
        work_ns: 0,
        full_ns: 0,
        ramps: Vec::new(),
        starts: 0,
        waiting_ns: 0,
    };

    /// Describes the core of a list of a table, with entries late by at most `late_ns`; `task`
    /// returns the task of a DAG.
    pub fn of_list<'a>(
        table: &Table,
        list: &CoreList,
        task: impl Fn(DagId) -> &'a Task,
        late_ns: u64,
    ) -> Self {
        let is_alone = table.is_of_one_dag();
        let entries = list.entries.iter().map(|entry| {
            let task = task(entry.dag);
            SuppliedEntry {
                release_ns: task.release_in_lap_ns(entry.job, is_alone),
                start_ns: entry.start_ns,
                wcet_ns: task.wcets_ns()[entry.subtask.index()],
            }
        });
        Self::of(table.lap_ns, &entries.collect::<Vec<_>>(), late_ns)
    }

    /// Describes a core from its list, in the order of starts.
    pub(super) fn of(lap_ns: u64, list: &[SuppliedEntry], late_ns: u64) -> Self {
        let waits = |of: &SuppliedEntry| {
            let before_ns = of.release_ns.saturating_neg();
            of.start_ns.saturating_add_signed(before_ns)
        };
        // A start is late by no more than its charge, already part of the WCET.
        let until_late = |of: &SuppliedEntry| waits(of) + of.wcet_ns;
        let waiting_ns = list.iter().map(until_late).max().unwrap_or(0);
        let mut supply = Self {
            lap_ns,
            work_ns: list.iter().map(|of| of.wcet_ns).sum(),
            starts: list.len(),
            waiting_ns: waiting_ns.saturating_add(late_ns),
            ..Self::FREE
        };
        // Below these limits no sum of the times overflows.
        let times_ns = [lap_ns, supply.work_ns, supply.waiting_ns];
        let is_small = times_ns.iter().all(|&ns| ns < 1 << 60);
        if !is_small || supply.work_ns >= lap_ns && !list.is_empty() {
            supply.full_ns = u64::MAX;
            return supply;
        }
        let lap = lap_ns.cast_signed();
        let arrivals = list.iter().map(|of| {
            let release_ns = of.release_ns.rem_euclid(lap).cast_unsigned();
            (release_ns, of.wcet_ns)
        });
        let arrivals: Vec<(u64, u64)> = sorted(&arrivals.collect::<Vec<_>>());
        let mut idle_at: Vec<(u64, u64)> = Vec::new();
        for start_ns in stretches(lap_ns, list) {
            let origin_ns = start_ns + late_ns;
            // All work released and not begun, over all laps.
            let open = |of: &SuppliedEntry| {
                let laps = (origin_ns + waits(of) + lap_ns - of.start_ns) / lap_ns;
                of.wcet_ns * laps.saturating_sub(u64::from(of.start_ns < start_ns))
            };
            let open_ns = list.iter().map(open).sum();
            let origin_ns = origin_ns % lap_ns;
            let full_ns = supply.until_idle_ns(&arrivals, origin_ns, open_ns);
            supply.full_ns = supply.full_ns.max(full_ns);
            idle_at.push((origin_ns, full_ns));
        }
        for (origin_ns, full_ns) in idle_at {
            supply.add_ramps(&arrivals, origin_ns, full_ns);
        }
        supply
    }

    /// Returns how long a core stays busy from a time of the lap on, with `open_ns` of work at once
    /// and later arrivals.
    fn until_idle_ns(&self, arrivals: &[(u64, u64)], origin_ns: u64, open_ns: u64) -> u64 {
        let gain_ns = self.lap_ns - self.work_ns;
        // At the end of the lap, after all arrivals.
        let mut room_ns = gain_ns;
        let mut came_ns = 0;
        let mut gaps = Vec::new();
        let first = arrivals.partition_point(|&(ns, _)| ns <= origin_ns);
        for (ns, wcet_ns) in arrivals[first..].iter().chain(&arrivals[..first]) {
            // In the lap ending with the origin.
            let after_ns = (ns + self.lap_ns - origin_ns - 1) % self.lap_ns + 1;
            room_ns = room_ns.max(after_ns.saturating_sub(came_ns));
            gaps.push((after_ns, came_ns));
            came_ns += wcet_ns;
        }
        // Each lap without a gap leaves the next lap less work, by the table's idle time.
        let laps = open_ns.saturating_sub(room_ns).div_ceil(gain_ns);
        let left_ns = open_ns - laps * gain_ns;
        let is_idle = |&&(after_ns, came_ns): &&(u64, u64)| left_ns + came_ns <= after_ns;
        let gap = gaps.iter().find(is_idle);
        laps * self.lap_ns + left_ns + gap.map_or(came_ns, |&(_, came_ns)| came_ns)
    }

    /// Adds the ramps of a window starting at a time of the lap, for the lap from `full_ns` on.
    fn add_ramps(&mut self, arrivals: &[(u64, u64)], origin_ns: u64, busy_ns: u64) {
        let laps = (self.full_ns - busy_ns) / self.lap_ns;
        let (mut now_ns, mut done_ns) =
            (busy_ns + laps * self.lap_ns, busy_ns + laps * self.work_ns);
        self.offer(now_ns - done_ns, done_ns);
        let at_ns = (origin_ns + busy_ns) % self.lap_ns;
        let (begin_ns, end_ns) = (now_ns, self.full_ns + self.lap_ns);
        let mut first = arrivals.partition_point(|&(ns, _)| ns < at_ns);
        for lap in 0.. {
            for (ns, wcet_ns) in &arrivals[first..] {
                let came_ns = begin_ns + lap * self.lap_ns + ns - at_ns;
                if came_ns >= end_ns {
                    return;
                }
                now_ns = now_ns.max(came_ns);
                let idle_ns = now_ns - done_ns;
                now_ns += wcet_ns;
                done_ns += wcet_ns;
                self.offer(idle_ns, done_ns);
            }
            first = 0;
        }
    }

    /// Adds a ramp unless another ramp is as high everywhere, and removes the ramps below.
    fn offer(&mut self, idle_ns: u64, top_ns: u64) {
        let end = self.ramps.partition_point(|ramp| ramp.0 <= idle_ns);
        if end > 0 && self.ramps[end - 1].1 >= top_ns {
            return;
        }
        let first = self.ramps[..end].partition_point(|ramp| ramp.0 < idle_ns);
        let below = self.ramps[first..].partition_point(|ramp| ramp.1 <= top_ns);
        self.ramps.splice(first..first + below, [(idle_ns, top_ns)]);
    }

    /// Returns the most time the table executes on this core in any window of a length, both in
    /// nanoseconds. The result never exceeds the length, and is 0 without a table.
    pub fn busy_ns(&self, window_ns: u64) -> u64 {
        self.busiest(window_ns).0
    }

    /// Returns the busy time, and for how long it keeps growing with the window, one for one.
    fn busiest(&self, window_ns: u64) -> (u64, u64) {
        let Some(after_ns) = window_ns.checked_sub(self.full_ns) else {
            return (window_ns, self.full_ns - window_ns);
        };
        let laps = after_ns / self.lap_ns;
        let within_ns = window_ns - laps * self.lap_ns;
        let is_past = |ramp: &(u64, u64)| ramp.0 + ramp.1 <= within_ns;
        let next = self.ramps.partition_point(is_past);
        let flat_ns = self.ramps[..next].last().map_or(0, |ramp| ramp.1);
        let rising = self.ramps.get(next).map(|&(idle_ns, top_ns)| {
            let busy_ns = within_ns.saturating_sub(idle_ns);
            (busy_ns, idle_ns + top_ns - within_ns)
        });
        let rising = rising.filter(|&(busy_ns, _)| busy_ns >= flat_ns);
        let (busy_ns, more_ns) = rising.unwrap_or((flat_ns, 0));
        (laps * self.work_ns + busy_ns, more_ns)
    }

    /// Adds the time members need to go on with another core when entries take this core.
    fn add_moves(&self, bursts: &mut WorkloadBursts) {
        let takes = self.starts as u128 * u128::from(bursts.move_ns);
        bursts.add(self.lap_ns.into(), self.waiting_ns.into(), takes);
    }

    /// Returns the busy time as work of one core, as far as its growth is certain.
    fn at(&self, window_ns: u64) -> WorkloadSegment {
        let (value, more) = self.busiest(window_ns);
        let span = (more > 0).then_some(more.into());
        WorkloadSegment::new(value.into(), u128::from(more > 0), span)
    }
}

/// Returns the begins of the stretches without idle time made by a list in its lap.
fn stretches(lap_ns: u64, list: &[SuppliedEntry]) -> Vec<u64> {
    let mut begins = Vec::new();
    // Shifted by a lap, so the times are never negative.
    let mut end_ns = 0;
    // In the second pass the carry-over from the lap before is known.
    for _ in 0..2 {
        begins.clear();
        for of in list {
            let start_ns = of.start_ns + lap_ns;
            if start_ns > end_ns {
                begins.push(of.start_ns);
            }
            end_ns = end_ns.max(start_ns) + of.wcet_ns;
        }
        end_ns = end_ns.saturating_sub(lap_ns);
    }
    begins
}

/// Returns a part of a period in millionths, rounded up; at most `u64::MAX`.
pub(super) fn parts_per_million(work_ns: u64, period_ns: u64) -> u64 {
    let parts = (u128::from(work_ns) * 1_000_000).div_ceil(u128::from(period_ns));
    u64::try_from(parts).unwrap_or(u64::MAX)
}

/// A DAG as a member of groups.
pub(super) struct MemberTask<'a> {
    pub(super) task: &'a Task,
    /// The most cores one job can use, out of those available.
    parallelism: u64,
    /// The most work of 1, 2, .. disjoint chains.
    pub(super) covers: Vec<u64>,
    bursts: &'a WorkloadBursts,
}

/// The most terms of equations evaluated in one attempt, one term for each core and member. A
/// member that needs more is not proven. Ordinary sets need hundreds or thousands.
pub(super) const STEP_LIMIT: u32 = 1 << 16;

impl<'a> MemberTask<'a> {
    pub(super) fn of(task: &'a Task, cores: u32, bursts: &'a WorkloadBursts) -> Self {
        let (parallelism, covers, _) = parallelism_covers_and_parts(task, cores);
        Self {
            task,
            parallelism,
            covers,
            bursts,
        }
    }

    /// Returns the response-time bound on these cores among more urgent members, each with its own
    /// bound; `None`: the bound exceeds the deadline, or the steps ran out.
    pub(super) fn respond(
        &self,
        cores: &[&CoreSupply],
        above: &[(&Self, u64)],
        steps: &mut u32,
    ) -> Option<u64> {
        // No response is shorter, and from there on all work to be executed only grows.
        let mut window_ns = match cores {
            [_] => self.task.volume_ns(),
            _ => self.task.length_ns(),
        };
        let terms = to_u32(cores.len() * (above.len() + 1));
        while window_ns <= self.task.within_ns() {
            *steps = steps.checked_sub(terms)?;
            let lack = match cores {
                [core] => self.on_one(core, above, window_ns),
                _ => self.on_several(cores, above, window_ns),
            };
            let Some(lack) = lack else {
                return Some(window_ns);
            };
            window_ns = window_ns.checked_add(u64::try_from(lack).ok()?)?;
        }
        None
    }

    /// Returns how much longer a window has to be at least on one core; `None`: long enough.
    fn on_one(&self, core: &CoreSupply, above: &[(&Self, u64)], window_ns: u64) -> Option<u128> {
        let steady = |work_ns: u64, jobs: u64| {
            WorkloadSegment::new(u128::from(work_ns) * u128::from(jobs), 0, None)
        };
        let lost = self.bursts.on(1, window_ns);
        let own = core.at(window_ns).and(lost);
        let own = own.and(steady(self.task.volume_ns(), 1));
        let all = above.iter().fold(own, |sum, (other, _)| {
            let jobs = window_ns.div_ceil(other.task.period_ns());
            sum.and(steady(other.task.volume_ns(), jobs))
        });
        all.lacks(1, window_ns.into())
    }

    /// Returns how much longer a window, no shorter than the length, has to be at least on several
    /// cores, by the best form; `None`: long enough.
    fn on_several(
        &self,
        cores: &[&CoreSupply],
        above: &[(&Self, u64)],
        window_ns: u64,
    ) -> Option<u128> {
        let waiting_ns = window_ns - self.task.length_ns();
        let lacks = self.forms(cores, above, window_ns).map(|form| {
            let works = form.works.iter().copied();
            let all = works.fold(WorkloadSegment::NONE, WorkloadSegment::and);
            all.lacks(form.free as u128, waiting_ns.into())
        });
        // Without subtasks there are no forms, and nothing to wait for.
        lacks.min().flatten()
    }

    /// Returns the forms of the equation on several cores for a window.
    pub(super) fn forms<'c>(
        &'c self,
        cores: &'c [&CoreSupply],
        above: &'c [(&Self, u64)],
        window_ns: u64,
    ) -> impl Iterator<Item = LentForm> + 'c {
        let waiting_ns = window_ns - self.task.length_ns();
        let all_waiting = WorkloadSegment::new(waiting_ns.into(), 1, None);
        let mut busy = [WorkloadSegment::NONE; 2];
        let mut bursts = self.bursts.clone();
        for core in cores {
            core.add_moves(&mut bursts);
            let of_core = core.at(window_ns);
            busy = [
                busy[0].and(of_core),
                busy[1].and(of_core.least(all_waiting)),
            ];
        }
        let forms = (1..=cores.len()).rev().zip(&self.covers);
        forms.flat_map(move |(free, &cover)| {
            let left = self.task.volume_ns() - cover;
            let own = |left: u64| WorkloadSegment::new(left.into(), 0, None);
            let [mut plain, mut clipped] =
                [[own(left), busy[0]], [own(left.max(1)), busy[1]]].map(Vec::from);
            for &(other, response_ns) in above {
                let used = other.parallelism.min(free as u64);
                let (task, volume_ns) = (other.task, other.task.volume_ns());
                let workload = InterferingWorkload::new(task, volume_ns, response_ns, used, used);
                let in_window = workload.at(window_ns);
                plain.push(in_window);
                clipped.push(in_window.least(workload.over(waiting_ns)));
            }
            let lost = bursts.on(free, window_ns);
            plain.push(lost);
            clipped.push(lost);
            [(false, plain), (true, clipped)].map(|(is_clipped, works)| LentForm {
                free,
                is_clipped,
                works,
            })
        })
    }
}

/// One form of the equation on several cores.
pub(super) struct LentForm {
    /// The number of cores beside the chains.
    pub(super) free: usize,
    pub(super) is_clipped: bool,
    /// The work beside the chains, the work of owners and of each more urgent member, and the time
    /// taken by long steps.
    pub(super) works: Vec<WorkloadSegment>,
}

#[cfg(test)]
mod tests {
    use super::{CoreSupply, MemberTask, STEP_LIMIT, SuppliedEntry};
    use crate::analysis::Task;
    use crate::analysis::workload::WorkloadBursts;
    use random::Random;

    /// A core with the list of an owner, by starts and finishes.
    fn owned(period_ns: u64, list: &[(u64, u64)]) -> CoreSupply {
        let list = list.iter().map(|&(start_ns, finish_ns)| SuppliedEntry {
            release_ns: 0,
            start_ns,
            wcet_ns: finish_ns - start_ns,
        });
        CoreSupply::of(period_ns, &list.collect::<Vec<_>>(), 0)
    }

    fn bound(task: &Task, cores: &[&CoreSupply], above: &[(&Task, u64)]) -> Option<u64> {
        let (count, no_bursts) = (
            u32::try_from(cores.len()).unwrap(),
            WorkloadBursts::default(),
        );
        let above = above
            .iter()
            .map(|&(task, ns)| (MemberTask::of(task, count, &no_bursts), ns));
        let above: Vec<_> = above.collect();
        let above: Vec<_> = above.iter().map(|(member, ns)| (member, *ns)).collect();
        MemberTask::of(task, count, &no_bursts).respond(cores, &above, &mut STEP_LIMIT.clone())
    }

    #[test]
    fn busy_time_is_the_most_over_all_phases_of_a_window() {
        let mut random = Random::new(7);
        for _ in 0..200 {
            let mut list = Vec::new();
            let mut now = random.index(4) as u64;
            for _ in 0..random.index(5) {
                let finish = now + 1 + random.index(5) as u64;
                list.push((now, finish));
                now = finish + random.index(4) as u64;
            }
            let period = now.max(1) + random.index(9) as u64;
            let is_busy = |at: &u64| {
                list.iter()
                    .any(|&(start, finish)| (start..finish).contains(at))
            };
            let job = (0..period).filter(is_busy).count() as u64;
            let supply = owned(period, &list);
            for window in 0..3 * period {
                // The window begins in a job that keeps to its list. The later ones come as
                // soon as they may, and execute at once: what they wait for takes no time.
                let later = |length: u64| length / period * job + job.min(length % period);
                let from = |phase: u64| {
                    let rest = (phase..period.min(phase + window)).filter(is_busy).count() as u64;
                    rest + later((window + phase).saturating_sub(period))
                };
                let most = (0..period).map(from).max().unwrap().max(later(window));
                assert_eq!(supply.busy_ns(window), most, "{list:?} {period} {window}");
            }
        }
    }

    #[test]
    fn busy_time_is_as_defined_where_jobs_outlast_laps_and_are_late() {
        let mut random = Random::new(7);
        for _ in 0..200 {
            let (mut list, mut now) = (vec![], random.index(4) as u64);
            for _ in 0..=random.index(4) {
                let (release_ns, wcet_ns) = (random.within(0..=29_u64), random.within(1..=4));
                list.push(SuppliedEntry {
                    release_ns: now.cast_signed() - release_ns.cast_signed(),
                    start_ns: now,
                    wcet_ns,
                });
                now += wcet_ns + random.within(0..=3);
            }
            let (lap, late) = (now + random.within(1..=4), random.within(0..=2));
            let supply = CoreSupply::of(lap, &list, late);
            // What a core does that never idles with work, from an instant of the lap on.
            let done = |from: u64, window: u64| {
                let (from, late) = (from.cast_signed(), late.cast_signed());
                let (mut left, mut done) = (0, 0);
                for now in from + late..from + late + window.cast_signed() {
                    for (of, lap) in list
                        .iter()
                        .flat_map(|of| (-9..30).map(move |n| (of, n * lap.cast_signed())))
                    {
                        let release = of.release_ns + lap;
                        let is_open = release <= now && of.start_ns.cast_signed() + lap >= from;
                        let is_new = release == now;
                        left += of.wcet_ns
                            * u64::from(if now == from + late { is_open } else { is_new });
                    }
                    done += left.min(1);
                    left -= left.min(1);
                }
                done
            };
            for window in [1, 3, lap / 2, lap, lap + 3, 2 * lap + 1, 4 * lap] {
                let most = (0..lap).map(|from| done(from, window)).max().unwrap();
                assert_eq!(
                    supply.busy_ns(window),
                    most,
                    "{list:?} {lap} {late} {window}"
                );
            }
        }
    }

    #[test]
    fn the_number_of_steps_does_not_depend_on_the_unit_of_time() {
        let unit = 1_000_000_000;
        let task = |wcet_ns| Task::new(20 * unit, 20 * unit, vec![wcet_ns], &[]).unwrap();
        let supply = owned(10 * unit, &[(0, 3 * unit)]);
        let (mut steps, no_bursts) = (20, WorkloadBursts::default());
        // From some window on the owner takes what the window gains, up to the end of its list.
        let (short, long) = (task(5 * unit), task(7 * unit + 1));
        let several =
            MemberTask::of(&short, 2, &no_bursts).respond(&[&supply, &supply], &[], &mut steps);
        let one = MemberTask::of(&long, 1, &no_bursts).respond(&[&supply], &[], &mut steps);
        assert_eq!((several, one), (Some(8 * unit), Some(13 * unit + 1)));
    }

    #[test]
    fn numbers_that_are_too_large_and_too_many_steps_are_not_proven() {
        let large = Task::new(u64::MAX, u64::MAX, vec![u64::MAX], &[]).unwrap();
        let often = Task::new(1, 1, vec![u64::MAX], &[]).unwrap();
        let supply = owned(u64::MAX, &[(0, 1)]);
        for cores in [&[&supply][..], &[&supply, &supply]] {
            assert_eq!(bound(&large, cores, &[(&often, 1)]), None);
        }
        let no_bursts = WorkloadBursts::default();
        let member = MemberTask::of(&large, 1, &no_bursts);
        assert_eq!(member.respond(&[&CoreSupply::FREE], &[], &mut 0), None);
        let alone = member.respond(&[&CoreSupply::FREE], &[], &mut 1);
        assert_eq!(alone, Some(u64::MAX));
    }
}
