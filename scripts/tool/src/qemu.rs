//! Starts QEMU with a board, a meaning of time, and an image.
//!
//! A [`Qemu`] describes a guest and becomes a command line; [`Qemu::start`] turns it into a process
//! ([`RunningQemu`]). The *mode* says what the guest's clock means, and the *machine* is the board
//! imitated by QEMU. The *loader* brings the image into memory: QEMU itself, or a firmware, with
//! GRUB or without. Everything a guest could see of the host is fixed or left out (`-nodefaults`,
//! no display, no network), so two runs in [`Mode::Deterministic`] give the same bytes.
//!
//! Serial output goes to a file, because a file loses nothing, whereas a slow pipe drops bytes. The
//! guest ends its run by writing to the port of QEMU's `isa-debug-exit` device, see [`RunEnd`].
//! Input to the serial port comes from us through a pipe.
//!
//! A [`RunEnd`] is the end of the process, seen from outside. A guest writes a byte `v` to port
//! 0xf4, and QEMU's `isa-debug-exit` ends the process with status `(v << 1) | 1`: 33 for success,
//! 35 for failure, 37 for a refused command line. No other status is a guest's own word.
//!
//! A QEMU started here does not outlive the tool, see [`crate::child`]. If its guest ends in order
//! at ctrl-C, QEMU leaves the terminal's process group. Then ctrl-C does not reach QEMU, and we
//! pass the request on to the guest through its serial port.

use std::ffi::OsString;
use std::fmt;
use std::fs::{self, File};
use std::io::Write;
use std::os::unix::ffi::{OsStrExt, OsStringExt};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::time::Duration;

use boot::MOST_COMMAND_LINE_BYTES;

use crate::child::{Child, StopReason, WaitEnd};
use crate::files::TemporaryFile;
use crate::system;
use views::protocol::Status;

/// The name of QEMU's program on the `PATH`.
pub const PROGRAM: &str = "qemu-system-x86_64";

/// The least memory of a guest, in MiB.
pub const LEAST_MEMORY_MIB: u64 = 16;

/// The most processors of a guest.
pub const MOST_CORES: u64 = text::MOST_CORES as u64;

/// The other end of a guest's second serial port.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SecondPort {
    /// Forward the bytes written to [`RunningQemu`]'s input to this port; the first port then gets
    /// none.
    pub is_live: bool,
    /// The file for the bytes sent by the guest.
    pub output: Option<PathBuf>,
}

impl SecondPort {
    /// Returns QEMU's arguments for the port.
    fn arguments(&self) -> [OsString; 4] {
        let device = match (&self.output, self.is_live) {
            (None, false) => "null,id=wire".into(),
            (None, true) => "stdio,id=wire,signal=off".into(),
            (Some(output), false) => file_value("file,id=wire,path=", output),
            (Some(output), true) => file_value("stdio,id=wire,signal=off,logfile=", output),
        };
        let port = "isa-serial,chardev=wire,iobase=0x2f8,irq=3";
        ["-chardev".into(), device, "-device".into(), port.into()]
    }
}

/// A network, and the guest's card on it.
#[derive(Clone, Debug)]
pub struct Network {
    /// QEMU's words for the network, such as `user,hostfwd=udp:127.0.0.1:17007-:5000`.
    pub words: String,
    /// QEMU's name for the card.
    pub card: &'static str,
    /// The file for the network's traffic, in the form read by Wireshark.
    pub traffic: Option<PathBuf>,
}

impl Network {
    /// Returns QEMU's arguments for the network and its card.
    fn arguments(&self) -> Vec<OsString> {
        let Self { words, card, .. } = self;
        let mut arguments = vec!["-netdev".into(), format!("{words},id=net").into()];
        arguments.extend(["-device".into(), format!("{card},netdev=net").into()]);
        if let Some(path) = &self.traffic {
            let dump = file_value("filter-dump,id=traffic,netdev=net,file=", path);
            arguments.extend(["-object".into(), dump]);
        }
        arguments
    }
}

