//! A machine in virtual time whose own work takes time.
//!
//! The scheduler is that of the project; what it costs is drawn, up to what is charged:
//!
//! - a timer interrupt is late, so a release is, unless a completion's step comes first;
//! - an instance that starts keeps its core for the decision and two switches more;
//! - a step that releases jobs takes the longer, the more instances become ready; meanwhile no
//!   core goes on, and no other step begins;
//! - one that is resumed keeps it for an interrupt more, which the one that preempted it pays.
//!
//! What is observed is the response of each job, from its nominal release on.

use std::collections::BTreeMap;
use std::sync::Arc;

use common::random::Random;
use sched_dag::analysis::Overheads;
use sched_dag::journal::What;
use sched_dag::{Decision, Instance, Notice, Scheduler, SchedulerOptions, TaskSet};

/// What the platform's own work takes at most.
#[derive(Clone, Copy, Debug)]
pub(super) struct Costs {
    pub(super) switch_ns: u64,
    pub(super) dispatch_ns: u64,
    pub(super) interrupt_ns: u64,
    pub(super) ready_ns: u64,
    /// From a nominal release to the interrupt for it.
    pub(super) late_ns: u64,
}

/// How long things take, of what they may.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Takes {
    /// All of it.
    Most,
    /// A drawn part.
    Drawn,
}

impl Costs {
    /// Returns what an analysis is to charge.
    pub(super) fn overheads(self) -> Overheads {
        Overheads {
            context_switch_ns: self.switch_ns,
            dispatch_ns: self.dispatch_ns + self.late_ns,
            interrupt_ns: self.interrupt_ns,
            ready_ns: self.ready_ns,
        }
    }
}

/// Runs a set of DAGs with WCETs until some time, and returns each DAG's longest response, that
/// of a job in flight at the end as far as it is known.
pub(super) fn longest_responses_ns(
    task_set: &Arc<TaskSet>,
    options: SchedulerOptions,
    costs: Costs,
    takes: Takes,
    until_ns: u64,
    random: &mut Random,
) -> Vec<u64> {
    let dags = task_set.dags().len();
    let mut machine = Machine {
        scheduler: Scheduler::new(Arc::clone(task_set), options),
        cores: vec![None; options.cores as usize],
        left_ns: BTreeMap::new(),
        costs,
        takes,
        random,
    };
    let mut watch = Watch {
        now_ns: 0,
        ready: 0,
        task_set,
        flying: vec![Vec::new(); dags],
        longest_ns: vec![0; dags],
    };
    machine.run(until_ns, &mut watch);
    for (longest_ns, flying) in watch.longest_ns.iter_mut().zip(&watch.flying) {
        let ages = flying
            .iter()
            .map(|(_, release_ns)| until_ns.saturating_sub(*release_ns));
        *longest_ns = ages.fold(*longest_ns, u64::max);
    }
    watch.longest_ns
}

struct Machine<'r> {
    scheduler: Scheduler,
    /// What each core executes, and when it finishes.
    cores: Vec<Option<(Instance, u64)>>,
    /// What is left of each preempted instance.
    left_ns: BTreeMap<Instance, u64>,
    costs: Costs,
    takes: Takes,
    random: &'r mut Random,
}

impl Machine<'_> {
    fn run(&mut self, until_ns: u64, watch: &mut Watch<'_>) {
        let mut notices = Vec::new();
        self.scheduler.hear([What::Released, What::Completed]);
        // The scheduler's next event, and when its interrupt comes.
        let mut alarm: Option<(u64, u64)> = None;
        // When the last step is over.
        let mut over_ns = 0;
        loop {
            let due_ns = self.scheduler.next_event_ns();
            if alarm.map(|(due_ns, _)| due_ns) != due_ns {
                alarm = due_ns.map(|due_ns| (due_ns, due_ns + self.draw(self.costs.late_ns)));
            }
            let finish_ns = self.cores.iter().flatten().map(|(_, finish_ns)| *finish_ns);
            let interrupt_ns = alarm.map(|(_, at_ns)| at_ns.max(watch.now_ns));
            let next_ns = finish_ns.chain(interrupt_ns).min();
            let next_ns = next_ns.map(|next_ns| next_ns.max(over_ns));
            let Some(now_ns) = next_ns.filter(|next_ns| *next_ns <= until_ns) else {
                return;
            };
            watch.now_ns = now_ns;
            for core in &mut self.cores {
                if let Some((instance, _)) = core.take_if(|(_, finish_ns)| *finish_ns <= now_ns) {
                    self.scheduler.at(now_ns).complete(instance);
                }
            }
            let decisions = self.scheduler.at(now_ns).dispatch().to_vec();
            self.scheduler.log.exchange_notices(&mut notices);
            notices.iter().for_each(|notice| watch.hear(notice));
            for decision in decisions {
                self.carry_out(decision, now_ns);
            }
            let takes_ns = self.draw(core::mem::take(&mut watch.ready) * self.costs.ready_ns);
            over_ns = now_ns + takes_ns;
            for (_, finish_ns) in self.cores.iter_mut().flatten() {
                *finish_ns += takes_ns;
            }
        }
    }

    fn carry_out(&mut self, decision: Decision, now_ns: u64) {
        let (core, instance) = (decision.core.index(), decision.instance);
        let takes_ns = match decision.what {
            What::Suspend => {
                if let Some((instance, finish_ns)) = self.cores[core].take() {
                    self.left_ns.insert(instance, finish_ns - now_ns);
                }
                return;
            }
            What::Resume => {
                let left_ns = self.left_ns.remove(&instance).unwrap_or(0);
                left_ns + self.draw(self.costs.interrupt_ns)
            }
            _ => {
                let dag = self.scheduler.task_set().dag(instance.dag);
                let wcet_ns = dag.subtask(instance.subtask).wcet_ns().unwrap_or(0);
                let own_ns = self.costs.dispatch_ns + 2 * self.costs.switch_ns;
                self.draw(wcet_ns).max(1) + self.draw(own_ns)
            }
        };
        self.cores[core] = Some((instance, now_ns + takes_ns));
    }

    fn draw(&mut self, most_ns: u64) -> u64 {
        match self.takes {
            Takes::Most => most_ns,
            Takes::Drawn => self.random.within(0..=most_ns),
        }
    }
}

struct Watch<'t> {
    now_ns: u64,
    /// How many instances the step in hand has made ready by releases.
    ready: u64,
    task_set: &'t TaskSet,
    /// The jobs in flight of each DAG: number and nominal release.
    flying: Vec<Vec<(u64, u64)>>,
    longest_ns: Vec<u64>,
}

impl Watch<'_> {
    fn hear(&mut self, notice: &Notice) {
        let (dag, job) = (notice.event.dag, notice.event.job);
        let flying = &mut self.flying[dag.index()];
        if notice.event.what == What::Released {
            self.ready += self.task_set.dag(dag).sources().len() as u64;
            flying.push((job, notice.at_ns.unwrap_or(0)));
        } else if let Some(place) = flying.iter().position(|(other, _)| *other == job) {
            let (_, release_ns) = flying.swap_remove(place);
            let longest_ns = &mut self.longest_ns[dag.index()];
            *longest_ns = (*longest_ns).max(self.now_ns - release_ns);
        }
    }
}
