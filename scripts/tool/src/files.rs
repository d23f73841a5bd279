//! Handles the files named by a person: reads them with care, and never overwrites them by mistake.
//!
//! A command reads its *inputs* and writes its *outputs*. Before a command begins its work it calls
//! [`check`]. The check promises that no output is also an input or another output, under whatever
//! name, except devices, which keep nothing, and that each output can be written. The check empties
//! no file; an output gets its new content when the content is ready.
//!
//! Only [`read`] reads inputs. It refuses folders, devices and named pipes, as these may have no
//! end or no writer.

use std::fmt::Display;
use std::fs::{self, File, OpenOptions};
use std::io::{Read, Write};
use std::os::unix::fs::{FileTypeExt, MetadataExt};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use text::visible;

use crate::system;

/// The most bytes of an input: far more than a guest or a reader can use.
const MOST_BYTES: u64 = 1 << 30;

/// The most bytes of a text read as a whole.
const MOST_TEXT_BYTES: usize = 64 << 20;

/// A file named on a command line.
#[derive(Clone, Copy, Debug)]
pub struct NamedFile<'n> {
    /// The option naming the file, without its dashes; empty for a positional word.
    pub option: &'n str,
    /// The file's name.
    pub path: &'n Path,
}

impl NamedFile<'_> {
    /// Returns the words that name the file, for a message.
    fn words(&self) -> String {
        let NamedFile { option, path } = self;
        let place = shown_path(path);
        match option.is_empty() {
            true => format!("`{place}`"),
            false => format!("`--{option} {place}`"),
        }
    }
}

/// Returns a file's whole name for a message, making control characters visible.
pub fn shown_path(path: &Path) -> String {
    visible(&path.to_string_lossy()).to_string()
}

/// Reads a whole input, of at most 1 GiB.
///
/// # Errors
///
/// The reason, without the file's name.
pub fn read(path: &Path) -> Result<Vec<u8>, String> {
    let cannot = |why: &dyn Display| format!("cannot be read: {why}");
    let data = fs::metadata(path).map_err(|error| cannot(&error))?;
    let kind = data.file_type();
    if kind.is_dir() {
        return Err(cannot(&"it is a folder"));
    }
    // A pipe of the shell's `<(...)` has a writer, but no path in the file system.
    let is_open_pipe = kind.is_fifo() && path.canonicalize().is_err();
    if !kind.is_file() && !is_open_pipe {
        return Err(cannot(&"it is a device or a pipe"));
    }
    let mut bytes = Vec::new();
    let file = File::open(path).map_err(|error| cannot(&error))?;
    let too_long = || cannot(&format_args!("it is longer than {} MiB", MOST_BYTES >> 20));
    if data.len() > MOST_BYTES {
        return Err(too_long());
    }
    // One byte more than allowed: the length of a pipe is unknown beforehand.
    let all = file.take(MOST_BYTES + 1).read_to_end(&mut bytes);
    all.map_err(|error| cannot(&error))?;
    match bytes.len() as u64 > MOST_BYTES {
        true => Err(too_long()),
        false => Ok(bytes),
    }
}

/// Reads an input; a message names the input by its path alone.
///
/// # Errors
///
/// In words, with the file's name.
pub fn read_at(path: &Path) -> Result<Vec<u8>, String> {
    read(path).map_err(|why| format!("`{}`: {why}", shown_path(path)))
}

/// Reads the input named by an option.
///
/// # Errors
///
/// In words, with the option and the file's name.
pub(crate) fn read_named(named: &NamedFile<'_>) -> Result<Vec<u8>, String> {
    read(named.path).map_err(|why| format!("{} {why}; name another file", named.words()))
}

/// Writes the file named by an option.
///
/// # Errors
///
/// In words, with the option and the file's name.
pub(crate) fn write_named(
    option: &str,
    path: &Path,
    content: impl AsRef<[u8]>,
) -> Result<(), String> {
    let named = NamedFile { option, path };
    let written = fs::write(path, content);
    written.map_err(|error| format!("{}: cannot be written: {error}", named.words()))
}

