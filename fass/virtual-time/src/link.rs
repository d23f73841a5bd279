//! Links: two machines in virtual time, each receiving the other's packets.
//!
//! The machines run in turns, in steps shorter than the least delay. Packets sent by one machine in
//! a step arrive at the other after the step, and so at their exact nanosecond.

use std::net::{Ipv4Addr, SocketAddrV4};
use std::time::Duration;

use fass::shared::Wire;
use random::Random;

use crate::machine::Arrival;
use crate::report::Report;
use crate::{VirtualTime, nanoseconds};

/// A link between two machines, carrying packets from wires of one machine to wires of the other.
///
/// # Examples
///
/// ```
/// use std::time::Duration;
/// use fass::shared::{Framing, Received, Sender, Wire, WireOptions};
/// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
/// use virtual_time::{Link, LinkOptions, VirtualTime};
///
/// let (ms, named) = (Duration::from_millis, SubtaskAttributes::named);
/// let wire = |name| Wire::with(name, WireOptions { framing: Framing::Chunks, ..WireOptions::default() });
/// let (said, heard) = (wire("said"), wire("heard"));
///
/// let left = VirtualTime::new();
/// let dag = create_dag();
/// dag.period(ms(10)).relative_deadline(ms(10)).jobs(3);
/// let say = |mut wire: Sender<'_>| _ = wire.send(b"!");
/// dag.using(said.sending()).source(say).register(named("say"));
/// finish_create_dags(&[dag]).unwrap();
///
/// let right = VirtualTime::new();
/// let dag = create_dag();
/// dag.relative_deadline(ms(5)).sporadic(ms(5));
/// let hear = |all: Received<'_, ()>| assert_eq!(all.count(), 1);
/// dag.using(heard.receiving(|_| Some(()))).source(hear).register(named("hear"));
/// finish_create_dags(&[dag]).unwrap();
///
/// let options = LinkOptions { delay: ms(2), ..LinkOptions::default() };
/// let mut link = Link::new([&left, &right], options);
/// link.carry(0, &said, &heard);
/// let [_, report] = link.run_for(ms(50));
/// let releases: Vec<_> = report.jobs.iter().filter_map(|job| job.release_ns).collect();
/// assert_eq!(releases, [2_000_000, 12_000_000, 22_000_000]);
/// ```
#[derive(Debug)]
pub struct Link<'m> {
    machines: [&'m VirtualTime; 2],
    options: LinkOptions,
    ways: Vec<Way>,
    is_up: bool,
    random: Random,
    /// How far both machines have run, on the first machine's time.
    reached_ns: u64,
}

/// Options of a link: when packets arrive, and whether.
///
/// See [`Link`].
#[derive(Clone, Copy, Debug, Default)]
pub struct LinkOptions {
    /// The shortest travel time of a packet, 2 ns or more.
    pub delay: Duration,
    /// The largest additional travel time of a packet, drawn at random. So packets may be
    /// overtaken, unless the link keeps their order.
    pub jitter: Duration,
    /// Prevents overtaking: each packet arrives with the packet before, at the earliest.
    pub keeps_order: bool,
    /// One packet in so many is lost, by random draws; with 0, none.
    pub lost_of: u64,
    /// How much later the second machine's time begins. Packets that would arrive earlier are lost.
    pub offset: Duration,
    /// The seed of the draws.
    pub seed: u64,
}

/// A way from a wire of one machine to a wire of the other.
#[derive(Debug)]
struct Way {
    /// The sending machine, and the places of its wire and of the other machine's wire.
    from: usize,
    places: [usize; 2],
    /// How many packets were taken, and when the latest packet arrives.
    taken: usize,
    latest_ns: u64,
}

