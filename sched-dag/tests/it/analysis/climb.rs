//! Runs of one set, from which a climb to the worst goes.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use random::Random;
use sched_dag::analysis::{AnalysisResult, AnalysisSettings};
use sched_dag::engine::SubtaskBody;
use sched_dag::journal::{Event, EventKind, EventSubject};
use sched_dag::law::{JudgeOptions, dispatch_violations, violations};
use sched_dag::lifecycle::{LifecyclePlan, ModeEntry, Request, WaitId, WaitLimit};
use sched_dag::virtual_time::{VirtualTime, Workload};
use sched_dag::{Dag, DagId, Instance, ModeId, Subtask, SubtaskId, TaskSet};

use super::random::mask;

/// Jobs have so many execution times of their own, in turn.
const JOBS: u64 = 8;

/// Segments of an instance have so many.
const SEGMENTS: u32 = 4;

/// A set, and what is proven of it.
pub(crate) struct Case {
    pub(crate) task_set: Arc<TaskSet>,
    pub(crate) settings: AnalysisSettings,
    pub(crate) answer: AnalysisResult,
    /// By cluster.
    pub(crate) features: Vec<u32>,
}

/// By features, the jobs with a bound in the runs of a climb.
pub(crate) type Climbed = BTreeMap<u32, u64>;

/// The events of a run besides the periodic releases.
#[derive(Clone, Debug)]
struct Scenario {
    until_ns: u64,
    /// By DAG, the signals of a sporadic one, ascending.
    signals_ns: Vec<Vec<u64>>,
    /// The part of its WCET that each segment takes, and what part of its limit the wait after it.
    parts: Vec<u32>,
    requests: Vec<(u64, Request)>,
    modes: Vec<Vec<DagId>>,
    /// One instance of so many fails; 0: none.
    faults: u64,
}

/// Returns a part of the most: every other time all of it.
fn part(drawn: u32, most: u64) -> u64 {
    match drawn & 7 {
        0..4 => most,
        4 => 0,
        5 => most.min(1),
        6 => most.saturating_sub(1),
        _ => u64::from(drawn >> 3 & 0x1fff) * most / 0x1fff,
    }
}

impl Case {
    /// Draws runs, and varies the worst one so many times; where nothing is proven, one run is
    /// drawn. The error is the first breach, with its run.
    pub(crate) fn climb(
        &self,
        random: &mut Random,
        is_disturbed: bool,
        [drawn, varied]: [u64; 2],
    ) -> Result<Climbed, String> {
        let bounds = (0..).zip(&self.answer.bounds);
        let proven = bounds.filter_map(|(dag, bound)| bound.map(|_| dag));
        let proven: Vec<usize> = proven.collect();
        let target = proven.get(random.index(proven.len().max(1)));
        let steps = target.map_or(1, |_| drawn + varied);
        let target = target.copied().unwrap_or(0);
        let mut climbed = Climbed::default();
        let mut worst: Option<(u64, Scenario)> = None;
        for step in 0..steps {
            let scenario = match &worst {
                Some((_, worst)) if step >= drawn => self.varied(worst, random),
                _ => self.drawn(target, is_disturbed, random),
            };
            let run = self.run(&scenario, target, step == 0, &mut climbed);
            let nearness = run.map_err(|found| {
                let (signals, requests) = (&scenario.signals_ns, &scenario.requests);
                format!("{found}\nsignals {signals:?}, {requests:?}")
            })?;
            if worst.as_ref().is_none_or(|(most, _)| nearness >= *most) {
                worst = Some((nearness, scenario));
            }
        }
        Ok(climbed)
    }

