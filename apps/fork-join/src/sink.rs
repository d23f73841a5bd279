//! The join at the end, for every number of parallel subtasks.

use alloc::format;
use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::sync::atomic::{AtomicU64, Ordering};

use fass::{Dag, SubtaskAttributes};

use crate::{BUDGET, RELATIVE_DEADLINE, WCET_OF_ENDS};

/// Calls a macro with the rows `1: a;`, `2: a b;` and so on to 16: a number and as many names.
///
/// The inputs of a subtask are a tuple, and the number of elements is part of the tuple's type. To
/// choose the number at run time, each arity must be written out; the table here does so for all
/// users.
#[macro_export]
macro_rules! each_arity {
    ($rows:ident) => {
        $rows! {
            1: a;
            2: a b;
            3: a b c;
            4: a b c d;
            5: a b c d e;
            6: a b c d e f;
            7: a b c d e f g;
            8: a b c d e f g h;
            9: a b c d e f g h i;
            10: a b c d e f g h i j;
            11: a b c d e f g h i j k;
            12: a b c d e f g h i j k l;
            13: a b c d e f g h i j k l m;
            14: a b c d e f g h i j k l m n;
            15: a b c d e f g h i j k l m n o;
            16: a b c d e f g h i j k l m n o p;
        }
    };
}

/// The number of joins, and of mixed joins.
#[derive(Clone, Debug, Default)]
pub struct JoinCount(Arc<SinkCounts>);

#[derive(Debug, Default)]
struct SinkCounts {
    total: AtomicU64,
    mixed: AtomicU64,
}

impl JoinCount {
    /// Returns the number of joins.
    pub fn total(&self) -> u64 {
        self.0.total.load(Ordering::Relaxed)
    }

    /// Returns the number of joins with a value from a job other than the job to be joined; the
    /// model allows none.
    pub fn mixed(&self) -> u64 {
        self.0.mixed.load(Ordering::Relaxed)
    }

    fn join(&self, parts: &[u64]) {
        let job = self.0.total.fetch_add(1, Ordering::Relaxed);
        if parts.iter().any(|part| *part != job) {
            self.0.mixed.fetch_add(1, Ordering::Relaxed);
        }
    }
}

pub(crate) fn register(dag: &Dag, parallel: usize, joins: &JoinCount) {
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
