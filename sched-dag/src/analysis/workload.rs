//! Workload: how much one DAG can execute in a window, whatever else runs.
//!
//! A. Melani, M. Bertogna, V. Bonifaci, A. Marchetti-Spaccamela, G. Buttazzo, "Schedulability
//! Analysis of Conditional Parallel Task Graphs in Multicore Systems", IEEE Trans. Computers 66(2),
//! 2017, doi:10.1109/TC.2016.2584064 (first at ECRTS 2015). Let the DAG use `p` cores at most at
//! any instant, and let every job complete within `R` of its release. Then in any window of length
//! `L`:
//!
//! - `V = min(volume, p R)` is the most work of one job,
//! - `A = p (L + R) - V`, never below 0, is an area,
//! - `W(L) = min(p L, (A / (p T)) V + min(V, A mod (p T)))` is the workload.
//!
//! Under EDF, against a job of relative deadline `D_k`, only jobs with a deadline no later count:
//!
//! - `N = max(0, (D_k - D) / T + 1)` (floor),
//! - `WE = N V + min(V, p max(0, D_k - N T - (D - R)))`,
//!
//! `WE` equals the sum in `W` taken at the area `A = p (D_k - D + R)`, if not negative. So the work
//! in a window is the same sum at the smaller of the two areas.
//!
//! If sinks have deadlines of their own, `D` is the least of them and may be less than `R`: a job
//! counts as a whole as soon as any of its subtasks may win. The job before the `N` whole jobs then
//! ends `R - D` after its least deadline. The same expression covers this case, with a negative
//! `D - R`.
//!
//! The paper has `p = m`. A smaller `p`, the width of the DAG or the number of cores counted, is
//! our own refinement: the worst case packs each job into a rectangle as wide as the job can be.
//! The same holds for a part of a DAG, such as a chain, with the volume of the part and, for a
//! chain, `p = 1`. The form needs jobs without overlap, `R <= T`. Overlapping jobs are dealt out in
//! turn to `k = ceil(R / T)` *lanes*. Within a lane the period is `k T >= R`, so nothing overlaps.
//! The DAG's workload is then at most `k` times a lane's, and at most `min(m, k p) L`.
//!
//! Trap: the closed form overshoots `p L` for short windows; hence the cap.
//!
//! # Bursts: long steps of the scheduler, with many instances becoming ready
//!
//! Each instance is charged for a step in which few instances become ready (`overheads`). Each
//! instance that becomes ready makes its step longer by `ready` at most, and as long as a step
//! lasts it may keep the cores from any instance, even a more urgent one. So in a window of length
//! `L` the time in which some core is lost, beyond the charges, is at most
//!
//! `E(L) = sum over all DAGs on them of ((L + late + carry) / T + 1) burst` (floor)
//!
//! with two bursts a job. The first is `ready` for each source, with `carry = 0`. The second is
//! `ready` for each instance beyond [`WIDE`] made ready by one completion, and for each wait, with
//! `carry = D`, since jobs complete until `D`. Steps follow one another, and each loss counts in a
//! single step. A release waiting for earlier steps is late by at most `late = charge + E(late)`,
//! with `late = 0` on the right.
//!
//! A DAG without a known bound may *fall behind*. With `k` jobs in flight, up to `k` of them may
//! complete in the window besides the jobs released in the window, so `carry = k T`. Where releases
//! wait for room, one completion releases `k` jobs at most. If the completion makes no more than
//! [`WIDE`] instances ready, and the DAG has no second burst, the ordinary charges cover them.
//! Otherwise the `carry` of both bursts grows by `k T` where `k` releases can wait
//! ([`OverrunPolicy::Abort`] and signals), and with [`OverrunPolicy::Queue`] the bursts have no
//! limit.
//!
//! In the equations all cores are busy for `E`. The workloads of the DAGs stay the same.
//!
//! A *device* has a burst as well: its interrupt keeps one core for `C` at most, and the next
//! interrupt begins at least `d` later, so `T = d`, `carry = 0` and the burst is `C`. Meanwhile
//! anything on any core may stand still: an instance, a section and the turn for a section, a
//! release, a step of the scheduler. In the rest of the window all other terms hold. With `C >= d`
//! no equation has a solution.

use alloc::vec::Vec;

