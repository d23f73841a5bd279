//! A scheduler that the test itself drives, by a script of lines such as
//! `100 pause 0: off 0, skipped 0.1`.
//!
//! Before the colon stands what the driver does at an instant, behind it what comes of that. Of
//! the kinds that are [`QUIET`] only those are compared that the script has.
//!
//! `finish`, `fail` and `replace` end an instance, by default that on core 0; `hand` tells a
//! finish by a short way, on behalf of core 0, or of another after `to`: then `done=` says what
//! it comes to, and the instant ends with it. `pause`, `resume`, `close`, `end` and
//! `signal` are for a DAG, by default DAG 0; `prefer` is for a core. With `open` the
//! instant ends without a dispatch.

use sched_dag::lifecycle::Request;
use sched_dag::{
    CoreId, DagId, DagSpec, Decision, HandOff, Journal, Moment, Scheduler, SchedulerOptions,
};

use super::{ask, kind, line, named, pass_on, scheduler, told};

/// Kinds of events that are compared only where the script has them.
const QUIET: [&str; 9] = [
    "ready",
    "start",
    "suspend",
    "resume",
    "finish",
    "ended",
    "due",
    "signalled",
    "dropped",
];

pub(crate) struct Hand {
    pub(crate) scheduler: Scheduler,
    /// How many events were compared.
    seen: usize,
    done: Option<HandOff>,
}

impl Hand {
    pub(crate) fn new(specs: &[DagSpec], options: SchedulerOptions) -> Self {
        Self::of(scheduler(specs, options))
    }

    pub(crate) fn of(mut scheduler: Scheduler) -> Self {
        scheduler.log.journal = Journal::growing();
        Self {
            scheduler,
            seen: 0,
            done: None,
        }
    }

    /// Goes through the instants of a script, and fails where they are not as it says.
    #[track_caller]
    pub(crate) fn must(&mut self, script: &str) -> &mut Self {
        let outcomes = || {
            script
                .lines()
                .filter_map(|line| Some(line.split_once(':')?.1))
        };
        let has = |of: &str| outcomes().any(|line| line.contains(&format!(" {of} ")));
        for text in script.lines().filter(|line| !line.trim().is_empty()) {
            let (told_ns, outcome) = text.split_once(':').unwrap_or((text, ""));
            let (now_ns, commands) = told_ns.trim().split_once(' ').unwrap_or((told_ns, ""));
            let now_ns = now_ns.trim().parse().expect("a time");
            let commands = commands.split(", ").filter(|command| !command.is_empty());
            self.instant(now_ns, &commands.collect::<Vec<_>>());
            let (_, questions, expected) = line(outcome);
            let events: Vec<_> = self.scheduler.log.journal.events().collect();
            let told = told(&events);
            let happened = told[self.seen..].iter().map(|(_, event)| event.as_str());
            let is_loud = |event: &&str| !QUIET.contains(&kind(event)) || has(kind(event));
            let happened: Vec<&str> = happened.filter(is_loud).collect();
            assert_eq!(happened, expected, "at `{}`", text.trim());
            self.seen = told.len();
            for question in questions {
                match question.strip_prefix("done=") {
                    Some(done) => assert_eq!(self.done(), done, "at `{}`", text.trim()),
                    None => ask(&self.scheduler, question),
                }
            }
        }
        self
    }

    fn done(&self) -> String {
        match self.done {
            Some(HandOff::To(vertex, decision)) => {
                assert_eq!(self.scheduler.vertex(decision.instance), vertex);
                format!("on {}", decision.core.0)
            }
            done => format!("{done:?}"),
        }
    }

    fn instant(&mut self, now_ns: u64, commands: &[&str]) {
        for command in commands {
            let (what, whom) = command.split_once(' ').unwrap_or((command, ""));
            if what == "hand" {
                let decided = self.hand(now_ns, whom);
                return self.carry_out(now_ns, decided.as_slice());
            }
            let first = self.scheduler.running(CoreId(0));
            let instance = || match whom {
                "" => first.expect("an instance runs"),
                name => named(name),
            };
            let id = whom.parse().unwrap_or(0);
            let mut moment: Moment<'_> = self.scheduler.at(now_ns);
            match what {
                "finish" => moment.complete(instance()),
                "fail" => moment.fail(instance()),
                "replace" => moment.fail_replaceable(instance()),
                "pause" => moment.serve(Request::Pause(DagId(id))),
                "resume" => moment.serve(Request::Resume(DagId(id))),
                "close" => moment.serve(Request::Close(DagId(id))),
                "end" => moment.serve(Request::End(DagId(id))),
                "signal" => moment.serve(Request::Signal(DagId(id))),
                "prefer" => moment.prefer(CoreId(id)),
                "open" => return,
                _ => panic!("`{command}` is no command"),
            }
        }
        let decisions = self.scheduler.at(now_ns).dispatch().to_vec();
        self.carry_out(now_ns, &decisions);
    }

    /// Tells a finish by a short way.
    fn hand(&mut self, now_ns: u64, whom: &str) -> Option<Decision> {
        let vertex = self.scheduler.vertex(named(whom));
        let mut cores = (0..self.scheduler.options().cores).map(CoreId);
        let core = cores.find(|core| self.scheduler.running(*core) == Some(named(whom)));
        let core = core.expect("it runs");
        let done = pass_on(&mut self.scheduler, now_ns, core, vertex);
        self.done = Some(done);
        match done {
            HandOff::To(_, decision) => Some(decision),
            HandOff::Idle | HandOff::Open => None,
        }
    }

    fn carry_out(&mut self, now_ns: u64, decisions: &[Decision]) {
        for decision in decisions {
            let (core, instance) = (decision.core, decision.instance);
            (self.scheduler.log).on_core(core, decision.what, now_ns, instance);
        }
    }
}
