//! Following a file that grows: each whole line is shown once, when it ends.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;

use crate::protocol::written;

/// A file that is being followed.
#[derive(Debug)]
pub(super) struct Tail<'p> {
    path: &'p Path,
    /// The text that has been read, and how much of it was shown.
    read: Vec<u8>,
    shown: usize,
}

impl Tail<'_> {
    /// Begins at the start of the file; it need not exist yet.
    pub(super) fn new(path: &Path) -> Tail<'_> {
        Tail {
            path,
            read: Vec::new(),
            shown: 0,
        }
    }

    /// Returns how many bytes have been read.
    pub(super) fn bytes(&self) -> u64 {
        self.read.len() as u64
    }

    /// Shows the lines that have ended since the last call.
    pub(super) fn follow(&mut self, show: &mut dyn FnMut(&str)) -> io::Result<()> {
        let mut file = File::open(self.path)?;
        file.seek(SeekFrom::Start(self.bytes()))?;
        file.read_to_end(&mut self.read)?;
        while let Some(length) = self.read[self.shown..]
            .iter()
            .position(|byte| *byte == b'\n')
        {
            let line = &self.read[self.shown..self.shown + length];
            show(written(&String::from_utf8_lossy(line)));
            self.shown += length + 1;
        }
        Ok(())
    }

    /// Shows the lines left, the last one also if it has no end, and returns all that is there.
    pub(super) fn finish(mut self, show: &mut dyn FnMut(&str)) -> io::Result<String> {
        self.follow(show)?;
        if self.shown < self.read.len() {
            show(&String::from_utf8_lossy(&self.read[self.shown..]));
        }
        Ok(String::from_utf8_lossy(&self.read).into_owned())
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
        assert!(tail.follow(&mut show).is_err(), "it is not there yet");
        let mut file = File::create(&path).unwrap();
        file.write_all(b"one\r\ntw").unwrap();
        tail.follow(&mut show).unwrap();
        tail.follow(&mut show).unwrap();
        file.write_all(b"o\nthree").unwrap();
        tail.follow(&mut show).unwrap();
        let text = tail.finish(&mut show).unwrap();
        assert_eq!(text, "one\r\ntwo\nthree");
        std::fs::remove_file(&path).unwrap();
        assert_eq!(shown, ["one", "two", "three"]);
    }
}
