//! The ways an app's function can end, and the verdict on its runs.
//!
//! # The verdict on faults, and on response times beyond their proven bounds
//!
//! An app fails if it ignores a fault that has ended any of its DAGs, and the verdict says so. An
//! app made for faults calls `Machine::accept_faults` and judges them itself.
//!
//! A bound holds as long as no instance takes longer than its WCET, and the machine no longer than
//! the overheads stated at commit. A job with a longer response time therefore proves a stated time
//! too small, and the commit's proof void. Such a run is no success, even if all deadlines are met.
//! An app whose WCETs are not meant for this machine calls `Machine::accept_exceeded_bounds`.
//!
//! In mode `threads` an exceeded bound is printed, but does not affect the verdict: in this mode
//! emulated processors wait for the host's, and no stated overhead can cover such waits.
//!
//! # Calls longer than their WCETs
//!
//! A proof rests on the WCETs, so an exceeded WCET is reported even if every bound has held. A call
//! includes the kernel's own work. A subtask is therefore named only if its longest call exceeds
//! its WCET by more than the overheads charged by the commit.

use alloc::format;
use alloc::string::String;
use core::cell::{Cell, RefCell};
use core::fmt;
use core::sync::atomic::{AtomicBool, Ordering};

use fass::commit::{CommitError, Overheads};
use sched_dag::engine::Run;
use sched_dag::{Dag, DagId, Instance, SubtaskId, TaskSet};

use crate::options::UsageError;
use crate::report::{self, Ns};
use crate::text::json;

/// The reason for an app's ending, other than success.
///
/// ```no_run
/// use kernel::{AppError, options::UsageError};
///
/// let ending = AppError::from(UsageError::new("`jobs=0`: give at least 1"));
/// assert!(matches!(ending, AppError::Usage(_)));
/// assert_eq!(ending.to_string(), "`jobs=0`: give at least 1");
/// ```
pub enum AppError {
    /// The command line is wrong; QEMU exits with 37.
    Usage(UsageError),
    /// The DAGs could not be committed; QEMU exits with 35.
    Commit(CommitError),
    /// Something else went wrong, described in the text; QEMU exits with 35.
    Failure(String),
    /// A person has ended the run, at the console or by ctrl-C; QEMU exits with 33.
    Shutdown,
}

impl AppError {
    /// Judges a run by the number of violated rules of the model.
    ///
    /// # Errors
    ///
    /// [`AppError::Failure`] if any rule was violated.
    pub fn of_violations(count: u64) -> Result<(), Self> {
        match count {
            0 => Ok(()),
            count => Err(Self::Failure(format!("{count} violations"))),
        }
    }

    /// Judges a run ended by a person, and returns how its app ends. Prints the judge's progress
    /// for a person waiting.
    pub fn after_shutdown(run: &Run) -> Self {
        /// The number of events between two lines of progress: a second or so of judging, where
        /// processors are emulated.
        const EVENTS: u64 = 1 << 16;
        let mut tell = |events: u64| {
            if events.is_multiple_of(EVENTS) {
                crate::println!("judging the run: {events} events so far");
            }
        };
        match run.judge(&mut tell).len() {
            0 => Self::Shutdown,
            count => Self::Failure(format!("shut down before its end, with {count} violations")),
        }
    }

    /// Turns a complaint of the kernel into the ending of an app that ends well or by a person's
    /// wish. The app's own error takes precedence.
    pub fn or_complaint(result: Result<(), Self>, complaint: Option<String>) -> Result<(), Self> {
        match (result, complaint) {
            (Ok(()) | Err(Self::Shutdown), Some(text)) => Err(Self::Failure(text)),
            (result, _) => result,
        }
    }
}

/// The outcome of an app, for the program or the machine about to end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AppExit {
    /// The app ended well, or by a person's wish.
    Success,
    /// The command line is wrong.
    Usage,
    /// The app ended for any other reason.
    Failure,
}