use super::AnalysisSettings;
use super::task::Task;
use crate::ids::SubtaskId;
use crate::policy::OverrunPolicy;
use crate::task_set::Dag;

/// A DAG, or a part of a DAG, executing next to the DAG under analysis.
#[derive(Clone, Copy, Debug)]
pub(super) struct InterferingWorkload {
    /// The most work of one job.
    volume: u128,
    /// The period of a lane.
    period: u128,
    response: u128,
    /// The most cores used by one job at an instant.
    parallelism: u128,
    /// The number of sequences into which overlapping jobs are dealt out.
    lanes: u128,
    /// The most cores used by all jobs at an instant.
    cap: u128,
    /// The most work in any window, whatever its length (EDF's `WE`).
    ceiling: Option<u128>,
}

/// A workload at one window length, and its growth from there.
#[derive(Clone, Copy, Debug)]
pub(super) struct WorkloadSegment {
    /// The workload.
    pub(super) value: u128,
    /// The least growth for each further nanosecond of window...
    pub(super) slope: u128,
    /// ...for this many nanoseconds, at least 1; `None`: without end.
    pub(super) span: Option<u128>,
}

impl InterferingWorkload {
    /// Describes a part of `volume_ns` of a task with jobs complete within `response_ns`. One job
    /// uses at most `parallelism` cores, and all jobs together at most `cores < 2^32` cores.
    pub(super) fn new(
        task: &Task,
        volume_ns: u64,
        response_ns: u64,
        parallelism: u64,
        cores: u64,
    ) -> Self {
        let lanes = u128::from(response_ns.div_ceil(task.period_ns()).max(1));
        let (parallelism, response) = (u128::from(parallelism), u128::from(response_ns));
        Self {
            volume: u128::from(volume_ns).min(parallelism * response),
            period: lanes * u128::from(task.period_ns()),
            response,
            parallelism,
            lanes,
            cap: (lanes * parallelism).min(cores.into()),
            ceiling: None,
        }
    }

    /// Adds EDF's limit on work competing with a job of relative deadline `deadline_ns`;
    /// `own_deadline_ns` is the least deadline of this task.
    ///
    /// Only for tasks without overlapping jobs.
    pub(super) fn by_deadlines(mut self, own_deadline_ns: u64, deadline_ns: u64) -> Self {
        self.ceiling = Some(self.due(own_deadline_ns, deadline_ns));
        self
    }

    /// Returns the limit of [`by_deadlines`](Self::by_deadlines).
    fn due(&self, own_deadline_ns: u64, deadline_ns: u64) -> u128 {
        let (own, other) = (u128::from(own_deadline_ns), u128::from(deadline_ns));
        let time = (other + self.response).checked_sub(own);
        time.map_or(0, |time| self.packed(self.parallelism * time).value)
    }

    /// Returns the workload in a window.
    ///
    /// Nothing overflows: times are below 2^64 and parallelism below 2^32, so every area is below
    /// 2^98; the only larger product saturates.
    pub(super) fn at(&self, window_ns: u64) -> WorkloadSegment {
        let body = self.lane(u128::from(window_ns)).times(self.lanes);
        let piece = body.least(self.over(window_ns));
        match self.ceiling {
            Some(ceiling) if piece.value >= ceiling => WorkloadSegment {
                value: ceiling,
                slope: 0,
                span: None,
            },
            Some(ceiling) if piece.slope > 0 => {
                // The piece ends where it meets the ceiling: from there on it does not grow.
                let room = (ceiling - piece.value) / piece.slope;
                let span = Some(piece.span.map_or(room, |span| span.min(room)));
                WorkloadSegment { span, ..piece }.or_one_flat_step()
            }
            _ => piece,
        }
    }

    /// Returns the part of a window's workload that fits into the time for which a job waits, a
    /// shorter time than the window.
    pub(super) fn within(&self, (window_ns, waiting_ns): (u64, u64)) -> WorkloadSegment {
        self.at(window_ns).least(self.over(waiting_ns))
    }

    /// Returns the most work all cores of the jobs could execute in a time.
    pub(super) fn over(&self, time_ns: u64) -> WorkloadSegment {
        WorkloadSegment::new(self.cap * u128::from(time_ns), self.cap, None)
    }