/// Returns the reason why nothing more can be written to a file; `None` if the file can grow.
pub(crate) fn why_full(path: &Path) -> Option<String> {
    const MORE: usize = 4096;
    let length = fs::metadata(path).ok()?.len();
    // Read from `/proc`, not tried: the system ends a program that goes beyond this limit.
    let limits = fs::read_to_string("/proc/self/limits").unwrap_or_default();
    let mut limits = limits.lines();
    let limit = limits.find_map(|line| line.strip_prefix("Max file size"));
    let limit = limit.and_then(|line| line.split_whitespace().next()?.parse().ok());
    if limit.is_some_and(|limit: u64| length + MORE as u64 > limit) {
        return Some("a file may not be longer (`ulimit -f`)".into());
    }
    let mut file = OpenOptions::new().append(true).open(path).ok()?;
    let written = file.write_all(&[b'\n'; MORE]);
    let written = written.and_then(|()| file.sync_all());
    // Removes the trial's bytes again.
    let _ = file.set_len(length);
    written.err().map(|error| error.to_string())
}

/// Writes a file of ours, and makes its folder if necessary.
///
/// # Errors
///
/// In words, with the file's name.
pub fn write(path: &Path, content: impl AsRef<[u8]>) -> Result<(), String> {
    let written = fs::create_dir_all(folder_of(path)).and_then(|()| fs::write(path, content));
    written.map_err(|error| format!("cannot write `{}`: {error}", path.display()))
}

/// Calls `work` with the path of a new folder of ours, and removes the folder afterwards.
///
/// # Errors
///
/// The errors of `work` and of [`system::new_log`].
pub(crate) fn in_folder<R>(
    name: &str,
    work: impl FnOnce(&Path) -> Result<R, String>,
) -> Result<R, String> {
    let folder = system::new_log(name)?.with_extension("folder");
    let result = work(&folder);
    // The folder is ours; a leftover folder harms nothing.
    let _ = fs::remove_dir_all(&folder);
    result
}

/// Reads an input as text of at most 64 MiB. Leaves out the byte order mark that some editors put
/// before UTF-8.
///
/// # Errors
///
/// In words that begin with the file's name and, for bytes that are not UTF-8, with their line: the
/// errors of [`read`]; also, that the text is not UTF-8, or too long.
pub fn read_text(path: &Path) -> Result<String, String> {
    let refused = |line: &dyn Display, why: &dyn Display| {
        let place = shown_path(path);
        format!("{place}{line}: {why}; name another file")
    };
    let bytes = read(path).map_err(|why| refused(&"", &why))?;
    if bytes.len() > MOST_TEXT_BYTES {
        let why = format!("it is longer than {} MiB", MOST_TEXT_BYTES >> 20);
        return Err(refused(&"", &why));
    }
    let mut text = String::from_utf8(bytes).map_err(|error| {
        let before = &error.as_bytes()[..error.utf8_error().valid_up_to()];
        let line = 1 + before.iter().filter(|byte| **byte == b'\n').count();
        refused(&format_args!(":{line}"), &"this is not UTF-8 text")
    })?;
    if text.starts_with('\u{feff}') {
        text.drain(..'\u{feff}'.len_utf8());
    }
    Ok(text)
}

/// Makes sure that no output overwrites an input or another output, and that each output can be
/// written. The files keep their content.
///
/// # Errors
///
/// In words, with the offender: two names of one file, or an output that cannot be written.
pub fn check(inputs: &[NamedFile<'_>], outputs: &[NamedFile<'_>]) -> Result<(), String> {
    for (position, output) in outputs.iter().enumerate() {
        let before = inputs.iter().chain(&outputs[..position]);
        let own = identity(output.path);
        // A device keeps nothing, so several outputs may share a device.
        let is_kept = fs::metadata(output.path).map_or(true, |data| data.is_file());
        for other in before.filter(|_| is_kept) {
            if own.is_some() && own == identity(other.path) {
                return Err(format!(
                    "{} and {} are one file, which would be overwritten; name another",
                    other.words(),
                    output.words()
                ));
            }
        }
    }
    outputs.iter().try_for_each(try_output)
}