/// Prints how the app ended; the verdict is the last line.
pub fn tell(result: &Result<(), AppError>) -> AppExit {
    // Lines logged outside of runs.
    report::tell_log(|| None);
    let (told, word) = match result {
        Ok(()) | Err(AppError::Shutdown) => (AppExit::Success, "success"),
        Err(AppError::Usage(_)) => (AppExit::Usage, "usage"),
        Err(_) => (AppExit::Failure, "failure"),
    };
    if let Err(AppError::Commit(error)) = result {
        for fault in error.faults() {
            json::report("commit_fault", |line| {
                line.text("fault", fault.code()).text("message", fault);
            });
        }
    }
    if let Err(ending) = result {
        crate::println!("{ending}");
    }
    json::report("verdict", |line| {
        line.text("status", word);
        if let Err(ending) = result
            && told != AppExit::Success
        {
            line.text("reason", ending);
        }
    });
    told
}

impl From<UsageError> for AppError {
    fn from(error: UsageError) -> Self {
        Self::Usage(error)
    }
}

impl From<CommitError> for AppError {
    fn from(error: CommitError) -> Self {
        Self::Commit(error)
    }
}

impl fmt::Display for AppError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Usage(error) => error.fmt(f),
            Self::Commit(error) => error.fmt(f),
            Self::Failure(message) => f.write_str(message),
            Self::Shutdown => f.write_str("shut down before its end"),
        }
    }
}

/// Whether the app was compiled without optimization, as reported by its entry.
pub static IS_UNOPTIMIZED: AtomicBool = AtomicBool::new(false);

/// The faults and exceeded bounds known of the runs so far.
pub struct RunVerdict {
    judges_faults: Cell<bool>,
    judges_bounds: Cell<bool>,
    /// Whether several cores share a single clock.
    shares_clock: bool,
    /// The complaint about the DAGs ended by faults, if any.
    fault: RefCell<Option<String>>,
    /// The complaint about the first exceeded bound, if any; not kept if the app judges bounds
    /// itself.
    exceeded: RefCell<Option<String>>,
}

/// The jobs of a DAG with response times beyond the proven bound, up to the end of all sinks or of
/// a single sink.
struct ExceededBound {
    dag: DagId,
    sink: Option<SubtaskId>,
    jobs: u64,
    /// The job with the longest response time.
    job: u64,
    response_ns: u64,
    bound_ns: u64,
}

impl RunVerdict {
    /// Creates the verdict before any run. `shares_clock`: several cores share a single clock.
    pub const fn new(judges_bounds: bool, shares_clock: bool) -> Self {
        Self {
            judges_faults: Cell::new(true),
            judges_bounds: Cell::new(judges_bounds),
            shares_clock,
            fault: RefCell::new(None),
            exceeded: RefCell::new(None),
        }
    }

    /// Leaves the faults of all runs to the app.
    pub fn accept_faults(&self) {
        self.judges_faults.set(false);
    }

    /// Leaves the bounds of all runs to the app.
    pub fn accept_exceeded_bounds(&self) {
        self.judges_bounds.set(false);
    }

    /// Notes the DAGs of a run ended by faults; prints and notes those with response times beyond
    /// their proven bounds. Allocates only if there are any.
    pub fn note(&self, run: &Run) {
        self.note_faults(run.task_set(), |dag| {
            run.statistics(dag).faults - run.statistics(dag).restarts
        });
        let dags = (0..).map(DagId).take(run.task_set().dags().len());
        let ends = dags.flat_map(|dag| {
            let sinks = run.task_set().dag(dag).sinks();
            let several = sinks.iter().filter(|_| sinks.len() > 1).copied().map(Some);
            several.chain([None]).map(move |sink| (dag, sink))
        });
        for exceeded in ends.filter_map(|(dag, sink)| ExceededBound::find(run, dag, sink)) {
            let is_unoptimized = IS_UNOPTIMIZED.load(Ordering::Relaxed);
            let dags = (0..).map(DagId).take(run.task_set().dags().len());
            let has_faults = dags.map(|dag| run.statistics(dag).faults).sum::<u64>() > 0;
            let also = causes(is_unoptimized, self.shares_clock, has_faults);
            let text = exceeded.report(run.task_set(), &also);
            // A complaint kept for an app with its own verdict would count as memory in use.
            if self.judges_bounds.get() {
                self.exceeded.borrow_mut().get_or_insert(text);
            }
        }
    }

