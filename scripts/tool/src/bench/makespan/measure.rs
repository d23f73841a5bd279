//! The boots: all graphs, one after the other, on one number of cores.

use std::fs;
use std::time::Duration;

use dag_file::{DagFile, Set};

use crate::dag_file::stg::TaskGraph;
use crate::outcome::{Outcome, boot};
use crate::qemu::{Mode, Qemu};
use crate::{image, install, system};

/// The length of a unit of time: long compared with what the kernel takes, as virtual time
/// costs nothing.
const UNIT_NS: u64 = 10_000_000;

/// How long a boot may take in wall time: seconds, whatever the host.
const LIMIT: Duration = Duration::from_secs(600);

/// The makespan of one graph on one number of cores.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Makespan {
    /// The graph's name.
    pub graph: String,
    /// The number of cores.
    pub cores: u64,
    /// Its makespan, in the graph's units of time.
    pub units: u64,
    /// The published optimum, in the same.
    pub optimal: u64,
}

impl Makespan {
    /// Returns the makespan over the optimum.
    #[must_use]
    #[expect(
        clippy::cast_precision_loss,
        reason = "units are far below 2^53, and it is for people"
    )]
    pub fn ratio(&self) -> f64 {
        self.units as f64 / self.optimal as f64
    }

    /// Says which limit is broken, if one is.
    #[must_use]
    pub fn complaint(&self) -> Option<String> {
        let Self {
            graph,
            cores,
            units,
            optimal,
        } = self;
        if units < optimal {
            return Some(format!(
                "{graph} on {cores} cores: {units} units are less than the optimum {optimal}; \
                 either the run or the file is wrong"
            ));
        }
        // 2 - 1/m as a fraction of whole numbers.
        let is_above = units * cores > optimal * (2 * cores - 1);
        is_above.then(|| {
            format!("{graph} on {cores} cores: {units} units are beyond what a list schedule takes")
        })
    }
}

/// Runs graphs on one number of cores, in one boot.
///
/// # Errors
///
/// In words: no QEMU, no image, a graph without an optimum, or the run failed.
pub fn measure(graphs: &[TaskGraph], cores: u64) -> Result<Vec<Makespan>, String> {
    let outcome = run(graphs, cores)?;
    if let Err(fault) = outcome.judge() {
        return Err(format!("{}\n{}", fault.reason, outcome.tail()));
    }
    let _ = fs::remove_file(&outcome.log);
    let lines = outcome.transcript.of_kind("dag_run");
    let mut makespans = Vec::new();
    for (graph, line) in graphs.iter().zip(lines) {
        let name = line.text_at("dag").unwrap_or_default();
        let took_ns = line.number_at("response_time_ns.max").unwrap_or(0);
        if name != graph.name || line.number_at("completed") != Some(1) {
            return Err(format!("the guest did not run `{}`", graph.name));
        }
        let optimal = graph.optimal.get(&cores).copied();
        makespans.push(Makespan {
            graph: graph.name.clone(),
            cores,
            units: (took_ns + UNIT_NS / 2) / UNIT_NS,
            optimal: optimal.ok_or_else(|| format!("`{name}` has no optimum for {cores} cores"))?,
        });
    }
    match makespans.len() == graphs.len() {
        true => Ok(makespans),
        false => Err("the guest did not run all graphs".into()),
    }
}

fn run(graphs: &[TaskGraph], cores: u64) -> Result<Outcome, String> {
    install::ensure_qemu()?;
    let image = image::build("dag-file").map_err(|error| error.to_string())?;
    let sets = graphs.iter().map(|graph| {
        let dag = graph.dag(UNIT_NS).map_err(|malformed| malformed.reason)?;
        Ok(Set {
            name: graph.name.clone(),
            dags: vec![dag],
        })
    });
    let sets = sets.collect::<Result<_, String>>()?;
    let log = system::new_log("dag-file")?;
    let module = log.with_extension("dag");
    fs::write(&module, DagFile { sets }.to_string())
        .map_err(|error| format!("cannot write `{}`: {error}", module.display()))?;
    let qemu = Qemu {
        mode: Mode::Deterministic,
        cores,
        guest_words: format!(
            "mode=deterministic policy=static preemption=off jobs=1 grid_ns={UNIT_NS} show=lines"
        ),
        module: Some(module.clone()),
        ..Qemu::default()
    };
    let outcome = boot(&qemu, &image.path, &log, LIMIT, |_| {});
    // It is ours, and in the way of no one if it cannot be removed.
    let _ = fs::remove_file(&module);
    outcome
}

#[cfg(test)]
mod tests {
    use super::Makespan;

    #[test]
    fn limits_are_the_optimum_and_grahams_bound() {
        let makespan = |cores, units| Makespan {
            graph: "g".into(),
            cores,
            units,
            optimal: 100,
        };
        assert!(
            makespan(2, 99)
                .complaint()
                .unwrap()
                .contains("less than the optimum")
        );
        assert_eq!(makespan(2, 100).complaint(), None);
        assert_eq!(makespan(2, 150).complaint(), None);
        assert!(makespan(2, 151).complaint().unwrap().contains("beyond"));
        assert_eq!(makespan(4, 175).complaint(), None);
        assert!((makespan(2, 150).ratio() - 1.5).abs() < 1e-9);
    }
}