    /// Returns the closed form for one lane, without the cap.
    fn lane(&self, window: u128) -> WorkloadSegment {
        let area = self.parallelism * (window + self.response);
        // A job's volume fits into its response time.
        self.packed(area - self.volume)
    }

    /// Returns the executed part of an area holding one job a period, packed to its beginning.
    fn packed(&self, area: u128) -> WorkloadSegment {
        let pitch = self.parallelism * self.period;
        let (jobs, rest) = (area / pitch, area % pitch);
        let whole = jobs.saturating_mul(self.volume);
        if rest < self.volume {
            let span = (self.volume - rest) / self.parallelism;
            let value = whole.saturating_add(rest);
            WorkloadSegment::new(value, self.parallelism, Some(span)).or_one_flat_step()
        } else {
            let span = (pitch - rest).div_ceil(self.parallelism);
            WorkloadSegment::new(whole.saturating_add(self.volume), 0, Some(span))
        }
    }
}

impl WorkloadSegment {
    /// Nothing, for all windows.
    pub(super) const NONE: Self = Self::new(0, 0, None);

    pub(super) const fn new(value: u128, slope: u128, span: Option<u128>) -> Self {
        Self { value, slope, span }
    }

    /// Returns the smaller of two pieces, for as long as it is certain to stay the smaller.
    pub(super) fn least(self, other: Self) -> Self {
        if self.value <= other.value {
            self.below(other)
        } else {
            other.below(self)
        }
    }

    /// Returns the sum of two pieces.
    pub(super) fn and(self, other: Self) -> Self {
        let span = match (self.span, other.span) {
            (Some(one), Some(two)) => Some(one.min(two)),
            (one, two) => one.or(two),
        };
        Self {
            value: self.value.saturating_add(other.value),
            slope: self.slope + other.slope,
            span,
        }
    }

    /// Returns the least further time for which `cores` cores must execute, after some time, until
    /// this much work is done; `None`: done already.
    pub(super) fn lacks(self, cores: u128, time: u128) -> Option<u128> {
        let gap = self.value.saturating_sub(cores * time);
        if gap == 0 {
            return None;
        }
        let whole_piece = self.span.unwrap_or(u128::MAX);
        let ahead = match cores.checked_sub(self.slope) {
            None | Some(0) => whole_piece,
            Some(closing) => gap.div_ceil(closing).min(whole_piece),
        };
        // The workload never falls, so the work missing now has to be executed in any case.
        Some(ahead.max(gap.div_ceil(cores)))
    }

    /// Returns the lower of two lines to the right of here; of equal values, the line with the
    /// smaller slope.
    pub(super) fn lower(self, other: Self) -> Self {
        match (self.value, self.slope) <= (other.value, other.slope) {
            true => self.until(other),
            false => other.until(self),
        }
    }

    /// Returns this piece for as long as it is certain to stay below a higher piece.
    fn below(self, higher: Self) -> Self {
        self.until(higher).or_one_flat_step()
    }

    /// As [`below`](Self::below), but may be empty: ends at once if the higher piece is met within
    /// 1 ns.
    fn until(self, higher: Self) -> Self {
        let until = match self.slope.checked_sub(higher.slope) {
            None | Some(0) => u128::MAX,
            Some(approach) => (higher.value - self.value) / approach,
        };
        let spans = [Some(until), self.span, higher.span];
        let span = spans.into_iter().flatten().min();
        Self { span, ..self }
    }

    /// Returns the sum of `count` equal pieces.
    fn times(self, count: u128) -> Self {
        Self {
            value: self.value.saturating_mul(count),
            slope: self.slope * count,
            span: self.span,
        }
    }

    /// Replaces an empty piece by a step of 1 ns without growth. The step never exceeds the
    /// workload, which never falls.
    fn or_one_flat_step(self) -> Self {
        if self.span == Some(0) {
            Self {
                slope: 0,
                span: Some(1),
                ..self
            }
        } else {
            self
        }
    }
}

/// The most instances made ready by one completion for which the charges already pay.
const WIDE: usize = 16;

/// The most evaluations of a sum; beyond, the sum counts as endless.
const STEP_LIMIT: u32 = 1024;