    fn note_faults(&self, task_set: &TaskSet, faults: impl Fn(DagId) -> u64) {
        let dags = (0..).map(DagId).zip(task_set.dags());
        let mut ended = dags.filter(|(dag, _)| faults(*dag) > 0);
        let mut complaint = self.fault.borrow_mut();
        if complaint.is_some() {
            return;
        }
        *complaint = ended.next().map(|(_, dag)| {
            let others = match ended.count() {
                0 => String::new(),
                count => format!(", and {count} more"),
            };
            format!(
                "a fault ended dag `{}`{others}; the line that begins with `fault:` says which",
                dag.name()
            )
        });
    }

    /// Takes the app's reason to fail, if there is a reason.
    pub fn complaint(&self) -> Option<String> {
        let fault = self.fault.take().filter(|_| self.judges_faults.get());
        let exceeded = self.exceeded.take();
        fault.or(exceeded.filter(|_| self.judges_bounds.get()))
    }
}

/// Lists the possible causes of calls longer than WCETs valid elsewhere.
fn causes(is_unoptimized: bool, shares_clock: bool, has_faults: bool) -> String {
    let of_image = "; the image's profile does not optimize: boot one that does";
    let of_clock = "; in mode deterministic cores that compute share one clock: `--cores 1` shows \
                    what each call takes alone";
    let of_faults = ", and functions that hold their cores instead (`Occupation::Hold`) share \
                     nothing; a function that a fault has ended took of that clock, too";
    [
        (of_image, is_unoptimized),
        (of_clock, shares_clock),
        (of_faults, shares_clock && has_faults),
    ]
    .into_iter()
    .filter_map(|(cause, applies)| applies.then_some(cause))
    .collect()
}

impl ExceededBound {
    /// Searches the complete jobs of a DAG for response times beyond the bound.
    fn find(run: &Run, dag: DagId, sink: Option<SubtaskId>) -> Option<Self> {
        let bound_ns = match sink {
            Some(sink) => run.sink_bound_ns(dag, sink)?,
            None => run.bound_ns(dag)?,
        };
        let record = run.try_record();
        let end_ns = |job| match sink {
            Some(subtask) => record?.instance(Instance { dag, job, subtask })?.finish_ns,
            None => record?.completion_ns(dag, job),
        };
        let complete = |(job, times): (u64, &sched_dag::law::JobRecord)| {
            times.outcome?;
            Some((end_ns(job)?.saturating_sub(times.release_ns?), job))
        };
        let recorded = record.into_iter().flat_map(|record| record.numbered(dag));
        let responses = recorded.filter_map(complete);
        let late = responses.filter(|(response_ns, _)| *response_ns > bound_ns);
        let (mut jobs, mut longest) = late.fold((0, (0, 0)), |(jobs, longest), of_job| {
            (jobs + 1, of_job.max(longest))
        });
        // The record may have dropped early jobs; the longest response time of all jobs is still
        // known.
        if record.is_none_or(|record| record.first_job(dag) > 0)
            && sink.is_none()
            && let Some(times) = run.times()
            && times.dag(dag).longest().0 > bound_ns
        {
            jobs = jobs.max(1);
            longest = times.dag(dag).longest();
        }
        let (response_ns, job) = longest;
        (jobs > 0).then_some(Self {
            dag,
            sink,
            jobs,
            job,
            response_ns,
            bound_ns,
        })
    }

    /// Prints the exceeded bound, and returns the message.
    fn report(&self, task_set: &TaskSet, also: &str) -> String {
        let dag = task_set.dag(self.dag);
        let name = dag.name();
        let sink = self.sink.map_or(String::new(), |sink| {
            format!("sink `{}` of ", dag.subtask(sink).name())
        });
        let text = format!(
            "{sink}dag `{name}` took {} in job {}, beyond its proven bound of {}; a WCET, or \
             `overheads_ns`, is stated too small{also}",
            Ns(self.response_ns),
            self.job,
            Ns(self.bound_ns)
        );
        crate::println!("bound exceeded: {text}");
        json::emit("bound_exceeded", |line| {
            line.number("dag", self.dag.0).text("dag_name", name);
            if let Some(sink) = self.sink {
                line.number("sink", sink.0);
            }
            line.number("jobs", self.jobs)
                .number("job", self.job)
                .number("response_ns", self.response_ns)
                .number("bound_ns", self.bound_ns);
        });
        text
    }
}

