//! Rules R1 and R4: when a job is released, complete, and late.
//!
//! R1: a job is released, queued or skipped at or after O + kT and not both
//! released and skipped; nothing of it is ready or starts before O + kT, nor
//! before its release was made.
//!
//! R4: a job is complete with the last of its instances, which must all be
//! over, and that is noticed in the scheduler's step that the last one brings
//! about, within the bound. It has missed its deadline if and only if the last finish is later
//! than that. A core may finish in time while another is just noticing the
//! miss: that is a breach only if more than the bound lies between.
//!
//! A job that was aborted, or cut short by its DAG's end, is complete with its
//! last instance, too; whether it missed its deadline is not judged. That of a
//! sporadic job is judged where the trace states its nominal release.

use sched_dag::{DagId, Instance, SubtaskId};

use super::breach::{Breach, Rule};
use super::history::History;
use super::model::{Event, Run, What};
use super::view::{Moment, View};

/// What is known of a job.
#[derive(Clone, Debug, Default)]
pub(super) struct JobHistory {
    pub(super) released: Option<Moment>,
    pub(super) queued: Option<Moment>,
    pub(super) skipped: Option<Moment>,
    pub(super) aborted: Option<Moment>,
    pub(super) missed: Option<Moment>,
    pub(super) completed: Option<Moment>,
}

impl JobHistory {
    pub(super) fn is_aborted(&self) -> bool {
        self.aborted.is_some()
    }

    /// Takes note of an event; that it happens twice is a breach.
    pub(super) fn note(&mut self, run: &Run, event: &Event, moment: Moment) -> Option<Breach> {
        let (place, rule) = match event.what {
            What::Released => (&mut self.released, Rule::Release),
            What::Queued => (&mut self.queued, Rule::Release),
            What::Skipped => (&mut self.skipped, Rule::Release),
            What::Aborted => (&mut self.aborted, Rule::Completion),
            What::Missed => (&mut self.missed, Rule::Completion),
            _ => (&mut self.completed, Rule::Completion),
        };
        let Some(earlier) = place else {
            *place = Some(moment);
            return None;
        };
        Some(Breach {
            rule,
            time_ns: event.time_ns,
            text: format!(
                "{} is {} a second time, after {} ns",
                run.job_name(event.dag, event.job),
                event.what,
                earlier.time_ns
            ),
        })
    }
}

/// Judges all jobs by R1 and R4.
pub(super) fn judge(view: &View<'_>, bound_ns: u64, breaches: &mut Vec<Breach>) {
    for (&(dag, job), history) in &view.jobs {
        let judge = Judge {
            view,
            bound_ns,
            dag,
            job,
            history,
        };
        breaches.extend(judge.off_the_grid());
        breaches.extend(judge.too_soon());
        breaches.extend(judge.released_and_skipped());
        breaches.extend(judge.never_released());
        breaches.extend(judge.completed());
        breaches.extend(judge.missed());
    }
    for (&instance, history) in &view.histories {
        breaches.extend(early(view, instance, history));
    }
}

/// R1 for an instance.
fn early(view: &View<'_>, instance: Instance, history: &History) -> Option<Breach> {
    let first = [history.ready, history.start].into_iter().flatten();
    let first = first.min_by_key(|moment| moment.time_ns)?;
    let run = view.run;
    let nominal_ns = run.release_ns(instance.dag, instance.job);
    let job = view.jobs.get(&(instance.dag, instance.job));
    let released = job.and_then(|job| job.released);
    let why = match released {
        _ if first.time_ns < nominal_ns => format!("before its release time {nominal_ns} ns"),
        Some(released) if first.time_ns < released.time_ns => {
            format!("before its release was made at {} ns", released.time_ns)
        }
        None if !view.is_lossy() => "although its job was never released".into(),
        _ => return None,
    };
    let does = match history.start {
        Some(start) if start.time_ns == first.time_ns => "starts",
        _ => "is ready",
    };
    let (name, core) = (run.name(instance), first.core.0);
    Some(Breach {
        rule: Rule::Release,
        time_ns: first.time_ns,
        text: format!("{name} {does} on core {core} {why}"),
    })
}

