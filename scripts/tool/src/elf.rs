//! Reads the parts of ELF needed to measure an image, and to tell an image from a program for the
//! host.
//!
//! *Stripped size* is the size `strip` would leave: the file's headers, all loaded bytes and notes,
//! and the table of the remaining sections with their names. Symbols and debugging data do not
//! count. Because the sum includes padding, it is a few bytes above the result of `strip`, never
//! below.

/// Sizes and constants of 64-bit ELF headers and tables (System V ABI, AMD64 supplement; gabi,
/// chapters 4 and 5).
const SECTION_HEADER_BYTES: u64 = 64;
const PROGRAM_HEADER_BYTES: u64 = 56;
const SHF_ALLOC: u64 = 2;
const PT_NOTE: u64 = 4;

/// Xen's number for the note with the 32-bit entry address.
const XEN_ELFNOTE_PHYS32_ENTRY: u64 = 18;

/// The mean length assumed for a section's name and its alignment.
const NAME_BYTES: u64 = 24;

/// Returns the stripped size of a 64-bit little-endian ELF file.
///
/// # Errors
///
/// In words: the file is no such ELF file, or a table points outside the file.
pub fn stripped_bytes(file: &[u8]) -> Result<u64, String> {
    check(file)?;
    let end = loaded_bytes(file)?;
    let mut kept = 2; // the null section and the section names
    for section in table(file, 40, 60, SECTION_HEADER_BYTES)? {
        let flags = number(file, section + 8, 8)?;
        // `strip` keeps the sections that are loaded.
        kept += u64::from(flags & SHF_ALLOC != 0);
    }
    Ok(end + kept * (SECTION_HEADER_BYTES + NAME_BYTES))
}

/// Cuts a file down to its loaded part. Removes symbols, debugging data, and the table of sections;
/// otherwise GRUB would load them.
///
/// # Errors
///
/// As [`stripped_bytes`].
pub fn loaded(mut file: Vec<u8>) -> Result<Vec<u8>, String> {
    check(&file)?;
    let end = usize::try_from(loaded_bytes(&file)?).unwrap_or(usize::MAX);
    if file.len() < end {
        return Err("a segment lies outside the file".into());
    }
    file.truncate(end);
    // Clears `e_shoff`, and `e_shentsize`, `e_shnum` and `e_shstrndx`: the table is gone.
    file[40..48].fill(0);
    file[58..64].fill(0);
    Ok(file)
}

/// Returns the offset of the end of headers and segments in the file, in bytes.
fn loaded_bytes(file: &[u8]) -> Result<u64, String> {
    let segments = table(file, 32, 56, PROGRAM_HEADER_BYTES)?;
    let mut end = 64 + PROGRAM_HEADER_BYTES * segments.len() as u64;
    for segment in segments {
        let offset = number(file, segment + 8, 8)?;
        let length = number(file, segment + 32, 8)?;
        end = end.max(offset.saturating_add(length));
    }
    Ok(end)
}

/// Makes sure that QEMU's `-kernel` can enter a file, namely a 64-bit ELF file with Xen's note of
/// the 32-bit entry address ("x86/HVM direct boot ABI", `docs/misc/pvh.pandoc` of Xen).
///
/// # Errors
///
/// In words: the file is no 64-bit ELF file, has no such note, or contains a table pointing outside
/// the file.
pub fn check_bootable(file: &[u8]) -> Result<(), String> {
    let is_entry = |note: &Note| (note.owner, note.kind) == (*b"Xen\0", XEN_ELFNOTE_PHYS32_ENTRY);
    match notes(file)?.iter().any(is_entry) {
        true => Ok(()),
        false => Err("it has no PVH note, by which QEMU would enter it".into()),
    }
}

/// Returns the name of an image's app, taken from the note written by `kernel::entry!`. Returns
/// `None` if there is no such note.
pub fn app_name(file: &[u8]) -> Option<String> {
    let notes = notes(file).ok()?;
    let note = notes.iter().find(|note| note.owner == *b"App\0")?;
    let from = usize::try_from(note.content).ok()?;
    let bytes = usize::try_from(note.content_bytes).ok()?;
    let content = file.get(from..from.checked_add(bytes)?)?;
    let name = content.split(|byte| *byte == 0).next()?;
    // The bytes come from a file that a person names; only a plain name goes into messages.
    let is_of_names = |byte: &u8| byte.is_ascii_alphanumeric() || b"-_".contains(byte);
    let is_name = !name.is_empty() && name.iter().all(is_of_names);
    is_name.then(|| String::from_utf8_lossy(name).into_owned())
}

/// A note with a four-byte owner's name.
struct Note {
    owner: [u8; 4],
    kind: u64,
    /// The offset of the note's content in the file.
    content: u64,
    content_bytes: u64,
}

fn notes(file: &[u8]) -> Result<Vec<Note>, String> {
    check(file)?;
    let mut notes = Vec::new();
    for segment in table(file, 32, 56, PROGRAM_HEADER_BYTES)? {
        if number(file, segment, 4)? != PT_NOTE {
            continue;
        }
        let mut at = number(file, segment + 8, 8)?;
        let end = at.saturating_add(number(file, segment + 32, 8)?);
        // A note consists of the lengths of name and content, its type, the name, and the content,
        // the last two padded to 4 bytes.
        while at < end {
            let owner_bytes = number(file, at, 4)?;
            let content_bytes = number(file, at + 4, 4)?;
            let content = at + 12 + owner_bytes.next_multiple_of(4);
            // Both owners that matter, `Xen` and `App`, have three letters and a zero.
            if owner_bytes == 4 {
                let owner = number(file, at + 12, 4)?;
                notes.push(Note {
                    owner: u32::try_from(owner).unwrap_or(0).to_le_bytes(),
                    kind: number(file, at + 8, 4)?,
                    content,
                    content_bytes,
                });
            }
            at = content + content_bytes.next_multiple_of(4);
        }
    }
    Ok(notes)
}

fn check(file: &[u8]) -> Result<(), String> {
    if file.starts_with(b"\x7fELF\x02\x01") {
        Ok(())
    } else {
        Err("not a 64-bit little-endian ELF file".into())
    }
}

/// Returns the offsets of a table's entries; `offset_at` and `count_at` are the positions of the
/// table's offset and length in the ELF header.
fn table(file: &[u8], offset_at: u64, count_at: u64, entry: u64) -> Result<Vec<u64>, String> {
    let offset = number(file, offset_at, 8)?;
    let entries = number(file, count_at, 2)?;
    Ok((0..entries)
        .map(|index| offset.saturating_add(index * entry))
        .collect())
}

/// Returns the little-endian number of `length` bytes at `at`.
///
/// # Errors
///
/// In words: the number lies outside the file.
fn number(file: &[u8], at: u64, length: usize) -> Result<u64, String> {
    let start = usize::try_from(at).unwrap_or(usize::MAX);
    let bytes = file.get(start..start.saturating_add(length));
    let bytes = bytes.ok_or("a header points outside the file")?;
    Ok(bytes
        .iter()
        .rev()
        .fold(0, |sum, byte| sum << 8 | u64::from(*byte)))
}
