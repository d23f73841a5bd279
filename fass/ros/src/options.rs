//! Options of a node.

use alloc::string::String;
use core::time::Duration;

use zenoh::{Session, SessionOptions};

/// Options of a node.
///
/// See [`Node`](crate::Node).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NodeOptions {
    /// The prefix of relative names of topics, empty or such as `/robot`.
    pub namespace: String,
    /// The domain, 0 to 232: nodes of other domains are not heard.
    pub domain: u32,
    /// Distinguishes the node's session from all others; not 0, and to be given.
    pub identity: u128,
    /// After so long without a datagram the router considers the node gone.
    pub lease: Duration,
}

impl Default for NodeOptions {
    fn default() -> Self {
        Self {
            namespace: String::new(),
            domain: 0,
            identity: 0,
            lease: Duration::from_secs(1),
        }
    }
}

impl NodeOptions {
    pub(crate) fn session(&self) -> Session {
        Session::new(SessionOptions {
            identity: self.identity,
            lease_ms: u64::try_from(self.lease.as_millis()).unwrap_or(u64::MAX),
        })
    }
}
