//! Starting QEMU: which machine, in which sense of time, with what image.
//!
//! A [`Qemu`] is a description that becomes a command line; [`Qemu::start`]
//! makes it a process ([`Running`]). The *mode* says what the guest's clock
//! means, the *machine* which board QEMU imitates. Everything a guest could
//! see of the host is fixed or left out (`-nodefaults`, no display, no
//! network), so that in [`Mode::Deterministic`] two runs give the same bytes.
//!
//! Serial output goes to a file, for that loses nothing, whereas a slow pipe
//! drops bytes. The guest ends its run by writing to the port of QEMU's
//! `isa-debug-exit` device, see [`Ending`]. Input to the serial port comes from us by a pipe.

mod choices;
mod process;

use std::ffi::OsString;
use std::os::unix::ffi::{OsStrExt, OsStringExt};
use std::path::{Path, PathBuf};
use std::process::Command;

use boot::MOST_COMMAND_LINE_BYTES;

pub use choices::{Loader, Machine, Mode, OVMF_FILE};
pub use process::{Ending, Running};

/// The name under which QEMU is looked for.
pub const PROGRAM: &str = "qemu-system-x86_64";

/// The least memory that a guest gets, in MiB.
pub const LEAST_MEMORY_MIB: u64 = 16;

/// The most processors that a guest gets.
pub const MOST_CORES: u64 = replay::lines::MOST_CORES as u64;

/// The other end of a guest's second serial port.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Second {
    /// Hand what is written to [`Running::input`] to this port; then the first one has none.
    pub is_live: bool,
    /// The file that gets what the guest sends.
    pub output: Option<PathBuf>,
}

impl Second {
    /// Returns QEMU's arguments for it.
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

/// A guest to be started.
#[derive(Clone, Debug)]
pub struct Qemu {
    /// The QEMU to use: a name on the `PATH`, or a path.
    pub program: PathBuf,
    /// What time means.
    pub mode: Mode,
    /// The board.
    pub machine: Machine,
    /// What brings the image into memory.
    pub loader: Loader,
    /// The number of processors.
    pub cores: u64,
    /// The memory in MiB.
    pub memory_mib: u64,
    /// The guest's command line.
    pub guest_words: String,
    /// A file to leave in the guest's memory.
    pub module: Option<PathBuf>,
    /// Where the bytes go that the guest sends to QEMU's debug port; it has none otherwise.
    pub records: Option<PathBuf>,
    /// Hand what is written to [`Running::input`] to the guest's serial port.
    pub has_input: bool,
    /// Have the guest end in order before it is killed, by ctrl-C at its first serial port.
    pub stops: bool,
    /// What the second serial port is connected to; `None`: there is none.
    pub second: Option<Second>,
    /// Write the address of each instruction that is executed to [`Running::log`].
    pub logs_instructions: bool,
    /// Wait for a debugger there, before the first instruction: what QEMU's `-gdb` takes.
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
            logs_instructions: false,
            debugger: None,
        }
    }
}

impl Qemu {
    /// Returns QEMU's arguments for booting `image` with its serial output
    /// going to `serial`. For a [`Loader`] with a firmware `image` is a whole stick.
    #[must_use]
    pub fn arguments(&self, image: &Path, serial: &Path) -> Vec<OsString> {
        let mut arguments: Vec<OsString> = vec!["-machine".into(), self.machine.name().into()];
        arguments.extend(self.mode.arguments().iter().map(OsString::from));
        arguments.extend(["-smp".into(), self.cores.to_string().into()]);
        arguments.extend(["-m".into(), format!("{}M", self.memory_mib).into()]);
        arguments.extend(self.loading(image));
        if self.has_input || self.stops {
            // The log file gets every byte; QEMU's own output goes nowhere.
            let port = file_value("stdio,id=console,signal=off,logfile=", serial);
            arguments.extend(["-chardev".into(), port]);
            arguments.extend(["-serial", "chardev:console"].map(OsString::from));
        } else {
            arguments.extend(["-serial".into(), file_value("file:", serial)]);
        }
        arguments.extend(self.second.iter().flat_map(Second::arguments));
        if let Some(path) = &self.records {
            let port = file_value("file,id=edge,path=", path);
            arguments.extend(["-chardev".into(), port]);
            let device = "isa-debugcon,iobase=0x402,chardev=edge";
            arguments.extend(["-device", device].map(OsString::from));
        }
        let exit_device = "isa-debug-exit,iobase=0xf4,iosize=0x04";
        arguments.extend(["-device", exit_device].map(OsString::from));
        arguments.extend(["-nodefaults", "-no-user-config"].map(OsString::from));
        arguments.extend(["-display", "none", "-no-reboot"].map(OsString::from));
        if let Some(device) = &self.debugger {
            arguments.extend(["-S".into(), "-gdb".into(), device.clone()]);
        }
        arguments
    }

