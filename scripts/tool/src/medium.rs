//! Makes boot media for a PC: for a single boot, or by the subcommand `image`.
//!
//! A medium is an ISO, for a stick or a disc. It contains the loaded part of the app's image,
//! optionally a file to leave in memory, GRUB for BIOS and for UEFI, and commands for GRUB to boot
//! the image with its words. `grub-mkrescue` makes the ISO, with the few modules of GRUB needed for
//! the boot. A [`BootStick`] is a stick for a single boot: a temporary file shown by QEMU as a
//! stick. Everything is checked before anything is built.
//!
//! Exit codes: 0 the file is there, 1 the file could not be made, 2 a refused command line.

use std::ffi::OsString;
use std::fs;
use std::path::Path;
use std::process::{self, ExitCode};

use crate::elf;
use crate::files::{self, TemporaryFile};
use crate::image;
use crate::install;
use crate::options::{Command, CommandLine, Refusal, ValueKind, options};
use crate::qemu::Qemu;
use crate::system;

/// The options and the help text of `image`.
pub static TABLE: Command = Command {
    invocation: "./scripts/image",
    about: "Makes a file that boots an app on a PC: to be written to a stick, or to a disc.",
    positional: Some((
        ValueKind::Text("WORD..."),
        "Words for the app and the kernel, such as `jobs=20`.",
    )),
    options: OPTIONS,
    notes: "\
The ISO boots by GRUB, under BIOS and UEFI. `cp FILE /dev/DEVICE` writes it to a stick,
and what was there is lost. docs/pc.md says how, and what is known of real PCs.

DAGs of a file: `./scripts/run --dag FILE --print-dag > MODULE` makes the module for
`--app dag-file`, whose words are those that `./scripts/run --dag FILE` shows.

exit codes: 0 the file is there; 1 it could not be made; 2 a refused command line
",
};

options! {
    /// The app: a package under apps/.
    APP: ValueKind::Text("NAME"), or "fork-join";
    /// The ISO to be made.
    ISO: ValueKind::File("FILE");
    /// A file that the app finds in memory, as dag-file does its DAGs.
    MODULE: ValueKind::File("MODULE");
    /// Take this image; build nothing.
    IMAGE: ValueKind::File("IMAGE");
}

/// Runs the subcommand with the words after its name.
pub fn image(words: &[OsString]) -> ExitCode {
    TABLE.carry_out(words, |options| {
        let guest_words = check(options).map_err(Refusal::Usage)?;
        print!("{}", make(options, &guest_words)?);
        Ok(ExitCode::SUCCESS)
    })
}

/// Checks everything a command line can get wrong, and returns the words for the guest.
fn check(options: &CommandLine) -> Result<String, String> {
    let outputs = options.named(&[name::ISO]);
    if outputs.is_empty() {
        return Err("which file? give --iso FILE".into());
    }
    let inputs = options.named(&[name::MODULE, name::IMAGE]);
    files::check(&inputs, &outputs)?;
    for input in &inputs {
        let (option, place) = (input.option, files::shown_path(input.path));
        let read = match option {
            "image" => image::check_file(input.path).map(|_| ()),
            _ => files::read(input.path).map(|_| ()),
        };
        read.map_err(|why| format!("`--{option} {place}`: {why}"))?;
    }
    if !options.is_given(name::IMAGE) {
        let app = options.text(name::APP).unwrap_or_default();
        image::check_app(app)?;
    }
    let words = options.files().map(Path::to_string_lossy);
    let guest_words = words.collect::<Vec<_>>().join(" ");
    check_words(&guest_words)?;
    let guest = Qemu {
        guest_words,
        ..Qemu::default()
    };
    guest.check_words()?;
    Ok(guest.guest_words)
}

/// Makes the ISO, and returns a line describing the file.
fn make(options: &CommandLine, words: &str) -> Result<String, String> {
    let image = match options.path(name::IMAGE) {
        Some(path) => path.into(),
        None => image::build(options.text(name::APP).unwrap_or_default())?,
    };
    let made = BootStick::new(&image, words, options.path(name::MODULE))?;
    let path = options.path(name::ISO).unwrap_or(Path::new(""));
    let place = files::shown_path(path);
    let bytes = fs::copy(made.path(), path)
        .map_err(|why| format!("`--iso {place}`: cannot be written: {why}"))?;
    Ok(format!(
        "{place}: {} KiB that boot under BIOS and UEFI; `cp {place} /dev/DEVICE` writes it to a \
         stick, and what was there is lost\n",
        bytes >> 10
    ))
}

/// The content of a stick, in a file removed when this value is dropped.
pub struct BootStick(TemporaryFile);

impl BootStick {
    /// Makes a medium from which GRUB boots `image` with `words`, leaving `module` in memory.
    ///
    /// # Errors
    ///
    /// In words: a file cannot be read, the image is no ELF file, the words are refused, a tool is
    /// missing, `grub-mkrescue` failed, or there is no room.
    pub fn new(image: &Path, words: &str, module: Option<&Path>) -> Result<BootStick, String> {
        let loaded = elf::loaded(files::read_at(image)?);
        let loaded = loaded.map_err(|why| format!("`{}`: {why}", files::shown_path(image)))?;
        let module = module.map(files::read_at).transpose()?;
        let log = system::new_log("stick")?;
        let medium = BootStick(TemporaryFile(Some(log.with_extension("iso"))));
        write_iso(medium.path(), &loaded, words, module.as_deref())?;
        Ok(medium)
    }

