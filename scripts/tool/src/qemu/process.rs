//! A QEMU process: waiting for it with a limit, and ending it.
//!
//! *Ending* is how the process went, seen from outside. A guest writes a byte
//! `v` to port 0xf4, and QEMU's `isa-debug-exit` ends the process with status
//! `(v << 1) | 1`: 33 for success, 35 for failure, 37 for a refused command
//! line. No other status is a guest's own word.
//!
//! A QEMU started here does not outlive the tool, see [`crate::child`]. One whose guest ends in
//! order at ctrl-C is no member of the terminal's process group, which ctrl-C would reach: we tell
//! the guest, by its serial port.

use std::ffi::OsString;
use std::fmt;
use std::fs::{self, File};
use std::io::Write;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{ChildStdin, ChildStdout, Command, ExitStatus, Stdio};
use std::time::Duration;

use crate::child::{Asked, Child, Waited};
use crate::files::Temporary;
use crate::protocol::Status;
use crate::system;

/// The most that a guest may print; beyond it something prints without end.
const MOST_SERIAL_BYTES: u64 = 64 << 20;

/// The byte that ends a guest's run in order (`console=stop`): ctrl-C on a serial line.
const CTRL_C: &[u8] = &[3];

/// What QEMU says when KVM cannot run the guest any further. It then keeps the guest
/// paused for ever, and none of its options makes it end.
const KVM_FAILURES: [&str; 4] = [
    "KVM internal error",
    "KVM: entry failed",
    "KVM: unknown exit",
    "error: kvm run failed",
];

/// How a QEMU process ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Ending {
    /// The guest ended it with one of the agreed statuses.
    Guest(Status),
    /// QEMU ended with another status; 0 is a reset or a shutdown.
    Status(i32),
    /// A signal ended it.
    Signal,
    /// It did not end within this limit and was killed.
    TimedOut {
        /// The limit.
        limit: Duration,
        /// How busy the host was then, in words.
        load: String,
    },
    /// A person pressed ctrl-C again, and it was killed.
    Killed,
    /// KVM could not run the guest any further, and it was killed.
    KvmFailed,
    /// It printed more than a run may and was killed.
    TooMuchOutput,
    /// It was no QEMU but a program of this computer, and ended as these words say.
    Program(String),
}

impl fmt::Display for Ending {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Ending::Guest(Status::Success) => f.write_str("the guest ended in success"),
            Ending::Guest(Status::Failure) => f.write_str("the guest ended in failure"),
            Ending::Guest(Status::Usage) => f.write_str("the guest refused its command line"),
            Ending::Program(words) => f.write_str(words),
            Ending::Status(0) => f.write_str(
                "the machine was reset or shut down without an exit status (a triple fault?)",
            ),
            Ending::Status(status) => write!(f, "QEMU ended with status {status}"),
            Ending::Signal => f.write_str("a signal ended QEMU"),
            Ending::TimedOut { limit, load } => write!(
                f,
                "no end within {} s, QEMU was killed; {load}",
                limit.as_secs_f64()
            ),
            Ending::Killed => f.write_str("ctrl-C was pressed again, and QEMU was killed"),
            Ending::KvmFailed => {
                f.write_str("KVM could not run the guest any further, QEMU was killed")
            }
            Ending::TooMuchOutput => write!(
                f,
                "more than {} MiB of serial output, QEMU was killed",
                MOST_SERIAL_BYTES >> 20
            ),
        }
    }
}

/// A QEMU that was started and not yet waited for.
#[derive(Debug)]
pub struct Running {
    child: Child,
    serial: PathBuf,
    complaints: Temporary,
    /// The way by which the guest is asked to end, if it listens.
    stop: Option<File>,
    asked: Option<Asked>,
}

