//! Published bounds, since replaced by multi-path bounds and kept for comparison.
//!
//! The bounds round down, as `bounds.txt` does. Their fixed points are found by small steps, which
//! is slow for times in nanoseconds. All but the last assume `D <= T`; priorities are the order
//! given.
//!
//! - [`graham`]: R. L. Graham, SIAM J. Applied Mathematics 17(2), 1969;
//! - [`long_paths`]: Q. He et al., RTSS 2022: path 0 is a longest path, path `j` a longest path if
//!   the subtasks of the earlier paths weigh nothing;
//! - [`melani_fp`], [`melani_edf`]: A. Melani et al., IEEE Trans. Computers 66(2), 2017;
//! - [`np_safe_fp`]: the same with the blocking of non-preemptive subtasks;
//! - [`li_edf`]: J. Li et al., ECRTS 2014: utilisation of `m / b`, `length <= D / b`, with
//!   `b = (3 - 2/m + sqrt(5 - 8/m + 4/m^2)) / 2`, and `D = T`;
//! - [`bonifaci_edf`]: V. Bonifaci et al., ECRTS 2013, Theorem 21: a density of `(m + 1/2) / 3`,
//!   `length <= D / 3`. The last two say only whether deadlines are met.

use std::cmp::Reverse;

use sched_dag::analysis::{Task, parallelism};

/// Whether a DAG's workload is limited to as many cores as the DAG's width.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Width {
    /// The workload may use all cores, as published.
    Ignored,
    /// The width limits the workload: the bound of Bertogna and Cirinei (RTSS 2007) for chains.
    Used,
}

impl Width {
    fn width(self, task: &Task, cores: u32) -> u64 {
        match self {
            Self::Ignored => u64::from(cores),
            Self::Used => parallelism(task, cores),
        }
    }
}

/// Returns Graham's bound for one job alone.
pub(crate) fn graham(task: &Task, cores: u32) -> u64 {
    task.length_ns() + (task.volume_ns() - task.length_ns()) / u64::from(cores)
}

/// Returns the bound by long paths for one job alone.
pub(crate) fn long_paths(task: &Task, cores: u32) -> u64 {
    let mut weights = task.wcets_ns().to_vec();
    let mut rest = task.volume_ns();
    let waits = (0..u64::from(cores)).map(|j| {
        for subtask in task.longest_path(&weights) {
            // Subtasks of earlier paths weigh nothing from here on.
            rest -= std::mem::take(&mut weights[subtask]);
        }
        rest / (u64::from(cores) - j)
    });
    task.length_ns() + waits.min().unwrap_or(0)
}

/// Bounds response times under fixed priorities; `None`: not accepted.
pub(crate) fn melani_fp(tasks: &[&Task], cores: u32, width: Width) -> Option<Vec<u64>> {
    by_priority(tasks, cores, width, |_| 0)
}

/// Works like [`melani_fp`], for non-preemptive subtasks.
pub(crate) fn np_safe_fp(tasks: &[&Task], cores: u32) -> Option<Vec<u64>> {
    by_priority(tasks, cores, Width::Ignored, |dag| {
        let lower = tasks[dag + 1..].iter();
        let mut wcets: Vec<u64> = lower.flat_map(|task| task.wcets_ns()).copied().collect();
        wcets.sort_by_key(|&wcet| Reverse(wcet));
        let largest = |count: u32| wcets.iter().take(count as usize).sum::<u64>();
        // Each later subtask of the path may be blocked again, on one core less.
        let later = tasks[dag].most_subtasks_on_a_path().saturating_sub(1);
        largest(cores) + later * largest(cores - 1)
    })
}

/// Bounds response times under EDF; `None`: not accepted.
pub(crate) fn melani_edf(tasks: &[&Task], cores: u32) -> Option<Vec<u64>> {
    if !are_constrained(tasks) {
        return None;
    }
    let mut bounds: Vec<u64> = tasks.iter().map(|task| graham(task, cores)).collect();
    // Repeated until no bound changes, since each depends on the others'.
    loop {
        let before = bounds.clone();
        for dag in 0..tasks.len() {
            let deadline = tasks[dag].relative_deadline_ns();
            bounds[dag] = least(tasks[dag], cores, 0, |window| {
                let others = (0..tasks.len()).filter(|&other| other != dag);
                let workloads = others.map(|other| {
                    let used = u64::from(cores);
                    // Under EDF, only jobs with deadlines no later than the DAG's can delay the
                    // DAG.
                    let limit = due(tasks[other], used, bounds[other], deadline);
                    workload(tasks[other], used, bounds[other], window).min(limit)
                });
                workloads.sum()
            })?;
        }
        if bounds == before {
            return Some(bounds);
        }
    }
}

