//! A stick for one boot: a file that QEMU shows as one, and that is gone afterwards.
//!
//! It is an ISO with GRUB, or a FAT file system with the application of UEFI alone.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::efi;
use crate::files::{self, Temporary};
use crate::image::Contents;
use crate::install;
use crate::iso;
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
    /// As [`Contents::read`], [`iso::write()`] or [`efi::application`], or there is no room.
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
            false => iso::write(medium.path(), &contents)?,
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