/// A description of the guest to start.
#[derive(Clone, Debug)]
pub struct Qemu {
    /// The QEMU to use: a name on the `PATH`, or a path.
    pub program: PathBuf,
    /// The meaning of time.
    pub mode: Mode,
    /// The board.
    pub machine: Machine,
    /// How the image gets into memory.
    pub loader: Loader,
    /// The number of processors.
    pub cores: u64,
    /// The memory in MiB.
    pub memory_mib: u64,
    /// The guest's command line.
    pub guest_words: String,
    /// A file to load into the guest's memory.
    pub module: Option<PathBuf>,
    /// The file for the bytes sent by the guest to QEMU's debug port; `None`: no such port.
    pub records: Option<PathBuf>,
    /// Forward the bytes written to [`RunningQemu`]'s input to the guest's serial port.
    pub has_input: bool,
    /// Send the guest ctrl-C at its first serial port before the kill, so that it ends in order.
    pub stops: bool,
    /// The connection of the second serial port; `None`: there is no such port.
    pub second: Option<SecondPort>,
    /// QEMU's words for further devices, with blanks between.
    pub devices: String,
    /// The network; `None`: there is no card.
    pub network: Option<Network>,
    /// Write the address of each executed instruction to [`RunningQemu`]'s output.
    pub logs_instructions: bool,
    /// Wait for a debugger before the first instruction, at this value of QEMU's `-gdb`.
    pub debugger: Option<OsString>,
}

impl Default for Qemu {
    /// Describes one core with 32 MiB on a microvm, deterministic, without a firmware.
    fn default() -> Self {
        Qemu {
            program: PROGRAM.into(),
            mode: Mode::Deterministic,
            machine: Machine::Microvm,
            loader: Loader::Pvh,
            cores: 1,
            memory_mib: 32,
            guest_words: String::new(),
            module: None,
            records: None,
            has_input: false,
            stops: false,
            second: None,
            devices: String::new(),
            network: None,
            logs_instructions: false,
            debugger: None,
        }
    }
}

impl Qemu {
    /// Returns QEMU's arguments for booting `image` with its serial output going to `serial`. For a
    /// [`Loader`] with a firmware, `image` is a whole stick.
    pub fn arguments(&self, image: &Path, serial: &Path) -> Vec<OsString> {
        let (machine, mode, cores) = (self.machine, self.mode.arguments(), self.cores);
        let mut arguments = words(&format!(
            "-machine {machine} {mode} -smp {cores} -m {}M",
            self.memory_mib
        ));
        arguments.extend(self.loading(image));
        if self.has_input || self.stops {
            // The log file gets every byte; QEMU's own output goes nowhere.
            // `signal=off`: the byte of ctrl-C goes to the guest instead of ending QEMU.
            let port = file_value("stdio,id=console,signal=off,logfile=", serial);
            arguments.extend(["-chardev".into(), port]);
            arguments.extend(words("-serial chardev:console"));
        } else {
            arguments.extend(["-serial".into(), file_value("file:", serial)]);
        }
        arguments.extend(self.second.iter().flat_map(SecondPort::arguments));
        if let Some(path) = &self.records {
            let port = file_value("file,id=edge,path=", path);
            arguments.extend(["-chardev".into(), port]);
            arguments.extend(words("-device isa-debugcon,iobase=0x402,chardev=edge"));
        }
        arguments.extend(words(
            "-device isa-debug-exit,iobase=0xf4,iosize=0x04 -nodefaults -no-user-config \
             -display none -no-reboot",
        ));
        for device in words(&self.devices) {
            arguments.extend(["-device".into(), device]);
        }
        arguments.extend(self.network.iter().flat_map(Network::arguments));
        // `-S` stops the processor before its first instruction.
        if let Some(device) = &self.debugger {
            arguments.extend(["-S".into(), "-gdb".into(), device.clone()]);
        }
        arguments
    }

