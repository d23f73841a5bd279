//! Files that a test makes.

use std::fs;
use std::path::PathBuf;

use tool::system;

/// A file's path, of which the file is removed with this value.
#[derive(Debug)]
pub struct File(pub PathBuf);

impl File {
    /// Returns the path of a file of a kind that is not there yet.
    ///
    /// # Panics
    ///
    /// Panics if the folder for it cannot be made.
    pub fn new(name: &str, kind: &str) -> File {
        let log = system::new_log(name).expect("a folder for logs");
        File(log.with_extension(kind))
    }

    /// Makes one.
    ///
    /// # Panics
    ///
    /// Panics if it cannot be written.
    pub fn of(name: &str, kind: &str, content: impl AsRef<[u8]>) -> File {
        let file = File::new(name, kind);
        fs::write(&file.0, content).expect("a file in it");
        file
    }
}

impl Drop for File {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.0);
    }
}