    /// Returns the path of the file.
    pub fn path(&self) -> &Path {
        self.0.path()
    }
}

/// The modules of GRUB beyond those for reading its own files. The `part_` modules are the kinds of
/// partitions GRUB asks for at its start. A test uses `wrmsr` to leave a processor in the state
/// left by some firmware.
const MODULES: &str = "--install-modules=normal multiboot2 cpuid echo read wrmsr iso9660 \
                       all_video part_acorn \
                       part_amiga part_apple part_bsd part_dfly part_dvh part_gpt part_msdos \
                       part_plan part_sun part_sunpc";

/// Makes sure that GRUB passes words to the image unchanged.
///
/// # Errors
///
/// In words, with the offending word: GRUB would change one of its characters.
pub fn check_words(words: &str) -> Result<(), String> {
    let changes = |c: char| matches!(c, '\'' | '"' | '\\') || !(c.is_ascii_graphic());
    for word in words.split_whitespace() {
        if let Some(c) = word.chars().find(|c| changes(*c)) {
            let remedy = "give words of ASCII without quotes and backslashes";
            return Err(format!(
                "`{word}`: GRUB would not hand on `{c}` as it is; {remedy}"
            ));
        }
    }
    Ok(())
}

/// Writes to `iso` a medium for booting the image. Installs missing tools.
fn write_iso(iso: &Path, image: &[u8], words: &str, module: Option<&[u8]>) -> Result<(), String> {
    check_words(words)?;
    install::ensure(&install::GRUB)?;
    files::in_folder("iso", |folder| {
        let boot = folder.join("boot");
        let commands = commands(words, module.is_some());
        files::write(&boot.join("grub/grub.cfg"), commands)?;
        files::write(&boot.join("image"), image)?;
        if let Some(module) = module {
            files::write(&boot.join("module"), module)?;
        }
        rescue(folder, iso)
    })
}

/// Returns GRUB's commands. The module stays as it is, compressed or not. GRUB itself reports a
/// processor without 64 bits, since the image cannot run a single instruction there.
///
/// Under UEFI, GRUB puts the first module at address 0. The firmware takes this address for a
/// missing address and reads no file to it, unless GRUB reads through its cache; whether GRUB does
/// so depends on the place of the file. So a small module, always read through the cache, comes
/// first. Without GRUB's screen drivers, the image would have no screen under UEFI.
fn commands(words: &str, has_module: bool) -> String {
    let quoted = words.split_whitespace().map(|word| format!(" '{word}'"));
    let quoted: String = quoted.collect();
    let boot = match has_module {
        true => {
            "module2 /boot/grub/grub.cfg filler\n\
             if module2 --nounzip /boot/module; then\nboot\nelse\nread\nfi\n"
        }
        false => "boot\n",
    };
    format!(
        "insmod all_video\nif cpuid -l; then\nmultiboot2 /boot/image{quoted}\n{boot}else\n\
         echo 'this processor has no 64-bit mode, which the image needs'\nread\nfi\n"
    )
}

fn rescue(folder: &Path, iso: &Path) -> Result<(), String> {
    let mut output = OsString::from("--output=");
    output.push(iso);
    let mut command = process::Command::new("grub-mkrescue");
    command.args(["--locales=", "--themes=", "--fonts=", MODULES]);
    let made = system::run(command.arg(output).arg(folder));
    // Success alone does not prove that the file is there.
    made.and_then(|_| match iso.is_file() {
        true => Ok(()),
        false => Err(format!(
            "`grub-mkrescue` has not made `{}`",
            files::shown_path(iso)
        )),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::right;

    /// `tests/tests/boots/by_grub.rs` shows that a module arrives.
    #[test]
    fn grub_gets_each_word_as_it_is_or_it_is_refused_by_name() {
        let words = "jobs=3  a=$x;{}#";
        assert!(commands(words, true).contains("multiboot2 /boot/image 'jobs=3' 'a=$x;{}#'\n"));
        assert_eq!(check_words(words), Ok(()));
        for word in ["it's", "say=\"x\"", "a\\b", "k=\u{e4}", "bell\u{7}"] {
            let why = check_words(&format!("jobs=3 {word}")).unwrap_err();
            assert!(why.starts_with(&format!("`{word}`: GRUB")), "{why}");
        }
    }

    #[test]
    fn what_cannot_be_made_is_refused_before_the_work() {
        let iso = system::new_log("refused").unwrap();
        for (line, words) in [
            ("--app fork-jion", "did you mean `fork-join`?"),
            ("it's", "`it's`: GRUB"),
            ("--module /dev/zero", "`--module /dev/zero`: cannot"),
            ("--image /etc/passwd", "`--image /etc/passwd`: is no image"),
            (&"x".repeat(2049), "2049 bytes"),
        ] {
            let refused = check(&right(&TABLE, line).with(name::ISO, &iso)).unwrap_err();
            assert!(refused.contains(words), "{refused}");
        }
        let why = check(&right(&TABLE, "jobs=3")).unwrap_err();
        assert_eq!(why, "which file? give --iso FILE");
        let right = check(&right(&TABLE, "jobs=3 seed=7").with(name::ISO, &iso));
        assert_eq!(right.as_deref(), Ok("jobs=3 seed=7"));
        assert!(!iso.exists());
    }
}