/// Reports whether a set passes the capacity-augmentation test; `None`: a DAG has `D != T`.
pub(crate) fn li_edf(tasks: &[&Task], cores: u32) -> Option<bool> {
    let implicit = |task: &&Task| task.relative_deadline_ns() == task.period_ns();
    let m = f64::from(cores);
    let b = (3.0 - 2.0 / m + (5.0 - 8.0 / m + 4.0 / (m * m)).sqrt()) / 2.0;
    (tasks.iter().all(implicit)).then(|| is_light(tasks, 1.0 / b, m / b))
}

/// Reports whether a set passes the speed-up test.
pub(crate) fn bonifaci_edf(tasks: &[&Task], cores: u32) -> bool {
    is_light(tasks, 1.0 / 3.0, (f64::from(cores) + 0.5) / 3.0)
}

/// Reports whether each length is at most `part` of its deadline, and the density at most
/// `density`.
fn is_light(tasks: &[&Task], part: f64, density: f64) -> bool {
    let mut lengths = (tasks.iter()).map(|task| (task.length_ns(), task.relative_deadline_ns()));
    let volumes = tasks.iter().map(|task| {
        let shorter = task.period_ns().min(task.relative_deadline_ns());
        task.volume_ns() as f64 / shorter as f64
    });
    // Floating-point numbers decide all cases but ties, hence the tolerance.
    lengths.all(|(length, deadline)| length as f64 <= part * deadline as f64 + 1e-9)
        && volumes.sum::<f64>() <= density + 1e-9
}

fn by_priority(
    tasks: &[&Task],
    cores: u32,
    width: Width,
    blocking: impl Fn(usize) -> u64,
) -> Option<Vec<u64>> {
    let mut bounds: Vec<u64> = Vec::new();
    for (dag, task) in tasks.iter().enumerate() {
        let bound = least(task, cores, blocking(dag), |window| {
            let workloads = tasks.iter().zip(&bounds).map(|(task, &bound)| {
                let used = width.width(task, cores);
                workload(task, used, bound, window)
            });
            workloads.sum()
        })?;
        bounds.push(bound);
    }
    Some(bounds).filter(|_| are_constrained(tasks))
}

fn are_constrained(tasks: &[&Task]) -> bool {
    let one = |task: &&Task| task.relative_deadline_ns() <= task.period_ns();
    tasks.iter().all(one)
}

/// Returns the least `r = length + (volume - length + blocking + interference(r)) / m`.
fn least(task: &Task, cores: u32, blocking: u64, interference: impl Fn(u64) -> u64) -> Option<u64> {
    let own = task.volume_ns() - task.length_ns() + blocking;
    let mut response = task.length_ns();
    while response <= task.relative_deadline_ns() {
        let next = task.length_ns() + (own + interference(response)) / u64::from(cores);
        if next <= response {
            return Some(response);
        }
        response = next;
    }
    None
}

/// Returns the largest execution in a window, on `p` cores, of jobs done within `bound`.
fn workload(task: &Task, p: u64, bound: u64, window: u64) -> u64 {
    let (volume, pitch) = (task.volume_ns(), p * task.period_ns());
    let area = (p * (window + bound)).checked_sub(volume);
    let packed = area.map_or(volume, |area| {
        area / pitch * volume + volume.min(area % pitch)
    });
    packed.min(p * window)
}

/// Returns the largest execution of jobs with deadlines no later than `deadline`.
fn due(task: &Task, p: u64, bound: u64, deadline: u64) -> u64 {
    let (volume, own) = (task.volume_ns(), task.relative_deadline_ns());
    let jobs = (deadline.checked_sub(own)).map_or(0, |gap| gap / task.period_ns() + 1);
    let carried = (deadline + bound).saturating_sub(own + jobs * task.period_ns());
    jobs * volume + volume.min(p * carried)
}
