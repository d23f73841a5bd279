//! Records of several machines, read as one: by the [hops](crate::record::Hop) of their messages.
//!
//! A source whose values have hops *receives*. The sender is the one subtask of the other records
//! that put such messages, by its events: a reader of a topic of the same name, or the topic's
//! writer if there is no reader. Hops of other jobs, such as jobs of an earlier run, are left out.
//! Nothing is guessed: where no subtask has put messages, or several may have, an error says so.
//!
//! The *offset* of a clock from the first record's clock comes from the exchange with the least
//! round trip. It is half the difference of the least delays both ways, and wrong by half their sum
//! at most, plus the possible drift of the clocks in a run. With messages one way only, the least
//! delay counts as 0, so all times across are lower bounds, but for the drift.
//!
//! The joint run has all DAGs and cores, and one axis of time. Time 0 is the epoch of the earliest
//! run. Each machine is judged alone by the rules; the joint run has the chains.

use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::Path;

use sched_dag::chains::{Chain, SampledEdge, SampledJobs, SubtaskRef};
use sched_dag::journal::Event;
use sched_dag::law::Distribution;
use sched_dag::{CoreDivision, CoreId, DagId, DagSpec, Instance, SubtaskId};

use crate::findings::{distribution, object};
use crate::json::{Object, quoted};
use crate::record::{Heard, Hop, Link, Machine, Record, Run, merged, task_set};
use crate::units::shown;
use crate::view::{View, complete_from_ns};

type Records = [(String, Record)];

/// Joins records that name each other; `None` if they do not.
///
/// # Errors
///
/// In words: the obstacle.
pub fn join(records: &Records) -> Result<Option<Run>, String> {
    if records.len() < 2 || records.iter().all(|(_, record)| record.heard.is_empty()) {
        return Ok(None);
    }
    let mut machines: Vec<Machine> = Vec::new();
    for (file, record) in records {
        let ([committed], [_]) = (&record.commits[..], &record.runs[..]) else {
            return Err(format!("{file} has several runs; name records of one"));
        };
        let last = machines.last();
        let (dags, cores) = last.map_or((0, 0), |it| (it.dags.end, it.cores.end));
        let name = Path::new(file).file_stem().unwrap_or_default();
        let said = record.transcript();
        let epoch = said.of_kind("epoch").next();
        machines.push(Machine {
            name: name.to_string_lossy().into(),
            dags: dags..committed.specs.iter().fold(dags, |end, _| end + 1),
            cores: cores..cores + committed.told.cores,
            began_ns: epoch.and_then(|line| line.number_at("ns")).unwrap_or(0),
            ahead_ns: 0,
            wrong_ns: Some(0),
        });
    }
    // By the clocks of all machines, until their offsets are known.
    let by_clocks = joint(records, &machines)?;
    let view = View::new(&by_clocks);
    let mut links = Vec::new();
    for (to, (_, record)) in records.iter().enumerate() {
        for heard in &record.heard {
            links.push(link(records, &view, to, heard)?);
        }
    }
    links.sort_by_key(|link| link.edge);
    let ends = records.iter();
    let ends = ends.filter_map(|(_, of)| of.runs[0].events.last());
    let longest_ns = ends.map(|event| event.time_ns).max().unwrap_or(0);
    set_clocks(&mut machines, &links, (longest_ns / DRIFT).into())?;
    for link in &mut links {
        judge(link, &view, &machines);
    }
    let run = joint(records, &machines)?;
    Ok(Some(Run { links, ..run }))
}

/// Makes the joint run, without links.
fn joint(records: &Records, machines: &[Machine]) -> Result<Run, String> {
    let mut run = records[0].1.runs[0].clone();
    (run.samplings, run.bounds_ns, run.events, run.lost) = Default::default();
    let mut specs = Vec::new();
    for ((_, record), machine) in records.iter().zip(machines) {
        let own = &record.runs[0];
        specs.extend(record.commits[0].specs.iter().map(|spec| DagSpec {
            name: format!("{}:{}", machine.name, spec.name),
            offset_ns: spec.offset_ns.saturating_add(machine.began_ns),
            // The joint run's cores are undivided: clusters of several machines would have the same
            // numbers.
            cluster: None,
            ..spec.clone()
        }));
        let edge = |edge: &SampledEdge| SampledEdge {
            writer: there(machine, edge.writer),
            reader: there(machine, edge.reader),
        };
        run.samplings.extend(own.samplings.iter().map(edge));
        run.bounds_ns.extend(&own.bounds_ns);
        let from_ns = complete_from_ns(own);
        let events = own.events.iter().filter(|event| event.time_ns >= from_ns);
        let events = events.map(|event| Event {
            time_ns: event.time_ns.saturating_add(machine.began_ns),
            core: CoreId(event.core.0 + machine.cores.start),
            dag: DagId(event.dag.0 + machine.dags.start),
            ..*event
        });
        run.events = merged(run.events, events.collect());
        run.options.cores = machine.cores.end;
    }
    run.machines = machines.to_vec();
    run.task_set = task_set(run.options, CoreDivision::Undivided, &[], &specs)?;
    Ok(run)
}