impl Running {
    /// Starts `command` with its streams away from the terminal.
    pub(super) fn start(
        mut command: Command,
        serial: &Path,
        has_input: bool,
        stops: bool,
        has_log: bool,
    ) -> Result<Running, String> {
        let file_error = |path: &Path| {
            let path = path.display().to_string();
            move |error| format!("cannot write `{path}`: {error}; name a file elsewhere")
        };
        File::create(serial).map_err(file_error(serial))?;
        let mut complaints = serial.as_os_str().to_owned();
        complaints.push(OsString::from(".qemu"));
        let complaints = Temporary(Some(complaints.into()));
        let errors = File::create(complaints.path()).map_err(file_error(complaints.path()))?;

        let piped = |is_piped: bool| match is_piped {
            true => Stdio::piped(),
            false => Stdio::null(),
        };
        command.stdin(piped(has_input)).stdout(piped(has_log));
        command.stderr(errors);
        if stops {
            command.process_group(0);
        }
        let child = Child::start(&mut command)
            .map_err(|error| format!("cannot start QEMU: {error}; is it for this machine?"))?;
        Ok(Running {
            stop: child.second_input().filter(|_| stops),
            child,
            serial: serial.to_path_buf(),
            complaints,
            asked: None,
        })
    }

    /// Waits for the end, for at most `limit` since the start, and shows each whole serial line
    /// to `show` as it comes. Returns also the serial log.
    ///
    /// # Errors
    ///
    /// In words: the log cannot be read.
    pub fn follow(
        &mut self,
        limit: Duration,
        show: &mut dyn FnMut(&str),
    ) -> Result<(Ending, String), String> {
        let complaints = self.complaints.path();
        let mut kvm_failed = false;
        let is_well = |bytes| {
            let said = fs::read(complaints).unwrap_or_default();
            let said = String::from_utf8_lossy(&said);
            kvm_failed = KVM_FAILURES.iter().any(|failure| said.contains(failure));
            !kvm_failed && bytes <= MOST_SERIAL_BYTES
        };
        // One that has just ended hears nothing any more.
        let stop = self.stop.take();
        let mut ask = |_| drop(stop.as_ref().map(|mut stop| stop.write_all(CTRL_C)));
        let ask: Option<&mut dyn FnMut(Asked)> = if stop.is_some() { Some(&mut ask) } else { None };
        let followed = (self.child).follow(limit, &self.serial, show, ask, is_well)?;
        self.asked = followed.asked;
        let ending = match followed.waited {
            Waited::Ended(status) => ending_of(status),
            Waited::TimedOut => Ending::TimedOut {
                limit,
                load: system::host_load(),
            },
            Waited::Killed => Ending::Killed,
            Waited::GivenUp if kvm_failed => Ending::KvmFailed,
            Waited::GivenUp => Ending::TooMuchOutput,
        };
        Ok((ending, followed.text))
    }

    /// Returns why the guest was asked to end, if it was.
    #[must_use]
    pub fn asked(&self) -> Option<Asked> {
        self.asked
    }

    /// Takes the way to the guest's serial port, if it has one and it was not taken.
    pub fn input(&mut self) -> Option<ChildStdin> {
        self.child.input()
    }

    /// Takes the log of instructions, if there is one and it was not taken.
    pub fn log(&mut self) -> Option<ChildStdout> {
        self.child.output()
    }

    /// Returns the time since the start.
    #[must_use]
    pub fn elapsed(&self) -> Duration {
        self.child.elapsed()
    }

    /// Returns what QEMU itself complained of, on one line; mostly empty.
    #[must_use]
    pub fn complaints(&self) -> String {
        let text = fs::read(self.complaints.path()).unwrap_or_default();
        let text = String::from_utf8_lossy(&text);
        text.lines().collect::<Vec<_>>().join("; ")
    }
}

fn ending_of(status: ExitStatus) -> Ending {
    match status.code() {
        Some(33) => Ending::Guest(Status::Success),
        Some(35) => Ending::Guest(Status::Failure),
        Some(37) => Ending::Guest(Status::Usage),
        Some(code) => Ending::Status(code),
        None => Ending::Signal,
    }
}
