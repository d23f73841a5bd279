//! A stick for one boot: a file that QEMU shows as one, and that is gone afterwards.
//!
//! It is an ISO with GRUB, or a FAT file system with the application of UEFI alone. The ISO
//! serves as a disc, too, and `./scripts/image --iso` keeps one. On it are GRUB for BIOS and for
//! UEFI, the image as far as it is loaded, a file to be left in memory if there is one, and
//! GRUB's commands to boot the one with the words and the other. `grub-mkrescue` makes it, with
//! the few of GRUB's modules that this takes.

use std::ffi::OsString;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::efi;
use crate::files::{self, Temporary};
use crate::image::Contents;
use crate::install;
use crate::qemu::Loader;
use crate::system;

/// A stick's content, which is removed with this value.
#[derive(Debug)]
pub struct Medium(Temporary);

impl Medium {
    /// Makes what `loader` boots `image` from, with `words`, and with `module` to be left
    /// in memory.
    ///
    /// # Errors
    ///
    /// As [`Contents::read`] or [`efi::application`], or the words are refused, something is missing,
    /// `grub-mkrescue` failed, or there is no room.
    pub fn new(
        loader: Loader,
        image: &Path,
        words: &str,
        module: Option<&Path>,
    ) -> Result<Medium, String> {
        let contents = Contents::read(image, words, module)?;
        let log = system::new_log("stick")?;
        let is_fat = loader == Loader::Efi;
        let path = log.with_extension(if is_fat { "img" } else { "iso" });
        let medium = Medium(Temporary(Some(path)));
        match is_fat {
            true => write_fat(medium.path(), &efi::application(&contents)?)?,
            false => write_iso(medium.path(), &contents)?,
        }
        Ok(medium)
    }

    /// Returns where it lies.
    #[must_use]
    pub fn path(&self) -> &Path {
        self.0.path()
    }
}

/// Writes a FAT file system that has the application where a firmware looks for it.
fn write_fat(stick: &Path, application: &[u8]) -> Result<(), String> {
    install::ensure(&install::MTOOLS)?;
    // More than what the file system itself takes.
    let bytes = (4 << 20) + application.len() as u64 / 64 * 65;
    let sized = File::create(stick).and_then(|file| file.set_len(bytes));
    sized.map_err(|why| format!("cannot write `{}`: {why}", stick.display()))?;
    let file = Temporary(Some(stick.with_extension("efi")));
    files::write(file.path(), application)?;
    let tool = |name: &str, words: &[&Path]| {
        system::run(Command::new(name).arg("-i").arg(stick).args(words)).map(drop)
    };
    let on_stick = |path: &str| PathBuf::from(format!("::/{path}"));
    tool("mformat", &[Path::new("::")])?;
    tool("mmd", &[&on_stick("EFI"), &on_stick("EFI/BOOT")])?;
    tool("mcopy", &[file.path(), &on_stick(efi::PLACE)])
}

/// What GRUB has to be able to do besides what it brings itself to its own files.
/// The kinds of partitions are those that it asks for at its start. A test has it leave a
/// processor as some firmware does, by `wrmsr`.
const MODULES: &str = "--install-modules=normal multiboot2 cpuid echo read wrmsr iso9660 \
                       all_video part_acorn \
                       part_amiga part_apple part_bsd part_dfly part_dvh part_gpt part_msdos \
                       part_plan part_sun part_sunpc";

/// Makes sure that words reach the image through GRUB as they are.
///
/// # Errors
///
/// In words, with the offender: it has a character that GRUB would change.
pub fn check_words(words: &str) -> Result<(), String> {
    let changes = |c: char| matches!(c, '\'' | '"' | '\\') || !(c.is_ascii_graphic());
    for word in words.split_whitespace() {
        if let Some(c) = word.chars().find(|c| changes(*c)) {
            return Err(format!(
                "`{word}`: GRUB would not hand on `{c}` as it is; give words of ASCII without \
                 quotes and backslashes"
            ));
        }
    }
    Ok(())
}

/// Makes the ISO `iso` that boots what `contents` have.
/// What it is made with is installed if it is missing.
fn write_iso(iso: &Path, contents: &Contents<'_>) -> Result<(), String> {
    check_words(contents.words)?;
    install::ensure(&install::GRUB)?;
    files::in_folder("iso", |folder| {
        let boot = folder.join("boot");
        let commands = commands(contents.words, contents.module.is_some());
        files::write(&boot.join("grub/grub.cfg"), commands)?;
        files::write(&boot.join("image"), &contents.image)?;
        if let Some(module) = &contents.module {
            files::write(&boot.join("module"), module)?;
        }
        rescue(folder, iso)
    })
}

/// Returns GRUB's commands. A file is left as it is, compressed or not. A processor without
/// 64 bits can execute nothing of the image, so it is GRUB that says so.
///
/// Under UEFI the first module is put at address 0, where the firmware reads no file to: it takes
/// the address for a missing one, unless GRUB reads by way of its cache, which depends on where
/// the file lies. So a small module goes first, which is always read by that way.
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
        "if cpuid -l; then\nmultiboot2 /boot/image{quoted}\n{boot}else\n\
         echo 'this processor has no 64-bit mode, which the image needs'\nread\nfi\n"
    )
}

fn rescue(folder: &Path, iso: &Path) -> Result<(), String> {
    let mut output = OsString::from("--output=");
    output.push(iso);
    let mut command = Command::new("grub-mkrescue");
    command.args(["--locales=", "--themes=", "--fonts=", MODULES]);
    let made = system::run(command.arg(output).arg(folder));
    made.and_then(|_| match iso.is_file() {
        true => Ok(()),
        false => Err(format!(
            "`grub-mkrescue` has not made `{}`",
            files::place(iso)
        )),
    })
}

#[cfg(test)]
mod tests {
    use super::{check_words, commands};

    /// That a module is there is shown by `tests/tests/boot_by_grub.rs`.
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
}
