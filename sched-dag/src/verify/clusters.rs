//! The checks of clusters: their cores, and the one that each DAG is in; and what they say.

use core::fmt;

use super::fault::Fault;
use super::findings::Findings;
use super::label::DagLabel;
use super::options::CommitOptions;
use crate::ids::ClusterId;
use crate::spec::DagSpec;

/// Checks the clusters of the whole commit.
pub(super) fn check(specs: &[DagSpec], options: &CommitOptions, findings: &mut Findings) {
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

impl Fault {
    /// Writes the text of a fault of clusters.
    pub(super) fn fmt_cluster(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::ClusterWithoutCores { cluster } => {
                write!(f, "cluster {} has no cores; give it one", cluster.0)
            }
            Self::ClustersBeyondCores { wanted, cores } => write!(
                f,
                "the clusters have {wanted} cores, and the machine has {cores}; give them fewer"
            ),
            Self::NoCluster { dag, clusters } => {
                write!(f, "{dag} is in no cluster, and the cores are divided; ")?;
                state_one(*clusters, f)
            }
            Self::UnknownCluster {
                dag,
                cluster,
                clusters,
            } => {
                write!(f, "{dag} is in cluster {}, and ", cluster.0)?;
                if *clusters == 0 {
                    return f
                        .write_str("this machine's cores are not divided; leave its cluster out");
                }
                f.write_str("there is none; ")?;
                state_one(*clusters, f)
            }
            _ => f.write_str(self.code()),
        }
    }
}

/// Writes which clusters can be stated, of so many.
fn state_one(clusters: usize, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    write!(f, "state one up to cluster {}", clusters.saturating_sub(1))
}