    /// Returns the arguments for loading the image, with its words and module.
    fn loading(&self, image: &Path) -> Vec<OsString> {
        if self.loader.needs_stick() {
            let drive = file_value("if=none,id=stick,format=raw,readonly=on,file=", image);
            let mut arguments: Vec<OsString> = vec!["-drive".into(), drive];
            arguments.extend(words("-device qemu-xhci -device usb-storage,drive=stick"));
            if self.loader == Loader::Uefi {
                arguments.extend(["-bios", OVMF_FILE].map(OsString::from));
            }
            // Words and module are already on the stick.
            return arguments;
        }
        let mut arguments: Vec<OsString> = vec!["-kernel".into(), image.into()];
        arguments.extend(["-append".into(), OsString::from(&self.guest_words)]);
        if let Some(module) = &self.module {
            arguments.extend(["-initrd".into(), module.into()]);
        }
        arguments
    }

    /// Makes sure that the guest gets all of its command line.
    ///
    /// # Errors
    ///
    /// In words: the command line is too long.
    pub fn check_words(&self) -> Result<(), String> {
        let bytes = self.guest_words.len();
        if bytes <= MOST_COMMAND_LINE_BYTES {
            return Ok(());
        }
        Err(format!(
            "the guest's command line has {bytes} bytes, and {MOST_COMMAND_LINE_BYTES} is the \
             most that it takes; give fewer or shorter words"
        ))
    }

    /// Starts the guest. QEMU's own complaints go to a file next to `serial`.
    ///
    /// # Errors
    ///
    /// In words: the guest's command line is too long, a file could not be made, or QEMU could not
    /// be started.
    pub fn start(&self, image: &Path, serial: &Path) -> Result<RunningQemu, String> {
        self.check_words()?;
        let program = crate::system::find_program(&self.program).ok_or_else(|| {
            let name = self.program.display();
            format!("there is no program `{name}`; install QEMU or name another")
        })?;
        let mut command = crate::child::bound_to_us(&program);
        let mut arguments = self.arguments(image, serial);
        if self.logs_instructions {
            log_instructions(&program, &mut arguments);
        }
        command.args(arguments);
        let is_live = self.second.as_ref().is_some_and(|second| second.is_live);
        let (has_input, stops) = (self.has_input || self.stops || is_live, self.stops);
        let started =
            RunningQemu::start(command, serial, has_input, stops, self.logs_instructions)?;
        Ok(RunningQemu {
            records: self.records.clone(),
            ..started
        })
    }
}

/// Makes QEMU translate, and so log, each instruction separately. Since version 8.1 the accelerator
/// has an option for this purpose.
fn log_instructions(program: &Path, arguments: &mut Vec<OsString>) {
    let said = system::run(Command::new(program).arg("--version")).unwrap_or_default();
    let version = said.split_once("version ").map_or("", |(_, rest)| rest);
    let mut numbers = version.split(|c: char| !c.is_ascii_digit());
    let mut number = || numbers.next()?.parse::<u32>().ok();
    if (number(), number()) >= (Some(8), Some(1)) {
        let accelerators = arguments.iter_mut().filter(|word| *word == "tcg");
        accelerators.for_each(|word| word.push(",one-insn-per-tb=on"));
    } else {
        arguments.push("-singlestep".into());
    }
    arguments.extend(words("-d exec,nochain -D /dev/stdout"));
}

/// Splits a text at its blanks into arguments.
pub(crate) fn words(text: &str) -> Vec<OsString> {
    text.split_whitespace().map(OsString::from).collect()
}

/// Returns a value ending in a file's name. A comma in the name is doubled, because in QEMU's
/// syntax a single comma would end the name.
pub(crate) fn file_value(before: &str, path: &Path) -> OsString {
    let parts = path.as_os_str().as_bytes().split(|byte| *byte == b',');
    let name = parts.collect::<Vec<_>>().join(&b",,"[..]);
    OsString::from_vec([before.as_bytes(), &name].concat())
}

/// The path of the firmware in Debian's package `ovmf`.
pub const OVMF_FILE: &str = "/usr/share/ovmf/OVMF.fd";

