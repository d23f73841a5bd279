//! Features of the model: those a DAG uses, and those the proof of a test covers.
//!
//! A test is asked about a DAG only if the test covers *every* feature entering the DAG: the
//! features of the machine, of the DAG itself, and of all DAGs that may delay it, directly or
//! through others. A test covers nothing but the features it names. So a new feature silences all
//! tests, until somebody has read the proofs one by one and named the feature in each test that
//! covers it. Where one of several values must hold (an order, one core or several, preemption),
//! each value is a feature, the plain value included, because a proof may need any of them.

use alloc::vec::Vec;

use super::AnalysisSettings;
use super::ranks::{InstanceOrder, PreemptionMix, RankRelation};
use super::workload::WorkloadBursts;
use crate::policy::Activation;
use crate::task_set::{Dag, Subtask};

/// A set of features.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Features(u32);

/// Names each feature and gives it the next free bit.
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
    /// Every job has the same order, as with static priorities.
    RANKED
    /// The earliest absolute deadline first.
    BY_DEADLINE
    /// An order of any other kind.
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
    /// Two DAGs may each outrank the other, in the same order for every job.
    INTERLEAVED
    /// Cores are told apart: DAGs are confined to groups of cores, or tables run on some cores.
    GROUPS
    /// The DAG is in a table, or a core of its group has one.
    TABLE
    /// Subtasks wait.
    WAITS
    /// A deadline is beyond the period, so jobs may overlap.
    LATE_DEADLINES
    /// Fewer jobs may be in flight than the deadline has periods.
    FEW_IN_FLIGHT
    /// Executions are charged the platform's costs.
    OVERHEADS
    /// Some steps of the scheduler are long because they make many instances ready.
    BURSTS
    /// A device interrupts a core.
    DEVICE
    /// Jobs are released by signals.
    SPORADIC
}

impl Features {
    /// No feature at all.
    pub(super) const NONE: Self = Self(0);

    /// Returns the union with other features.
    pub(super) const fn and(self, others: Self) -> Self {
        Self(self.0 | others.0)
    }

    /// Returns these features if a condition holds, otherwise none.
    pub(super) const fn if_so(self, holds: bool) -> Self {
        if holds { self } else { Self::NONE }
    }

    /// Reports whether all the others are among these features.
    pub(super) const fn cover(self, others: Self) -> bool {
        others.0 & !self.0 == 0
    }

    /// Returns by DAG its features and those of all DAGs that may delay it, directly or through
    /// others.
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

    /// Returns the features of the machine. Every setting is named, like a DAG's attributes below.
    pub(super) fn of_machine(
        settings: &AnalysisSettings,
        bursts: &WorkloadBursts,
        tells_cores: bool,
    ) -> Self {
        let AnalysisSettings {
            // The relation contains both, together with what subtasks state.
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

    /// Returns the joint features of the DAGs without tables.
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

    /// Returns the features made by the attributes of a DAG. Every attribute is named, so a new
    /// attribute does not compile until somebody says which feature it makes, or that no proof
    /// depends on it.
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
            // Bounds hold for any offsets and any subset of the jobs. Exceptions are tables, made
            // for particular offsets, and graphs, whose certificates contain both.
            offset_ns: _,
            first_job: _,
            jobs: _,
            // Proven DAGs neither overrun nor fail; the bursts account for other DAGs.
            overrun: _,
            on_fault: _,
            // A case contains the DAGs of one cluster.
            cluster: _,
            why_there: _,
            // Cores are told apart for all DAGs of a case: see `of_machine`.
            affinity: _,
            // An order and a shared state are edges already.
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
            // The analysis sees the sum.
            wcet_ns: _,
            lock_wait_ns: _,
            wcet_source: _,
            budget_ns: _,
            stack_bytes: _,
            // Their effect depends on the settings and on the other DAGs: see `of_order`.
            priority: _,
            non_preemptive: _,
            relative_deadline_ns: _,
        } = subtask;
        Self::WAITS.if_so(!waits.is_empty())
    }
}

/// Returns the set of the named features.
macro_rules! covers {
    ($($NAME:ident)+) => {
        $crate::analysis::features::Features::NONE
            $(.and($crate::analysis::features::Features::$NAME))+
    };
}

pub(super) use covers;
