//! A script: bytes with their times, in place of those that arrive at the port.
//!
//! Where runs have to repeat, input is a script in the loader's module: each entry is a time
//! of the run (8 bytes), a length (2 bytes), both with the lowest byte first, and its bytes. They
//! arrive at their times, by the heartbeat's alarm, as if the port had got them. The host has
//! made it, and so what is no entry is its end. What is sent goes by the port.

use alloc::boxed::Box;
use alloc::format;

use fass::shared::{DeviceEnd, Wire};

use super::serial::SerialEndpoint;
use super::{Endpoint, EndpointWords, Opened, arrive};
use crate::options::UsageError;
use executive::machine::spinlock::SpinLock;
use executive::machine::this_core::{self, Core};
use executive::machine::timer::{self, Alarm};
use executive::run::execution;
use front::app::endpoint::EndpointWord;

struct ScriptEndpoint {
    port: SerialEndpoint,
    script: &'static [u8],
    /// The entries that are still to arrive in this run.
    rest: SpinLock<&'static [u8]>,
}

/// Opens the script, if there is one.
pub(super) fn open(wire: &Wire, words: &EndpointWords<'_>) -> Opened {
    let bytes = words.options.number("input", 0..=1 << 32, 0)?;
    let file = words.module.get().unwrap_or_default();
    let own = usize::try_from(bytes)
        .ok()
        .and_then(|bytes| file.len().checked_sub(bytes));
    let own = own.ok_or_else(|| UsageError::new("`input`: the module is shorter"))?;
    // The script stands behind the app's own bytes.
    let (own, script) = file.split_at(own);
    words.module.set(Some(own).filter(|own| !own.is_empty()));
    let is_meant = words.word.is_none_or(|word| word == EndpointWord::File);
    if script.is_empty() || !is_meant {
        if words.word == Some(EndpointWord::File) {
            let line = format!("`wire.{}=file` has no file; give --input FILE", wire.name());
            return Err(UsageError::new(line).into());
        }
        return Ok(None);
    }
    Ok(Some(Box::new(ScriptEndpoint {
        port: SerialEndpoint::new(wire)?,
        script,
        rest: SpinLock::new(&[]),
    })))
}

/// Returns the first entry of a script, its time before its bytes, and the entries after it.
fn first(script: &[u8]) -> Option<(u64, &[u8], &[u8])> {
    let (at_ns, rest) = script.split_first_chunk()?;
    let (length, rest) = rest.split_first_chunk()?;
    let length = usize::from(u16::from_le_bytes(*length));
    let (bytes, rest) = rest.split_at_checked(length)?;
    Some((u64::from_le_bytes(*at_ns), bytes, rest))
}

impl ScriptEndpoint {
    /// Takes the bytes that the script has for now. Reports whether there were some; if not, the
    /// heartbeat comes for the next ones.
    fn play(&self, now_ns: u64) -> bool {
        let mut rest = self.rest.lock();
        let Some((at_ns, bytes, after)) = first(&rest) else {
            return false;
        };
        let waits_ns = at_ns.saturating_sub(execution::since_epoch(now_ns));
        if waits_ns > 0 {
            let due_ns = now_ns.saturating_add(waits_ns);
            timer::set_no_later(this_core::get(), Alarm::Heartbeat, due_ns);
            return false;
        }
        *rest = after;
        drop(rest);
        arrive(self.end(), bytes, now_ns);
        true
    }
}

impl Endpoint for ScriptEndpoint {
    fn begin_run(&self, now_ns: u64) {
        *self.rest.lock() = self.script;
        timer::set_no_later(this_core::get(), Alarm::Heartbeat, now_ns);
    }

    fn beat(&self, core: &Core, now_ns: u64) {
        // As often as the script has entries.
        while core.index == 0 && self.play(now_ns) {}
    }

    fn step(&self) -> bool {
        self.port.step()
    }

    fn end_run(&self) {
        *self.rest.lock() = &[];
        self.port.end_run();
    }

    fn end(&self) -> &DeviceEnd {
        self.port.end()
    }
}

#[cfg(test)]
mod tests {
    use super::first;

    #[test]
    fn a_script_is_read_entry_by_entry_to_its_end() {
        let script = b"\x07\0\0\0\0\0\0\0\x02\0ab\x00\x01\0\0\0\0\0\0\x01\0c";
        let (at_ns, bytes, rest) = first(script).unwrap();
        assert_eq!((at_ns, bytes), (7, &b"ab"[..]));
        assert_eq!(first(rest), Some((256, &b"c"[..], &b""[..])));
        for end in 0..11 {
            assert_eq!(first(&rest[..end.min(rest.len() - 1)]), None);
        }
    }
}
