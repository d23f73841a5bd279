//! A commit for each fault an app can make with `fass`.
//!
//! A *case* builds DAGs with exactly one fault; the case is named like the fault, and the commit
//! must refuse the DAGs. A fault excluded by the types of `fass` (such as 17 inputs) has no case.

use std::time::Duration;

use fass::shared::{Asker, Latest, Modes, Parameter, Sample, Uses, create_device};
use fass::{Dag, FaultLimit, Subtask, SubtaskAttributes, Unique, create_dag, finish_create_dags};

/// A fault's name and the function building DAGs with this fault.
type Case = (&'static str, fn() -> Vec<Dag>);

pub(crate) const PERIOD: Duration = Duration::from_millis(10);

/// One fault within 100 jobs, and 8 in all.
const FAULT_LIMIT: FaultLimit = FaultLimit::new(1, 100, 8);

/// Wrong graphs, each behind the name of its fault.
pub(crate) const GRAPHS: &str = "\
no_subtasks = lidar:
duplicate_subtask = lidar: > read > points; points > filter > near_points; near_points > filter > objects; objects > store >
cycle = lidar: > read > points; points objects > filter > near_points; near_points > detect > objects; objects > store >
self_edge = lidar: > read > points; points tracks > track > tracks; tracks > store >
not_connected = lidar: > read > points; points > store >; > measure > heat; heat > cool >
no_source = lidar: objects > filter > near_points; near_points > detect > objects; objects > store >
several_sources = lidar: > left > left_points; > right > right_points; left_points right_points > store >
no_sink = lidar: > read > points; points objects > filter > near_points; near_points > detect > objects
several_sinks = lidar: > read > points; points > store >; points > show >
unread_topic = lidar: > read > points heat; points > store >
unwritten_topic = lidar: > read > points; points > filter > ground; ground point > store >
several_writers = lidar: > read > points; points > near > objects; points > far > objects; objects > store >
duplicate_topic = lidar: > read > points; points points > store >";

/// The cases, for a platform with static priorities. The last case needs an earlier, successful
/// commit.
pub(crate) const CASES: &[Case] = &[
    // The graph: its subtasks, edges, topics and types.
    ("no_dags", Vec::new),
    ("given_twice", || {
        let dag = sound("lidar", "points");
        vec![dag.clone(), dag]
    }),
    ("input_arity", || {
        let dag = dag("lidar: > read > points");
        let store = attributes("store");
        dag.register_sink_subtask(|(_, _): (u32, u32)| (), vec!["points"], PERIOD, store);
        vec![dag]
    }),
    ("output_arity", || {
        let dag = dag("lidar:");
        let read = || (1_u32, 2_u32);
        dag.register_periodic_subtask(read, vec!["points"], PERIOD, attributes("read"));
        with(dag, "points > store >")
    }),
    ("type_mismatch", || {
        let dag = dag("lidar: > read > points");
        let store = attributes("store");
        dag.register_sink_subtask(|(_,): (f64,)| (), vec!["points"], PERIOD, store);
        vec![dag]
    }),
    ("several_readers", || {
        let dag = dag("lidar:");
        let read = || (Unique::new(1_u32),);
        dag.register_periodic_subtask(read, vec!["points"], PERIOD, attributes("read"));
        for (name, output) in [("near", "near points"), ("far", "far points")] {
            let take = |(points,): (Unique<u32>,)| (points.into_inner(),);
            dag.register_subtask(take, vec!["points"], vec![output], attributes(name));
        }
        with(dag, "near_points far_points > store >")
    }),
    ("topic_in_several_dags", || {
        vec![sound("lidar", "points"), sound("radar", "points")]
    }),
    // Times, priorities and numbers.
    ("missing_period", || {
        untyped(|dag| _ = dag.relative_deadline(PERIOD))
    }),
    ("zero_period", || {
        read_by(Duration::ZERO, attributes("read"))
    }),
    ("periods_differ", || {
        let dag = dag("lidar: > left > left_points");
        let right = attributes("right");
        dag.register_periodic_subtask(|| (1_u32,), vec!["right points"], PERIOD * 2, right);
        with(dag, "left_points right_points > store >")
    }),
    ("missing_deadline", || untyped(|dag| _ = dag.period(PERIOD))),
    ("zero_deadline", || due(Duration::ZERO, attributes("store"))),
    ("zero_sink_deadline", || {
        of_dag(due(Duration::ZERO, attributes("store")))
    }),
    ("sink_deadline_beyond_dag", || {
        of_dag(due(PERIOD * 2, attributes("store")))
    }),
    ("deadline_of_no_sink", || {
        let dag = dag("lidar:");
        dag.period(PERIOD).relative_deadline(PERIOD);
        let read = dag.register_untyped_subtask(|_job| (), attributes("read"));
        let store = dag.register_untyped_subtask(|_job| (), attributes("store"));
        dag.precede(&read, &store).sink_deadline(&read, PERIOD / 2);
        vec![dag]
    }),
    ("duration_too_long", || {
        read_by(Duration::MAX, attributes("read"))
    }),
    ("wcet_exceeds_deadline", || {
        due(PERIOD, attributes("store").wcet(PERIOD * 2))
    }),
    ("wcet_exceeds_budget", || {
        let store = attributes("store").wcet(PERIOD / 2);
        due(PERIOD, store.budget(PERIOD / 5))
    }),
    ("priorities_partly_given", || {
        read_by(PERIOD, attributes("read").priority(7))
    }),
    ("priorities_exhausted", || {
        // The last numbers there are; those of the other DAG are to be derived below them.
        let given = dag("radar:");
        let of = |name| attributes(name).priority(u32::MAX);
        given.register_periodic_subtask(|| (1_u32,), vec!["echoes"], PERIOD, of("read"));
        given.register_sink_subtask(|(_,): (u32,)| (), vec!["echoes"], PERIOD, of("store"));
        vec![given, sound("lidar", "points")]
    }),
    ("affinity_out_of_range", || {
        changed(|dag| _ = dag.affinity(&[0, 9]))
    }),
    ("stack_out_of_range", || {
        read_by(PERIOD, attributes("read").stack_bytes(4096))
    }),
    ("zero_jobs", || changed(|dag| _ = dag.jobs(0))),
    ("zero_in_flight", || changed(|dag| _ = dag.in_flight(0))),
    ("zero_faults", || surviving(FaultLimit::new(1, 100, 0))),
    ("zero_window", || surviving(FaultLimit::new(1, 0, 8))),
    ("too_many_instances", || {
        changed(|dag| _ = dag.in_flight(u32::MAX))
    }),
    ("time_overflow", || {
        changed(|dag| _ = dag.offset(Duration::from_nanos(u64::MAX)))
    }),
    ("unknown_cluster", || changed(|dag| _ = dag.cluster(1))),
    // What subtasks share: states, latest values, signals.
    ("activations_differ", || {
        changed(|dag| _ = dag.sporadic(PERIOD))
    }),
    ("duplicate_state", || {
        changed(|dag| {
            for _ in 0..2 {
                let _ = dag.state("map", 0_u32);
            }
        })
    }),
    ("unused_state", || {
        changed(|dag| _ = dag.state("map", 0_u32))
    }),
    ("state_never_updated", || {
        let dag = dag("lidar: > read > points");
        storing(dag.clone(), dag.state("map", 0_u32).read(), |_| ())
    }),
    ("state_used_twice", || {
        let dag = dag("lidar: > read > points");
        let map = dag.state("map", 0_u32);
        storing(dag, (map.update(), map.read()), |(_, _)| ())
    }),
    ("state_without_reset", || {
        let dag = dag("lidar: > read > points");
        dag.survive_faults(FAULT_LIMIT);
        let map = dag.state("map", 0_u32);
        let store = || |map: &mut u32, (points,): (u32,)| *map += points;
        stored(dag, |dag| dag.using(map.update()).restarting(store))
    }),
    // Waits.
    ("cannot_wait", || {
        let read = attributes("read").wait(PERIOD / 2);
        waiting(|dag| dag.source(|| (1_u32,)), read)
    }),
    ("replaceable_waits", || {
        let read = attributes("read").wait(PERIOD / 2);
        let dags = waiting(|dag| dag.restarting(|| |()| (1_u32,)), read);
        dags[0].survive_faults(FAULT_LIMIT);
        dags
    }),
    ("segments_partly_given", || {
        let read = attributes("read").wait(PERIOD / 2).wcet(PERIOD / 4);
        let sleep = || async { (1_u32,) };
        waiting(|dag| dag.async_source(sleep), read)
    }),
    ("segments_partly_given", || {
        let read = attributes("read").wcet(PERIOD / 4).wait(PERIOD / 2);
        let sleep = || async { (1_u32,) };
        waiting(|dag| dag.async_source(sleep), read)
    }),
    ("answers_not_recorded", || {
        let (accelerator, _driver) = create_device::<u32, u32>("accelerator");
        let dag = dag("lidar: > read > points");
        dag.record::<u32>("points");
        storing(dag, accelerator.asking(), |_: Asker<u32, u32>| ())
    }),
    ("too_many_waits", || {
        let read = (0..255).fold(attributes("read"), |read, _| read.wait(PERIOD / 300));
        waiting(|dag| dag.async_source(|| async { (1_u32,) }), read)
    }),
    ("device_asked_twice", || {
        let (accelerator, _driver) = create_device::<u32, u32>("accelerator");
        let dag = dag("lidar:");
        let read = dag.period(PERIOD).using(accelerator.asking());
        let read = read.source(|_: Asker<u32, u32>| (1_u32,));
        read.writes(&["points"]).register(attributes("read"));
        storing(dag, accelerator.asking(), |_: Asker<u32, u32>| ())
    }),
    ("replaced_in_vain", || {
        let dag = dag("lidar: > read > points");
        stored(dag, |dag| dag.restarting(|| |(_,): (u32,)| ()))
    }),
    ("nothing_replaceable", || surviving(FAULT_LIMIT)),
    ("state_over_jobs", || {
        let dag = dag("lidar:");
        dag.in_flight(2);
        let map = dag.state("map", 0_u32);
        let read = |map: &mut u32| (*map,);
        let read = dag.period(PERIOD).using(map.update()).source(read);
        read.writes(&["points"]).register(attributes("read"));
        storing(dag, map.read(), |_| ())
    }),
    ("latest_unwritten", || {
        let lidar = sound("lidar", "points");
        let planner = planner(&lidar.latest::<u32>("pose"));
        vec![lidar, planner]
    }),
    ("latest_unread", || {
        changed(|dag| _ = dag.latest::<u32>("points"))
    }),
    ("latest_type_mismatch", || {
        let lidar = sound("lidar", "points");
        let planner = planning(lidar.latest::<f64>("points").sample(), |_| ());
        vec![lidar, planner]
    }),
    ("latest_of_moved", || {
        let lidar = dag("lidar:");
        lidar.relative_deadline(PERIOD);
        let read = || (Unique::new(1_u32),);
        lidar.register_periodic_subtask(read, vec!["points"], PERIOD, attributes("read"));
        let points = lidar.latest::<Unique<u32>>("points");
        let planner = planning((points.sample(), points.sample()), |(_, _)| ());
        vec![lidar, planner]
    }),
    ("latest_not_committed", || {
        // Without `lidar`.
        vec![planner(&sound("lidar", "points").latest::<u32>("points"))]
    }),
    ("signal_not_committed", || {
        let alarm = create_dag().sporadic(PERIOD);
        let dag = dag("lidar: > read > points");
        storing(dag, alarm.raising(), |mut alarm| alarm.raise())
    }),
    ("switched_not_committed", || {
        let camera = sound("camera", "frames"); // and it is not given
        let dag = dag("lidar: > read > points");
        storing(dag, camera.switching(), |mut camera| camera.pause())
    }),
    ("taken_by_no_source", || {
        let nearest = Parameter::new("nearest", 0.5, 0.0..=2.0);
        let dag = dag("lidar: > read > points");
        storing(dag, nearest.reading(), |_nearest| ())
    }),
    ("taken_twice", || {
        let dag = dag("lidar:");
        let nearest = Parameter::new("nearest", 0.5, 0.0..=2.0);
        for (name, topic) in [("left", "left points"), ("right", "right points")] {
            let read = |_nearest: f64| (1_u32,);
            let read = dag.period(PERIOD).using(nearest.reading()).source(read);
            read.writes(&[topic]).register(attributes(name));
        }
        with(dag, "left_points right_points > store >")
    }),
    ("source_partly_recorded", || {
        let dag = dag("lidar: > read > points heat; points heat > store >");
        dag.record::<u32>("points");
        vec![dag]
    }),
    ("sample_not_recorded", || {
        let lidar = sound("lidar", "points");
        let points = lidar.latest::<u32>("points");
        let planner = dag("planner: > tick > ticks");
        planner.record::<u32>("ticks");
        let plan = |_: Option<Sample<'_, u32>>, (_,): (u32,)| ();
        let plan = planner.using(points.sample()).subtask(plan);
        plan.reads(&["ticks"])
            .due(PERIOD)
            .register(attributes("plan"));
        vec![lidar, planner]
    }),
    // Modes.
    ("duplicate_mode", || {
        let modes = Modes::new();
        two(|lidar, camera| {
            modes.mode("flight", &[lidar]);
            modes.mode("flight", &[camera]);
        })
    }),
    ("several_sets_of_modes", || {
        two(|lidar, camera| {
            Modes::new().mode("flight", &[lidar]);
            Modes::new().mode("landing", &[camera]);
        })
    }),
    ("mode_not_committed", || {
        let mut both = two(|lidar, camera| _ = Modes::new().mode("flight", &[lidar, camera]));
        both.truncate(1); // without `camera`
        both
    }),
    ("mode_starts_paused", || {
        changed(|dag| {
            dag.starts_paused();
            Modes::new().mode("flight", &[dag]);
        })
    }),
    ("mode_without_handler", || {
        let brakes = dag("brakes:");
        brakes.relative_deadline(PERIOD);
        let signal = brakes.sporadic(PERIOD);
        brakes.register_untyped_subtask(|_job| (), attributes("hold"));
        let mut both = two(|lidar, camera| {
            lidar.on_fault(&signal);
            let modes = Modes::new();
            modes.mode("flight", &[lidar]);
            modes.mode("landing", &[camera, &brakes]);
        });
        both.push(brakes);
        both
    }),
    ("not_proven", || {
        // No number of cores helps a subtask that takes longer than a period.
        let dag = dag("lidar:");
        dag.demand_proof();
        let read = attributes("read").wcet(PERIOD / 10);
        dag.register_periodic_subtask(|| (1_u32,), vec!["points"], PERIOD, read);
        let store = attributes("store").wcet(PERIOD * 2);
        dag.register_sink_subtask(|(_,): (u32,)| (), vec!["points"], PERIOD * 4, store);
        vec![dag]
    }),
    ("already_committed", || {
        let dag = sound("lidar", "points");
        dag.jobs(1);
        // What it returns shows at the next commit, which is the case.
        let _ = finish_create_dags(std::slice::from_ref(&dag));
        vec![dag]
    }),
];

fn attributes(name: &str) -> SubtaskAttributes {
    SubtaskAttributes::named(name)
}

/// Makes a DAG from its name and its subtasks, as `inputs > name > outputs`; a `_` in a topic's
/// name becomes a blank.
pub(crate) fn dag(text: &str) -> Dag {
    let (name, subtasks) = text.split_once(':').expect("a name");
    let dag = create_dag();
    dag.name(name);
    with(dag, subtasks).remove(0)
}

/// Registers subtasks of a DAG, and returns the DAG.
fn with(dag: Dag, subtasks: &str) -> Vec<Dag> {
    for subtask in subtasks.split(';').filter(|text| !text.is_empty()) {
        let parts: Vec<&str> = subtask.split('>').map(str::trim).collect();
        let topics = |part: &str| -> Vec<String> {
            let names = part.split_whitespace();
            names.map(|name| name.replace('_', " ")).collect()
        };
        let (inputs, outputs) = (topics(parts[0]), topics(parts[2]));
        let inputs: Vec<&str> = inputs.iter().map(String::as_str).collect();
        let outputs: Vec<&str> = outputs.iter().map(String::as_str).collect();
        let named = attributes(parts[1]);
        match (inputs.len(), outputs.len()) {
            (0, 1) => dag.register_periodic_subtask(|| (1_u32,), outputs, PERIOD, named),
            (0, 2) => dag.register_periodic_subtask(|| (1_u32, 2_u32), outputs, PERIOD, named),
            (1, 1) => dag.register_subtask(|(x,): (u32,)| (x,), inputs, outputs, named),
            (2, 1) => dag.register_subtask(|(x, _): (u32, u32)| (x,), inputs, outputs, named),
            (1, 0) => dag.register_sink_subtask(|(_,): (u32,)| (), inputs, PERIOD, named),
            _ => dag.register_sink_subtask(|(_, _): (u32, u32)| (), inputs, PERIOD, named),
        }
    }
    vec![dag]
}

/// Makes a DAG without fault: a source, a topic, a sink.
pub(crate) fn sound(name: &str, topic: &str) -> Dag {
    dag(&format!("{name}: > read > {topic}; {topic} > store >"))
}

/// Makes a DAG from a source and the source's attributes.
fn waiting(
    source: impl for<'d> FnOnce(&'d Dag) -> Subtask<'d>,
    read: SubtaskAttributes,
) -> Vec<Dag> {
    let dag = dag("lidar:");
    dag.period(PERIOD);
    source(&dag).writes(&["points"]).register(read);
    with(dag, "points > store >")
}