/// Makes an enumeration whose variants are written and read by name.
macro_rules! named {
    ($(#[$about:meta])* $kind:ident {
        $($(#[$what:meta])* $choice:ident = $name:literal,)*
    }) => {
        $(#[$about])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum $kind {
            $($(#[$what])* $choice,)*
        }

        impl $kind {
            /// The names, as written on command lines.
            pub const NAMES: &[&str] = &[$($name),*];

            /// Returns the variant with this name; `None` if there is none.
            pub fn from_name(name: &str) -> Option<Self> {
                match name {
                    $($name => Some(Self::$choice),)*
                    _ => None,
                }
            }

            /// Returns the variant's name.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$choice => $name,)*
                }
            }
        }

        impl std::fmt::Display for $kind {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str(self.name())
            }
        }
    };
}

named! {
    /// The meaning of time in the guest.
    Mode {
        /// Real cores in real time, by the host's virtualization.
        Kvm = "kvm",
        /// One instruction is one virtual nanosecond; all runs are equal.
        Deterministic = "deterministic",
        /// Emulated cores in real time, one host thread each.
        Threads = "threads",
    }
}

impl Mode {
    /// Says in one sentence how far times in this mode can be trusted.
    pub fn meaning(self) -> &'static str {
        match self {
            Mode::Kvm => "real nanoseconds on real cores, the host's noise included",
            Mode::Deterministic => {
                "one instruction is one virtual nanosecond, idle time is skipped, busy \
                 processors share one clock; these are not wall times, and are the same \
                 on every machine"
            }
            Mode::Threads => {
                "real nanoseconds of emulated processors; expect milliseconds of \
                 noise where the host has fewer cores"
            }
        }
    }

    /// Returns QEMU's arguments for the mode.
    pub(crate) fn arguments(self) -> &'static str {
        match self {
            Mode::Kvm => "-accel kvm -cpu host",
            // With `sleep=off` an idle guest jumps to its next timer.
            Mode::Deterministic => {
                "-accel tcg -icount shift=0,sleep=off -cpu max -seed 1 \
                 -rtc base=2000-01-01,clock=vm"
            }
            Mode::Threads => "-accel tcg,thread=multi -cpu max",
        }
    }
}

named! {
    /// The board imitated by QEMU, by QEMU's own name.
    Machine {
        /// The smallest board, which boots in a tenth of a second.
        Microvm = "microvm",
        /// A PC with PCI Express, HPET and all.
        Q35 = "q35",
    }
}

named! {
    /// How the image gets into the guest's memory.
    Loader {
        /// QEMU's `-kernel`: the image is in memory at the reset.
        Pvh = "pvh",
        /// GRUB, started by QEMU's BIOS from a stick.
        Bios = "bios",
        /// GRUB, started from a stick by UEFI.
        Uefi = "uefi",
    }
}

impl Loader {
    /// Reports whether the image is on a stick, to be read by a PC's firmware.
    pub fn needs_stick(self) -> bool {
        self != Loader::Pvh
    }

    /// Returns the least memory, in MiB, with which the loader was seen to reach the image.
    pub fn least_memory_mib(self) -> u64 {
        match self {
            Loader::Pvh | Loader::Bios => LEAST_MEMORY_MIB,
            Loader::Uefi => 96,
        }
    }
}

/// The most bytes a guest may print; a guest printing more is taken to print without end.
const MOST_SERIAL_BYTES: u64 = 64 << 20;

/// The byte for ending a guest's run in order (`console=stop`): ctrl-C on a serial line.
const CTRL_C: &[u8] = &[3];

/// QEMU's messages when KVM cannot run the guest any further. After such a message QEMU keeps the
/// guest paused for ever, and has no option to end instead.
const KVM_FAILURES: [&str; 4] = [
    "KVM internal error",
    "KVM: entry failed",
    "KVM: unknown exit",
    "error: kvm run failed",
];

/// How a QEMU process ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RunEnd {
    /// The guest ended QEMU with one of the agreed statuses.
    Guest(Status),
    /// QEMU ended with another status; 0 is a reset or a shutdown.
    Status(i32),
    /// A signal ended QEMU.
    Signal,
    /// QEMU did not end within this limit and was killed.
    TimedOut {
        /// The limit.
        limit: Duration,
        /// How busy the host was then, in words.
        load: String,
    },
    /// A person pressed ctrl-C after the request to end, and QEMU was killed.
    Killed,
    /// KVM could not run the guest any further, and QEMU was killed.
    KvmFailed,
    /// The guest printed more than a run may, and QEMU was killed.
    TooMuchOutput,
    /// The process was no QEMU but a program of this computer; the words describe its end.
    Program(String),
}

