//! The join at the end, for every number of parallel subtasks.

use alloc::format;
use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::sync::atomic::{AtomicU64, Ordering};

use fass::{Dag, SubtaskAttributes};

use common::each_arity;

use crate::{BUDGET, RELATIVE_DEADLINE, WCET_OF_ENDS};

/// How many joins the sink has seen.
#[derive(Clone, Debug, Default)]
pub struct Joins(Arc<Counts>);

#[derive(Debug, Default)]
struct Counts {
    total: AtomicU64,
    mixed: AtomicU64,
}

impl Joins {
    /// Returns the number of joins.
    #[must_use]
    pub fn total(&self) -> u64 {
        self.0.total.load(Ordering::Relaxed)
    }

    /// Returns the number of joins whose values were not all of the job that
    /// was to be joined; the model allows none.
    #[must_use]
    pub fn mixed(&self) -> u64 {
        self.0.mixed.load(Ordering::Relaxed)
    }

    fn join(&self, parts: &[u64]) {
        let job = self.0.total.fetch_add(1, Ordering::Relaxed);
        fass::log!(Debug, "joins", parts = parts.len());
        if parts.iter().any(|part| *part != job) {
            self.0.mixed.fetch_add(1, Ordering::Relaxed);
        }
    }
}

pub(crate) fn register(dag: &Dag, parallel: usize, joins: &Joins) {
    let names: Vec<String> = (0..parallel)
        .map(|branch| format!("part-{branch}"))
        .collect();
    let topics: Vec<&str> = names.iter().map(String::as_str).collect();
    let joins = joins.clone();
    let attributes = SubtaskAttributes::named("sink")
        .wcet(WCET_OF_ENDS)
        .budget(BUDGET);
    macro_rules! register_for {
        ($($number:literal: $($part:ident)+;)+) => {
            match parallel {
                $($number => dag.register_sink_subtask(
                    move |($($part,)+): ($(register_for!(@u64 $part),)+)| joins.join(&[$($part),+]),
                    topics,
                    RELATIVE_DEADLINE,
                    attributes,
                ),)+
                _ => panic!("a fork-join DAG has 1 to 16 parallel subtasks, not {parallel}"),
            }
        };
        (@u64 $part:ident) => { u64 };
    }
    each_arity!(register_for);
}
