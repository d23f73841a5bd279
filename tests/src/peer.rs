//! A router of Zenoh on loopback, the same as users have: `peers/router.py`, in its own Python.

use std::io::{BufRead, BufReader, Write};
use std::net::{Ipv4Addr, UdpSocket};
use std::process::{ChildStdin, Stdio};
use std::sync::mpsc::{self, Receiver};
use std::thread;
use std::time::Duration;

use tool::child::{Child, bound_to_us};
use tool::{install, system};

/// The most time for a router's start: many times the usual.
const LIMIT: Duration = Duration::from_secs(60);

/// A running router. Dropping the value ends the process.
pub struct Router {
    /// The router's UDP port.
    pub port: u16,
    commands: ChildStdin,
    lines: Receiver<String>,
    _process: Child,
}

impl Router {
    /// Starts a router at a port, or at a free port, and waits until the router is up.
    ///
    /// # Panics
    ///
    /// Panics if the router does not come up, as on computers without Zenoh in Python: there
    /// `./scripts/test` skips the module `with_router`, and counts it.
    #[must_use]
    pub fn start(port: Option<u16>) -> Self {
        let python = install::python().expect("a Python with a router");
        let free = || UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))?.local_addr();
        let port = port.unwrap_or_else(|| free().expect("a port").port());
        let mut command = bound_to_us(&python);
        command.arg(system::workspace().join("tests/peers/router.py"));
        command.arg(port.to_string());
        command.stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut process = Child::start(&mut command).expect("a process");
        let output = BufReader::new(process.output().expect("its output"));
        let (sender, lines) = mpsc::channel();
        // The thread ends with the process.
        thread::spawn(move || {
            let mut lines = output.lines().map_while(Result::ok);
            lines.try_for_each(|line| sender.send(line))
        });
        let commands = process.input().expect("its input");
        let router = Self {
            port,
            commands,
            lines,
            _process: process,
        };
        // A client that has waited for it may be heard of before.
        let next = || router.lines.recv_timeout(LIMIT).expect("it comes up");
        while !next().starts_with("up ") {}
        router
    }

    /// Gives the router a command.
    ///
    /// # Panics
    ///
    /// Panics if the router has ended.
    pub fn command(&mut self, line: &str) {
        writeln!(self.commands, "{line}").expect("a router");
    }

    /// Returns the router's output since the last call.
    pub fn said(&self) -> impl Iterator<Item = String> {
        self.lines.try_iter()
    }
}