impl fmt::Display for RunEnd {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            RunEnd::Guest(Status::Success) => f.write_str("the guest ended in success"),
            RunEnd::Guest(Status::Failure) => f.write_str("the guest ended in failure"),
            RunEnd::Guest(Status::Usage) => f.write_str("the guest refused its command line"),
            RunEnd::Program(words) => f.write_str(words),
            RunEnd::Status(0) => f.write_str(
                "the machine was reset or shut down without an exit status (a triple fault?)",
            ),
            RunEnd::Status(status) => write!(f, "QEMU ended with status {status}"),
            RunEnd::Signal => f.write_str("a signal ended QEMU"),
            RunEnd::TimedOut { limit, load } => write!(
                f,
                "no end within {} s, QEMU was killed; {load}",
                limit.as_secs_f64()
            ),
            RunEnd::Killed => f.write_str("ctrl-C was pressed again, and QEMU was killed"),
            RunEnd::KvmFailed => {
                f.write_str("KVM could not run the guest any further, QEMU was killed")
            }
            RunEnd::TooMuchOutput => write!(
                f,
                "more than {} MiB of serial output, QEMU was killed",
                MOST_SERIAL_BYTES >> 20
            ),
        }
    }
}

/// A started QEMU, running or ended.
#[derive(Debug)]
pub struct RunningQemu {
    /// The process. Its input is the guest's serial port, its output the log of instructions, if
    /// wanted.
    pub child: Child,
    serial: PathBuf,
    complaints: TemporaryFile,
    /// The file for the record, if there is one.
    records: Option<PathBuf>,
    /// The serial port for asking the guest to end, if the guest listens.
    stop: Option<File>,
    /// The reason for asking the guest to end, if anybody asked.
    pub(crate) asked: Option<StopReason>,
}

impl RunningQemu {
    /// Starts `command` with its streams away from the terminal.
    fn start(
        mut command: Command,
        serial: &Path,
        has_input: bool,
        stops: bool,
        has_log: bool,
    ) -> Result<RunningQemu, String> {
        let file_error = |path: &Path| {
            let path = path.display().to_string();
            move |error| format!("cannot write `{path}`: {error}; name a file elsewhere")
        };
        // Created before QEMU opens it, so a reader finds a file from the start.
        File::create(serial).map_err(file_error(serial))?;
        let mut complaints = serial.as_os_str().to_owned();
        complaints.push(OsString::from(".qemu"));
        let complaints = TemporaryFile(Some(complaints.into()));
        let errors = File::create(complaints.path()).map_err(file_error(complaints.path()))?;

        let piped = |is_piped: bool| match is_piped {
            true => Stdio::piped(),
            false => Stdio::null(),
        };
        command.stdin(piped(has_input)).stdout(piped(has_log));
        command.stderr(errors);
        // Out of the terminal's process group: ctrl-C is for us, and we ask the guest.
        if stops {
            command.process_group(0);
        }
        let child = Child::start(&mut command)
            .map_err(|error| format!("cannot start QEMU: {error}; is it for this machine?"))?;
        Ok(RunningQemu {
            stop: child.second_input().filter(|_| stops),
            child,
            serial: serial.to_path_buf(),
            complaints,
            records: None,
            asked: None,
        })
    }