/// Returns how many releases of a DAG may wait for room, in units of its limit on jobs in flight;
/// `None`: any number.
pub(super) const fn waiting_rooms(dag: &Dag) -> Option<u128> {
    match dag.overrun() {
        OverrunPolicy::Skip => Some(0),
        // One signal is kept.
        OverrunPolicy::Queue if !dag.is_sporadic() => None,
        OverrunPolicy::Abort | OverrunPolicy::Queue => Some(1),
    }
}

/// The bursts of the DAGs sharing cores.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct WorkloadBursts {
    /// The greatest lateness of a release.
    pub(super) late_ns: u64,
    /// The time needed to go on with an instance on another core.
    pub(super) move_ns: u64,
    /// The place of the first DAG with an unlimited number of bursts, because it may fall behind.
    pub(super) endless: Option<usize>,
    /// `T`, `carry` and `burst` of each.
    repeated: Vec<[u128; 3]>,
}

impl WorkloadBursts {
    /// Returns the bursts of DAGs, analysable or not; each flag tells whether the DAG may fall
    /// behind.
    pub(super) fn of<'a>(
        dags: impl Iterator<Item = (&'a Dag, bool)>,
        settings: &AnalysisSettings,
    ) -> Self {
        let overheads = &settings.overheads;
        let mut bursts = Self {
            move_ns: overheads.of_a_move_ns(settings.preemption),
            ..Self::default()
        };
        let ready_ns = u128::from(overheads.ready_ns);
        for (place, (dag, falls_behind)) in dags.filter(|_| ready_ns > 0).enumerate() {
            let ids = (0..).map(SubtaskId).take(dag.subtasks().len());
            let beyond = ids.map(|id| dag.successors(id).len().saturating_sub(WIDE));
            // Any number of waits may end at once, whenever their jobs are not complete.
            let wakes = dag.subtasks().iter().map(|subtask| subtask.waits().len());
            let (sources, later) = (dag.sources().len(), beyond.chain(wakes).sum::<usize>());
            let period = u128::from(dag.period_ns());
            let in_flight = dag.in_flight() as usize;
            let room = in_flight as u128 * period;
            let is_wide = sources.saturating_mul(in_flight) > WIDE || later > 0;
            let carries = match waiting_rooms(dag) {
                _ if !falls_behind => [0, dag.relative_deadline_ns().into()],
                _ if !is_wide => [0, 0],
                Some(waiting) => [waiting * room, (waiting + 1) * room],
                None => {
                    bursts.endless.get_or_insert(place);
                    [0, 0]
                }
            };
            for (carry, count) in carries.into_iter().zip([sources, later]) {
                bursts.add(period, carry, count as u128 * ready_ns);
            }
        }
        let has_long_steps = !bursts.repeated.is_empty();
        // Without a distance the losses have no end, as with the least distance.
        let distance_ns = overheads.device_distance_ns.max(1);
        bursts.add(distance_ns.into(), 0, overheads.device_ns.into());
        let charge_ns = overheads.of_an_instance_ns(settings.preemption);
        let late_ns = charge_ns.and_then(|charge_ns| bursts.after(charge_ns));
        // With endless lateness each window counts as full of bursts, and nothing is proven.
        bursts.late_ns = match late_ns.filter(|_| bursts.endless.is_none()) {
            _ if !has_long_steps => 0,
            late_ns => late_ns.unwrap_or(u64::MAX),
        };
        bursts
    }

    /// Adds a burst of each period, for jobs released up to a time `carry` before.
    pub(super) fn add(&mut self, period: u128, carry: u128, takes: u128) {
        let same = |other: &&mut [u128; 3]| other[..2] == [period, carry];
        match self.repeated.iter_mut().find(same) {
            Some(other) => other[2] += takes,
            None if takes > 0 => self.repeated.push([period, carry, takes]),
            None => {}
        }
    }

    /// Reports whether all steps are short.
    pub(super) const fn are_none(&self) -> bool {
        self.late_ns == 0
    }

    /// Returns `E` of a window.
    pub(super) fn during(&self, window_ns: u128) -> u128 {
        let time = window_ns.saturating_add(self.late_ns.into());
        let takes = |&[period, carry, burst]: &[u128; 3]| {
            ((time.saturating_add(carry)) / period + 1).saturating_mul(burst)
        };
        let takes = self.repeated.iter().map(takes);
        takes.fold(0, u128::saturating_add)
    }

