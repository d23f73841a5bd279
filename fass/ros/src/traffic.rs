//! The node as a [`Protocol`]: the router's puts become packets of wires, and packets become puts.

use alloc::boxed::Box;
use alloc::format;
use alloc::string::String;
use alloc::sync::Arc;
use core::time::Duration;

use fass::platform::{Buffer, Protocol};
use fass::shared::DeviceEnd;
use zenoh::{Declaration, MOST_BYTES, SessionCounts};

use super::node::{Node, Topic};
use super::rmw::attachment;

/// The most bytes of a datagram besides key and value: a frame with its number, a put, three
/// lengths, and the attachment.
const AROUND_BYTES: usize = 48;

/// How many packets without a session are lost at once, to bound the time.
const MOST_LOST: u32 = 4;

/// The most by which a message's stamp moves the clock.
const STEP: Duration = Duration::from_millis(1);

impl Node {
    /// Tells the DAGs if the session has come up, or is lost, since the last call.
    fn tell_session(&mut self) {
        let since_ns = self
            .session
            .up_since_ns()
            .map_or(0, |since_ns| since_ns.max(1));
        if self.up_since.value() != since_ns {
            // Any number is in the range.
            let _ = self.up_since.set(since_ns);
            let ends = self.topics.iter().filter_map(|topic| topic.end.as_ref());
            ends.for_each(|end| end.set_link(since_ns > 0));
        }
    }

    /// Puts the next datagram into the buffer. Reports whether there is one.
    fn fill(&mut self, now_ns: u64) -> bool {
        let start = Buffer::HEADROOM;
        let room = &mut self.out.whole()[start..];
        let end = room.len().min(self.most_bytes);
        let room = &mut room[..end];
        let declared = &self.declared;
        let declaration = |place: usize| {
            let (is_token, key) = declared.get(place)?;
            Some(match is_token {
                true => Declaration::Token(key),
                false => Declaration::Subscriber(key),
            })
        };
        let mut length = self.session.due(now_ns, declaration, room);
        for _ in 0..MOST_LOST {
            let count = if length > 0 { 0 } else { self.topics.len() };
            let turn = self.turn;
            let is_waiting = |place: &usize| {
                let topic = &self.topics[*place];
                topic.publishes && topic.end.as_ref().is_some_and(|end| end.has_bytes_to_go())
            };
            let mut places = (turn..turn + count).map(|place| place % count);
            let Some(place) = places.find(is_waiting) else {
                break;
            };
            // Behind a lost packet, the same topic's next packet: searching takes longest.
            self.turn = place;
            let topic = &mut self.topics[place];
            let unix_ns = self.clock.at(now_ns).unwrap_or(0);
            let attachment = attachment(topic.number + 1, unix_ns, topic.gid);
            let (session, key, mut put) = (&mut self.session, &topic.key, None);
            if let Some(end) = &topic.end {
                end.swap_out(|packet, _| {
                    put = session.put(key, &attachment, packet.content(), room);
                    true
                });
            }
            match put {
                Some(put) => {
                    (length, topic.number) = (put, topic.number + 1);
                    self.turn += 1;
                }
                None => self.unsent += 1,
            }
        }
        self.out.set_range(start..start + length);
        length > 0
    }
}

impl Protocol for Node {
    fn begin(&mut self, most_bytes: usize, ready: fn()) -> Result<Box<[Arc<DeviceEnd>]>, String> {
        let most_bytes = most_bytes.min(MOST_BYTES.into());
        self.out = Buffer::new(Buffer::HEADROOM + most_bytes);
        self.most_bytes = most_bytes;
        let begin = |topic: &mut Topic| {
            let name = topic.wire.name();
            let end = DeviceEnd::of(&topic.wire).ok_or_else(|| {
                format!("topic `{name}` has a device already; join the node once, to one router")
            })?;
            let most_bytes = most_bytes.saturating_sub(AROUND_BYTES + topic.key.len());
            end.begin_packets(most_bytes, ready);
            end.set_link(false);
            Ok(Arc::clone(topic.end.insert(Arc::new(end))))
        };
        self.topics.iter_mut().map(begin).collect()
    }

    fn hear(&mut self, datagram: &[u8], now_ns: u64) -> u64 {
        let Self {
            session,
            topics,
            clock,
            unknown,
            ..
        } = self;
        let mut heard = 0;
        session.hear(now_ns, datagram, &mut |put| {
            if let Some(stamp_ns) = put.stamp_ns {
                clock.correct(now_ns, stamp_ns, STEP);
            }
            let is_of = |topic: &Topic| !topic.publishes && topic.key.as_bytes() == put.key;
            let place = topics.iter().position(is_of);
            *unknown += u64::from(place.is_none());
            if let Some(place) = place
                && let Some(end) = &topics[place].end
                && end.copy_in(put.payload, now_ns)
            {
                heard |= 1 << place;
            }
        });
        self.tell_session();
        heard
    }

    fn send(&mut self, now_ns: u64, send: &mut dyn FnMut(&mut Buffer) -> bool) -> bool {
        // A datagram that has not gone is still there.
        let is_there = !self.out.content().is_empty() || self.fill(now_ns);
        self.tell_session();
        let has_gone = is_there && send(&mut self.out);
        if has_gone {
            self.out.set_range(0..0);
        }
        has_gone
    }

    fn set_link(&mut self, _: bool) {
        // Gone, or there: another session begins.
        self.session.lose();
        self.tell_session();
    }

    fn close(&mut self) {
        self.session.close();
        self.out.set_range(0..0);
    }

    fn tell_news(&mut self) {
        let SessionCounts { opened, lost, .. } = self.session.counts();
        if self.told.lost != lost {
            fass::log!(Warn, "session lost", lost = lost);
        }
        if self.told.opened != opened {
            fass::log!(Info, "session opened", opened = opened);
        }
        self.told = self.session.counts();
    }

    fn counts(&self, tell: &mut dyn FnMut(&'static str, u64)) {
        let counts = self.session.counts();
        for (name, count) in [
            ("opened", counts.opened),
            ("lost", counts.lost),
            ("puts", counts.puts),
            ("sent", counts.sent),
            ("unsent", self.unsent),
            ("unknown", self.unknown),
            ("malformed", counts.malformed),
            ("foreign", counts.foreign),
            ("repeated", counts.repeated),
            ("missing", counts.gaps + counts.dropped),
        ] {
            tell(name, count);
        }
    }
}
