//! The commit of DAGs that are added to a run, and their removal.
//!
//! The added DAGs are verified by themselves, and the answer is about all: those that run, and
//! those that come. What was running is changed by neither, whether the addition is refused or not.

use alloc::format;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::time::Duration;

use sched_dag::{CommitOptions, ConstructionPolicy, Count, DagId, TaskSet, Verified, Warning};

use super::answer::Answers;
use super::demands::{demands_of, lacking_proofs};
use super::error::CommitError;
use super::fault::Fault;
use super::tie::tie;
use super::{Commit, staleness, verify};
use crate::api::dag::Dag;
use crate::platform::{self, Additions, LaunchError, Platform};

impl Commit {
    /// Adds DAGs to those that run, and returns when their time begins, counted from the beginning
    /// of the run: their first releases come their offsets later.
    ///
    /// The answers are made anew, about all DAGs, before anything changes: they are what
    /// [`answers`](Self::answers) returns from now on. To the DAGs that run, nothing happens but
    /// that others delay them from now on as the answers say.
    /// Added DAGs may share values and signals among themselves, and not with those that run;
    /// nothing of them is recorded, and they make no requests but signals.
    ///
    /// # Errors
    ///
    /// As [`finish_create_dags`](crate::finish_create_dags): any fault of the added DAGs, a lacking proof that *any* DAG
    /// demands, or a platform that takes no DAGs during a run. Everything goes on as it was then.
    ///
    /// # Examples
    ///
    /// ```
    /// use core::time::Duration;
    /// use fass::{Dag, SubtaskAttributes, create_dag, finish_create_dags};
    /// use virtual_time::VirtualTime;
    ///
    /// let ms = Duration::from_millis;
    /// let ticking = |name, wcet| -> Dag {
    ///     let dag = create_dag();
    ///     dag.name(name).jobs(5).demand_proof();
    ///     let tick = SubtaskAttributes::named("tick").wcet(ms(wcet));
    ///     dag.period(ms(10)).relative_deadline(ms(10));
    ///     dag.register_untyped_subtask(|_job| (), tick);
    ///     dag
    /// };
    /// let machine = VirtualTime::new();
    /// let mut commit = finish_create_dags(&[ticking("first", 6)]).unwrap();
    /// machine.run_for(ms(25));
    ///
    /// let error = commit.add(&[ticking("heavy", 5)]).unwrap_err();
    /// assert_eq!(error.faults()[0].code(), "not_proven");
    /// let light = ticking("light", 3);
    /// assert_eq!(commit.add(&[light.clone()]).unwrap(), ms(25));
    /// machine.run_for(ms(15));
    ///
    /// commit.remove(&light).unwrap(); // the job of 35 ms is the last
    /// let report = machine.run();
    /// assert_eq!(report.violations(), []);
    /// assert_eq!(report.statistics[0].completed, 5);
    /// assert_eq!(report.statistics[1].completed, 2);
    /// ```
    pub fn add(&mut self, dags: &[Dag]) -> Result<Duration, CommitError> {
        self.add_with(dags, ConstructionPolicy::paper())
    }