fn changed(change: impl FnOnce(&Dag)) -> Vec<Dag> {
    let dag = sound("lidar", "points");
    change(&dag);
    vec![dag]
}

/// Makes two sound DAGs, and changes them.
fn two(change: impl FnOnce(&Dag, &Dag)) -> Vec<Dag> {
    let both = [sound("lidar", "points"), sound("camera", "frames")];
    change(&both[0], &both[1]);
    both.into()
}

fn surviving(limit: FaultLimit) -> Vec<Dag> {
    changed(|dag| _ = dag.survive_faults(limit))
}

/// Makes a DAG from the period and the attributes of its source.
fn read_by(period: Duration, read: SubtaskAttributes) -> Vec<Dag> {
    let dag = dag("lidar:");
    dag.register_periodic_subtask(|| (1_u32,), vec!["points"], period, read);
    with(dag, "points > store >")
}

/// Makes a DAG from the deadline and the attributes of its sink.
fn due(deadline: Duration, store: SubtaskAttributes) -> Vec<Dag> {
    let dag = dag("lidar: > read > points");
    dag.register_sink_subtask(|(_,): (u32,)| (), vec!["points"], deadline, store);
    vec![dag]
}

/// Gives a DAG a deadline next to its sink's.
fn of_dag(dags: Vec<Dag>) -> Vec<Dag> {
    dags[0].relative_deadline(PERIOD);
    dags
}

