//! Hops: the origin of a value sent by another machine, and the offset of the other machine's
//! clock.
//!
//! The app *states* the delay of a link. Nothing proves the stated delay: the node measures the
//! real one, by the clocks of both machines, and counts each excess. The offset of the clocks
//! follows from an exchange of two messages. The offset is known up to half of both messages'
//! travel time, so the fastest exchange is the most precise.

use core::time::Duration;

/// How far two clocks may drift apart, in millionths: 100 for each crystal.
const DRIFT_PPM: u64 = 200;

crate::message! {
    /// The origin of a value. In messages between machines, this is the first field, named `hop`.
    ///
    /// ```
    /// use core::time::Duration;
    /// use ros::Hop;
    ///
    /// let sent = Hop::sent(7, 1_000);
    /// let heard = sent.heard(1_500, Duration::from_micros(1));
    /// assert_eq!((heard.job, heard.received_ns, heard.delay_ns), (7, 1_500, 1_000));
    /// ```
    #[derive(Eq)]
    pub struct Hop: "fass_msgs/msg/Hop",
        "1edd48ab78536fd2d5c9f0a2759ce5a279975e01cfd60a0e3ffb3c05d47d608d" {
        /// The sending job.
        pub job: u64,
        /// The time of sending, on the sender's clock.
        pub sent_ns: u64,
        /// The time of receipt, on the receiver's clock; set by the receiving source.
        pub received_ns: u64,
        /// The delay stated by the app for the link; set by the receiving source.
        pub delay_ns: u64,
    }
}

impl Hop {
    /// Begins a hop, in the sending job.
    #[must_use]
    pub const fn sent(job: u64, sent_ns: u64) -> Self {
        Self {
            job,
            sent_ns,
            received_ns: 0,
            delay_ns: 0,
        }
    }

    /// Completes a hop, in the receiving source.
    #[must_use]
    pub fn heard(self, received_ns: u64, stated: Duration) -> Self {
        let delay_ns = u64::try_from(stated.as_nanos()).unwrap_or(u64::MAX);
        Self {
            received_ns,
            delay_ns,
            ..self
        }
    }
}

recording::recordable! {
    /// The offset of another machine's clock from ours.
    ///
    /// ```
    /// use core::time::Duration;
    /// use ros::{ClockOffset, Hop};
    ///
    /// let mut peer = ClockOffset::default(); // its clock is 100 ns ahead
    /// let stated = Duration::from_nanos(30);
    /// let there = Hop::sent(1, 1_000).heard(1_120, stated);
    /// let back = Hop::sent(1, 1_150).heard(1_080, stated);
    /// peer.exchange(&there, &back);
    /// assert_eq!((peer.offset_ns(), peer.uncertainty_ns(1_080)), (Some(95), 25));
    /// assert_eq!(peer.delay_ns(&back), Some(25)); // it was 30, within the uncertainty
    /// assert!(!peer.judge(&back) && peer.judge(&Hop::sent(2, 1_200).heard(1_165, stated)));
    /// assert_eq!(peer.exceeded, 1);
    /// ```
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub struct ClockOffset {
        /// Exchanges so far.
        pub exchanges: u64,
        /// Hops that took longer than stated, by more than the uncertainty.
        pub exceeded: u64,
        offset_ns: i64,
        /// Half of the kept exchange's travel time, and the end of that exchange.
        half_ns: u64,
        kept_ns: u64,
    }
}

impl ClockOffset {
    /// Takes an exchange: a message of ours, and the answer. The exchange is kept if it is more
    /// precise than the kept one, whose uncertainty grows with the drift of the clocks.
    pub fn exchange(&mut self, there: &Hop, back: &Hop) {
        let from_to = |from: u64, to: u64| i128::from(to) - i128::from(from);
        let whole_ns = from_to(there.sent_ns, back.received_ns);
        let answer_ns = from_to(there.received_ns, back.sent_ns);
        let Ok(way_ns) = u64::try_from(whole_ns - answer_ns) else {
            return; // it is none
        };
        let half_ns = way_ns.div_ceil(2);
        if self.exchanges == 0 || half_ns <= self.uncertainty_ns(back.received_ns) {
            let there_ns = from_to(there.sent_ns, there.received_ns);
            let twice_ns = there_ns - from_to(back.sent_ns, back.received_ns);
            self.offset_ns = i64::try_from(twice_ns / 2).unwrap_or(i64::MAX);
            (self.half_ns, self.kept_ns) = (half_ns, back.received_ns);
        }
        self.exchanges += 1;
    }

    /// Returns how far the other clock is ahead of ours, if there was an exchange.
    #[must_use]
    pub const fn offset_ns(&self) -> Option<i64> {
        match self.exchanges {
            0 => None,
            _ => Some(self.offset_ns),
        }
    }

    /// Returns the possible error of the offset, in either direction, at an instant of our clock.
    #[must_use]
    pub const fn uncertainty_ns(&self, now_ns: u64) -> u64 {
        let drift_ns = now_ns.saturating_sub(self.kept_ns) / (1_000_000 / DRIFT_PPM);
        self.half_ns.saturating_add(drift_ns)
    }

    /// Returns how long a message to us was on its way, according to this offset.
    #[must_use]
    pub fn delay_ns(&self, hop: &Hop) -> Option<i64> {
        let sent_ns = i128::from(hop.sent_ns) - i128::from(self.offset_ns()?);
        i64::try_from(i128::from(hop.received_ns) - sent_ns).ok()
    }

    /// Counts a hop to us if it took longer than stated, by more than the uncertainty. Reports
    /// whether it did.
    pub fn judge(&mut self, hop: &Hop) -> bool {
        let most_ns = hop
            .delay_ns
            .saturating_add(self.uncertainty_ns(hop.received_ns));
        let is_late = self
            .delay_ns(hop)
            .is_some_and(|delay| i128::from(delay) > most_ns.into());
        self.exceeded += u64::from(is_late);
        is_late
    }
}
