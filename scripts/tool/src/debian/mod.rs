//! Runs programs under Debian's Linux in QEMU. Some of our programs need another kernel than this
//! computer's: a kernel with `sched_ext`, or a kernel that grants SCHED_FIFO.
//!
//! Kernel and tools come from Debian's packages. The guest's files are in an archive, unpacked by
//! the kernel into memory: the program, its libraries, and a script to run the program. The
//! program's output comes through a port of its own, as bytes and at any speed. Its exit code comes
//! through a second port into a file.
//!
//! The packages are unpacked beside this computer's system, never into it. `apt-get` fetches them
//! with its own sources, lists and downloads below `target/debian`, and `dpkg` unpacks them there.
//! They come from trixie, the kernel from trixie's backports, on any Debian or Ubuntu. Their own
//! loader runs their programs.

use std::ffi::OsString;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::files::{self, TemporaryFile, write};
use crate::install;
use crate::progress::ProgressNote;
use crate::qemu::{self, Mode, PROGRAM, file_value};
use crate::system::{self, find_program, run};

/// The guest's first program, a script to run the others.
const INIT: &str = include_str!("init.sh");

/// The scheduling policy for `sched_ext`, as source.
const POLICY: &str = "fass/linux/bpf/seats.bpf.c";

/// The memory of a guest, in MiB.
const MEMORY_MIB: u64 = 1024;

/// A program to run in a guest.
pub struct GuestOrder<'a> {
    /// The program.
    pub program: &'a Path,
    /// The program's arguments. A word beginning with `module=` names a file of this computer.
    pub words: &'a [OsString],
    /// Whether the guest loads the policy first.
    pub with_policy: bool,
    /// The number of programs computing beside the program.
    pub busy: u64,
    /// The meaning of time in the guest.
    pub mode: Mode,
    /// The guest's processors.
    pub cores: u64,
}

/// A guest ready to start: QEMU and its arguments.
pub struct Guest {
    /// QEMU.
    pub program: PathBuf,
    /// QEMU's arguments.
    pub words: Vec<OsString>,
    /// The file with the output of kernel and script.
    console: PathBuf,
    /// The file with the program's exit code.
    end: TemporaryFile,
    _archive: TemporaryFile,
}