    /// Returns the arguments by which the image comes into memory, with words and module.
    fn loading(&self, image: &Path) -> Vec<OsString> {
        if self.loader.needs_stick() {
            let drive = file_value("if=none,id=stick,format=raw,readonly=on,file=", image);
            let mut arguments: Vec<OsString> = vec!["-drive".into(), drive];
            let devices = ["-device", "qemu-xhci", "-device", "usb-storage,drive=stick"];
            arguments.extend(devices.map(OsString::from));
            if self.loader.is_by_uefi() {
                arguments.extend(["-bios", OVMF_FILE].map(OsString::from));
            }
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
    /// In words: it is too long.
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
    /// In words: the guest's command line is too long, a file could not be made, or QEMU
    /// could not be started.
    pub fn start(&self, image: &Path, serial: &Path) -> Result<Running, String> {
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
        Running::start(command, serial, has_input, stops, self.logs_instructions)
    }
}

/// Makes QEMU translate, and so log, each instruction by itself. From version 8.1 on
/// that is an option of the accelerator.
fn log_instructions(program: &Path, arguments: &mut Vec<OsString>) {
    let said = Command::new(program).arg("--version").output();
    let said = said.map_or_else(|_| Vec::new(), |output| output.stdout);
    let said = String::from_utf8_lossy(&said);
    let version = said.split_once("version ").map_or("", |(_, rest)| rest);
    let mut numbers = version.split(|c: char| !c.is_ascii_digit());
    let mut number = || numbers.next()?.parse::<u32>().ok();
    if (number(), number()) >= (Some(8), Some(1)) {
        let accelerators = arguments.iter_mut().filter(|word| *word == "tcg");
        accelerators.for_each(|word| word.push(",one-insn-per-tb=on"));
    } else {
        arguments.push("-singlestep".into());
    }
    arguments.extend(["-d", "exec,nochain", "-D", "/dev/stdout"].map(OsString::from));
}

/// Returns a value that ends in a file's name. A comma would end the name in QEMU's syntax unless
/// doubled.
pub(crate) fn file_value(before: &str, path: &Path) -> OsString {
    let parts = path.as_os_str().as_bytes().split(|byte| *byte == b',');
    let name = parts.collect::<Vec<_>>().join(&b",,"[..]);
    OsString::from_vec([before.as_bytes(), &name].concat())
}

#[cfg(test)]
mod tests {
    use super::{Loader, Machine, Mode, Qemu, Second};
    use std::ffi::OsStr;
    use std::path::Path;

    #[test]
    fn names_are_read_back() {
        for name in Mode::NAMES {
            assert_eq!(Mode::from_name(name).map(Mode::name), Some(*name));
        }
        assert_eq!(Mode::from_name("fast"), None);
    }

    /// Holds QEMU's words for a guest to those that are in it, and those that are not.
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

    #[test]
    fn a_firmware_gets_a_stick_that_has_the_words() {
        let firmware = "-bios /usr/share/ovmf/OVMF.fd";
        let stick = "readonly=on,file=image ";
        for (loader, parts, others) in [
            (
                Loader::Pvh,
                &["-kernel image -append jobs=3"][..],
                &[stick][..],
            ),
            (Loader::Bios, &[stick], &["-kernel", "jobs", "-bios"]),
            (Loader::Uefi, &[stick, firmware], &["-kernel", "jobs"]),
            (Loader::Efi, &[stick, firmware], &["-kernel", "jobs"]),
        ] {
            let guest = Qemu {
                loader,
                machine: Machine::Q35,
                guest_words: "jobs=3".into(),
                ..Qemu::default()
            };
            has(&guest, parts, others);
        }
    }

    #[test]
    fn the_port_has_what_is_connected_to_it() {
        let with = |is_live, output: Option<&str>| {
            let output = output.map(Into::into);
            let words = Second { is_live, output }.arguments();
            words.join(OsStr::new(" ")).into_string().unwrap()
        };
        let device = " -device isa-serial,chardev=wire,iobase=0x2f8,irq=3";
        for (line, port) in [
            (with(false, None), "-chardev null,id=wire"),
            (with(false, Some("a,b")), "-chardev file,id=wire,path=a,,b"),
            (with(true, None), "-chardev stdio,id=wire,signal=off"),
            (
                with(true, Some("a")),
                "-chardev stdio,id=wire,signal=off,logfile=a",
            ),
        ] {
            assert_eq!(line, format!("{port}{device}"));
        }
    }
}
