//! Cores that are lent: the time that an owner takes from them, and response times in the rest.
//!
//! A heavy DAG *owns* cores: it executes there by a [list schedule](super::ListSchedule), and nothing
//! wins over it. What its lists leave is *lent* to a *group*: some cores, and DAGs that are its
//! *members*, the more urgent first by deadline. On cores of a group on which no owner's subtask
//! executes, ready subtasks of its members do. Proofs are in `docs/bounds.md`, "Lent cores"; here
//! in short.
//!
//! *Busy time.* In a window of length `r` the owner, of period `T`, executes on one of its cores for
//! [`busy_ns`](CoreSupply::busy_ns) at most. Let `b` be the core's work of one job, `s_x` the start
//! of the x-th subtask of its list, `S(s_x)` the work of the list from there on, and
//! `Z(z) = (z / T) b + min(b, z mod T)`. Then it is the largest of `min(b, r)` and of
//! `S(s_x) + Z(r + s_x - T)` for all x with `r + s_x > T`: the window begins with the rest of one
//! job, and all that can follow does. So `r - busy(r)` is the core's supply bound function
//! (I. Shin, I. Lee, RTSS 2003).
//!
//! *One core.* A member is a sequence of its volume there. Its response time is the least `r` with
//! `r >= volume + sum of (r / T_h) volume_h (ceiling) + busy(r)`, over the more urgent members h.
//!
//! *Several cores.* The form of `multi_path`, with each core of the group as one more that
//! interferes, on one core at a time. `r` is proven on `q` cores if for some `j < q`
//!
//! - `(q - j) x >= B_j + sum of busy(r) + sum of W_h(r)`, or
//! - `(q - j) x >= max(1, B_j) + sum of min(busy(r), x) + sum of W_h(r) clipped to x`.
//!
//! *Long steps* (bursts, in `workload`) take `E(r)` from every core. An owner's subtasks are late by
//! as much then, so its lists are shifted; and `E(r)`, or `(q - j) E(r)`, is added on the right. So is,
//! on several cores, the time for going on elsewhere with what an owner's subtask finds on its core.
//!
//! Assumes: `D <= T` for all, subtasks that can be preempted and do not wait, and bounds that all
//! owners and more urgent members keep. Releases may be sporadic.
//!
//! Traps: a job of the owner that is under way when the window begins, which the form without
//! `S(s_x)` leaves out; and `max(1, ..)`, as in `multi_path`.

use alloc::vec::Vec;

use super::cover::parallelism_covers_and_parts;
use super::list_schedule::ScheduledSubtask;
use super::task::Task;
use super::workload::{InterferingWorkload, WorkloadBursts, WorkloadSegment};
use crate::ids::to_u32;

/// The time that one core supplies besides its owner's subtasks.
///
/// See the analysis of lent cores in `docs/bounds.md`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CoreSupply {
    /// The owner's period; without an owner any.
    period_ns: u64,
    /// When the owner's jobs are complete, from their releases on.
    response_ns: u64,
    /// The owner's subtasks on this core, in the order of their starts.
    tails: Vec<ListTail>,
}

/// The part of a list from one subtask on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct ListTail {
    start_ns: u64,
    /// The sum of the WCETs.
    work_ns: u64,
}

impl CoreSupply {
    /// A core that nobody owns.
    pub(super) const UNOWNED: Self = Self {
        period_ns: 1,
        response_ns: 0,
        tails: Vec::new(),
    };

    /// Describes a core with a list of an owner whose lists together have a length, and whose subtasks
    /// are late by so much at most; even then it ends within its period.
    pub(super) fn of(
        period_ns: u64,
        list: &[ScheduledSubtask],
        (length_ns, late_ns): (u64, u64),
    ) -> Self {
        let mut work_ns = 0;
        let tails = list.iter().rev().map(|of| {
            work_ns += of.finish_ns - of.start_ns;
            ListTail {
                start_ns: of.start_ns + late_ns,
                work_ns,
            }
        });
        let mut tails: Vec<ListTail> = tails.collect();
        tails.reverse();
        Self {
            period_ns,
            response_ns: length_ns.saturating_add(late_ns),
            tails,
        }
    }

    /// Returns the most time that the owner executes on this core in any window of a length, both
    /// in nanoseconds; never more than the length, 0 without an owner.
    pub fn busy_ns(&self, window_ns: u64) -> u64 {
        self.busiest(window_ns).0
    }

