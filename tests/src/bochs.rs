//! Boots in Bochs, an emulator imitating a PC more strictly than QEMU.
//!
//! Bochs tests properties QEMU does not imitate: a disabled local APIC keeps its timer masked,
//! processors come out of INIT with their caches off, and x2APIC, the counter's deadline timer and
//! five-level paging are there, as on today's PCs. Bochs is slow, and has its own clock: a test may
//! judge by counts and order alone.
//!
//! A run ends when the kernel powers the PC off by ACPI: then Bochs ends.

use std::fs;
use std::path::Path;
use std::process::Stdio;
use std::time::Duration;

use tool::child::{Child, WaitEnd, bound_to_us};
use tool::install;
use tool::medium::BootStick;
use tool::outcome::judge_lines;
use tool::system::{find_program, host_load, new_log};
use views::protocol::Transcript;

use crate::guest::built;

/// Files of a boot: the PC's settings, its serial output, and Bochs' messages.
const SETTINGS: &str = "settings";
const SERIAL: &str = "serial";
const SAID: &str = "said";

/// The most wall time of a boot: many times the usual time.
const LIMIT: Duration = Duration::from_secs(600);

/// Boots the image of a package from an ISO in a PC, and returns the output of the run, which must
/// succeed. The PC has `cores` processors of Bochs' model `model`. GRUB first executes `command`,
/// unless it is empty.
///
/// # Panics
///
/// Panics if a program or file is missing, or, with the serial log, if the run does not succeed.
pub fn succeed(command: &str, package: &str, words: &str, model: &str, cores: u64) -> Transcript {
    let run = || -> Result<(String, String), String> {
        install::ensure(&install::BOCHS)?;
        let program = find_program("bochs").ok_or("there is no program `bochs`")?;
        let words = format!("{words} end=off");
        let iso = BootStick::new(&built(package)?, &words, None)?;
        if !command.is_empty() {
            put_before(command, iso.path())?;
        }
        let folder = new_log("bochs")?.with_extension("files");
        let cannot = |why| format!("`{}`: {why}", folder.display());
        fs::create_dir(&folder).map_err(cannot)?;
        let text = settings_text(model, cores, iso.path(), &folder);
        fs::write(folder.join(SETTINGS), text).map_err(cannot)?;
        let booted = boot(&program, &folder);
        let serial = fs::read(folder.join(SERIAL)).unwrap_or_default();
        // It is ours, and in the way of no one if it cannot be removed.
        let _ = fs::remove_dir_all(&folder);
        Ok((String::from_utf8_lossy(&serial).into_owned(), booted?))
    };
    let booted = run().unwrap_or_else(|why| panic!("`{package}` did not boot in Bochs: {why}"));
    let (serial, end) = booted;
    let transcript = Transcript::read(&serial);
    if let Err(fault) = judge_lines(&transcript) {
        panic!("{}\n{serial}\n{end}", fault.reason);
    }
    transcript
}

/// Replaces GRUB's question whether the processor has 64 bits by a command. The ISO has the
/// question as text.
fn put_before(command: &str, iso: &Path) -> Result<(), String> {
    const QUESTION: &[u8] = b"if cpuid -l; then\n";
    const ANSWER: &[u8] = b"\nelse\n";
    const END: &[u8] = b"\nfi\n";
    let mut bytes = fs::read(iso).map_err(|why| format!("`{}`: {why}", iso.display()))?;
    let place = |from: usize, text: &[u8]| {
        let found = bytes[from..].windows(text.len());
        found
            .enumerate()
            .find(|(_, window)| *window == text)
            .map(|(at, _)| from + at)
    };
    let places = || {
        let start = place(0, QUESTION)?;
        let answer = place(start, ANSWER)?;
        Some((start, answer, place(answer, END)? + END.len()))
    };
    let (start, answer, end) = places().ok_or("the ISO has other commands")?;
    let mut commands = [command.as_bytes(), b"\n"].concat();
    commands.extend(&bytes[start + QUESTION.len()..=answer]);
    commands.resize(end - start, b'\n');
    bytes[start..end].copy_from_slice(&commands);
    fs::write(iso, bytes).map_err(|why| format!("`{}`: {why}", iso.display()))
}

/// Runs Bochs with the settings in a folder until its end, at most until the limit. Returns the way
/// Bochs ended, and its last words from its log and its standard error.
fn boot(program: &Path, folder: &Path) -> Result<String, String> {
    let cannot = |why| format!("cannot write in `{}`: {why}", folder.display());
    let mut command = bound_to_us(program);
    // Debian's Bochs has a debugger, which has to be told to begin; its commands are a file.
    let commands = folder.join("commands");
    fs::write(&commands, "c\n").map_err(cannot)?;
    command.arg("-q").arg("-f").arg(folder.join(SETTINGS));
    command.arg("-rc").arg(&commands);
    command.env("SDL_VIDEODRIVER", "dummy");
    let errors = fs::File::create(folder.join("errors")).map_err(cannot)?;
    command.stdin(Stdio::null()).stdout(Stdio::null());
    let started = Child::start(command.stderr(errors));
    let mut child = started.map_err(|why| format!("cannot start Bochs: {why}"))?;
    let waited = child.wait(LIMIT, || true);
    let words = [SAID, "errors"].map(|file| last_words(&folder.join(file)));
    let words = words.concat();
    match waited {
        WaitEnd::Ended(status) => Ok(format!("Bochs ended with {status} and said:\n{words}")),
        _ => Err(format!("it was not powered off; {}\n{words}", host_load())),
    }
}

/// Returns the last lines of a file written by another program.
fn last_words(file: &Path) -> String {
    const LINES: usize = 20;
    let text = fs::read(file).unwrap_or_default();
    let text = String::from_utf8_lossy(&text).into_owned();
    let first = text.lines().count().saturating_sub(LINES);
    text.lines()
        .skip(first)
        .map(|line| format!("{line}\n"))
        .collect()
}

/// Returns the settings of the PC. It has no sound: without the host's sound card Bochs would end
/// itself.
fn settings_text(model: &str, cores: u64, iso: &Path, folder: &Path) -> String {
    let [log, said] = [SERIAL, SAID].map(|file| folder.join(file));
    let (iso, log, said) = (iso.display(), log.display(), said.display());
    format!(
        "\
config_interface: textconfig
display_library: sdl2
cpu: model={model}, count={cores}, ips=50000000, reset_on_triple_fault=0
memory: guest=256, host=256
romimage: file=/usr/share/bochs/BIOS-bochs-latest
vgaromimage: file=/usr/share/bochs/VGABIOS-lgpl-latest
ata0: enabled=1, ioaddr1=0x1f0, ioaddr2=0x3f0, irq=14
ata0-master: type=cdrom, path={iso}, status=inserted
boot: cdrom
com1: enabled=1, mode=file, dev={log}
clock: sync=none
sound: waveoutdrv=dummy, waveindrv=dummy, midioutdrv=dummy
log: {said}
"
    )
}
