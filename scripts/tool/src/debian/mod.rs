//! A Linux of Debian's in QEMU, for programs of ours that need another kernel than this
//! computer's: one with `sched_ext`, or one that grants SCHED_FIFO.
//!
//! Kernel and tools are Debian's packages (`packages`). What the guest has of files is in an
//! archive that the kernel unpacks into memory: the program, the libraries that it
//! names, and a script that runs it. What it prints comes through a port of its own, as bytes
//! and at any speed; its exit code through another one, into a file.

mod packages;

use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::files::{self, Temporary, write};
use crate::install;
use crate::progress::Lasting;
use crate::qemu::{Mode, PROGRAM, file_value};
use crate::system::{self, run};
use packages::Packages;

/// What the guest runs first, and all that it runs besides the program.
const INIT: &str = include_str!("init.sh");

/// The policy of `sched_ext`, as source.
const POLICY: &str = "fass/linux/bpf/seats.bpf.c";

/// Memory of a guest, in MiB.
const MEMORY_MIB: u64 = 1024;

/// A program to run in a guest.
#[derive(Debug)]
pub struct Order<'a> {
    /// The program.
    pub program: &'a Path,
    /// Its words. One that begins with `module=` names a file of ours.
    pub words: &'a [OsString],
    /// Whether the policy is loaded before.
    pub with_policy: bool,
    /// How many programs compute next to it.
    pub busy: u64,
    /// What time means there.
    pub mode: Mode,
    /// The guest's processors.
    pub cores: u64,
}

/// A guest that can be started: QEMU, and what it is told.
#[derive(Debug)]
pub struct Guest {
    /// QEMU.
    pub program: PathBuf,
    /// Its words.
    pub words: Vec<OsString>,
    /// What the kernel and the script say.
    console: PathBuf,
    /// The program's exit code.
    end: Temporary,
    _archive: Temporary,
}

impl Guest {
    /// Gets what the guest takes, compiles the policy if it is wanted, and makes the archive. The
    /// guest's own files lie next to `log`.
    ///
    /// # Errors
    ///
    /// In words: something cannot be had, or the policy does not compile.
    pub fn new(order: &Order<'_>, log: &Path) -> Result<Guest, String> {
        install::ensure_qemu()?;
        let packages = Packages::get()?;
        let own = system::new_log("debian")?;
        let place = |kind: &str| Temporary(Some(own.with_extension(kind)));
        let (archive, end) = (place("cpio"), place("end"));
        let console = log.with_extension("console");
        files::in_folder("debian", |folder| {
            order.lay_out(folder, &packages)?;
            pack(folder, &packages, archive.path())
        })?;
        write(end.path(), "")?;
        let mut words: Vec<OsString> = Vec::new();
        let accelerator: &[&str] = match order.mode {
            Mode::Kvm => &["-accel", "kvm", "-cpu", "host"],
            // Two instructions of Linux's a nanosecond are nearer to a PC than one.
            Mode::Deterministic => &["-icount", "shift=1,sleep=off", "-cpu", "max"],
            Mode::Threads => &["-accel", "tcg,thread=multi", "-cpu", "max"],
        };
        words.extend(accelerator.iter().map(OsString::from));
        // Not by standard output: the port would be closed with the end of standard input.
        for (port, path) in [("out", log), ("end", end.path())] {
            let file = file_value(&format!("file,id={port},path="), path);
            words.extend(["-chardev".into(), file]);
        }
        let fixed = "-machine q35 -nodefaults -display none -no-reboot \
                     -device virtio-serial-pci \
                     -device virtserialport,nr=1,chardev=out \
                     -device virtserialport,nr=2,chardev=end -append";
        words.extend(fixed.split_whitespace().map(OsString::from));
        // Where instructions are counted, a processor that computes keeps the emulator until a
        // timer ends: processors whose ticks are apart wait less for each other.
        words.push("console=ttyS0 quiet panic=-1 skew_tick=1".into());
        for (option, value) in [
            ("-smp", order.cores.to_string().into()),
            ("-m", MEMORY_MIB.to_string().into()),
            ("-kernel", packages.kernel.clone().into()),
            ("-initrd", archive.path().into()),
            ("-serial", file_value("file:", &console)),
        ] {
            words.extend([option.into(), value]);
        }
        Ok(Guest {
            program: PROGRAM.into(),
            words,
            console,
            end,
            _archive: archive,
        })
    }

    /// Returns the program's exit code; `None` if it has none: the guest did not get so far, or
    /// Linux has ended the policy before the program's end.
    #[must_use]
    pub fn code(&self) -> Option<i32> {
        let end = fs::read_to_string(self.end.path());
        end.ok()?.trim().parse().ok()
    }

    /// Returns the last lines of what the guest itself has said, and where all of it is.
    #[must_use]
    pub fn said(&self) -> String {
        let said = system::last_lines(&fs::read(&self.console).unwrap_or_default());
        format!("{said}\nits console: {}", self.console.display())
    }
}

impl Order<'_> {
    /// Lays out what the guest needs of files in a folder.
    fn lay_out(&self, folder: &Path, packages: &Packages) -> Result<(), String> {
        let add = |name: &str, source: &Path| write(&folder.join(name), files::read_at(source)?);
        let mut words = Vec::new();
        for word in self.words {
            match word.to_str().and_then(|word| word.strip_prefix("module=")) {
                Some(module) => {
                    add("module", Path::new(module))?;
                    words.push("module=/module".to_owned());
                }
                None => words.push(word.to_string_lossy().into_owned()),
            }
        }
        write(&folder.join("init"), INIT)?;
        write(&folder.join("words"), words.join("\n"))?;
        write(&folder.join("busy"), self.busy.to_string())?;
        add("bin/busybox", &packages.busybox())?;
        add("program", self.program)?;
        let mut programs = vec![self.program.to_path_buf()];
        if self.with_policy {
            let bpftool = packages.root.join("usr/sbin/bpftool");
            add("bin/bpftool", &bpftool)?;
            compile(packages, &folder.join("policy.o"))?;
            programs.push(bpftool);
        }
        add("lib64/ld-linux-x86-64.so.2", &packages.loader())?;
        for library in packages.libraries(&programs)? {
            if let Some(name) = library.file_name().and_then(|name| name.to_str()) {
                add(&format!("lib/x86_64-linux-gnu/{name}"), &library)?;
            }
        }
        Ok(())
    }
}

/// Packs a folder for Linux, which unpacks it into memory when it starts: in cpio's format, with
/// the folders that the script mounts. Everything may be executed, and is root's.
fn pack(folder: &Path, packages: &Packages, archive: &Path) -> Result<(), String> {
    const LINES: &str = "set -e; mkdir proc sys dev tmp; chmod -R 755 .
        find . | \"$0\" cpio -o -H newc -R 0:0 >\"$1\"";
    let busybox = packages.busybox();
    let mut command = Command::new(&busybox);
    command.current_dir(folder).args(["sh", "-c", LINES]);
    run(command.arg(&busybox).arg(archive)).map(drop)
}

/// Compiles the policy.
fn compile(packages: &Packages, object: &Path) -> Result<(), String> {
    let _lasting = Lasting::new("compiling the policy");
    let mut clang = packages.command("usr/lib/llvm-19/bin/clang");
    clang.args("-target bpf -mcpu=v3 -O2 -g -Wall -Werror -D__TARGET_ARCH_x86 -c".split(' '));
    clang.arg("-I").arg(packages.root.join("usr/include"));
    clang.arg(system::workspace().join(POLICY));
    run(clang.arg("-o").arg(object)).map(drop)
}
