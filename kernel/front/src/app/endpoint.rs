//! The option `wire.NAME=...`, which names the endpoint that a wire is connected to.
//!
//! | option | meaning |
//! | --- | --- |
//! | `wire.NAME=serial` | the serial port, as for a wire without an option |
//! | `wire.NAME=file` | a script: packets with their times |
//! | `wire.NAME=udp://:PORT` | datagrams to this port, from anyone |
//! | `wire.NAME=udp://ADDRESS:PORT` | datagrams from and to this peer |

use alloc::format;
use core::net::SocketAddrV4;

use fass::shared::Wire;

use crate::options::{CommandLine, UsageError};

/// The endpoint named by an option.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EndpointWord {
    /// The serial port.
    Serial,
    /// A script.
    File,
    /// Datagrams to an own port.
    Port(u16),
    /// Datagrams to and from a peer.
    Peer(SocketAddrV4),
}

/// Takes the option of a wire, if given.
///
/// # Errors
///
/// [`UsageError`] if the value is not among the values allowed.
pub fn word_of(wire: &Wire, options: &CommandLine<'_>) -> Result<Option<EndpointWord>, UsageError> {
    let key = format!("wire.{}", wire.name());
    let Some(value) = options.text(&key) else {
        return Ok(None);
    };
    read(value).map(Some).ok_or_else(|| {
        UsageError::new(format!(
            "`{key}={value}`: allowed are udp://:PORT, udp://ADDRESS:PORT, serial and file"
        ))
    })
}

/// Reads a peer, such as `udp://10.0.2.2:7447`.
pub(super) fn peer(value: &str) -> Option<SocketAddrV4> {
    let peer: SocketAddrV4 = value.strip_prefix("udp://")?.parse().ok()?;
    Some(peer).filter(|peer| !peer.ip().is_unspecified() && peer.port() > 0)
}

fn read(value: &str) -> Option<EndpointWord> {
    Some(match value {
        "serial" => EndpointWord::Serial,
        "file" => EndpointWord::File,
        _ => {
            let place = value.strip_prefix("udp://")?;
            match place.strip_prefix(':') {
                Some(port) => EndpointWord::Port(port.parse().ok().filter(|port| *port > 0)?),
                None => EndpointWord::Peer(peer(value)?),
            }
        }
    })
}

#[cfg(test)]
mod tests {
    use super::{CommandLine, EndpointWord, Wire, word_of};

    #[test]
    fn a_word_names_an_endpoint_or_what_is_allowed() {
        let peer = "10.0.0.2:5000".parse().unwrap();
        for (value, meant) in [
            ("serial", EndpointWord::Serial),
            ("file", EndpointWord::File),
            ("udp://:5000", EndpointWord::Port(5000)),
            ("udp://10.0.0.2:5000", EndpointWord::Peer(peer)),
        ] {
            let line = format!("wire.radar={value}");
            let options = CommandLine::parse(&line).unwrap();
            assert_eq!(word_of(&Wire::new("radar"), &options), Ok(Some(meant)));
            assert_eq!(word_of(&Wire::new("motor"), &options), Ok(None));
        }
        for value in [
            "",
            "udp",
            "udp://",
            "udp://:",
            "udp://:0",
            "udp://:65536",
            "udp://10.0.0.2",
            "udp://0.0.0.0:7",
            "udp://host:7",
            "tcp://:7",
            "udp://[::1]:7",
            "udp://10.0.0.2:0",
        ] {
            let line = format!("wire.radar={value}");
            let options = CommandLine::parse(&line).unwrap();
            let refused = word_of(&Wire::new("radar"), &options)
                .unwrap_err()
                .to_string();
            assert!(refused.starts_with(&format!("`{line}`: allowed are udp://:PORT")));
        }
    }
}