impl Guest {
    /// Gets the packages, compiles the policy if wanted, and makes the archive. The guest's own
    /// files lie next to `log`.
    ///
    /// # Errors
    ///
    /// In words: a package or tool cannot be obtained, or the policy does not compile.
    pub fn new(order: &GuestOrder<'_>, log: &Path) -> Result<Guest, String> {
        install::ensure_qemu()?;
        let packages = UnpackedPackages::get()?;
        let own = system::new_log("debian")?;
        let place = |kind: &str| TemporaryFile(Some(own.with_extension(kind)));
        let (archive, end) = (place("cpio"), place("end"));
        let console = log.with_extension("console");
        files::in_folder("debian", |folder| {
            order.lay_out(folder, &packages)?;
            pack(folder, &packages, archive.path())
        })?;
        // The file must exist already: until the guest writes a code, it stays empty, meaning no
        // code.
        write(end.path(), "")?;
        let mut words = qemu::words(match order.mode {
            // Two of Linux's instructions per nanosecond are nearer to a PC than one.
            Mode::Deterministic => "-icount shift=1,sleep=off -cpu max",
            other => other.arguments(),
        });
        // Not through standard output: QEMU would close that port at the end of standard input.
        for (port, path) in [("out", log), ("end", end.path())] {
            let file = file_value(&format!("file,id={port},path="), path);
            words.extend(["-chardev".into(), file]);
        }
        words.extend(qemu::words(
            "-machine q35 -nodefaults -display none -no-reboot -device virtio-serial-pci \
             -device virtserialport,nr=1,chardev=out -device virtserialport,nr=2,chardev=end \
             -append",
        ));
        // With counted instructions, a computing processor keeps the emulator until a timer fires.
        // With ticks apart, the processors wait less for each other.
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

    /// Returns the program's exit code. Returns `None` if the guest did not get that far, or if
    /// Linux ended the policy before the program's end.
    pub fn code(&self) -> Option<i32> {
        let end = fs::read_to_string(self.end.path());
        end.ok()?.trim().parse().ok()
    }

    /// Returns the last lines of the guest's console, and the path of its file.
    pub fn said(&self) -> String {
        let said = system::last_lines(&fs::read(&self.console).unwrap_or_default());
        format!("{said}\nits console: {}", self.console.display())
    }
}

impl GuestOrder<'_> {
    /// Lays out the guest's files in a folder.
    fn lay_out(&self, folder: &Path, packages: &UnpackedPackages) -> Result<(), String> {
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

/// Packs a folder into a cpio archive, with the folders that the script mounts on. Linux unpacks
/// the archive into memory when it starts. Every file is executable and belongs to root.
fn pack(folder: &Path, packages: &UnpackedPackages, archive: &Path) -> Result<(), String> {
    const LINES: &str = "set -e; mkdir proc sys dev tmp; chmod -R 755 .
        find . | \"$0\" cpio -o -H newc -R 0:0 >\"$1\"";
    let busybox = packages.busybox();
    let mut command = Command::new(&busybox);
    command.current_dir(folder).args(["sh", "-c", LINES]);
    run(command.arg(&busybox).arg(archive)).map(drop)
}

/// Compiles the policy.
fn compile(packages: &UnpackedPackages, object: &Path) -> Result<(), String> {
    let _lasting = ProgressNote::new("compiling the policy");
    let mut clang = packages.command("usr/lib/llvm-19/bin/clang");
    clang.args("-target bpf -mcpu=v3 -O2 -g -Wall -Werror -D__TARGET_ARCH_x86 -c".split(' '));
    clang.arg("-I").arg(packages.root.join("usr/include"));
    clang.arg(system::workspace().join(POLICY));
    run(clang.arg("-o").arg(object)).map(drop)
}

/// The packages fetched besides the kernel, with their dependencies.
const PACKAGES: [&str; 4] = ["busybox-static", "bpftool", "clang-19", "libbpf-dev"];

/// The keys for checking the signatures of the package lists.
const KEYS: &str = "/usr/share/keyrings/debian-archive-keyring.gpg";

/// The preferred kernel version: the policy was tried with it.
const TRIED: [u32; 2] = [6, 18];
/// The first kernel version whose `sched_ext` has everything that the policy uses.
const LEAST: [u32; 2] = [6, 13];

/// The unpacked packages.
struct UnpackedPackages {
    /// The folder used as the root of a file system.
    root: PathBuf,
    /// The kernel.
    kernel: PathBuf,
}

impl UnpackedPackages {
    /// Makes sure that the packages are there, and returns them.
    fn get() -> Result<UnpackedPackages, String> {
        let folder = system::workspace().join("target/debian");
        let parts = ["lists/partial", "cache/archives/partial", "root"];
        for part in parts.map(|part| folder.join(part)) {
            fs::create_dir_all(&part)
                .map_err(|why| format!("cannot make the folder `{}`: {why}", part.display()))?;
        }
        // Of two commands at once the second waits, and finds the packages.
        let lock = File::create(folder.join("lock"));
        let locked = lock.and_then(|lock| lock.lock().map(|()| lock));
        let _lock = locked.map_err(|why| format!("cannot lock `{}`: {why}", folder.display()))?;
        let (root, ready) = (folder.join("root"), folder.join("kernel"));
        // Written last, so this file is there only if everything is unpacked.
        if !ready.is_file() {
            let kernel = fetch(&folder)?;
            files::write(&ready, kernel)?;
        }
        let kernel = fs::read_to_string(&ready)
            .map_err(|why| format!("cannot read `{}`: {why}", ready.display()))?;
        let kernel = root.join("boot").join(kernel);
        Ok(UnpackedPackages { root, kernel })
    }

    /// Returns the dynamic loader of the packages.
    fn loader(&self) -> PathBuf {
        self.root.join("usr/lib64/ld-linux-x86-64.so.2")
    }

    /// Returns busybox, one statically linked program with many tools.
    fn busybox(&self) -> PathBuf {
        self.root.join("usr/bin/busybox")
    }

    /// Returns a command for a program of the packages.
    fn command(&self, program: &str) -> Command {
        let mut command = self.loading();
        command.arg(self.root.join(program));
        command
    }

    /// Returns the command for loading a program with the packages' libraries.
    fn loading(&self) -> Command {
        let mut command = Command::new(self.loader());
        let libraries = self.root.join("usr/lib/x86_64-linux-gnu");
        command.arg("--library-path").arg(libraries);
        command
    }

    /// Returns the libraries that programs are linked with, each once.
    fn libraries(&self, programs: &[PathBuf]) -> Result<Vec<PathBuf>, String> {
        let mut found = Vec::new();
        for program in programs {
            let list = run(self.loading().arg("--list").arg(program))?;
            found.extend(list.lines().filter_map(library).filter(|path| {
                // The loader lies elsewhere in the guest.
                !path.ends_with("ld-linux-x86-64.so.2")
            }));
        }
        found.sort();
        found.dedup();
        Ok(found)
    }
}

/// Returns the path in a line of the loader such as `libz.so.1 => /lib/libz.so.1 (0x7f00)`.
fn library(line: &str) -> Option<PathBuf> {
    let (_, path) = line.split_once(" => ")?;
    let (path, _) = path.rsplit_once(" (")?;
    Some(path.into())
}

/// Fetches and unpacks everything, and returns the kernel's file name.
fn fetch(folder: &Path) -> Result<String, String> {
    for (name, what) in [("apt-get", "apt"), ("dpkg", "dpkg")] {
        if find_program(name).is_none() {
            return Err(format!(
                "there is no `{name}`, which fetches and unpacks Debian's packages; install \
                 `{what}` and start again"
            ));
        }
    }
    if !Path::new(KEYS).is_file() {
        return Err(format!(
            "there is no `{KEYS}`, with which Debian's packages are checked; install \
             `debian-archive-keyring` and start again"
        ));
    }
    eprintln!(
        "fetching a kernel, busybox, clang and bpftool of Debian's, some 145 MB, to `{}`; \
         unpacked they take 500 MB",
        folder.display()
    );
    let lasting = ProgressNote::new("fetching Debian's packages");
    let line = |suite: &str| {
        format!("deb [arch=amd64 signed-by={KEYS}] http://deb.debian.org/debian {suite} main\n")
    };
    let sources = line("trixie") + &line("trixie-backports");
    for (name, text) in [("sources.list", sources.as_str()), ("status", "")] {
        files::write(&folder.join(name), text)?;
    }
    run(apt("apt-get", folder).arg("update"))?;
    let names = run(apt("apt-cache", folder).args(["pkgnames", "linux-image-"]))?;
    let kernel = choose(names.lines()).ok_or(
        "Debian's lists have no kernel of 6.13 or later for clouds; look for a newer state of this project",
    )?;
    let mut install = apt("apt-get", folder);
    // `--download-only`: this computer's own packages must not change.
    install.args("--yes --no-install-recommends --download-only install".split(' '));
    run(install.args(PACKAGES))?;
    let archives = folder.join("cache/archives");
    run(apt("apt-get", folder)
        .current_dir(&archives)
        .args(["download", kernel]))?;
    drop(lasting);
    let _lasting = ProgressNote::new("unpacking Debian's packages");
    let files = fs::read_dir(&archives);
    let files = files.map_err(|why| format!("cannot read `{}`: {why}", archives.display()))?;
    for file in files.flatten().map(|file| file.path()) {
        if file.extension().is_some_and(|kind| kind == "deb") {
            run(Command::new("dpkg")
                .arg("-x")
                .arg(&file)
                .arg(folder.join("root")))?;
            // The file is unpacked, and can be fetched again.
            let _ = fs::remove_file(&file);
        }
    }
    Ok(kernel.replacen("linux-image-", "vmlinuz-", 1))
}

/// Returns an apt command that neither knows nor changes this computer's packages.
fn apt(program: &str, folder: &Path) -> Command {
    let mut command = Command::new(program);
    for (name, part) in [
        ("Dir::Etc::sourcelist", "sources.list"),
        ("Dir::Etc::sourceparts", "none"),
        ("Dir::State", "."),
        ("Dir::State::lists", "lists"),
        ("Dir::State::status", "status"),
        ("Dir::Cache", "cache"),
    ] {
        let place = folder.join(part);
        command.arg("-o").arg(format!("{name}={}", place.display()));
    }
    // The user `_apt` could not write into our folder.
    command.args([
        "-o",
        "APT::Sandbox::User=root",
        "-o",
        "APT::Architecture=amd64",
    ]);
    command.args(["-o", "Acquire::Languages=none", "-q"]);
    command.env("DEBIAN_FRONTEND", "noninteractive");
    command
}

/// Chooses a kernel for virtual machines: the latest of the tried version, else the latest of all.
fn choose<'a>(names: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    let version = |name: &str| -> Option<[u32; 3]> {
        let name = name.strip_prefix("linux-image-")?;
        let (version, rest) = name.split_once('+')?;
        let mut parts = version.split('.').map(|part| part.parse().ok());
        let version = [parts.next()??, parts.next()??, parts.next()??];
        let is_whole = rest.ends_with("-cloud-amd64") && parts.next().is_none();
        (is_whole && version[..2] >= LEAST[..]).then_some(version)
    };
    let rated = names.filter_map(|name| {
        let version = version(name)?;
        // A tried version beats any other; among equals the latest wins.
        Some(((version[..2] == TRIED, version), name))
    });
    rated.max().map(|(_, name)| name)
}

#[cfg(test)]
mod tests {
    use super::{choose, library};

    #[test]
    fn the_latest_kernel_of_those_that_were_tried_is_taken() {
        let names = [
            "linux-image-6.12.107+deb13-cloud-amd64",
            "linux-image-6.18.9+deb13-cloud-amd64",
            "linux-image-6.18.15+deb13-cloud-amd64",
            "linux-image-6.18.16+deb13-cloud-amd64-dbg",
            "linux-image-6.18.16+deb13-amd64",
            "linux-image-7.2.12+deb13-cloud-amd64",
            "linux-image-cloud-amd64",
        ];
        let of = |names: &[&'static str]| choose(names.iter().copied());
        assert_eq!(of(&names), Some(names[2]));
        assert_eq!(of(&names[5..]), Some(names[5]));
        assert_eq!(of(&names[..1]), None, "it is too old");
        let line = "\tlibz.so.1 => /a b/libz.so.1 (0x00007f0000000000)";
        assert_eq!(library(line), Some("/a b/libz.so.1".into()));
        assert_eq!(library("\tlinux-vdso.so.1 (0x00007f0000000000)"), None);
    }
}
