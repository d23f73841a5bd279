//! A stick for one boot: a file that QEMU shows as one, and that is gone afterwards.
//!
//! It is an ISO with GRUB, or a FAT file system with the application of UEFI alone.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::efi;
use crate::files;
use crate::install;
use crate::iso;
use crate::qemu::Loader;
use crate::system;

/// A stick's content, which is removed with this value.
#[derive(Debug)]
pub struct Medium {
    path: PathBuf,
}

impl Medium {
    /// Makes what `loader` boots `image` from, with `words`, and with `module` to be left
    /// in memory.
    ///
    /// # Errors
    ///
    /// As [`iso::write()`] or [`efi::application`], or there is no room.
    pub fn new(
        loader: Loader,
        image: &Path,
        words: &str,
        module: Option<&Path>,
    ) -> Result<Medium, String> {
        let log = system::new_log("stick")?;
        let is_fat = loader == Loader::Efi;
        let medium = Medium {
            path: log.with_extension(if is_fat { "img" } else { "iso" }),
        };
        match is_fat {
            true => write_fat(&medium.path, &efi::application(image, words, module)?)?,
            false => iso::write(&medium.path, image, words, module)?,
        }
        Ok(medium)
    }

    /// Returns where it lies.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for Medium {
    fn drop(&mut self) {
        // It is ours, and in the way of no one if it cannot be removed.
        let _ = fs::remove_file(&self.path);
    }
}

/// Writes a FAT file system that has the application where a firmware looks for it.
fn write_fat(stick: &Path, application: &[u8]) -> Result<(), String> {
    install::ensure(&install::MTOOLS)?;
    // More than what the file system itself takes.
    let bytes = (4 << 20) + application.len() as u64 / 64 * 65;
    let sized = File::create(stick).and_then(|file| file.set_len(bytes));
    sized.map_err(|why| format!("cannot write `{}`: {why}", stick.display()))?;
    let file = stick.with_extension("efi");
    files::write(&file, application)?;
    let tool = |name: &str, words: &[&Path]| {
        let output = Command::new(name).arg("-i").arg(stick).args(words).output();
        let output = output.map_err(|why| format!("`{name}` did not start: {why}"))?;
        match output.status.success() {
            true => Ok(()),
            false => Err(format!(
                "`{name}` could not write `{}`: {}",
                stick.display(),
                String::from_utf8_lossy(&output.stderr).trim()
            )),
        }
    };
    let on_stick = |path: &str| PathBuf::from(format!("::/{path}"));
    let written = tool("mformat", &[Path::new("::")])
        .and_then(|()| tool("mmd", &[&on_stick("EFI"), &on_stick("EFI/BOOT")]))
        .and_then(|()| tool("mcopy", &[&file, &on_stick(efi::PLACE)]));
    // It is ours, and in the way of no one if it cannot be removed.
    let _ = fs::remove_file(&file);
    written
}
