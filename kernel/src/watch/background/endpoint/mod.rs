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
    let second = || failure(wire, "is a second one; connect one wire, once");
    // Not even opened: the script would take its bytes off the app's file once more.
    if CONNECTED.get().is_some() {
        return Err(second());
    }
    let mut opened = ENDPOINTS
        .iter()
        .filter_map(|open| open(wire, words).transpose());
    let endpoint = opened.next().transpose()?;
    let is_connected = endpoint.is_some_and(|endpoint| CONNECTED.set(Box::leak(endpoint)));
    is_connected.then_some(()).ok_or_else(second)
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

#[cfg(test)]
mod tests {
    use super::{Box, CONNECTED, Cell, CommandLine, DeviceEnd, Endpoint, EndpointWords, Wire};

    struct DeadEnd(DeviceEnd);

    impl Endpoint for DeadEnd {
        fn beat(&self, _now_ns: u64) {}

        fn end(&self) -> &DeviceEnd {
            &self.0
        }
    }

    #[test]
    fn a_second_wire_is_refused_as_that_whatever_the_words_say() {
        let [first, second] = ["first", "second"].map(Wire::new);
        let end = DeadEnd(DeviceEnd::of(&first).unwrap());
        assert!(CONNECTED.set(Box::leak(Box::new(end))));
        let options = CommandLine::parse("input=3").unwrap();
        let module = Cell::new(Some(&b"own"[..]));
        let words = EndpointWords {
            options: &options,
            module: &module,
        };
        let why = super::connect(&second, &words).unwrap_err().to_string();
        assert_eq!(why, "wire `second` is a second one; connect one wire, once");
        assert_eq!(module.get(), Some(&b"own"[..]));
    }
}
