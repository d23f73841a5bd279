//! What the machine did, against the reference.

use replay::Case;

use super::transcript::Ran;
use super::{Deviation, Settings};
use crate::oracle::equal;

/// Compares a case with what ran.
///
/// # Errors
///
/// The first difference in the order of the reference's starts, in one line.
pub(super) fn compare(case: &Case, ran: &Ran, settings: &Settings) -> Result<Deviation, String> {
    let unit_ns = settings.scale().unit_ns;
    let mut near = Near {
        unit_ns,
        tolerance_ns: settings.tolerance_ns(),
        deviation: Deviation::default(),
    };
    for (dag, job, subtask) in in_order_of_starts(case) {
        let position = case.dags[dag].position(job, subtask);
        let (expected, found) = (case.instances[position], ran.instances[position]);
        let place = format!("dag {dag} job {job} subtask {subtask}");
        let same = |what, expected, found| equal("ran", &place, what, expected, found);
        near.check(&place, "start", expected.start_ns, found.start_ns)?;
        near.check(&place, "finish", expected.finish_ns, found.finish_ns)?;
        same("preemptions", expected.preemptions, found.preemptions)?;
    }
    let mut ran_jobs = ran.jobs.iter();
    for (dag, jobs) in case.jobs.iter().enumerate() {
        for (job, (expected, found)) in jobs.iter().zip(ran_jobs.by_ref()).enumerate() {
            let place = format!("dag {dag} job {job}");
            let release_ns = expected.release_ns.saturating_mul(unit_ns);
            let same = |what, expected, found| equal("ran", &place, what, expected, found);
            same("release", release_ns, found.release_ns)?;
            near.check(&place, "finish", expected.finish_ns, found.finish_ns)?;
            same("missed", expected.missed.into(), found.missed.into())?;
        }
    }
    if ran.violations > 0 {
        let count = ran.violations;
        return Err(format!(
            "the run breaks the model's rules in {count} places"
        ));
    }
    if ran.allocations > 0 {
        return Err(format!("{} allocations while it ran", ran.allocations));
    }
    Ok(near.deviation)
}

/// Returns each instance's DAG, job and subtask.
fn in_order_of_starts(case: &Case) -> Vec<(usize, usize, usize)> {
    let mut places = Vec::with_capacity(case.instances.len());
    for (number, dag) in case.dags.iter().enumerate() {
        for job in 0..dag.jobs {
            places.extend((0..dag.subtasks).map(|subtask| (number, job, subtask)));
        }
    }
    places.sort_by_key(|&(dag, job, subtask)| {
        let position = case.dags[dag].position(job, subtask);
        case.instances[position].start_ns
    });
    places
}

/// Compares times, and remembers the greatest differences.
struct Near {
    unit_ns: u64,
    tolerance_ns: u64,
    deviation: Deviation,
}

impl Near {
    fn check(&mut self, place: &str, what: &str, units: u64, found_ns: u64) -> Result<(), String> {
        let difference_ns = i128::from(found_ns) - i128::from(units) * i128::from(self.unit_ns);
        if difference_ns.unsigned_abs() > u128::from(self.tolerance_ns) {
            let (whole, part) = (found_ns / self.unit_ns, found_ns % self.unit_ns);
            let thousandths = u128::from(part) * 1000 / u128::from(self.unit_ns);
            return Err(format!(
                "{place}: {what}: expected at {units}, ran at {whole}.{thousandths:03} units"
            ));
        }
        self.deviation = self.deviation.and(Deviation {
            earliest_ns: difference_ns,
            latest_ns: difference_ns,
        });
        Ok(())
    }
}
