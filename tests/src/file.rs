//! Files made by tests.

use std::fs;
use std::path::PathBuf;

use tool::system;

/// A file's path; dropping this value removes the file.
#[derive(Debug)]
pub struct File(pub PathBuf);

impl File {
    /// Returns the path of a new file of a kind, and does not create the file.
    ///
    /// # Panics
    ///
    /// Panics if the file's folder cannot be made.
    pub fn new(name: &str, kind: &str) -> File {
        let log = system::new_log(name).expect("a folder for logs");
        File(log.with_extension(kind))
    }

    /// Makes a file with a content.
    ///
    /// # Panics
    ///
    /// Panics if the file cannot be written.
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
