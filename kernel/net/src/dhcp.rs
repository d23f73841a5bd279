//! The client of DHCP (RFC 2131): gets an address from a server, and renews it as long as the
//! server answers.

use core::net::Ipv4Addr;

use crate::bytes::{array, ip_at, put, u32_at};
use crate::interface::is_host;
use crate::{Address, Mac, Peer};

/// The bytes of a sent message: some relays drop shorter messages (RFC 1542, 2.1).
const LENGTH: usize = 300;

/// The most options read, padding included: a limit on the time spent in an interrupt.
const MOST_OPTIONS: usize = 64;

const COOKIE_AT: usize = 236;
const COOKIE: [u8; 4] = [99, 130, 83, 99];

const DISCOVER: u8 = 1;
const OFFER: u8 = 2;
const REQUEST: u8 = 3;
const ACK: u8 = 5;
const NAK: u8 = 6;

const NS_PER_S: u64 = 1_000_000_000;

/// An address given by a server.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lease {
    /// The address.
    pub address: Address,
    /// The server.
    pub server: Ipv4Addr,
    /// The length of the lease in seconds; `u32::MAX` means without an end.
    pub seconds: u32,
}

#[derive(Clone, Copy)]
enum State {
    /// Looks for a server.
    Discovering,
    /// Asks for the lease offered by a server.
    Requesting(Lease),
    /// Has an address until a time, and renews it.
    Bound { lease: Lease, end_ns: u64 },
}

/// A client. Its messages go from port [`Client::PORT`] to [`Client::SERVERS`], and the answers
/// come to that port. The client has no clock: each call is told the time.
pub struct Client {
    mac: Mac,
    transaction: u32,
    state: State,
    /// The time at which the next message is due.
    due_ns: u64,
    /// The time from the next message to the one after it, if nobody answers; doubles up to 64 s.
    patience_ns: u64,
}

impl Client {
    /// The client's port.
    pub const PORT: u16 = 68;

    /// All servers of the network.
    pub const SERVERS: Peer = Peer::new(Ipv4Addr::BROADCAST, 67);

    /// Returns a client that looks for a server at once. `transaction` is any number unlikely to be
    /// shared by clients in the same network.
    pub const fn new(mac: Mac, transaction: u32) -> Self {
        Self {
            mac,
            transaction,
            state: State::Discovering,
            due_ns: 0,
            patience_ns: NS_PER_S,
        }
    }

    /// Returns the time at which [`Client::send`] is to be called.
    pub const fn due_ns(&self) -> u64 {
        self.due_ns
    }

    /// Returns the lease given by a server, while its time lasts.
    pub const fn lease(&self) -> Option<Lease> {
        match self.state {
            State::Bound { lease, .. } => Some(lease),
            _ => None,
        }
    }

    /// Writes the message that is due, and returns its length. At the end of a lease not renewed by
    /// any server, the address is lost, and the client starts over.
    ///
    /// # Panics
    ///
    /// Panics if the buffer has less than 300 bytes.
    pub fn send(&mut self, now_ns: u64, payload: &mut [u8]) -> Option<usize> {
        if now_ns < self.due_ns {
            return None;
        }
        if let State::Bound { end_ns, .. } = self.state
            && now_ns >= end_ns
        {
            self.begin(now_ns);
        }
        // The server has ignored four requests, after 1, 2, 4 and 8 s: look for another one.
        let is_last_request = self.patience_ns > 8 * NS_PER_S;
        if matches!(self.state, State::Requesting(_)) && is_last_request {
            self.begin(now_ns);
        }
        self.write(payload);
        self.due_ns = now_ns.saturating_add(self.patience_ns);
        if let State::Bound { end_ns, .. } = self.state {
            // At the end of the lease the address has to go, however patient the client is.
            self.due_ns = self.due_ns.min(end_ns);
        }
        self.patience_ns = (2 * self.patience_ns).min(64 * NS_PER_S);
        Some(LENGTH)
    }

    fn begin(&mut self, now_ns: u64) {
        self.enter(State::Discovering, now_ns);
        // Late answers to the former search are then another client's.
        self.transaction = self.transaction.wrapping_add(1);
    }

    fn enter(&mut self, state: State, due_ns: u64) {
        self.state = state;
        self.due_ns = due_ns;
        self.patience_ns = NS_PER_S;
    }