/// Returns the place of a subtask in the joint run.
fn there(machine: &Machine, (dag, subtask): SubtaskRef) -> SubtaskRef {
    (DagId(dag.0 + machine.dags.start), subtask)
}

fn instance((dag, subtask): SubtaskRef, job: u64) -> Instance {
    Instance { dag, job, subtask }
}

/// Finds the sender of the messages heard by a source of the record `to`.
fn link(records: &Records, view: &View<'_>, to: usize, heard: &Heard) -> Result<Link, String> {
    let machines = &view.run.machines;
    let has_put = |sender: SubtaskRef, hop: &Hop| {
        let history = view.histories.get(&instance(sender, hop.job));
        let span = history.and_then(|it| it.start_ns.zip(it.finish_ns));
        span.is_some_and(|(start_ns, finish_ns)| (start_ns..=finish_ns).contains(&hop.sent_ns))
    };
    let mut found = Vec::new();
    for (from, (_, record)) in records.iter().enumerate().filter(|(from, _)| *from != to) {
        for (dag, told) in (0..).map(DagId).zip(&record.commits[0].told.dags) {
            for topic in told.topics.iter().filter(|topic| topic.name == heard.topic) {
                let writer = Some(&topic.writer).filter(|_| topic.readers.is_empty());
                for sender in topic.readers.iter().chain(writer) {
                    let writer = there(&machines[from], (dag, SubtaskId(*sender)));
                    let reader = there(&machines[to], heard.source);
                    let mut heard = heard.clone();
                    // A source may return a message in several jobs; only the first of them
                    // received it.
                    let mut seen = BTreeSet::new();
                    (heard.hops).retain(|(_, hop)| has_put(writer, hop) && seen.insert(hop.job));
                    found.push(Link {
                        edge: SampledEdge { writer, reader },
                        machines: [from, to],
                        heard,
                        ahead_ns: 0,
                        wrong_ns: None,
                        delays: Distribution::default(),
                        exceeded: 0,
                        late: BTreeSet::new(),
                        lost: 0,
                    });
                }
            }
        }
    }
    found.retain(|link| !link.heard.hops.is_empty());
    match found.pop() {
        Some(link) if found.is_empty() => Ok(link),
        other => Err(format!(
            "{} subtasks of the others may have put the messages of topic `{}` in {}, and not 1",
            found.len() + other.iter().count(),
            heard.topic,
            records[to].0
        )),
    }
}

/// Returns the time taken by a message, by two clocks.
fn taken_ns(hop: &Hop) -> i128 {
    i128::from(hop.received_ns) - i128::from(hop.sent_ns)
}

/// The nanoseconds in which two clocks may drift apart by 1 ns: each crystal by 100 millionths.
const DRIFT: u64 = 5_000;

/// Finds the offsets of the clocks from the first clock, and the begin of each run on the joint
/// axis.
fn set_clocks(machines: &mut [Machine], links: &[Link], drift_ns: i128) -> Result<(), String> {
    let least_ns = |way: [usize; 2]| {
        let links = links.iter().filter(|link| link.machines == way);
        let hops = links.flat_map(|link| &link.heard.hops);
        hops.map(|(_, hop)| taken_ns(hop)).min()
    };
    for (to, machine) in machines.iter_mut().enumerate().skip(1) {
        (machine.ahead_ns, machine.wrong_ns) = match (least_ns([0, to]), least_ns([to, 0])) {
            (None, None) => return Err(format!("no message goes to or from {}", machine.name)),
            (Some(there_ns), None) => (there_ns, None),
            (None, Some(back_ns)) => (-back_ns, None),
            (Some(there_ns), Some(back_ns)) => {
                let wrong_ns = (there_ns + back_ns + 1).div_euclid(2) + drift_ns;
                let wrong_ns = u64::try_from(wrong_ns);
                ((there_ns - back_ns).div_euclid(2), wrong_ns.ok())
            }
        };
    }
    let began_ns = |machine: &Machine| i128::from(machine.began_ns) - machine.ahead_ns;
    let first_ns = machines.iter().map(began_ns).min().unwrap_or(0);
    for machine in machines {
        let began_ns = u64::try_from(began_ns(machine) - first_ns);
        machine.began_ns = began_ns.unwrap_or(u64::MAX);
    }
    Ok(())
}