    fn drawn(&self, target: usize, is_disturbed: bool, random: &mut Random) -> Scenario {
        let dags = self.task_set.dags();
        let span_ns = |dag: &Dag| dag.period_ns() + dag.relative_deadline_ns();
        let longest_ns = dags.iter().map(span_ns).max().unwrap_or(1);
        let until_ns = longest_ns * random.within(2..=5);
        let mode = random.index(3);
        let shortened = random.one_of(&[0, 30, 100]);
        let parts = 0..self.task_set.vertices() as u64 * JOBS * u64::from(SEGMENTS);
        let mut part = || random.within(0..=u32::MAX) * u32::from(random.chance(shortened));
        let parts = parts.map(|_| part()).collect();
        let mut this = Scenario {
            until_ns,
            signals_ns: Vec::new(),
            parts,
            requests: Vec::new(),
            modes: Vec::new(),
            faults: 0,
        };
        for (number, dag) in dags.iter().enumerate() {
            let first_ns = match mode {
                0 => 0,
                _ if mode == 2 && number == target => longest_ns,
                _ => self.anchor_ns(number, target, longest_ns, random),
            };
            let (period_ns, kind) = (dag.period_ns(), random.index(4));
            let (mut now_ns, mut signals_ns) = (first_ns % period_ns, Vec::new());
            while dag.is_sporadic() && now_ns <= until_ns && signals_ns.len() < 200 {
                signals_ns.push(now_ns);
                now_ns += match kind {
                    // Some come too early; what they release is due later.
                    0 => random.within(1..=2 * period_ns),
                    1 if random.once_in(3) => period_ns + random.within(0..=period_ns),
                    _ => period_ns,
                };
            }
            this.signals_ns.push(signals_ns);
        }
        if is_disturbed {
            self.disturb(&mut this, random);
        }
        this
    }

    /// Returns when a DAG has a job, where the target has one at a time: as late as that job can be
    /// carried into the target's, due with it, or at any time.
    fn anchor_ns(&self, number: usize, target: usize, at_ns: u64, random: &mut Random) -> u64 {
        let [dag, other] = [number, target].map(|number| &self.task_set.dags()[number]);
        let deadline_ns = dag.relative_deadline_ns();
        let bound_ns = self.answer.bounds[number].map_or(deadline_ns, |bound| bound.bound_ns);
        let wcets = dag.subtasks().iter().filter_map(|of| of.wcet_ns());
        let volume_ns = wcets.sum::<u64>().min(bound_ns);
        let any_ns = random.within(0..=at_ns);
        random.one_of(&[
            at_ns,
            at_ns - bound_ns + volume_ns,
            at_ns - bound_ns + 1,
            (at_ns + other.relative_deadline_ns()).saturating_sub(deadline_ns),
            any_ns,
        ])
    }

    /// Adds faults, pauses, modes, and now and then the end of a DAG.
    fn disturb(&self, scenario: &mut Scenario, random: &mut Random) {
        let dags = (0..).map(DagId).zip(self.task_set.dags());
        let until_ns = scenario.until_ns;
        let [fails, pauses, has_modes] = [(); 3].map(|()| random.chance(60));
        scenario.faults = random.within(3..=60) * u64::from(fails);
        let mut asked = Vec::new();
        for (dag, _) in dags.clone() {
            for _ in 0..random.within(1..=6) * u64::from(pauses) {
                asked.extend([Request::Pause(dag), Request::Resume(dag)]);
            }
            let end = random.one_of(&[Request::End(dag), Request::Close(dag)]);
            asked.extend(random.chance(4).then_some(end));
        }
        for mode in (0..3).filter(|_| has_modes) {
            // Modes are of one cluster's DAGs.
            let here = dags.clone().filter(|(_, dag)| dag.cluster().0 == 0);
            let here = here.map(|(dag, _)| dag).filter(|_| random.chance(60));
            scenario.modes.push(here.collect());
            for _ in 0..random.within(1..=4) {
                let entry = random.one_of(&[ModeEntry::AtOnce, ModeEntry::WhenIdle]);
                asked.push(Request::Enter(ModeId(mode), entry));
            }
        }
        let asked = asked
            .into_iter()
            .map(|of| (random.within(0..=until_ns), of));
        scenario.requests = asked.collect();
    }