impl<'m> Link<'m> {
    /// Makes a link.
    ///
    /// # Panics
    ///
    /// If the delay is shorter than 2 ns: then the machines' steps could not be ordered.
    #[must_use]
    pub fn new(machines: [&'m VirtualTime; 2], options: LinkOptions) -> Self {
        let takes_time = options.delay > Duration::from_nanos(1);
        assert!(
            takes_time,
            "a link takes time; give it a delay of 2 ns or more"
        );
        Self {
            machines,
            options,
            ways: Vec::new(),
            is_up: true,
            random: Random::new(options.seed),
            reached_ns: 0,
        }
    }

    /// Carries packets sent by machine `from`, the first (0) or the second (1), on a wire, to a
    /// wire of the other machine.
    ///
    /// # Panics
    ///
    /// If another machine has one of the wires.
    pub fn carry(&mut self, from: usize, out: &Wire, to: &Wire) {
        let [sender, hearer] = [from, 1 - from].map(|machine| &self.machines[machine].machine);
        let places = [sender.place_of(out), hearer.place_of(to)];
        (sender.wires.borrow_mut()[places[0]].1).get_or_insert_default();
        self.ways.push(Way {
            from,
            places,
            taken: 0,
            latest_ns: 0,
        });
    }

    /// Cuts or mends the link. While the link is cut, sent packets are lost, and [`Wire::link`]
    /// reports the cut at either end.
    pub fn set_up(&mut self, is_up: bool) {
        self.is_up = is_up;
        for way in &self.ways {
            for (machine, place) in [way.from, 1 - way.from].into_iter().zip(way.places) {
                let wires = self.machines[machine].machine.wires.borrow();
                wires[place].0.set_link(is_up);
            }
        }
    }

    /// Runs both machines for a time, and reports as [`VirtualTime::run_for`] does.
    ///
    /// # Panics
    ///
    /// As [`VirtualTime::run_for`].
    pub fn run_for(&mut self, duration: Duration) -> [Report; 2] {
        let end_ns = self.reached_ns.saturating_add(nanoseconds(duration));
        let begins_ns = [0, nanoseconds(self.options.offset)];
        while self.reached_ns < end_ns {
            // So packets sent at the step's start, too, arrive behind its end.
            let step_ns = nanoseconds(self.options.delay) - 1;
            self.reached_ns = self.reached_ns.saturating_add(step_ns).min(end_ns);
            for (machine, begin_ns) in self.machines.iter().zip(begins_ns) {
                if let Some(own_ns) = self.reached_ns.checked_sub(begin_ns) {
                    let run = machine.with_session(|session| session.run_up_to(own_ns));
                    run.unwrap_or_else(|error| panic!("{error}"));
                }
            }
            let mut ways = std::mem::take(&mut self.ways);
            ways.iter_mut().for_each(|way| self.take(way, begins_ns));
            self.ways = ways;
        }
        self.machines.map(|machine| machine.run_for(Duration::ZERO))
    }

    /// Takes the packets sent on a way in the latest step, and lets them arrive.
    fn take(&mut self, way: &mut Way, begins_ns: [u64; 2]) {
        let (from, to, options) = (way.from, 1 - way.from, &self.options);
        let [sender, hearer] = [from, to].map(|machine| &self.machines[machine].machine);
        let end = hearer.wires.borrow()[way.places[1]].0.clone();
        let wires = sender.wires.borrow();
        let sent = wires[way.places[0]].1.as_deref().unwrap_or_default();
        for (sent_ns, (packet, _)) in &sent[way.taken..] {
            let is_lost = options.lost_of > 0 && self.random.once_in(options.lost_of);
            let more_ns = self.random.within(0..=nanoseconds(options.jitter));
            let mut at_ns = sent_ns + begins_ns[from] + nanoseconds(options.delay) + more_ns;
            if options.keeps_order {
                at_ns = at_ns.max(way.latest_ns);
            }
            let own_ns = at_ns.checked_sub(begins_ns[to]);
            let arrives = own_ns.filter(|_| self.is_up && !is_lost);
            if let Some(own_ns) = arrives {
                way.latest_ns = at_ns;
                let nobody = SocketAddrV4::new(Ipv4Addr::UNSPECIFIED, 0);
                let arrival = Arrival::Bytes(end.clone(), packet.clone(), Some(nobody));
                hearer.keep(own_ns, arrival);
            }
        }
        way.taken = sent.len();
    }
}