/// Makes sure that no input is given, and so counted, twice.
///
/// # Errors
///
/// In words, with the two names of one file.
pub fn check_once<'n>(inputs: impl Iterator<Item = &'n Path>) -> Result<(), String> {
    let mut before: Vec<(&Path, FileIdentity)> = Vec::new();
    for path in inputs {
        // A file in a missing folder is refused later, by the read.
        let Some(own) = identity(path) else {
            continue;
        };
        if let Some((other, _)) = before.iter().find(|(_, identity)| *identity == own) {
            let (other, own) = (shown_path(other), shown_path(path));
            return Err(format!("`{other}` and `{own}` are one file; give it once"));
        }
        before.push((path, own));
    }
    Ok(())
}

/// The identity of a file, equal for all of its names.
#[derive(PartialEq, Eq)]
enum FileIdentity {
    /// An existing file: its device and its inode.
    There(u64, u64),
    /// A file to be created: its folder and its name there.
    ToCome(PathBuf),
}

fn identity(path: &Path) -> Option<FileIdentity> {
    if let Ok(data) = fs::metadata(path) {
        return Some(FileIdentity::There(data.dev(), data.ino()));
    }
    // The folder's canonical path resolves links and `..`, so two spellings compare equal.
    let folder = folder_of(path).canonicalize().ok()?;
    Some(FileIdentity::ToCome(folder.join(path.file_name()?)))
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// Makes sure that an output can be written, without changing its content.
fn try_output(output: &NamedFile<'_>) -> Result<(), String> {
    let path = output.path;
    let there = fs::metadata(path).ok();
    let cannot = |why: &dyn Display| {
        let words = output.words();
        format!("{words}: cannot be written: {why}; name another file")
    };
    // Opening a named pipe would wait for a reader; a pipe of the shell's `>(...)` has a reader.
    if fs::symlink_metadata(path).is_ok_and(|data| data.file_type().is_fifo()) {
        return Err(cannot(&"it is a named pipe"));
    }
    // `append` keeps the content, and the trial writes nothing.
    let opened = OpenOptions::new().append(true).create(true).open(path);
    opened.map_err(|error| cannot(&error))?;
    if there.is_none() {
        // The trial has made this file; through a dangling link, at the other end of the link.
        let made = path.canonicalize().map_err(|error| cannot(&error))?;
        fs::remove_file(made).map_err(|error| cannot(&error))?;
    }
    Ok(())
}

/// Makes sure that files can be written into a folder, even if the folder does not exist yet.
/// Leaves nothing behind.
///
/// # Errors
///
/// In words, with the offending file or folder.
pub fn check_folder(output: &NamedFile<'_>) -> Result<(), String> {
    let there = output.path.ancestors().find_map(|folder| {
        let folder = match folder.as_os_str().is_empty() {
            true => Path::new("."),
            false => folder,
        };
        fs::metadata(folder).ok().map(|data| (folder, data))
    });
    let why = match there {
        Some((folder, data)) if data.is_dir() => {
            // Two threads may try the same folder at once.
            static TRIALS: AtomicU64 = AtomicU64::new(0);
            let (process, trial) = (std::process::id(), TRIALS.fetch_add(1, Ordering::Relaxed));
            let probe = folder.join(format!(".trial-{process}-{trial}"));
            let trial = NamedFile {
                path: &probe,
                ..*output
            };
            return try_output(&trial).map_err(|_| {
                let (words, folder) = (output.words(), shown_path(folder));
                format!("{words}: nothing can be written into `{folder}`; name another folder")
            });
        }
        Some((file, _)) => format!("`{}` is no folder", shown_path(file)),
        None => "there is no such folder".into(),
    };
    Err(format!("{}: {why}; name another folder", output.words()))
}

/// A file of ours, removed when this value is dropped; `None` for no file.
#[derive(Debug)]
pub(crate) struct TemporaryFile(pub(crate) Option<PathBuf>);

impl TemporaryFile {
    /// Returns the file's path; empty if there is no file.
    pub(crate) fn path(&self) -> &Path {
        self.0.as_deref().unwrap_or(Path::new(""))
    }
}

impl Drop for TemporaryFile {
    fn drop(&mut self) {
        // The file is ours; a leftover file harms nothing.
        let _ = self.0.take().map(fs::remove_file);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::symlink;

    fn folder(name: &str) -> PathBuf {
        let folder = std::env::temp_dir().join(format!("{name}-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        folder
    }

    fn named<'n>(option: &'n str, path: &'n Path) -> NamedFile<'n> {
        NamedFile { option, path }
    }

    /// `tests/it/files.rs` has the commands that refuse such names.
    #[test]
    fn one_file_of_two_names_is_found_and_kept() {
        let folder = folder("one-file");
        let own = folder.file_name().unwrap();
        let (file, link, hard) = (folder.join("a"), folder.join("b"), folder.join("c"));
        fs::write(&file, "kept").unwrap();
        symlink(&file, &link).unwrap();
        fs::hard_link(&file, &hard).unwrap();
        let dotted = folder.join("..").join(own).join("a");
        for other in [&file, &link, &hard, &dotted] {
            let refused = check(&[named("dag", &file)], &[named("keep", other)]).unwrap_err();
            let ends = " are one file, which would be overwritten; name another";
            assert!(refused.starts_with("`--dag ") && refused.ends_with(ends));
        }
        let twice = check_once([file.as_path(), &folder, &link].into_iter()).unwrap_err();
        assert!(twice.ends_with("/b` are one file; give it once"), "{twice}");
        // Neither is there yet.
        let (new, again) = (folder.join("new"), folder.join(".").join("new"));
        assert!(check(&[], &[named("keep", &new), named("serial", &again)]).is_err());
        assert_eq!(check(&[named("", &file)], &[named("keep", &new)]), Ok(()));
        assert!(!new.exists(), "the trial is removed");

        for path in [file.join("x"), folder.join("none/x"), folder.clone()] {
            let refused = check(&[], &[named("out", &path)]).unwrap_err();
            assert!(refused.contains(": cannot be written: "), "{refused}");
        }
        let refused = check_folder(&named("out", &file.join("x"))).unwrap_err();
        assert!(refused.ends_with("/a` is no folder; name another folder"));
        assert_eq!(check_folder(&named("out", &folder.join("to/come"))), Ok(()));
        assert_eq!(fs::read_dir(&folder).unwrap().count(), 3);

        assert_eq!(fs::read(&file).unwrap(), b"kept");
        fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn text_is_read_without_its_mark_and_refused_with_its_line() {
        let folder = folder("text");
        let file = folder.join("file");
        fs::write(&file, "\u{feff}dag ä\n").unwrap();
        assert_eq!(read_text(&file).as_deref(), Ok("dag ä\n"));
        let ends = |why: &str| {
            let said = read_text(&file).unwrap_err();
            let is_told = said.ends_with(&format!("{why}; name another file"));
            assert!(is_told, "{said}");
        };
        fs::write(&file, b"one\ntwo \xff\n").unwrap();
        ends("/file:2: this is not UTF-8 text");
        let long = File::create(&file).unwrap();
        long.set_len((64 << 20) + 1).unwrap();
        ends("/file: it is longer than 64 MiB");
        long.set_len(MOST_BYTES + 1).unwrap();
        let expected = "cannot be read: it is longer than 1024 MiB";
        assert_eq!(read(&file).unwrap_err(), expected);
        fs::remove_dir_all(folder).unwrap();
    }
}