    /// Varies a run in up to three ways.
    fn varied(&self, worst: &Scenario, random: &mut Random) -> Scenario {
        let mut this = worst.clone();
        for _ in 0..random.within(1..=3) {
            let dag = random.index(this.signals_ns.len());
            let period_ns = self.task_set.dags()[dag].period_ns();
            let kind = random.index(8);
            let signals = this.signals_ns[dag].len();
            if kind < 4 && signals > 0 {
                // All signals, or those from one on; a little, or a lot, or to those of another.
                let first = random.index(signals) * usize::from(kind == 0);
                let other = &this.signals_ns[random.index(this.signals_ns.len())];
                let from_ns = this.signals_ns[dag][first];
                let to_ns = match random.index(5) {
                    0 => from_ns + random.within(1..=3),
                    1 => from_ns.saturating_sub(random.within(1..=3)),
                    2 => from_ns + random.within(0..=period_ns),
                    3 if !other.is_empty() => other[random.index(other.len())],
                    _ => from_ns.saturating_sub(random.within(0..=period_ns)),
                };
                for at_ns in &mut this.signals_ns[dag][first..] {
                    *at_ns = (*at_ns + to_ns).saturating_sub(from_ns);
                }
                this.signals_ns[dag].sort_unstable();
                continue;
            }
            let any = random.within(0..=u32::MAX);
            let drawn = random.one_of(&[0, 4, 0x4_0000, any]);
            let at = random.index(this.parts.len());
            this.parts[at] = drawn;
            if kind > 5 {
                // The segment in every job.
                let stride = this.parts.len() / usize::try_from(JOBS).expect("few");
                let places = this.parts.iter_mut().skip(at % stride);
                places.step_by(stride).for_each(|part| *part = drawn);
            }
        }
        this
    }

    /// Runs a set. Returns how near to its bound a response of the target came, in permille; others
    /// count a third.
    fn run(
        &self,
        scenario: &Scenario,
        target: usize,
        is_judged: bool,
        climbed: &mut Climbed,
    ) -> Result<u64, String> {
        let options = self.settings.scheduler();
        let drawn = Drawn {
            case: self,
            scenario,
        };
        let dags = (0..).map(DagId).zip(self.task_set.dags());
        let bodies = dags.clone().flat_map(|(dag, model)| {
            let subtasks = (0..).map(SubtaskId).zip(model.subtasks());
            let drawn = &drawn;
            subtasks.map(move |(subtask, model)| Body {
                instance: Instance::new(dag, 0, subtask),
                turn: 0,
                model,
                drawn,
            })
        });
        let mut world = World {
            drawn: &drawn,
            requests: BTreeMap::new(),
            asked: 0,
        };
        let signals = dags.zip(&scenario.signals_ns);
        for ((dag, _), signals_ns) in signals {
            for &at_ns in signals_ns {
                world.ask(at_ns, Request::Signal(dag));
            }
        }
        for &(at_ns, request) in &scenario.requests {
            world.ask(at_ns, request);
        }
        let count = u32::try_from(self.task_set.dags().len()).expect("few DAGs");
        let plan = LifecyclePlan::new(count, true).with_modes(scenario.modes.clone());
        let run = VirtualTime::of_bodies(&self.task_set, options, bodies, &[]);
        let run = run.with_lifecycle(Some(Box::new(plan)))?;
        let mut run = run.recording();
        let _ = run.run_until(scenario.until_ns, &mut world);
        let events = run.events();
        if is_judged {
            let (terms, all) = (JudgeOptions::EXACT, || events.iter().copied());
            let mut found = violations(&self.task_set, terms, all());
            found.extend(dispatch_violations(&self.task_set, &options, terms, all()));
            if let Some(first) = found.first() {
                return Err(format!("the law finds: {first}"));
            }
        }
        self.judge(&events, scenario, target, climbed)
    }