    /// Works like [`add`](Self::add) for other shapes of graph. See [`add`](Self::add).
    ///
    /// # Errors
    ///
    /// As [`add`](Self::add), except for the shapes that `construction` allows.
    pub fn add_with(
        &mut self,
        dags: &[Dag],
        construction: ConstructionPolicy,
    ) -> Result<Duration, CommitError> {
        let (platform, additions) = taking().map_err(refused)?;
        let construction = ConstructionPolicy {
            writers: Count::One,
            ..construction
        };
        let options = CommitOptions::new(platform.policy(), platform.cores())
            .with_construction(construction)
            .with_clusters(self.task_set.division())
            .with_priorities_after(self.task_set.last_priority());
        let Verified {
            task_set: added,
            mut warnings,
        } = verify(dags, options, platform.wcets().as_deref())?;
        dags.iter().try_for_each(is_addable).map_err(refused)?;
        let first = self.task_set.dags().len();
        let is_there = |dag: &DagId| dag.index() >= first || additions.counts(self.number, *dag);
        let all = self.task_set.with_added(&added, 0);
        let there: Vec<DagId> = all.ids().filter(is_there).collect();
        check_names(&all, &there, first).map_err(refused)?;
        let answered = all.only(|dag| there.contains(&dag));
        let answers = Answers::new(&answered, platform).put_into(&self.answers, &there);
        let certain = answers.certain_misses();
        warnings.extend(certain.map(|(dag, reason)| Warning::CertainMiss { dag, reason }));
        let demands = [&self.demands[..], &demands_of(dags)].concat();
        let faults = lacking_proofs(&demands, &answers);
        if !faults.is_empty() {
            return Err(CommitError { faults, warnings });
        }
        let mut staleness = self.staleness.clone();
        staleness.extend(staleness::of_all(dags, &added, &answers.of_dags[first..]));
        for sample in &mut staleness {
            let writer = sample.writer_dag.id;
            sample.bound = staleness::bound(all.dag(writer), &answers.of_dags[writer.index()]);
        }
        let place = (self.number, u32::try_from(first).unwrap_or(u32::MAX));
        let added = Arc::new(added);
        let plan = tie(dags, place, Arc::clone(&added), &answers, staleness.clone());
        let from_ns = additions.add(plan).map_err(refused)?;
        *self = Self {
            warnings,
            answers,
            staleness,
            task_set: Arc::new(self.task_set.with_added(&added, from_ns)),
            answered: Arc::new(answered),
            number: self.number,
            demands,
        };
        Ok(Duration::from_nanos(from_ns))
    }

    /// Removes a DAG from the run: it releases nothing more, what is in flight comes to its end,
    /// then its functions and values are given back. What it wrote last stays with those that
    /// sample it, and signals to it are dropped.
    ///
    /// The [`answers`](Self::answers) stay as they are until DAGs are added. Then the removed one
    /// counts no more, once nothing that it has delayed is in flight: from the first addition or
    /// removal on that finds no job of its cluster in flight.
    ///
    /// See [`add`](Self::add).
    ///
    /// # Errors
    ///
    /// If the DAG is not of this commit, or the platform removes none.
    pub fn remove(&mut self, dag: &Dag) -> Result<(), LaunchError> {
        let (_, additions) = taking()?;
        let committed = dag.draft.borrow().committed;
        let Some((_, dag)) = committed.filter(|(plan, _)| *plan == self.number) else {
            return Err(LaunchError::new(
                "a dag is to be removed that is not of this commit; give the handle of one that is",
            ));
        };
        additions.remove(self.number, dag)?;
        self.demands[dag.index()] = false;
        Ok(())
    }
}

/// Returns the platform, if it takes DAGs during a run.
fn taking() -> Result<(&'static dyn Platform, &'static dyn Additions), LaunchError> {
    let platform = platform::expect_installed();
    let additions = platform.additions().ok_or_else(|| {
        LaunchError::new("this platform takes no dags during a run; commit all in one call")
    })?;
    Ok((platform, additions))
}

/// Refuses an added DAG that has the name of one that is there; people would mean either by it.
fn check_names(all: &TaskSet, there: &[DagId], first: usize) -> Result<(), LaunchError> {
    let (present, added): (Vec<DagId>, _) = there.iter().partition(|dag| dag.index() < first);
    let name = |dag: &DagId| all.dag(*dag).name();
    let is_taken = |of: &&str| !of.is_empty() && present.iter().any(|dag| name(dag) == *of);
    match added.iter().map(name).find(is_taken) {
        None => Ok(()),
        Some(name) => Err(LaunchError::new(format!(
            "dag `{name}` is added to a run that has one of this name, or had it and has jobs in \
             flight since then; give it another name, or remove that one first"
        ))),
    }
}

/// Reports what a DAG states that none can that is added.
fn is_addable(dag: &Dag) -> Result<(), LaunchError> {
    let draft = dag.draft.borrow();
    if !draft.recorded.is_empty() {
        return Err(LaunchError::new(
            "a dag is added to a run, and a topic of it is recorded; record topics of the first \
             commit only",
        ));
    }
    if draft.lifecycle.is_some() {
        return Err(LaunchError::new(
            "a dag is added to a run, and pauses dags, starts paused, has to do with modes or \
             ends the run; commit it with the first ones",
        ));
    }
    Ok(())
}

fn refused(error: LaunchError) -> CommitError {
    CommitError {
        faults: Vec::from([Fault::NotLaunched(error)]),
        warnings: Vec::new(),
    }
}