    /// Returns the time lost by so many cores in a window.
    pub(super) fn on(&self, cores: usize, window_ns: u64) -> WorkloadSegment {
        let time = u128::from(window_ns) + u128::from(self.late_ns);
        let spans = self.repeated.iter();
        let spans = spans.map(|[period, carry, _]| period - (time + carry) % period);
        let value = self.during(window_ns.into()).saturating_mul(cores as u128);
        WorkloadSegment::new(value, 0, spans.min())
    }

    /// Returns the least window with this much time left besides the losses.
    pub(super) fn after(&self, time_ns: u64) -> Option<u64> {
        let mut window_ns = time_ns;
        for _ in 0..STEP_LIMIT {
            let lost_ns = u64::try_from(self.during(window_ns.into())).ok()?;
            match time_ns.checked_add(lost_ns)? {
                same if same == window_ns => return Some(window_ns),
                longer => window_ns = longer,
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::InterferingWorkload;
    use crate::analysis::Task;

    #[test]
    fn e2_e3_and_e13_workloads() {
        let diamond = [(0, 1), (0, 2), (1, 3), (2, 3)];
        let one = Task::new(10, 10, vec![1, 2, 2, 1], &diamond).unwrap();
        let at = |workload: InterferingWorkload, windows: [u64; 3]| {
            windows.map(|l| workload.at(l).value)
        };
        assert_eq!(
            at(InterferingWorkload::new(&one, 6, 5, 2, 2), [8, 11, 14]),
            [6, 12, 12]
        );

        let chain = Task::new(10, 10, vec![2, 3], &[(0, 1)]).unwrap();
        assert_eq!(
            at(InterferingWorkload::new(&chain, 5, 6, 2, 2), [4, 9, 14]),
            [5, 10, 10]
        );
        assert_eq!(
            at(InterferingWorkload::new(&chain, 5, 6, 1, 2), [4, 9, 14]),
            [4, 5, 10]
        );

        let forks = [(0, 1), (0, 2), (0, 3), (1, 4), (2, 4), (3, 4)];
        let two = Task::new(20, 20, vec![1, 3, 3, 3, 1], &forks).unwrap();
        let in_two = InterferingWorkload::new(&one, 6, 9, 2, 2).by_deadlines(10, 20);
        assert_eq!(in_two.at(1000).value, 12);
        let in_one = InterferingWorkload::new(&two, 11, 14, 2, 2).by_deadlines(20, 10);
        assert_eq!(in_one.at(1000).value, 8);
    }

    #[test]
    fn the_limit_of_edf_is_the_one_that_is_published() {
        for (response, own) in [(5, 9), (9, 9), (7, 4), (6, 6)] {
            let task = Task::new(9, 9, vec![2, 3, 5], &[(0, 1)]).unwrap();
            for parallelism in 1..4 {
                let workload = InterferingWorkload::new(&task, 10, response, parallelism, 3);
                let volume = 10.min(parallelism * response);
                for other in 0..60 {
                    let jobs = if other < own {
                        0
                    } else {
                        (other - own) / 9 + 1
                    };
                    let carried_in = (other + response).saturating_sub(jobs * 9 + own);
                    let limit = jobs * volume + volume.min(parallelism * carried_in);
                    assert_eq!(workload.due(own, other), u128::from(limit));
                }
            }
        }
    }

    #[test]
    fn pieces_never_exceed_the_workload_and_it_never_falls() {
        for parallelism in 1..4 {
            for response in 10..22 {
                let task = Task::new(9, 9, vec![2, 3, 5], &[(0, 1)]).unwrap();
                let plain = InterferingWorkload::new(&task, 10, response, parallelism, 3);
                for workload in [plain, plain.by_deadlines(13, 30)] {
                    let values: Vec<u128> = (0..80).map(|l| workload.at(l).value).collect();
                    assert!(values.is_sorted(), "{values:?}");
                    for window in 0..60 {
                        let piece = workload.at(window);
                        let last = piece.span.unwrap_or(20).min(20);
                        assert!(last > 0);
                        for step in 0..=last {
                            let index = usize::try_from(u128::from(window) + step).unwrap();
                            let least = piece.value + piece.slope * step;
                            assert!(values[index] >= least, "{workload:?} {window} {step}");
                        }
                    }
                }
            }
        }
    }
}