    /// Holds responses against bounds.
    fn judge(
        &self,
        events: &[Event],
        scenario: &Scenario,
        target: usize,
        counts: &mut Climbed,
    ) -> Result<u64, String> {
        let mut nearest = 0;
        let mut flying: HashMap<(DagId, u64), u64> = HashMap::new();
        let mut jobs = vec![0; self.task_set.dags().len()];
        let mut hold = |event: &Event, response_ns: u64, bound_ns: u64| {
            let nearness = response_ns * 1000 / bound_ns;
            let share = if event.dag.index() == target { 1 } else { 3 };
            nearest = nearest.max(nearness / share);
            let is_kept = response_ns <= bound_ns;
            let say = || format!("{event:?} after {response_ns} ns, bound {bound_ns}");
            if is_kept { Ok(()) } else { Err(say()) }
        };
        for event in events {
            let (dag, job) = (event.dag, (event.dag, event.job));
            if event.what.is_of_dag() || event.what == EventKind::Entered {
                continue;
            }
            let Some(bound) = self.answer.bounds[dag.index()] else {
                continue;
            };
            let model = self.task_set.dag(dag);
            let release_ns = flying.get(&job).copied().unwrap_or(event.time_ns);
            let response_ns = event.time_ns - release_ns;
            match event.what {
                EventKind::Due => _ = flying.insert(job, event.time_ns),
                EventKind::Released if !model.is_sporadic() => {
                    flying.insert(job, model.grid_ns(event.job));
                }
                EventKind::Finish => {
                    let subtask = event.subtask.expect("of an instance");
                    let mut sinks = model.sinks().iter();
                    let sink = sinks.position(|sink| *sink == subtask);
                    if let Some(sink) = sink {
                        let bound_ns = self.answer.sinks_ns[dag.index()][sink];
                        hold(event, response_ns, bound_ns.expect("as its job has one"))?;
                    }
                }
                EventKind::Completed => {
                    hold(event, response_ns, bound.bound_ns)?;
                    flying.remove(&job);
                    jobs[dag.index()] += 1;
                }
                EventKind::Missed | EventKind::Queued | EventKind::Aborted => {
                    return Err(format!("{event:?} of a DAG with {bound:?}"));
                }
                _ => {}
            }
        }
        for ((dag, job), release_ns) in flying {
            let bound_ns = self.answer.bounds[dag.index()].map(|bound| bound.bound_ns);
            if Some(scenario.until_ns - release_ns) > bound_ns {
                return Err(format!("job {job} of {dag:?} goes on beyond {bound_ns:?}"));
            }
        }
        self.count(scenario, &jobs, counts);
        Ok(nearest)
    }

    /// Adds the jobs of each DAG to those of the features of its cluster and of the run.
    fn count(&self, scenario: &Scenario, jobs: &[u64], counts: &mut Climbed) {
        let mut requests = scenario.requests.iter();
        let of_run = mask(&[
            ("faults", scenario.faults > 0),
            ("modes", !scenario.modes.is_empty()),
            (
                "pauses",
                requests.any(|of| matches!(of.1, Request::Pause(_))),
            ),
        ]);
        for (model, jobs) in self.task_set.dags().iter().zip(jobs) {
            let of_set = self.features.get(model.cluster().index());
            *counts.entry(of_run | of_set.unwrap_or(&0)).or_default() += jobs;
        }
    }
}

/// All that a run depends on.
struct Drawn<'s> {
    case: &'s Case,
    scenario: &'s Scenario,
}

impl Drawn<'_> {
    fn part(&self, of: Instance, turn: u32) -> u32 {
        let vertices = self.case.task_set.vertices() as u64;
        let vertex = u64::from(self.case.task_set.vertex(of).0);
        let segment = u64::from(turn.min(SEGMENTS - 1));
        let at = (of.job % JOBS * vertices + vertex) * u64::from(SEGMENTS) + segment;
        self.scenario.parts[usize::try_from(at).expect("an index")]
    }

    /// Returns how long an instance waits at most: some for less than their subtask states.
    fn limit_ns(&self, wait: WaitId) -> u64 {
        let Instance { dag, subtask, .. } = wait.instance;
        let stated = &self.case.task_set.dag(dag).subtask(subtask).waits()[wait.number as usize];
        let is_shorter = self.part(wait.instance, wait.number) >> 29 == 7;
        stated.limit_ns >> u32::from(is_shorter)
    }

    /// Returns after what time a wait has its answer. Of those that take all of their limit, some
    /// have it too late.
    fn answer_ns(&self, wait: WaitId) -> u64 {
        let (limit_ns, job) = (self.limit_ns(wait), wait.instance.job);
        let answer_ns = part(self.part(wait.instance, wait.number) >> 16, limit_ns);
        let is_late = answer_ns == limit_ns && !job.is_multiple_of(2);
        answer_ns + (1 + job % 8) * u64::from(is_late)
    }
}

