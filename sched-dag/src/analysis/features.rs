//! Features of the model: what DAGs make use of, and what the proof of a test covers.
//!
//! A test is asked of a DAG only if it covers *every* feature that enters the DAG: those of the
//! machine, the DAG's own, and those of all that may delay it, directly or through others. A test
//! covers nothing but what it names. So a new feature silences all tests, until somebody has read
//! their proofs one by one and names it where it is covered. Where one of several values must hold
//! (an order, one core or several, preemption), each is a feature, the plain one, too: a proof may
//! need any of them.

use alloc::vec::Vec;

use super::AnalysisSettings;
use super::ranks::{InstanceOrder, PreemptionMix, RankRelation};
use super::workload::WorkloadBursts;
use crate::policy::Activation;
use crate::task_set::{Dag, Subtask};

/// Some features.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Features(u32);

/// Names each feature, one bit after the other.
macro_rules! features {
    ($($(#[doc = $doc:literal])+ $NAME:ident)+) => {
        #[allow(non_camel_case_types, clippy::upper_case_acronyms, reason = "it counts the names")]
        enum Bit { $($NAME),+ }

        impl Features {
            $($(#[doc = $doc])+ pub(super) const $NAME: Self = Self(1 << Bit::$NAME as u32);)+
        }
    };
}

features! {
    /// The same order for every job, as by static priorities.
    RANKED
    /// The earliest absolute deadline first.
    BY_DEADLINE
    /// Any other order.
    ANY_ORDER
    /// One core.
    ONE_CORE
    /// Several cores.
    CORES
    /// Each subtask can be preempted.
    PREEMPTION
    /// Each subtask keeps its core.
    ALL_KEEP
    /// Some subtasks keep their cores, and others do not.
    SOME_KEEP
    /// Sinks have deadlines of their own, and the order depends on them.
    SINK_DEADLINES
    /// Of two DAGs each may outrank the other, in the same order for every job.
    INTERLEAVED
    /// Cores are told apart: DAGs are confined to groups of cores, or tables run on some.
    GROUPS
    /// The DAG is in a table, or a core of its group has one.
    TABLE
    /// Subtasks wait.
    WAITS
    /// A deadline is beyond the period, so jobs may overlap.
    LATE_DEADLINES
    /// Fewer jobs may be in flight than the deadline has periods.
    FEW_IN_FLIGHT
    /// Executions are charged what the platform takes.
    OVERHEADS
    /// Steps of the scheduler are long that make much ready.
    BURSTS
    /// A device interrupts a core.
    DEVICE
    /// Jobs are released by signals.
    SPORADIC
}

impl Features {
    /// No feature at all.
    pub(super) const NONE: Self = Self(0);

    /// Returns these and others.
    pub(super) const fn and(self, others: Self) -> Self {
        Self(self.0 | others.0)
    }

    /// Returns these where a condition holds, else none.
    pub(super) const fn if_so(self, holds: bool) -> Self {
        if holds { self } else { Self::NONE }
    }

    /// Reports whether all others are among these.
    pub(super) const fn cover(self, others: Self) -> bool {
        others.0 & !self.0 == 0
    }

    /// Returns by DAG the features of it and of all that may delay it, directly or through others.
    pub(super) fn spread(mut of: Vec<Self>, delays: impl Fn(usize, usize) -> bool) -> Vec<Self> {
        let mut news: Vec<usize> = (0..of.len()).collect();
        while let Some(other) = news.pop() {
            for dag in 0..of.len() {
                if !of[dag].cover(of[other]) && delays(other, dag) {
                    of[dag] = of[dag].and(of[other]);
                    news.push(dag);
                }
            }
        }
        of
    }

    /// Returns the features of the machine. Each setting is named, as the attributes of a DAG are
    /// below.
    pub(super) fn of_machine(
        settings: &AnalysisSettings,
        bursts: &WorkloadBursts,
        tells_cores: bool,
    ) -> Self {
        let AnalysisSettings {
            // Both are in the relation, with what subtasks state.
            policy: _,
            preemption,
            cores,
            overheads,
        } = settings;
        let is_charged = overheads.of_an_instance_ns(*preemption) != Some(0);
        let count = if *cores == 1 {
            Self::ONE_CORE
        } else {
            Self::CORES
        };
        count
            .and(Self::OVERHEADS.if_so(is_charged))
            .and(Self::DEVICE.if_so(overheads.device_ns > 0))
            .and(Self::BURSTS.if_so(!bursts.are_none()))
            .and(Self::GROUPS.if_so(tells_cores))
    }

    /// Returns the features that the DAGs without tables make together.
    pub(super) fn of_order(relation: &RankRelation) -> Self {
        let order = match relation.order {
            InstanceOrder::Ranked => {
                Self::RANKED.and(Self::INTERLEAVED.if_so(relation.interleaves()))
            }
            InstanceOrder::ByDeadline => Self::BY_DEADLINE,
            InstanceOrder::Any => Self::ANY_ORDER,
        };
        let preemption = match relation.preemption {
            PreemptionMix::All => Self::PREEMPTION,
            PreemptionMix::None => Self::ALL_KEEP,
            PreemptionMix::Some => Self::SOME_KEEP,
        };
        let sinks = Self::SINK_DEADLINES.if_so(relation.ranks_sinks);
        order.and(preemption).and(sinks)
    }

    /// Returns the features that the attributes of a DAG make. Each attribute is named: a new one
    /// does not compile before somebody says which feature it makes, or that no proof depends on it.
    pub(super) fn of_dag(dag: &Dag) -> Self {
        let Dag {
            activation,
            period_ns,
            relative_deadline_ns,
            in_flight,
            subtasks,
            locks,
            name: _,
            graph_hash: _,
            // Bounds hold for any offsets and any of the jobs; but those of tables, which are made
            // for their offsets, and of graphs, whose certificates have both.
            offset_ns: _,
            first_job: _,
            jobs: _,
            // What is proven neither overruns nor fails, and what others may is in the bursts.
            overrun: _,
            on_fault: _,
            // A case has the DAGs of one cluster.
            cluster: _,
            why_there: _,
            // Cores are told apart for all DAGs of a case: see `of_machine`.
            affinity: _,
            // An order and a shared state are edges.
            state_precedences: _,
            graph: _,
            topics: _,
        } = dag;
        let room_ns = u128::from(*in_flight) * u128::from(*period_ns);
        let own = Self::SPORADIC
            .if_so(*activation == Activation::Sporadic)
            .and(Self::LATE_DEADLINES.if_so(relative_deadline_ns > period_ns))
            .and(Self::OVERHEADS.if_so(!locks.is_empty()))
            .and(Self::FEW_IN_FLIGHT.if_so(room_ns < u128::from(*relative_deadline_ns)));
        subtasks.iter().map(Self::of_subtask).fold(own, Self::and)
    }

    fn of_subtask(subtask: &Subtask) -> Self {
        let Subtask {
            waits,
            name: _,
            // The analysis sees their sum.
            wcet_ns: _,
            lock_wait_ns: _,
            wcet_source: _,
            budget_ns: _,
            stack_bytes: _,
            // What these come to depends on the settings and on the other DAGs: see `of_order`.
            priority: _,
            non_preemptive: _,
            relative_deadline_ns: _,
        } = subtask;
        Self::WAITS.if_so(!waits.is_empty())
    }
}

/// Returns the features of these names.
macro_rules! covers {
    ($($NAME:ident)+) => {
        $crate::analysis::features::Features::NONE
            $(.and($crate::analysis::features::Features::$NAME))+
    };
}

pub(super) use covers;