/// Names the subtasks of a run with calls longer than their WCET and these overheads, the overheads
/// charged by the commit.
pub(super) fn note(run: &Run, overheads: Overheads) {
    let set = run.task_set();
    let mut subtasks = set.dags().iter().flat_map(|dag| dag.subtasks());
    if !subtasks.any(|subtask| subtask.wcet_ns().is_some()) {
        return;
    }
    let Some(counts) = run.coarse_times() else {
        return;
    };
    for (dag, model) in (0..).map(DagId).zip(set.dags()) {
        let shares = |other: &&Dag| other.cluster() == model.cluster();
        let mut here = set.dags().iter().filter(shares);
        let overheads = overheads.among(&mut here, run.options().cores);
        let overhead_ns = overheads.of_an_instance_ns(run.options().preemption);
        for (subtask, of_subtask) in (0..).map(SubtaskId).zip(model.subtasks()) {
            let Some(wcet_ns) = of_subtask.wcet_ns() else {
                continue;
            };
            let job = 0;
            let counted = counts.subtask(set.vertex(Instance { dag, job, subtask }));
            let times = counted.execution_time.distribution();
            let (calls, longest_ns) = (times.count(), times.max());
            let without_device_ns = longest_ns.saturating_sub(overheads.of_device_ns(longest_ns));
            // What does not fit into 64 bits is charged as well, and no call takes longer.
            let charged_ns =
                overhead_ns.and_then(|of_segment_ns| of_subtask.charged_ns(of_segment_ns));
            if charged_ns.is_none_or(|charged_ns| without_device_ns <= charged_ns) {
                continue;
            }
            crate::println!(
                "WCET exceeded: subtask `{}` of dag `{}`, {} of {} calls, by {} at most; its WCET \
                 is {}",
                of_subtask.name(),
                model.name(),
                counted.beyond_wcet,
                calls,
                Ns(longest_ns - wcet_ns),
                Ns(wcet_ns)
            );
            json::emit("wcet_exceeded", |line| {
                line.number("dag", dag.0)
                    .text("dag_name", model.name())
                    .number("subtask", subtask.0)
                    .text("subtask_name", of_subtask.name())
                    .number("calls", calls)
                    .number("beyond", counted.beyond_wcet)
                    .number("longest_ns", longest_ns)
                    .number("wcet_ns", wcet_ns);
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use fass::Policy;
    use sched_dag::{CommitOptions, DagSpec, SubtaskSpec, verify};

    use super::*;
    use crate::app::ending::AppError;

    /// Judges an app that had one run of the DAGs `a`, `b` and `c`.
    fn judged(faults: [u64; 3], accepts: bool, result: Result<(), AppError>) -> String {
        let dags = ["a", "b", "c"].map(|name| DagSpec {
            name: name.into(),
            period_ns: Some(10),
            relative_deadline_ns: Some(10),
            subtasks: alloc::vec![SubtaskSpec::default()],
            ..DagSpec::default()
        });
        let options = CommitOptions::new(Policy::Edf, 1);
        let task_set = verify(&dags, &options).expect("sound DAGs").task_set;
        let verdict = RunVerdict::new(true, false);
        verdict.note_faults(&task_set, |dag| faults[dag.index()]);
        if accepts {
            verdict.accept_faults();
        }
        match AppError::or_complaint(result, verdict.complaint()) {
            Ok(()) => "success".into(),
            Err(ending) => format!("{ending}"),
        }
    }

    #[test]
    fn faults_that_nobody_has_accepted_are_a_failure() {
        assert_eq!(judged([0; 3], false, Ok(())), "success");
        let one = "a fault ended dag `b`; the line that begins with `fault:` says which";
        assert_eq!(judged([0, 2, 0], false, Ok(())), one);
        assert_eq!(judged([0, 2, 0], false, Err(AppError::Shutdown)), one);
        assert_eq!(
            judged([1, 0, 1], false, Ok(())),
            "a fault ended dag `a`, and 1 more; the line that begins with `fault:` says which"
        );
    }

    #[test]
    fn the_app_has_the_last_word() {
        assert_eq!(judged([1; 3], true, Ok(())), "success");
        let own = || Err(AppError::Failure("late".into()));
        assert_eq!(judged([1; 3], false, own()), "late");
    }
}