/// Makes a DAG of a single subtask without topics, and changes the DAG.
fn untyped(change: impl FnOnce(&Dag)) -> Vec<Dag> {
    let dag = dag("lidar:");
    dag.register_untyped_subtask(|_job| (), attributes("start"));
    change(&dag);
    vec![dag]
}

/// Makes the DAG `planner` of a single subtask, with a use besides inputs.
fn planning<U: Uses + 'static>(
    uses: U,
    mut plan: impl for<'a> FnMut(U::Borrowed<'a>) + Send + 'static,
) -> Dag {
    let dag = dag("planner:");
    dag.period(PERIOD).relative_deadline(PERIOD);
    let source = move |used: U::Borrowed<'_>| plan(used);
    (dag.using(uses).source(source)).register(attributes("plan"));
    dag
}

/// Makes the DAG `planner` sampling a latest value.
fn planner(latest: &Latest<u32>) -> Dag {
    planning(latest.sample(), |_| ())
}

/// Registers the sink `store`, reading the topic `points`, with another use besides.
fn storing<U: Uses + 'static>(
    dag: Dag,
    uses: U,
    mut store: impl for<'a> FnMut(U::Borrowed<'a>) + Send + 'static,
) -> Vec<Dag> {
    let sink = move |used: U::Borrowed<'_>, (_,): (u32,)| store(used);
    stored(dag, |dag| dag.using(uses).subtask(sink))
}

/// Registers a subtask as the sink `store`, reading the topic `points`.
fn stored(dag: Dag, store: impl for<'d> FnOnce(&'d Dag) -> Subtask<'d>) -> Vec<Dag> {
    let store = store(&dag).reads(&["points"]).due(PERIOD);
    store.register(attributes("store"));
    vec![dag]
}