    fn write(&self, payload: &mut [u8]) {
        let message = &mut payload[..LENGTH];
        message.fill(0);
        // A request (1) by Ethernet (1), whose addresses have 6 bytes.
        put(message, 0, &[1, 1, 6]);
        put(message, 4, &self.transaction.to_be_bytes());
        // The answer goes to all, as this address is not known to the server's network yet.
        put(message, 10, &[0x80]);
        put(message, 28, &self.mac.0);
        put(message, COOKIE_AT, &COOKIE);
        let kind = match self.state {
            State::Discovering => DISCOVER,
            _ => REQUEST,
        };
        // The kind, and the requested values: mask, router, length of the lease, server.
        put(message, 240, &[53, 1, kind, 55, 4, 1, 3, 51, 54, 255]);
        match self.state {
            State::Discovering => {}
            State::Requesting(offer) => {
                put(message, 249, &[50, 4]);
                put(message, 251, &offer.address.ip.octets());
                put(message, 255, &[54, 4]);
                put(message, 257, &offer.server.octets());
                put(message, 261, &[255]);
            }
            State::Bound { lease, .. } => put(message, 12, &lease.address.ip.octets()),
        }
    }

    /// Takes a message, and returns whether [`Client::lease`] has changed. A malformed message, or
    /// a message to another client, changes nothing.
    pub fn take(&mut self, payload: &[u8], now_ns: u64) -> bool {
        let Some((kind, server, lease)) = self.read(payload) else {
            return false;
        };
        match (self.state, kind, lease) {
            (State::Discovering, OFFER, Some(offer)) => {
                self.enter(State::Requesting(offer), now_ns);
                false
            }
            (State::Requesting(asked) | State::Bound { lease: asked, .. }, ACK, Some(lease))
                if lease.server == asked.server =>
            {
                let length_ns = match lease.seconds {
                    u32::MAX => u64::MAX,
                    seconds => u64::from(seconds) * NS_PER_S,
                };
                let end_ns = now_ns.saturating_add(length_ns);
                let before = self.lease();
                // T1 of RFC 2131, 4.4.5.
                let renewal_ns = now_ns.saturating_add(length_ns / 2);
                self.enter(State::Bound { lease, end_ns }, renewal_ns);
                before != Some(lease)
            }
            // Only the asked server counts: otherwise any sender could keep this client asking
            // forever.
            (State::Requesting(asked) | State::Bound { lease: asked, .. }, NAK, _)
                if server == Some(asked.server) =>
            {
                let had = self.lease().is_some();
                self.begin(now_ns);
                had
            }
            _ => false,
        }
    }

    /// Reads the kind of an answer to this client, the server, and the lease if the answer has a
    /// whole one.
    fn read(&self, message: &[u8]) -> Option<(u8, Option<Ipv4Addr>, Option<Lease>)> {
        let is_ours = array(message, 0)? == [2, 1, 6]
            && u32_at(message, 4)? == self.transaction
            && array(message, 28)? == self.mac.0
            && array(message, COOKIE_AT)? == COOKIE;
        is_ours.then_some(())?;
        let ip = ip_at(message, 16)?;
        let (mut kind, mut mask, mut gateway, mut seconds, mut server) =
            (None, None, None, None, None);
        let mut options = message.get(240..)?;
        for _ in 0..MOST_OPTIONS {
            let [option, rest @ ..] = options else {
                break;
            };
            match option {
                0 => options = rest,
                255 => break,
                option => {
                    let (length, rest) = rest.split_first()?;
                    let (value, after) = rest.split_at_checked(usize::from(*length))?;
                    options = after;
                    match option {
                        1 => mask = u32_at(value, 0),
                        3 => gateway = ip_at(value, 0).filter(|ip| is_host(*ip)),
                        51 => seconds = u32_at(value, 0),
                        53 => kind = value.first().copied(),
                        54 => server = ip_at(value, 0),
                        _ => {}
                    }
                }
            }
        }
        let lease = || {
            let (mask, seconds) = (mask?, seconds?);
            let is_network = mask.leading_ones() + mask.trailing_zeros() == 32;
            // A lease shorter than two seconds would be renewed almost without a pause.
            let prefix = u8::try_from(mask.leading_ones()).ok()?;
            let address = Address {
                ip,
                prefix,
                gateway,
            };
            let is_whole = is_network && address.is_of_a_host() && seconds >= 2;
            is_whole.then_some(Lease {
                address,
                server: server?,
                seconds,
            })
        };
        Some((kind?, server, lease()))
    }
}