    /// Waits for the end, for at most `limit` since the start, and passes each whole serial line to
    /// `show` as soon as it is complete. A guest that can be asked to end may take longer, see
    /// [`crate::child`]. Also returns the serial log.
    ///
    /// # Errors
    ///
    /// In words: the log cannot be read.
    pub fn follow(
        &mut self,
        limit: Duration,
        show: &mut dyn FnMut(&str),
    ) -> Result<(RunEnd, String), String> {
        let complaints = self.complaints.path();
        let mut kvm_failed = false;
        let records = self.records.as_deref();
        let sent = |bytes| {
            // A short file, read at each look: after such a message QEMU does not end by itself.
            let said = fs::read(complaints).unwrap_or_default();
            let said = String::from_utf8_lossy(&said);
            kvm_failed = KVM_FAILURES.iter().any(|failure| said.contains(failure));
            let record = records.and_then(|path| fs::metadata(path).ok());
            (!kvm_failed && bytes <= MOST_SERIAL_BYTES).then(|| record.map_or(0, |file| file.len()))
        };
        // The request may fail: a guest that has just ended no longer listens.
        let stop = self.stop.take();
        let mut ask = |_| drop(stop.as_ref().map(|mut stop| stop.write_all(CTRL_C)));
        let ask: Option<&mut dyn FnMut(StopReason)> =
            if stop.is_some() { Some(&mut ask) } else { None };
        let followed = (self.child).follow(limit, &self.serial, show, ask, sent)?;
        self.asked = followed.asked;
        let ending = match followed.waited {
            WaitEnd::Ended(status) => ending_of(status),
            WaitEnd::TimedOut => RunEnd::TimedOut {
                limit,
                load: system::host_load(),
            },
            WaitEnd::Killed => RunEnd::Killed,
            WaitEnd::GivenUp if kvm_failed => RunEnd::KvmFailed,
            WaitEnd::GivenUp => RunEnd::TooMuchOutput,
        };
        Ok((ending, followed.text))
    }

    /// Returns QEMU's own error output on one line; mostly empty.
    pub fn complaints(&self) -> String {
        let text = fs::read(self.complaints.path()).unwrap_or_default();
        let text = String::from_utf8_lossy(&text);
        text.lines().collect::<Vec<_>>().join("; ")
    }
}

fn ending_of(status: ExitStatus) -> RunEnd {
    match status.code() {
        Some(33) => RunEnd::Guest(Status::Success),
        Some(35) => RunEnd::Guest(Status::Failure),
        Some(37) => RunEnd::Guest(Status::Usage),
        Some(code) => RunEnd::Status(code),
        None => RunEnd::Signal,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::ffi::OsStr;

    /// Asserts which words are among QEMU's arguments, and which are not.
    fn has(qemu: &Qemu, parts: &[&str], others: &[&str]) {
        let words = qemu.arguments(Path::new("image"), Path::new("a,b.log"));
        let line = words.join(OsStr::new(" ")).into_string().unwrap();
        let missing = parts.iter().find(|part| !line.contains(**part));
        assert_eq!(missing, None, "{line}");
        let odd = others.iter().find(|other| line.contains(**other));
        assert_eq!(odd, None, "{line}");
    }

    #[test]
    fn a_deterministic_guest_sees_nothing_of_the_host() {
        let parts = [
            "-machine microvm",
            "-accel tcg -icount shift=0,sleep=off -cpu max",
            "-seed 1 -rtc base=2000-01-01,clock=vm",
            "-smp 1 -m 32M",
            "-serial file:a,,b.log",
            "-nodefaults -no-user-config -display none -no-reboot",
        ];
        let others = ["-gdb", "stdio", "-initrd", "debugcon"];
        has(&Qemu::default(), &parts, &others);
        for (mode, accelerator) in [
            (Mode::Kvm, "-accel kvm -cpu host"),
            (Mode::Threads, "-accel tcg,thread=multi -cpu max"),
        ] {
            let guest = Qemu {
                mode,
                ..Qemu::default()
            };
            has(&guest, &[accelerator], &[]);
        }
    }

    #[test]
    fn input_and_recordings_have_ports_and_the_log_is_a_file_all_the_same() {
        let talks = Qemu {
            has_input: true,
            records: Some("a,b.rec".into()),
            ..Qemu::default()
        };
        let serial =
            "-chardev stdio,id=console,signal=off,logfile=a,,b.log -serial chardev:console";
        let records = "-chardev file,id=edge,path=a,,b.rec -device isa-debugcon,iobase=0x402,";
        has(&talks, &[serial, records], &["file:a"]);
    }
}
