//! The checks of clusters: their cores, and the one that each DAG is in.

use super::fault::Fault;
use super::findings::Findings;
use super::label::DagLabel;
use super::options::CommitOptions;
use crate::ids::ClusterId;
use crate::spec::DagSpec;

/// Checks the clusters of the whole commit.
#[inline(never)]
pub(super) fn check(specs: &[&DagSpec], options: &CommitOptions, findings: &mut Findings) {
    let sizes = options.clusters.sizes();
    for (cluster, _) in (0..)
        .map(ClusterId)
        .zip(sizes)
        .filter(|(_, size)| **size == 0)
    {
        findings.fault(0, Fault::ClusterWithoutCores { cluster });
    }
    let wanted: u64 = sizes.iter().copied().map(u64::from).sum();
    let cores = options.cores;
    if wanted > cores.into() {
        findings.fault(0, Fault::ClustersBeyondCores { wanted, cores });
    }
    for (dag, spec) in specs.iter().enumerate() {
        let clusters = sizes.len();
        let is_known = match spec.cluster {
            None => clusters == 0,
            Some(cluster) => cluster.index() < clusters.max(1),
        };
        if is_known {
            continue;
        }
        let label = DagLabel::new(specs, dag);
        let fault = match spec.cluster {
            None => Fault::NoCluster {
                dag: label,
                clusters,
            },
            Some(cluster) => Fault::UnknownCluster {
                dag: label,
                cluster,
                clusters,
            },
        };
        findings.fault(dag, fault);
    }
}