/// Judges the messages of a link; the times of `view` are by the machines' own clocks.
fn judge(link: &mut Link, view: &View<'_>, machines: &[Machine]) {
    let [from, to] = link.machines.map(|at| &machines[at]);
    let wrong_ns = from.wrong_ns.zip(to.wrong_ns);
    link.ahead_ns = to.ahead_ns - from.ahead_ns;
    link.wrong_ns = wrong_ns.map(|(from, to)| from.saturating_add(to));
    let model = view.run.task_set.dag(link.edge.reader.0);
    let (mut late, mut delays_ns) = (None, Vec::new());
    for (job, hop) in &link.heard.hops {
        let delay_ns = u64::try_from(taken_ns(hop) - link.ahead_ns).unwrap_or(0);
        delays_ns.push(delay_ns);
        let exceeds = delay_ns > hop.delay_ns.saturating_add(link.wrong_ns.unwrap_or(0));
        link.exceeded += usize::from(exceeds);
        let due_ns = view.release_ns(link.edge.reader.0, *job);
        let has_waited = match model.is_sporadic() {
            // A late job has put off all later jobs up to this one, some of them without a message.
            true => late.is_some_and(|(late_job, late_ns): (u64, u64)| {
                let after_ns = (job - late_job).saturating_mul(model.period_ns());
                due_ns == late_ns.saturating_add(after_ns) && due_ns > hop.received_ns
            }),
            // Earlier jobs were skipped in a pause.
            false => due_ns > hop.received_ns.saturating_add(model.renewal_ns()),
        };
        let is_late = exceeds || has_waited;
        link.late.extend(is_late.then_some(*job));
        late = is_late.then_some((*job, due_ns));
    }
    link.delays = Distribution::new(delays_ns);
    let sent = view.histories.iter().filter(|(of, history)| {
        (of.dag, of.subtask) == link.edge.writer && history.finish_ns.is_some()
    });
    link.lost = sent.count().saturating_sub(link.heard.hops.len());
}

/// Returns the senders and receivers of all messages, or only of the messages with valid bounds.
pub fn messages(run: &Run, with_late: bool) -> impl Iterator<Item = (Instance, Instance)> {
    run.links.iter().flat_map(move |link| {
        let hops = link.heard.hops.iter();
        let hops = hops.filter(move |(job, _)| with_late || !link.late.contains(job));
        hops.map(|(job, hop)| {
            let writer = instance(link.edge.writer, hop.job);
            (writer, instance(link.edge.reader, *job))
        })
    })
}

/// Returns the jobs that got a value of another job, by samples and by messages.
pub fn sampled(run: &Run, with_late: bool, events: &[Event]) -> SampledJobs {
    let mut sampled = SampledJobs::new(&run.samplings, events.iter().copied());
    messages(run, with_late).for_each(|(writer, reader)| sampled.add(reader, writer));
    sampled
}

/// Returns the links of a chain with their stated delays, and the time by which messages may have
/// exceeded the delays unnoticed.
pub fn of_chain(run: &Run, chain: &Chain) -> (Vec<(SampledEdge, u64)>, u64) {
    let link = |edge| run.links.iter().find(|link| link.edge == edge);
    let over: Vec<&Link> = chain.edges().filter_map(link).collect();
    let stated = over.iter().map(|link| (link.edge, link.stated_ns()));
    let wrong_ns = over.iter().filter_map(|link| link.wrong_ns);
    (stated.collect(), wrong_ns.fold(0, u64::saturating_add))
}

/// Returns the text about links for people, and the machine lines about links.
pub fn told(files: &str, run: &Run) -> (String, Vec<String>) {
    let mut text = format!("{files}: read as one, by the hops of messages\n");
    let mut lines = Vec::new();
    for link in &run.links {
        let SampledEdge { writer, reader } = link.edge;
        let way = Chain::between(&run.task_set, &[link.edge], writer, reader);
        let names = way.iter().flat_map(|way| way.names(&run.task_set));
        let names: Vec<String> = names.map(|name| name.to_string()).collect();
        let unknown = || "unknown: messages go one way".into();
        let wrong = link.wrong_ns.map_or_else(unknown, shown);
        let (topic, ahead_ns, stated_ns) = (&link.heard.topic, link.ahead_ns, link.stated_ns());
        let (exceeded, lost) = (link.exceeded, link.lost);
        // Writing into a `String` cannot fail.
        let _ = writeln!(
            text,
            "  link {} by topic `{topic}`
    delay                         {} (stated {}, which nothing proves)
    messages                      {exceeded} took longer, {lost} did not come
    clock of the receiver         {ahead_ns} ns ahead, +- {wrong}",
            names.join(" > "),
            distribution(&link.delays),
            shown(stated_ns)
        );
        let line = Object::new()
            .text("kind", "link")
            .text("file", files)
            .text("topic", topic)
            .list("path", names.iter().map(|name| quoted(name)))
            .number("lost", lost as u64)
            .number("stated_ns", stated_ns)
            .number("exceeded", exceeded as u64)
            .json("delay_ns", &object(&link.delays))
            .json("offset_ns", &ahead_ns.to_string());
        let wrong = link.wrong_ns.map_or("null".into(), |ns| ns.to_string());
        lines.push(line.json("uncertainty_ns", &wrong).into_text());
    }
    (text, lines)
}