/// The function of a subtask, which takes all waits that it states.
struct Body<'s> {
    instance: Instance,
    turn: u32,
    model: &'s Subtask,
    drawn: &'s Drawn<'s>,
}

impl SubtaskBody for Body<'_> {
    type Alternate = ();

    fn set_job(&mut self, job: u64) {
        (self.instance.job, self.turn) = (job, 0);
    }

    fn subject(&self) -> EventSubject {
        EventSubject::of(self.instance)
    }

    fn discard(&mut self, _: u64) {}

    fn has_effects(&self) -> bool {
        true
    }

    fn complete(&mut self, _: u64, _: &mut dyn FnMut(Request)) -> Option<WaitLimit> {
        let (instance, number) = (self.instance, self.turn);
        ((number as usize) < self.model.waits().len()).then(|| {
            self.turn += 1;
            WaitLimit::For(self.drawn.limit_ns(WaitId { instance, number }))
        })
    }

    fn alternate(&self) -> Option<()> {
        Some(())
    }

    fn replace(&mut self) {}
}

/// The requests that are to come, in order.
struct World<'s> {
    drawn: &'s Drawn<'s>,
    requests: BTreeMap<(u64, u64), Request>,
    asked: u64,
}

impl World<'_> {
    fn ask(&mut self, at_ns: u64, request: Request) {
        self.requests.insert((at_ns, self.asked), request);
        self.asked += 1;
    }
}

impl<'s> Workload<Body<'s>> for World<'_> {
    fn execute(&mut self, body: &mut Body<'s>, _: u64) -> Option<u64> {
        let (waits, whole_ns) = (body.model.waits(), body.model.wcet_ns());
        let of_wait = |wait: &sched_dag::Wait| wait.segment_ns;
        let stated_ns: Option<u64> = waits.iter().map(of_wait).sum();
        let wcet_ns = match (whole_ns, stated_ns, body.turn) {
            // What is not known is long.
            (None, ..) => 50,
            (Some(whole_ns), None, _) => whole_ns / (waits.len() as u64 + 1),
            (Some(whole_ns), Some(stated_ns), 0) => whole_ns - stated_ns,
            (.., turn) => waits[turn as usize - 1].segment_ns.unwrap_or(0),
        };
        let executed_ns = part(self.drawn.part(body.instance, body.turn), wcet_ns);
        Some(executed_ns + self.drawn.case.settings.overheads.dispatch_ns)
    }

    fn fails(&mut self, instance: Instance) -> bool {
        let drawn = u64::from(self.drawn.part(instance, 0)) ^ instance.job << 32;
        let vertex = self.drawn.case.task_set.vertex(instance);
        let drawn = drawn ^ u64::from(vertex.0) << 16;
        let faults = self.drawn.scenario.faults;
        faults > 0 && Random::new(drawn).once_in(faults)
    }

    fn is_replaceable(&mut self, instance: Instance) -> bool {
        instance.subtask.0 != 1
    }

    fn waits(&mut self, wait: WaitId, now_ns: u64) {
        let at_ns = now_ns + self.drawn.answer_ns(wait);
        self.ask(at_ns, Request::Answer(wait));
        // Some have it twice.
        if self
            .drawn
            .part(wait.instance, wait.number)
            .is_multiple_of(5)
        {
            self.ask(at_ns + wait.instance.job % 8, Request::Answer(wait));
        }
    }

    fn next_request_ns(&self) -> Option<u64> {
        let first = self.requests.first_key_value();
        first.map(|((at_ns, _), _)| *at_ns)
    }

    fn take_request(&mut self, now_ns: u64) -> Option<Request> {
        let first = self.requests.first_entry()?;
        (first.key().0 <= now_ns).then(|| first.remove())
    }
}
