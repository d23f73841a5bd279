//! The archive of files that Linux unpacks into memory when it starts: cpio's "newc" format.

use std::collections::BTreeSet;

/// What a file and a folder are, and who may do what: everything is root's.
const FILE: u32 = 0o100_755;
const FOLDER: u32 = 0o040_755;

/// The archive, as far as it is written.
#[derive(Debug, Default)]
pub(super) struct Archive {
    bytes: Vec<u8>,
    /// The folders that are in it.
    folders: BTreeSet<String>,
}

impl Archive {
    /// Adds a file, which may be executed, and the folders that it lies in.
    pub(super) fn add(&mut self, path: &str, content: &[u8]) {
        if let Some((folder, _)) = path.rsplit_once('/') {
            self.folder(folder);
        }
        self.entry(path, FILE, content);
    }

    /// Adds a folder and those that it lies in, unless they are there.
    pub(super) fn folder(&mut self, path: &str) {
        if let Some((above, _)) = path.rsplit_once('/') {
            self.folder(above);
        }
        if self.folders.insert(path.to_owned()) {
            self.entry(path, FOLDER, &[]);
        }
    }

    /// Ends the archive.
    pub(super) fn finish(mut self) -> Vec<u8> {
        self.entry("TRAILER!!!", 0, &[]);
        self.bytes
    }

    fn entry(&mut self, path: &str, mode: u32, content: &[u8]) {
        let number = self.bytes.len();
        let fields = [
            number,
            mode as usize,
            0,
            0,
            1,
            0,
            content.len(),
            0,
            0,
            0,
            0,
            path.len() + 1,
            0,
        ];
        self.bytes.extend(b"070701");
        for field in fields {
            self.bytes.extend(format!("{field:08x}").bytes());
        }
        self.bytes.extend(path.bytes());
        self.bytes.push(0);
        self.align();
        self.bytes.extend(content);
        self.align();
    }

    fn align(&mut self) {
        let bytes = self.bytes.len().next_multiple_of(4);
        self.bytes.resize(bytes, 0);
    }
}

#[cfg(test)]
mod tests {
    use super::Archive;

    #[test]
    fn files_follow_their_folders_and_everything_begins_at_a_multiple_of_4() {
        let mut archive = Archive::default();
        archive.add("a/b/c", b"12345");
        archive.add("a/b/d", b"");
        let bytes = archive.finish();
        let text = String::from_utf8(bytes).expect("all of it is text");
        let mut rest = text.as_str();
        let mut names = Vec::new();
        while let Some(entry) = rest.strip_prefix("070701") {
            let field = |place: usize| {
                let digits = &entry[8 * place..8 * place + 8];
                usize::from_str_radix(digits, 16).expect("a number")
            };
            let (content, name) = (field(6), field(11));
            names.push(&entry[104..104 + name - 1]);
            let begin = (110 + name).next_multiple_of(4);
            rest = &rest[(begin + content).next_multiple_of(4)..];
        }
        assert_eq!(names, ["a", "a/b", "a/b/c", "a/b/d", "TRAILER!!!"]);
        assert_eq!(rest, "");
    }
}
