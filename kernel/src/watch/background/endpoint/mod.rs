//! Endpoints: the devices of the machine that wires are connected to.
//!
//! An endpoint is a type that implements [`Endpoint`], in a file of its own, and a row of
//! [`ENDPOINTS`]. Endpoints are reached through the trait and the table only, so the image of an
//! app that connects no wire contains no code for any endpoint.

mod network;
mod script;
mod serial;
mod udp;

pub(crate) use network::protocol::connect as connect_protocol;

use alloc::boxed::Box;
use alloc::format;
use alloc::string::String;
use core::cell::Cell;

use fass::platform::SetOnce;
use fass::shared::{DeviceEnd, Wire};

use crate::options::CommandLine;
use executive::machine::this_core::Core;
use executive::run::execution;
use front::app::ending::AppError;
use front::app::endpoint::EndpointWord;

/// A device served during a run, besides people.
pub(crate) trait Endpoint: Send + Sync {
    /// Begins a run.
    fn begin_run(&self, _now_ns: u64) {}

    /// Takes arrived bytes, if they arrive on this core. Called in each core's heartbeat.
    fn beat(&self, core: &Core, now_ns: u64);

    /// Sends a part of the waiting output, and reports whether there may be more. Called in the
    /// background.
    fn step(&self) -> bool {
        false
    }

    /// Ends the run: sends the rest.
    fn end_run(&self) {}

    /// Prints the endpoint's report of the finished run.
    fn tell(&self);
}

/// The words that select an endpoint: the app's command line, and the loader's module.
pub(crate) struct EndpointWords<'a> {
    pub(crate) options: &'a CommandLine<'static>,
    pub(crate) module: &'a Cell<Option<&'static [u8]>>,
    /// The option of the wire, if given.
    pub(crate) word: Option<EndpointWord>,
}

/// Adds an endpoint for a wire, if the words select this kind of endpoint, and reports whether they
/// do.
///
/// # Errors
///
/// The machine lacks the device, or the wire has one.
type Open = fn(&Wire, &EndpointWords<'_>) -> Opened;

type Opened = Result<bool, AppError>;

/// All kinds of endpoints, in the order in which they are tried. The last one accepts any words.
const ENDPOINTS: &[Open] = &[udp::open, script::open, serial::open];

/// The endpoints of the wires connected by the app.
pub(crate) static CONNECTED: Chain<Box<dyn Endpoint>> = Chain::new();

/// The time between two looks at a device, in nanoseconds.
pub(super) const PERIOD_NS: u64 = 1_000_000;

/// A list of permanent values, extended before the commit.
pub(crate) struct Chain<T: 'static>(SetOnce<&'static ChainLink<T>>);

struct ChainLink<T: 'static> {
    value: T,
    next: Chain<T>,
}

impl<T: Send + Sync> Chain<T> {
    const fn new() -> Self {
        Self(SetOnce::new())
    }

    /// Appends a value.
    fn add(&self, value: T) {
        let mut last = self;
        while let Some(link) = last.0.get() {
            last = &link.next;
        }
        let next = Self::new();
        last.0.set(Box::leak(Box::new(ChainLink { value, next })));
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = &'static T> {
        let links = core::iter::successors(self.0.get(), |link| link.next.0.get());
        links.map(|link| &link.value)
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.0.get().is_none()
    }
}

/// Connects a wire to the endpoint named by the words.
pub(crate) fn connect(wire: &Wire, words: &EndpointWords<'_>) -> Result<(), AppError> {
    for open in ENDPOINTS {
        if open(wire, words)? {
            break;
        }
    }
    Ok(())
}

/// Returns the device end of a wire, for an endpoint.
fn end_of(wire: &Wire) -> Result<DeviceEnd, AppError> {
    let end = DeviceEnd::of(wire);
    end.ok_or_else(|| failure(&name_of(wire), "has a device already; connect it once"))
}

fn name_of(wire: &Wire) -> String {
    format!("wire `{}`", wire.name())
}

fn failure(who: &str, why: &str) -> AppError {
    AppError::Failure(format!("{who} {why}"))
}

/// Lets bytes arrive on a wire.
fn arrive(wire: &DeviceEnd, bytes: &[u8], now_ns: u64) {
    if let Some((plan, dag)) = wire.arrive(bytes, now_ns) {
        execution::raise_in_interrupt(plan, dag);
    }
}

#[cfg(test)]
mod tests {
    use super::Chain;

    #[test]
    fn a_chain_has_its_values_in_the_order_in_which_they_were_added() {
        static CHAIN: Chain<u32> = Chain::new();
        assert!(CHAIN.is_empty());
        (0..5).for_each(|value| CHAIN.add(value));
        assert!(CHAIN.iter().copied().eq(0..5));
    }
}
