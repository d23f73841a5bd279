//! Following a file that grows: each whole line is shown once, when it ends.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use crate::protocol::written;

/// A file that is being followed.
#[derive(Debug)]
pub struct Tail {
    path: PathBuf,
    read: u64,
    /// The bytes after the last line end.
    rest: Vec<u8>,
}

impl Tail {
    /// Begins at the start of the file; it need not exist yet.
    #[must_use]
    pub fn new(path: &Path) -> Tail {
        Tail {
            path: path.to_path_buf(),
            read: 0,
            rest: Vec::new(),
        }
    }

    /// Shows the lines that have ended since the last call. A file that
    /// cannot be read is taken as one that has not grown.
    pub fn follow(&mut self, show: &mut impl FnMut(&str)) {
        let mut fresh = Vec::new();
        let opened = File::open(&self.path).and_then(|mut file| {
            file.seek(SeekFrom::Start(self.read))?;
            file.read_to_end(&mut fresh)
        });
        if opened.is_err() {
            return;
        }
        self.read += u64::try_from(fresh.len()).unwrap_or(0);
        self.rest.extend(fresh);
        while let Some(end) = self.rest.iter().position(|byte| *byte == b'\n') {
            let line: Vec<u8> = self.rest.drain(..=end).collect();
            show(written(&String::from_utf8_lossy(&line)));
        }
    }

    /// Shows the lines left, the last one also if it has no end.
    pub fn finish(&mut self, show: &mut impl FnMut(&str)) {
        self.follow(show);
        if !self.rest.is_empty() {
            let line = std::mem::take(&mut self.rest);
            show(&String::from_utf8_lossy(&line));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Tail;
    use std::fs::File;
    use std::io::Write;

    #[test]
    fn a_line_is_shown_once_and_only_when_it_is_whole() {
        let path = crate::system::new_log("tail").unwrap();
        let mut tail = Tail::new(&path);
        let mut shown: Vec<String> = Vec::new();
        let mut show = |line: &str| shown.push(line.to_string());
        tail.follow(&mut show);
        let mut file = File::create(&path).unwrap();
        file.write_all(b"one\r\ntw").unwrap();
        tail.follow(&mut show);
        tail.follow(&mut show);
        file.write_all(b"o\nthree").unwrap();
        tail.follow(&mut show);
        tail.finish(&mut show);
        tail.finish(&mut show);
        std::fs::remove_file(&path).unwrap();
        assert_eq!(shown, ["one", "two", "three"]);
    }
}