struct Judge<'v> {
    view: &'v View<'v>,
    bound_ns: u64,
    dag: DagId,
    job: u64,
    history: &'v JobHistory,
}

impl Judge<'_> {
    fn breach(&self, rule: Rule, time_ns: u64, what: &str) -> Breach {
        let name = self.view.run.job_name(self.dag, self.job);
        Breach {
            rule,
            time_ns,
            text: format!("{name} {what}"),
        }
    }

    fn off_the_grid(&self) -> Option<Breach> {
        let nominal_ns = self.view.run.release_ns(self.dag, self.job);
        let JobHistory {
            released,
            queued,
            skipped,
            ..
        } = *self.history;
        let early = [
            ("released", released),
            ("queued", queued),
            ("skipped", skipped),
        ]
        .into_iter()
        .filter_map(|(word, moment)| Some((word, moment?.time_ns)))
        .find(|&(_, time_ns)| time_ns < nominal_ns);
        let (word, time_ns) = early?;
        let what = format!("is {word} before its release time {nominal_ns} ns");
        Some(self.breach(Rule::Release, time_ns, &what))
    }

    /// A sporadic DAG's jobs are due at least T apart, and never before O.
    fn too_soon(&self) -> Option<Breach> {
        let dag = &self.view.run.dags[self.dag.index()];
        let releases = dag.sporadic.as_ref()?;
        let release_ns = *releases.times_ns.get(&self.job)?;
        let before = releases.times_ns.range(..self.job).next_back();
        let earliest_ns = before.map_or(dag.offset_ns, |(_, before_ns)| {
            before_ns.saturating_add(dag.period_ns)
        });
        // An estimated release may be a little later than the nominal one.
        let slack_ns = if releases.are_exact { 0 } else { self.bound_ns };
        (release_ns.saturating_add(slack_ns) < earliest_ns).then(|| {
            let what =
                format!("is due before {earliest_ns} ns, the earliest by its DAG's distance");
            self.breach(Rule::Release, release_ns, &what)
        })
    }

    fn released_and_skipped(&self) -> Option<Breach> {
        let (released, skipped) = (self.history.released?, self.history.skipped?);
        let what = format!("is released at {} ns and also skipped", released.time_ns);
        Some(self.breach(Rule::Release, skipped.time_ns, &what))
    }

    /// What never was released can be neither aborted nor complete.
    fn never_released(&self) -> Option<Breach> {
        let JobHistory {
            aborted, completed, ..
        } = self.history;
        let ends = aborted.or(*completed)?;
        let is_unknown = self.history.released.is_none() && !self.view.is_lossy();
        is_unknown.then(|| {
            let what = "is aborted or completed and never was released";
            self.breach(Rule::Release, ends.time_ns, what)
        })
    }

    /// The job's instances by subtask; `None` where nothing is known.
    fn instances(&self) -> impl Iterator<Item = (Instance, Option<&History>)> {
        let (dag, job) = (self.dag, self.job);
        let subtasks = self.view.run.dags[dag.index()].subtasks.len();
        (0..).take(subtasks).map(move |subtask| {
            let subtask = SubtaskId(subtask);
            let instance = Instance { dag, job, subtask };
            (instance, self.view.histories.get(&instance))
        })
    }

    fn completed(&self) -> Option<Breach> {
        let run = self.view.run;
        let Some(completed) = self.history.completed else {
            return self.never_completed();
        };
        let is_stopped = self.view.stopped.contains_key(&self.dag);
        let mut overs = Vec::new();
        for (instance, history) in self.instances() {
            match history.and_then(History::over) {
                Some(over) if over.time_ns <= completed.time_ns => overs.push(over),
                // Of an ended DAG, an instance may be taken away for good.
                _ if is_stopped => return None,
                None if self.view.is_lossy() && history.is_none() => return None,
                late => {
                    let when = match late {
                        Some(over) => format!("is over only at {} ns", over.time_ns),
                        None => "is not over".into(),
                    };
                    let what = format!("is completed although {} {when}", run.name(instance));
                    return Some(self.breach(Rule::Completion, completed.time_ns, &what));
                }
            }
        }
        let last_ns = overs.iter().map(|over| over.time_ns).max().unwrap_or(0);
        let at_abort = self.history.aborted;
        let is_last = |over: Moment| over.is_same_step(completed);
        let what = if !overs.into_iter().chain(at_abort).any(is_last) {
            let core = completed.core.0;
            format!("is completed in a step on core {core} that no instance of it brought about")
        } else if last_ns.saturating_add(self.bound_ns) < completed.time_ns {
            let late_ns = completed.time_ns - last_ns;
            format!("is completed {late_ns} ns after all of it was over at {last_ns} ns")
        } else {
            return None;
        };
        Some(self.breach(Rule::Completion, completed.time_ns, &what))
    }

    fn never_completed(&self) -> Option<Breach> {
        self.history.released?;
        if self.view.stopped.contains_key(&self.dag) {
            return None;
        }
        let overs = self.instances().map(|(_, history)| history?.over());
        let last_ns = overs
            .map(|over| Some(over?.time_ns))
            .reduce(|last, over| Some(last?.max(over?)))
            .flatten();
        match last_ns {
            Some(last_ns) if last_ns.saturating_add(self.bound_ns) < self.view.end_ns => {
                let what = format!("is not completed although all of it was over at {last_ns} ns");
                Some(self.breach(Rule::Completion, last_ns, &what))
            }
            _ if self.view.run.complete => {
                let what = "is not completed although the run says that it is";
                Some(self.breach(Rule::Completion, self.view.end_ns, what))
            }
            _ => None,
        }
    }

    /// The last finish; `None` if an instance has not finished, or was lost.
    fn finish_ns(&self) -> Option<u64> {
        let finishes = self.instances().map(|(_, history)| history?.finish);
        finishes
            .map(|finish| Some(finish?.time_ns))
            .reduce(|last, finish| Some(last?.max(finish?)))
            .flatten()
    }

    fn missed(&self) -> Option<Breach> {
        let sporadic = &self.view.run.dags[self.dag.index()].sporadic;
        if sporadic
            .as_ref()
            .is_some_and(|releases| !releases.are_exact)
        {
            return None;
        }
        let deadline_ns = self.view.run.deadline_ns(self.dag, self.job);
        let finish_ns = self.finish_ns();
        if let Some(missed) = self.history.missed {
            if missed.time_ns <= deadline_ns {
                let what = format!("is missed before its deadline {deadline_ns} ns has passed");
                return Some(self.breach(Rule::Completion, missed.time_ns, &what));
            }
            let finish_ns = finish_ns.filter(|&finish_ns| {
                finish_ns <= deadline_ns && finish_ns.saturating_add(self.bound_ns) < missed.time_ns
            })?;
            let what = format!(
                "is missed although its last instance finished at {finish_ns} ns, by its \
                 deadline {deadline_ns} ns"
            );
            return Some(self.breach(Rule::Completion, missed.time_ns, &what));
        }
        let JobHistory {
            released,
            queued,
            skipped,
            ..
        } = self.history;
        let is_known = released.or(*queued).is_some();
        // Where its release was lost, so may be that it was aborted.
        let may_be_lost = deadline_ns < self.view.from_ns;
        if !is_known || may_be_lost || skipped.is_some() || self.view.is_cut(self.dag, self.job) {
            return None;
        }
        if let Some(finish_ns) = finish_ns.filter(|&finish_ns| finish_ns > deadline_ns) {
            let what = format!(
                "is not missed although its last instance finished at {finish_ns} ns, after its \
                 deadline {deadline_ns} ns"
            );
            return Some(self.breach(Rule::Completion, finish_ns, &what));
        }
        let is_late = finish_ns.is_none()
            && self.history.completed.is_none()
            && deadline_ns.saturating_add(self.bound_ns) < self.view.end_ns;
        is_late.then(|| {
            let what = format!("is not missed although its deadline {deadline_ns} ns has passed");
            self.breach(Rule::Completion, self.view.end_ns, &what)
        })
    }
}
