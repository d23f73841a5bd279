//! Two machines, one application: the left machine measures and acts, the right machine decides.
//!
//! | machine | DAG | released | takes | gives |
//! |---|---|---|---|---|
//! | left | `sense` | each 10 ms | a measurement | `reading`, over the link |
//! | right | `act` | by `reading` | `reading` | `wish`, over the link |
//! | left | `apply` | each 10 ms | `wish`; its own wish after 50 ms without | the applied wish |
//!
//! A message names its sending job, and the time of sending: [`Hop`]. From the answers, the left
//! machine learns the offset of the right machine's clock, and so counts messages slower than the
//! link's delay. The app states the delay; nothing proves it. The library does not use the kernel.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

use core::time::Duration;

use fass::shared::{Received, Wire};
use fass::{Dag, SubtaskAttributes, create_dag};
use ros::{ClockOffset, Hop, Node, Publication, Publisher, Subscription};

/// The period of the left machine.
pub const PERIOD: Duration = Duration::from_millis(10);

/// The least time between two jobs of the right machine: messages may arrive closer together than
/// they were sent.
pub const LEAST: Duration = Duration::from_millis(5);

/// The time for which a wish counts, and the wish applied without a fresh one.
const FRESH_NS: u64 = 50_000_000;
const OWN_WISH: f64 = 0.0;

ros::message! {
    /// A measurement, or the value to apply.
    pub struct Wish: "fass_msgs/msg/Wish",
        "12ed0826ea45770e91cd366d0a56e36b0cf2d10451b6d8d31728f16a2390fa30" {
        /// The hop of this message.
        pub hop: Hop,
        /// The hop of the message being answered.
        pub heard: Hop,
        /// The value.
        pub value: f64,
    }
}

/// The role of one of the two machines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// The measuring and acting machine.
    Left,
    /// The deciding machine.
    Right,
}

/// Builds a machine's DAGs, and returns them with the wires of the topics `reading` and `wish`. The
/// run ends after the given number of jobs, released once per period. The app states a delay of up
/// to `delay` for the link.
pub fn build(
    node: &mut Node,
    role: Role,
    delay: Duration,
    (jobs, period): (u64, Duration),
) -> ([Dag; 2], [Wire; 2]) {
    let cycle = |name| {
        let dag = create_dag();
        dag.name(name).jobs(jobs).period(period);
        dag.relative_deadline(period);
        dag
    };
    match role {
        Role::Left => {
            let (readings, wishes) = (node.publish("reading"), node.subscribe("wish"));
            let wires = [readings.wire().clone(), wishes.wire().clone()];
            let sense = sense(cycle("sense"), &readings, period);
            let apply = apply(cycle("apply"), &wishes, delay, period);
            ([sense, apply], wires)
        }
        Role::Right => {
            let (readings, wishes) = (node.subscribe("reading"), node.publish("wish"));
            let wires = [readings.wire().clone(), wishes.wire().clone()];
            let clock = cycle("clock");
            clock.register_untyped_subtask(|_job| (), taking("tick", 50));
            ([act(&readings, &wishes, delay, period / 2), clock], wires)
        }
    }
}

/// Registers a source for the newest message received.
fn hear(dag: &Dag, messages: &Subscription<Wish>, delay: Duration, topic: &'static str) {
    dag.record::<Option<Wish>>(topic);
    let hear = move |all: Received<'_, Wish>| {
        let newest = all.last().map(|packet| Wish {
            hop: packet.value.hop.heard(packet.received_ns, delay),
            ..packet.value
        });
        (newest,)
    };
    let hear = dag.using(messages.receiving()).source(hear);
    hear.writes(&[topic]).register(taking("hear", 100));
}

/// Registers a sink to send the message, if there is any.
fn tell(dag: &Dag, messages: &Publication<Wish>, topic: &'static str, due: Duration) {
    dag.record::<Option<Wish>>(topic);
    let tell = |mut out: Publisher<'_, Wish>, (message,): (Option<Wish>,)| {
        if let Some(mut message) = message {
            message.hop.sent_ns = fass::now_ns();
            out.put(&message);
        }
    };
    let tell = dag.using(messages.publishing()).subtask(tell);
    tell.reads(&[topic]).due(due).register(taking("tell", 100));
}

fn taking(name: &str, us: u64) -> SubtaskAttributes {
    SubtaskAttributes::named(name).wcet(Duration::from_micros(us))
}

fn sense(sense: Dag, readings: &Publication<Wish>, period: Duration) -> Dag {
    let mut job = 0_u32;
    let measure = move || {
        let reading = Wish {
            hop: Hop::sent(job.into(), fass::now_ns()),
            value: f64::from(job % 100),
            ..Wish::default()
        };
        job += 1;
        (Some(reading),)
    };
    let measure = sense.source(measure).writes(&["reading"]);
    measure.register(taking("measure", 200));
    tell(&sense, readings, "reading", period);
    sense
}

fn act(
    readings: &Subscription<Wish>,
    wishes: &Publication<Wish>,
    delay: Duration,
    least: Duration,
) -> Dag {
    let act = create_dag();
    act.name("act").sporadic(least);
    hear(&act, readings, delay, "reading");
    let mut job = 0;
    let decide = move |(reading,): (Option<Wish>,)| {
        let hop = Hop::sent(job, fass::now_ns());
        job += 1;
        let wish = reading.map(|reading| Wish {
            hop,
            heard: reading.hop,
            value: reading.value / 2.0,
        });
        (wish,)
    };
    act.register_subtask(decide, ["reading"], ["wish"], taking("decide", 200));
    tell(&act, wishes, "wish", least);
    act
}

fn apply(apply: Dag, wishes: &Subscription<Wish>, delay: Duration, period: Duration) -> Dag {
    apply.record::<f64>("applied");
    let peer = apply.state("peer", ClockOffset::default());
    hear(&apply, wishes, delay, "wish");
    let (mut newest, mut own) = (None, 0_u64);
    let follow = move |peer: &mut ClockOffset, (wish,): (Option<Wish>,)| {
        if let Some(wish) = wish {
            peer.exchange(&wish.heard, &wish.hop);
            peer.judge(&wish.hop);
            newest = Some(wish);
        }
        let now_ns = fass::now_ns();
        let is_fresh = |wish: &Wish| now_ns.saturating_sub(wish.hop.received_ns) < FRESH_NS;
        let fresh = newest.filter(is_fresh);
        own += u64::from(fresh.is_none());
        (fresh.map_or(OWN_WISH, |wish| wish.value), own)
    };
    apply
        .using(peer.update())
        .subtask(follow)
        .reads(&["wish"])
        .writes(&["applied", "own"])
        .register(taking("follow", 200));
    let mut job = 0_u64;
    let drive = move |peer: &ClockOffset, (_applied, own): (f64, u64)| {
        job += 1;
        if job.is_multiple_of(100) {
            let offset_ns = peer.offset_ns().unwrap_or(0);
            let (exchanges, exceeded) = (peer.exchanges, peer.exceeded);
            fass::log!(
                Info,
                "peer",
                exchanges = exchanges,
                exceeded = exceeded,
                offset_ns = offset_ns,
                own = own
            );
        }
    };
    apply
        .using(peer.read())
        .subtask(drive)
        .reads(&["applied", "own"])
        .due(period)
        .register(taking("drive", 100));
    apply
}