    /// Returns the part of its time that the owner takes, in millionths, rounded up.
    pub(super) fn taken_ppm(&self) -> u64 {
        let job_ns = self.tails.first().map_or(0, |tail| tail.work_ns);
        parts_per_million(job_ns, self.period_ns)
    }

    /// Returns that time, and by how much it grows at once with the window, one for one.
    fn busiest(&self, window_ns: u64) -> (u64, u64) {
        let job_ns = self.tails.first().map_or(0, |tail| tail.work_ns);
        let within = |time_ns: u64| (job_ns.min(time_ns), job_ns.saturating_sub(time_ns));
        let mut busiest = within(window_ns);
        for tail in &self.tails {
            // From the next release on; it lies in the window if that is not over before.
            if let Some(after_ns @ 1..) = window_ns.checked_sub(self.period_ns - tail.start_ns) {
                // A list takes no more than its period, so this is no more than the window.
                let whole_ns = after_ns / self.period_ns * job_ns;
                let (last_ns, more_ns) = within(after_ns % self.period_ns);
                busiest = busiest.max((tail.work_ns + whole_ns + last_ns, more_ns));
            }
        }
        busiest
    }

    /// Adds the time that it takes members to go on with another core, as the owner's subtasks take
    /// this one.
    fn add_moves(&self, bursts: &mut WorkloadBursts) {
        let takes = self.tails.len() as u128 * u128::from(bursts.move_ns);
        bursts.add(self.period_ns.into(), self.response_ns.into(), takes);
    }

    /// Returns the busy time as work of one core, as far as it surely grows.
    fn at(&self, window_ns: u64) -> WorkloadSegment {
        let (value, more) = self.busiest(window_ns);
        let span = (more > 0).then_some(more.into());
        WorkloadSegment::new(value.into(), u128::from(more > 0), span)
    }
}

/// Returns a part of a period in millionths, rounded up; no more than `u64::MAX`.
pub(super) fn parts_per_million(work_ns: u64, period_ns: u64) -> u64 {
    let parts = (u128::from(work_ns) * 1_000_000).div_ceil(u128::from(period_ns));
    u64::try_from(parts).unwrap_or(u64::MAX)
}

/// A DAG as a member of groups.
pub(super) struct MemberTask<'a> {
    pub(super) task: &'a Task,
    /// The most cores that one job can use, as far as there are any.
    parallelism: u64,
    /// The most work of 1, 2, .. disjoint chains.
    pub(super) covers: Vec<u64>,
    bursts: &'a WorkloadBursts,
}

/// How many terms of equations may be evaluated in one attempt, one for each core and member; a
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

    /// Returns the response-time bound on these cores, among more urgent members, each with its
    /// own; `None` if it is not within the deadline.
    pub(super) fn respond(
        &self,
        cores: &[&CoreSupply],
        above: &[(&Self, u64)],
        steps: &mut u32,
    ) -> Option<u64> {
        // No response is shorter, and from there on all that is to be executed only grows.
        let mut window_ns = match cores {
            [_] => self.task.volume_ns(),
            _ => self.task.length_ns(),
        };
        let terms = to_u32(cores.len() * (above.len() + 1));
        while window_ns <= self.task.relative_deadline_ns() {
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

    /// Returns how much longer a window has to be at least on one core; `None`: it is enough.
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

    /// Returns how much longer a window of at least the length has to be at least on several
    /// cores, by the best form; `None`: it is enough.
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

    /// Returns the forms of the equation on several cores, for a window.
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
    /// The work beside the chains, that of owners and of each more urgent member, and the time that
    /// long steps take.
    pub(super) works: Vec<WorkloadSegment>,
}

#[cfg(test)]
mod tests {
    use super::{CoreSupply, MemberTask, STEP_LIMIT};
    use crate::analysis::workload::WorkloadBursts;
    use crate::analysis::{ScheduledSubtask, Task};
    use random::Random;

    /// A core with the list of an owner, by starts and finishes.
    fn owned(period_ns: u64, list: &[(u64, u64)]) -> CoreSupply {
        let list = list.iter().map(|&(start_ns, finish_ns)| ScheduledSubtask {
            subtask: 0,
            start_ns,
            finish_ns,
        });
        CoreSupply::of(period_ns, &list.collect::<Vec<_>>(), (0, 0))
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
        assert_eq!(member.respond(&[&CoreSupply::UNOWNED], &[], &mut 0), None);
        let alone = member.respond(&[&CoreSupply::UNOWNED], &[], &mut 1);
        assert_eq!(alone, Some(u64::MAX));
    }
}
