//! Random walks of a driver, each step held against the rules.
//!
//! Here happens what a driver that is punctual does not meet: several dispatches at one time, a
//! driver that comes late, ends of instances that have lost their core meanwhile or were moved to
//! another one. An end is told by [`Scheduler::pass_on`].

use sched_dag::{CoreId, DagId, HandOff, Instance, Notice, Scheduler};

use crate::random::Random;
use crate::rules::{Facts, SAID, instance, place};
use crate::set::Set;
use crate::support::{pass_on, scheduler};

/// Returns the first difference between a walk and the rules.
pub(crate) fn difference(set: &Set) -> Option<String> {
    walk(set).err()
}

fn walk(set: &Set) -> Result<(), String> {
    let mut random = Random::new(set.choices);
    let mut scheduler = scheduler(&set.specs(), set.options);
    scheduler.hear(SAID);
    let mut facts = Facts::new(set);
    let mut now_ns = 0;
    for step in 0..80 {
        let mut passed_on = None;
        now_ns = match random.between(0, 5) {
            0 | 1 => now_ns,
            2 | 3 => (scheduler.next_event_ns()).map_or(now_ns, |event_ns| event_ns.max(now_ns)),
            4 => now_ns + random.between(1, 4),
            _ => now_ns + random.between(1, 20),
        };
        facts.at(now_ns);
        let cores = (0..scheduler.options().cores).map(CoreId);
        let running = cores.filter_map(|core| Some((core, scheduler.running(core)?)));
        let running: Vec<(CoreId, Instance)> = running.collect();
        let started = facts.started().into_iter().map(instance);
        let is_preempted = |it: &Instance| running.iter().all(|(_, running)| running != it);
        let preempted: Vec<Instance> = started.filter(is_preempted).collect();
        let kind = random.between(0, 99);
        if kind < 60 && !running.is_empty() {
            let at = random.below(running.len());
            let (core, instance) = running[at];
            if random.chance(20) && running.len() > 1 {
                // An instant that is not over: a dispatch is owed.
                let (_, before) = running[(at + 1) % running.len()];
                scheduler.at(now_ns).complete(before);
                facts.complete(place(before));
            }
            passed_on = complete(&mut scheduler, now_ns, core, instance, &mut random);
            facts.complete(place(instance));
        } else if kind < 70 && !preempted.is_empty() {
            let instance = preempted[random.below(preempted.len())];
            let core = any_core(&scheduler, &mut random);
            passed_on = complete(&mut scheduler, now_ns, core, instance, &mut random);
            facts.complete(place(instance));
        } else {
            let at = random.below(set.dags.len());
            let dag = DagId(u32::try_from(at).expect("few DAGs"));
            let mut moment = scheduler.at(now_ns);
            match (kind % 10, running.first()) {
                (0, Some(&(_, instance))) if step > 20 => {
                    moment.fail_replaceable(instance);
                    facts.fail_replaceable(place(instance));
                }
                (1, _) if step > 60 => {
                    moment.stop(dag);
                    facts.stop(at);
                }
                (2, _) => {
                    moment.pause(dag);
                    facts.pause(at);
                }
                (3 | 4, _) => {
                    moment.resume(dag);
                    facts.resume(at);
                }
                (9, _) if step > 60 => {
                    moment.close(dag);
                    facts.close(at);
                }
                (5..9, _) if set.dags[at].signals_ns.is_some() => {
                    moment.signal(dag);
                    facts.signal(at);
                }
                _ => {}
            }
            let _decisions = moment.release_due().dispatch();
        }
        facts.end_instant();
        let mut notices = Vec::new();
        scheduler.log.exchange_notices(&mut notices);
        notices.extend(passed_on);
        let compared = facts.compare(&scheduler, &notices);
        compared.map_err(|found| format!("step {step} at {now_ns}: {found}"))?;
    }
    Ok(())
}

fn any_core(scheduler: &Scheduler, random: &mut Random) -> CoreId {
    let cores = usize::try_from(scheduler.options().cores).expect("few cores");
    CoreId(u32::try_from(random.below(cores)).expect("few cores"))
}

/// Ends an instance by a short way, and the instant.
fn complete(
    scheduler: &mut Scheduler,
    now_ns: u64,
    mut core: CoreId,
    instance: Instance,
    random: &mut Random,
) -> Option<Notice> {
    let vertex = scheduler.vertex(instance);
    if random.chance(5) {
        // It was moved, and has finished before it knew.
        core = any_core(scheduler, random);
    }
    let (done, passed_on) = pass_on(scheduler, now_ns, core, vertex);
    if let HandOff::Open = done {
        let _decisions = scheduler.at(now_ns).release_due().dispatch();
    }
    passed_on
}
