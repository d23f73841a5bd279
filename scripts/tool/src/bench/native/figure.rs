//! One measured quantity, for people and for machines.

use std::fmt::Write;

/// A distribution of times, in nanoseconds.
pub(super) struct Figure {
    workload: String,
    /// What is measured: one step of what.
    what: &'static str,
    /// What runs it.
    runner: &'static str,
    workers: u32,
    /// Sorted.
    samples: Vec<f64>,
}

impl Figure {
    /// Makes a figure of at least one sample.
    pub(super) fn new(
        workload: impl ToString,
        what: &'static str,
        runner: &'static str,
        workers: u32,
        mut samples: Vec<f64>,
    ) -> Self {
        samples.sort_unstable_by(f64::total_cmp);
        Self {
            workload: workload.to_string(),
            what,
            runner,
            workers,
            samples,
        }
    }

    /// Returns the least time.
    pub(super) fn min(&self) -> f64 {
        self.samples[0]
    }

    /// Returns the time that half of the samples do not exceed.
    pub(super) fn median(&self) -> f64 {
        self.samples[self.samples.len() / 2]
    }

    fn p99(&self) -> f64 {
        self.samples[(self.samples.len() * 99).div_ceil(100) - 1]
    }

    /// Returns a table of figures.
    pub(super) fn table(figures: &[Self]) -> String {
        let mut text = format!(
            "{:14}{:38}{:18}{:>8}{:>10}{:>10}{:>10}\n",
            "", "ns", "bodies, policy", "workers", "min", "median", "p99"
        );
        let mut last = "";
        for figure in figures {
            let is_same = std::mem::replace(&mut last, &figure.workload) == figure.workload;
            let name = if is_same { "" } else { last };
            // Writing to a string cannot fail.
            let _ = writeln!(
                text,
                "{name:14}{:38}{:18}{:>8}{:>10.1}{:>10.1}{:>10.1}",
                figure.what,
                figure.runner,
                figure.workers,
                figure.min(),
                figure.median(),
                figure.p99()
            );
        }
        text
    }

    /// Returns the machine line.
    pub(super) fn json(&self) -> String {
        format!(
            "{{\"kind\":\"bench\",\"name\":\"native\",\"workload\":\"{}\",\"what\":\"{}\",\
             \"runner\":\"{}\",\"workers\":{},\"samples\":{},\
             \"min_ns\":{:.2},\"median_ns\":{:.2},\"p99_ns\":{:.2}}}",
            self.workload,
            self.what,
            self.runner,
            self.workers,
            self.samples.len(),
            self.min(),
            self.median(),
            self.p99()
        )
    }
}
