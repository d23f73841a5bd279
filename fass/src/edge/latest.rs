//! The last jobs before a fault, kept where nothing else is recorded or replayed.
//!
//! Only inputs are kept, in memory that is taken at the launch ([`LatestJobs`]). Nothing is sent
//! unless an instance fails; then a drain makes a recording of them, when the run is over. It is
//! one that is cut, for some of its jobs may lack an input.

use alloc::boxed::Box;
use alloc::string::String;
use alloc::vec::Vec;
use core::mem;

use recording::{Channel, Entry, Header, What};
use sched_dag::journal;
use sched_dag::{DagId, Instance, Notice};

use super::drain::{Releases, SIGNALS};
use super::guard::narrow;
use super::replay::Outcome;
use super::{Crossing, Drain, Drained, Record, name, open};
use crate::run::crossing::Recorded;
use crate::run::latest_jobs::LatestJobs;
use crate::run::line::LineOf;
use crate::run::plan::Plan;

/// Keeps the last jobs.
pub(super) struct Latest {
    app: &'static str,
    jobs: u32,
    /// What the next plan says of itself.
    header: Header,
    /// From the launch on, if there is memory.
    kept: Option<Kept>,
}

/// What is kept of a plan.
struct Kept {
    header: Header,
    latest: LatestJobs,
    releases: Vec<Releases>,
    lines: Vec<LineOf>,
    /// The first instance of each DAG that has failed, and when.
    faults: Vec<(Instance, u64)>,
}

impl Latest {
    pub(super) fn new(app: &'static str, jobs: u32) -> Self {
        Self {
            app,
            // No more than signals are remembered of.
            jobs: jobs.min(SIGNALS),
            header: Header::default(),
            kept: None,
        }
    }
}

impl Crossing for Latest {
    fn open(&mut self, dag: DagId, graph: u64, channels: &[Channel]) -> bool {
        open(&mut self.header, dag, graph, channels);
        false
    }

    fn launch(&mut self, plan: &mut Plan) -> Result<(), String> {
        let mut header = mem::take(&mut self.header);
        name(&mut header, self.app, &plan.task_set);
        plan.keep_states_of(self.jobs);
        // Without memory the app runs as if nothing was kept, for nobody has asked for it.
        let latest = LatestJobs::new(&header.channels, self.jobs);
        self.kept = latest.map(|latest| Kept {
            header,
            latest,
            releases: Releases::of_all(&plan.task_set),
            lines: mem::take(&mut plan.lines),
            faults: Vec::with_capacity(plan.task_set.dags().len()),
        });
        Ok(())
    }

    fn record(&mut self, value: &Recorded<'_>, at_ns: u64) {
        if let Some(kept) = &mut self.kept {
            kept.latest.take(&Recorded {
                completed_ns: at_ns,
                ..*value
            });
        }
    }

    fn happened(&mut self, notice: &Notice) {
        let (dag, job) = (notice.event.dag.index(), notice.event.job);
        // A skipped job counts, or those after it would be others in a replay.
        if let journal::What::Due | journal::What::Skipped = notice.event.what
            && let Some(kept) = &mut self.kept
            && let Some(release_ns) = notice.at_ns
            && let Some(releases) = kept.releases.get_mut(dag)
            && kept.latest.is_of_interest(dag, job)
        {
            releases.note(job, release_ns);
        }
    }

    fn failed(&mut self, instance: Instance, at_ns: u64, _clock_ns: u64) {
        if let Some(kept) = &mut self.kept {
            for of in kept.lines.iter().filter(|of| of.is_found_by(instance)) {
                of.line.show(at_ns, |sample| kept.latest.take(sample));
            }
            kept.latest.hold(instance.dag.index(), instance.job);
            if kept
                .faults
                .iter()
                .all(|(other, _)| other.dag != instance.dag)
            {
                kept.faults.push((instance, at_ns));
            }
        }
    }

    fn lend(&self, _channel: u16, _job: u64, _take: &mut dyn FnMut(&[u8])) {}

    fn drain(&mut self) -> Option<Box<dyn Drain>> {
        let kept = self.kept.take_if(|kept| !kept.faults.is_empty())?;
        Some(Box::new(OfLatest(kept)))
    }

    fn outcome(&self, _is_over: bool) -> Option<Outcome> {
        None
    }
}

/// Makes the file.
struct OfLatest(Kept);

impl Drain for OfLatest {
    fn begin(&mut self, to: &mut Record) {
        let Kept {
            header,
            latest,
            releases,
            faults,
            ..
        } = &self.0;
        to.header(header);
        let mut write = |what, dag, place, job, at_ns, value: &[u8]| {
            let release_ns = releases[usize::from(dag)].of(job).unwrap_or(at_ns);
            let entry = Entry {
                what,
                dag,
                place,
                job,
                release_ns,
                at_ns,
                value,
            };
            to.write(&entry);
        };
        for (dag, of_dag) in (0_u16..).zip(releases) {
            if let Releases::Periodic { .. } = of_dag {
                continue;
            }
            for job in latest.jobs(dag.into()) {
                if let Some(release_ns) = of_dag.of(job) {
                    write(What::Signal, dag, 0, job, release_ns, &[]);
                }
            }
        }
        for value in latest.values() {
            let dag = header.channels[usize::from(value.channel)].dag;
            let what = value.bytes.map_or(What::Lost, |_| What::Value);
            let (at_ns, bytes) = (value.completed_ns, value.bytes.unwrap_or_default());
            write(what, dag, value.channel, value.job, at_ns, bytes);
        }
        for &(instance, at_ns) in faults {
            if let Some((dag, place)) = narrow(instance) {
                write(What::Fault, dag, place, instance.job, at_ns, &[]);
            }
        }
    }

    /// All has been sent at the beginning.
    fn step(&mut self, _to: Option<&mut Record>) -> bool {
        false
    }

    fn end(&mut self, to: &mut Record) -> Option<Drained> {
        Some(Drained {
            entries: to.entries(),
            lost: to.lost(),
            is_cut: true,
        })
    }
}
