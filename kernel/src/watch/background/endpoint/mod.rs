//! Endpoints: what a wire is connected to on the machine.
//!
//! An endpoint is one type that implements [`Endpoint`], in a file of its own, and one row of
//! [`ENDPOINTS`]. It is reached through these only, so an image whose app connects no wire has no
//! code for any.

mod script;
mod serial;

use alloc::boxed::Box;
use alloc::format;
use core::cell::Cell;

use fass::platform::SetOnce;
use fass::shared::{DeviceEnd, Wire};

use crate::options::CommandLine;
use executive::run::execution;
use front::app::ending::AppError;

/// A device that a run serves, besides people.
pub(crate) trait Endpoint: Sync {
    /// Begins a run.
    fn begin_run(&self, _now_ns: u64) {}

    /// Takes what has arrived. In core 0's heartbeat.
    fn beat(&self, now_ns: u64);

    /// Sends some of what is to go, and reports whether there may be more. In the background.
    fn step(&self) -> bool {
        false
    }

    /// Ends the run: sends the rest.
    fn end_run(&self) {}

    /// Returns the wire's other end.
    fn end(&self) -> &DeviceEnd;
}

/// The words that say which endpoint is meant: the app's command line, and the loader's module.
pub(crate) struct EndpointWords<'a> {
    pub(crate) options: &'a CommandLine<'static>,
    pub(crate) module: &'a Cell<Option<&'static [u8]>>,
}

/// Makes an endpoint of a wire, if the words mean this one.
///
/// # Errors
///
/// The machine lacks the device, or the wire has one.
type Open = fn(&Wire, &EndpointWords<'_>) -> Opened;

type Opened = Result<Option<Box<dyn Endpoint>>, AppError>;

/// Every endpoint, in the order in which they are asked. The last one takes any words.
const ENDPOINTS: &[Open] = &[script::open, serial::open];

/// The endpoint, if the app has connected a wire.
pub(crate) static CONNECTED: SetOnce<&'static dyn Endpoint> = SetOnce::new();

/// The time between two looks at a device.
pub(super) const PERIOD_NS: u64 = 1_000_000;

/// Connects a wire to the endpoint that the words name.
pub(crate) fn connect(wire: &Wire, words: &EndpointWords<'_>) -> Result<(), AppError> {
    let mut opened = ENDPOINTS
        .iter()
        .filter_map(|open| open(wire, words).transpose());
    let endpoint = opened.next().transpose()?;
    let is_connected = endpoint.is_some_and(|endpoint| CONNECTED.set(Box::leak(endpoint)));
    let taken = || failure(wire, "finds the second serial port taken; connect one wire");
    is_connected.then_some(()).ok_or_else(taken)
}

/// Returns the other end of a wire, for an endpoint.
fn end_of(wire: &Wire) -> Result<DeviceEnd, AppError> {
    let end = DeviceEnd::of(wire);
    end.ok_or_else(|| failure(wire, "has a device already; connect it once"))
}

fn failure(wire: &Wire, why: &str) -> AppError {
    AppError::Failure(format!("wire `{}` {why}", wire.name()))
}

/// Lets bytes arrive on a wire.
fn arrive(wire: &DeviceEnd, bytes: &[u8], now_ns: u64) {
    if let Some((plan, dag)) = wire.arrive(bytes, now_ns) {
        execution::raise_in_interrupt(plan, dag);
    }
}
